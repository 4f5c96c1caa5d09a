"""`python -m export label|synthesize|train|merge|onnx|evaluate`: from panoramas to the network that ships."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from lighting.errors import LightingError

FOLDER = click.Path(path_type=Path)
Command = Callable[..., Any]
data_option = click.option("--data", type=FOLDER, required=True, help="Folder with panoramas.csv and the pictures.")
labels_option = click.option("--labels", type=FOLDER, default="runs/labels.csv", show_default=True)


def share_option(name: str, default: float, meaning: str) -> Callable[[Command], Command]:
    """An option that says which share of something, 0 to 1."""
    return click.option(name, type=click.FloatRange(0, 1), default=default, show_default=True, help=meaning)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def cli() -> None:
    """From a folder of panoramas to the network that ships; see export/README.md for the folder's format."""


@cli.command()
@data_option
@click.option("--out", type=FOLDER, default="runs/labels.csv", show_default=True, help="CSV to write.")
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def label(data: Path, out: Path, workers: int) -> None:
    """Find suns, fit skies, and print how well both agree with what is known."""
    from export.data.label_report import run

    out.parent.mkdir(parents=True, exist_ok=True)
    run(data, out, workers)


@cli.command()
@click.option("--out", type=FOLDER, default="runs/towns", show_default=True, help="Folder to fill or to go on with.")
@click.option("--count", type=click.IntRange(1), default=1000, show_default=True, help="Places in all.")
@click.option("--height", type=click.IntRange(32), default=256, show_default=True, help="Rows of each panorama.")
@click.option("--samples", type=FOLDER, default=None, help="JPEG to write: a crop each of the first 48 places.")
def synthesize(out: Path, count: int, height: int, samples: Path | None) -> None:
    """Render places with exact truth to train on; two to three seconds each on two cores."""
    from export.towns.dataset import synthesize as run
    from export.towns.samples import write_samples

    run(out, count, height)
    if samples:
        write_samples(out, samples)


@cli.command()
@data_option
@labels_option
@click.option(
    "--out", type=FOLDER, default=None, help="Folder of the run; resumed if it has a checkpoint. [runs/NETWORK]"
)
@click.option("--network", type=click.Choice(["outdoor", "cvpr2017"]), default="outdoor", show_default=True)
@click.option("--crops", type=click.IntRange(1), default=100_000, show_default=True, help="Drawn in all.")
@click.option("--batch", type=click.IntRange(2), default=32, show_default=True)
@click.option("--learning-rate", type=click.FloatRange(0, 1), default=8e-4, show_default=True)
@click.option("--version", default="1.0.0", show_default=True, help="Of the network, for its metadata.")
@click.option("--licensed-only", is_flag=True, help="Train on permissively licensed panoramas alone.")
@click.option("--scratch", is_flag=True, help="Start from random weights instead of ImageNet's.")
@click.option("--start", type=FOLDER, default=None, help="Earlier run to start from. [ImageNet's weights]")
@click.option("--synthetic", type=FOLDER, default=None, help="Folder of `synthesize`, mixed in.")
@share_option("--synthetic-share", 0.3, "Of the crops.")
@share_option("--aimed", 0.2, "Of the crops of panoramas that show the sun, turned until they hold it.")
@share_option("--joined", 0.0, "Of the crops, with a second place under the same sun beyond a line.")
@click.option("--surroundings", is_flag=True, help="Learn also to say the light all around the camera.")
@click.option("--only-seen", is_flag=True, help="Train alone what says where in the picture the sun is seen.")
@share_option("--tune-share", 0.08, "Of the places, held out for the log.")
@click.option("--workers", type=click.IntRange(0), default=2, show_default=True, help="Processes that cut crops.")
def train(
    out: Path | None,
    network: str,
    scratch: bool,
    start: Path | None,
    synthetic: Path | None,
    data: Path,
    labels: Path,
    **given: Any,
) -> None:
    """Train a network, or go on where a killed run stopped; takes a GPU where there is one."""
    from export.networks.network import TARGET_WIDTH
    from export.training.train import TrainConfig
    from export.training.train import train as run

    if network != "outdoor" and (given["only_seen"] or given["surroundings"]):
        raise click.UsageError(f"--only-seen and --surroundings are of the network outdoor, not of {network}.")
    given |= {"data": str(data), "labels": str(labels), "out": str(out or Path("runs") / network), "network": network}
    given |= {"start": str(start or ""), "synthetic": str(synthetic or "")}
    run(TrainConfig(**given, target_width=TARGET_WIDTH[network], pretrained=not scratch))


@cli.command()
@click.argument("runs", type=FOLDER, nargs=-1, required=True)
@click.option("--out", type=FOLDER, required=True, help="Folder to write, of a run like any other.")
def merge(runs: tuple[Path, ...], out: Path) -> None:
    """Average the weights of runs that continue one another."""
    from export.networks.averaging import merge as run

    run(runs, out)


@cli.command()
@click.argument("runs", type=FOLDER, nargs=-1, required=True)
@click.option("--out", type=FOLDER, default=None, help="File to write. [RUN/NAME-VERSION.onnx]")
@click.option(
    "--temperature", type=click.FloatRange(0.1, 10), default=1.0, show_default=True, help="Of the sun's softmax."
)
@click.option("--version", help="Of the network, where it is not the run's: another temperature makes another one.")
def onnx(runs: tuple[Path, ...], out: Path | None, temperature: float, version: str | None) -> None:
    """Write the averaged network of a run, or of several that answer together, as ONNX; compare it with torch."""
    from export.networks.onnx import export
    from export.networks.runs import read_spec

    spec = read_spec(runs[0])
    target = out or runs[0] / f"{spec.name}-{version or spec.version}.onnx"
    difference = export(runs, target, temperature=temperature, version=version)
    click.echo(f"{target}: {target.stat().st_size / 1e6:.1f} MB, largest difference to torch {difference:.1e}")


@cli.command()
@data_option
@labels_option
@click.option("--model", type=FOLDER, default=None, help="Network to score. [the one in the package]")
@click.option("--compare", type=FOLDER, multiple=True, help="Further networks, such as the CVPR 2017 one.")
@click.option("--out", type=FOLDER, default="runs/evaluation", show_default=True, help="Folder for report and crops.")
@click.option(
    "--with-metadata", is_flag=True, help="Also with simulated time, place, compass, lens, and several views."
)
@click.option("--mirror", is_flag=True, help="Also average with the answers about mirrored crops.")
@click.option(
    "--suncompass", is_flag=True, help="Also score that outside peer; pip install --no-deps suncompass==0.0.1."
)
@click.option("--relight", is_flag=True, help="Also relight a sphere with the estimated maps.")
@click.option(
    "--failures", is_flag=True, help="Also write the worst crops; not for publishing, the pictures are the data's."
)
@click.option("--card", is_flag=True, help="Also write lighting/data/MODEL_CARD.md and docs/reliability.png.")
def evaluate(
    data: Path,
    labels: Path,
    model: Path | None,
    compare: tuple[Path, ...],
    out: Path,
    with_metadata: bool,
    mirror: bool,
    suncompass: bool,
    relight: bool,
    failures: bool,
    card: bool,
) -> None:
    """Print the accuracy on the `val` split, whose places training never saw."""
    from export.evaluation.card import write_card
    from export.evaluation.diagnostics import PICTURE
    from export.evaluation.evaluate import evaluate as run
    from export.evaluation.relight import relight as run_relight
    from lighting.model import packaged_model

    ours = model or packaged_model()
    models = [ours, *compare]
    parts = {"with_metadata": with_metadata, "with_mirror": mirror, "with_suncompass": suncompass, "failures": failures}
    report = run(data, labels, models, out, **parts)
    if relight:
        report += "\n" + run_relight(data, labels, models, out) + "\n"
    click.echo(report)
    if card:
        write_card(ours, report, data, labels, out / PICTURE)


@cli.command()
@data_option
@click.option("--count", type=click.IntRange(1), default=8, show_default=True, help="Clips of each kind.")
@click.option("--kind", "kinds", multiple=True, help="Only clips of these kinds. [all]")
@click.option("--only", type=click.Choice(("clips", "streams", "speed")), help="One part of the report. [all]")
@click.option("--model", type=FOLDER, default=None, help="Network to ask. [the one in the package]")
def video(data: Path, count: int, kinds: tuple[str, ...], only: str | None, model: Path | None) -> None:
    """Print how well clips are followed, and how fast, by cameras moved in `val` panoramas and rendered places."""
    from export.video.evaluate import KINDS, evaluate
    from lighting.model import Model

    for part in evaluate(data, count, kinds or KINDS, Model.load(model), only):
        click.echo(part + "\n")


@cli.command()
@data_option
@click.option("--split", type=click.Choice(["train", "val"]), default="val", show_default=True)
@click.option("--last", type=click.IntRange(1), help="Only the last rows of the index, which a network did not see.")
@click.argument("parts", nargs=-1, type=click.Choice(["pairs", "walks", "sets", "overlap", "days"]))
def turns(data: Path, split: str, last: int | None, parts: tuple[str, ...]) -> None:
    """Print how well turns between photos are found, and what they are worth."""
    from export.turns.report import PARTS, report

    click.echo(report(data, split, parts or PARTS, last))


def main() -> None:
    """Run the command line; expected errors end as one sentence."""
    try:
        cli(prog_name="python -m export")
    except (LightingError, OSError) as error:
        sys.exit(f"Error: {error}")


if __name__ == "__main__":
    main()
