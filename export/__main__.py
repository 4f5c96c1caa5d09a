"""`python -m export`: from panoramas to networks (label, train, onnx, ...), and what they are worth (evaluate, ...)."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from export.arguments import CLIP_KINDS, FILE, PATH, PHOTO_SET_PARTS, VIDEO_PARTS
from export.stereo.normals_commands import stereo
from lighting.errors import LightingError

Command = Callable[..., Any]
FITS = ("ground", "sky-color", "sun-color", "sun-power")  # of export.evaluation.fit_constants


def option(name: str, meaning: str, kind: Any = PATH, default: Any = None, **more: Any) -> Callable[[Command], Command]:
    """An option with its meaning; the default is shown if there is one."""
    if default is not None:  # an explicit None would count as given, also where the option is required
        more |= {"default": default, "show_default": True}
    return click.option(name, type=kind, help=meaning, **more)


def share(name: str, default: float, meaning: str) -> Callable[[Command], Command]:
    """An option that is a share, 0 to 1."""
    return option(name, meaning, click.FloatRange(0, 1), default)


def flag(name: str, meaning: str) -> Callable[[Command], Command]:
    """An option that is off unless given."""
    return click.option(name, is_flag=True, help=meaning)


data = option("--data", "Folder with panoramas.csv and the pictures.", required=True)
network = option("--model", "Network to ask. [default: the one in the package]")
labels = option("--labels", "CSV file of `label`.", default="runs/labels.csv")


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def cli() -> None:
    """From a folder of panoramas to the network that ships. export/README.md describes the folder's format."""


cli.add_command(stereo)


@cli.command()
@data
@option("--out", "CSV file to write.", FILE, "runs/labels.csv")
@option("--workers", "Processes.", click.IntRange(1), 2)
def label(data: Path, out: Path, workers: int) -> None:
    """Find suns and fit skies; print how well both agree with what is known."""
    from export.data.reports import run

    run(data, out, workers)


@cli.command()
@option("--out", "Folder to fill; places that it holds are kept.", default="runs/towns")
@option("--count", "Places in all.", click.IntRange(1), 1000)
@option("--height", "Rows of each panorama.", click.IntRange(32), 256)
@option("--samples", "JPEG file to write: one crop of each of the first 48 places.", FILE)
def synthesize(out: Path, count: int, height: int, samples: Path | None) -> None:
    """Render places with exact labels to train on; each takes two to three seconds on two cores."""
    from export.towns import synthesize as run

    run(out, count, height)
    if samples:
        from export.training import write_samples

        write_samples(out, samples)


@cli.command()
@data
@labels
@option("--out", "Folder of the run; a run with a checkpoint is resumed. [default: runs/NETWORK]")
@option("--network", "Network to train.", click.Choice(["outdoor", "cvpr2017"]), "outdoor")
@option("--crops", "Crops drawn in all.", click.IntRange(1), 100_000)
@option("--batch", "Crops per step.", click.IntRange(2), 32)
@option("--learning-rate", "Highest learning rate.", click.FloatRange(0, 1), 8e-4)
@option("--version", "Version of the network, for its metadata.", str, "1.0.0")
@flag("--licensed-only", "Train on permissively licensed panoramas and photos only.")
@flag("--scratch", "Start from random weights instead of ImageNet's.")
@option("--start", "Folder of an earlier run to start from. [default: ImageNet's weights]")
@option("--teacher", "Folder of a finished run to learn from as well; repeatable.", multiple=True)
@option("--synthetic", "Folder of `synthesize`, whose places are mixed in.")
@share("--synthetic-share", 0.3, "Share of the crops that show synthetic places.")
@share("--aimed", 0.2, "Share of the crops of panoramas with a visible sun whose camera is turned towards it.")
@share("--joined", 0.0, "Share of the crops divided by a line between two places under the same sun.")
@share("--stretched", 0.0, "Share of the crops that show a stretched world, its sun and shadows with it.")
@flag("--surroundings", "Also learn the light all around the camera and its power.")
@share("--photos-share", 0.0, "Share of the crops that show the photos of photos_train.csv.")
@flag("--only-seen", "Train only the head that says where in the picture the sun is seen.")
@flag("--only-camera", "Train for the camera's elevation, roll and field of view alone.")
@share("--tune-share", 0.08, "Share of the places that are held out for the log.")
@option("--workers", "Processes that cut crops.", click.IntRange(0), 2)
def train(out: Path | None, network: str, scratch: bool, teacher: tuple[Path, ...], **given: Any) -> None:
    """Train a network, or resume a run that was stopped. Uses a GPU if there is one."""
    from export.networks import TARGET_WIDTH
    from export.training import TrainConfig
    from export.training import train as run

    if network != "outdoor" and (given["only_seen"] or given["only_camera"] or given["surroundings"] or teacher):
        options = "--only-seen, --only-camera, --surroundings and --teacher"
        raise click.UsageError(f"{options} are for the network outdoor, not for {network}.")
    if given["start"] and scratch:
        raise click.UsageError("Choose one of --start and --scratch.")
    if given["only_seen"] and given["only_camera"]:
        raise click.UsageError("Choose one of --only-seen and --only-camera.")
    if teacher and (given["only_seen"] or given["only_camera"]):
        raise click.UsageError("--teacher answers for all heads; leave out --only-seen and --only-camera.")
    given |= {"out": out or Path("runs") / network, "teachers": tuple(map(str, teacher))}
    given |= {name: str(given[name] or "") for name in ("data", "labels", "out", "start", "synthetic")}
    run(TrainConfig(**given, network=network, target_width=TARGET_WIDTH[network], pretrained=not scratch))


@cli.command()
@click.argument("file", type=PATH)
@click.argument("number", type=click.IntRange(0))
@data
@labels
@option("--out", "Folder to write; `train --start` continues from it.", required=True)
def unpack(file: Path, number: int, data: Path, labels: Path, out: Path) -> None:
    """Read network NUMBER (from 0) of the ONNX file FILE back, so that its training can go on."""
    from export.training import TrainConfig
    from export.training.unpack import unpack as run

    run(file, number, TrainConfig(str(data), str(labels), str(out), aimed=0.2))


@cli.command()
@click.argument("runs", type=PATH, nargs=-1, required=True)
@data
@labels
def suitable(runs: tuple[Path, ...], data: Path, labels: Path) -> None:
    """Fit the head that says whether a photo suits, on the features of finished runs that will answer together.

    Prints what it catches.
    """
    from export.training.suitable import learn_suitable

    click.echo(learn_suitable(runs, data, labels))


@cli.command()
@data
@labels
def prior(data: Path, labels: Path) -> None:
    """Fit how much lower the sun stands in the photos of photos_train.csv than in training crops."""
    from export.training.prior import describe_prior

    click.echo(describe_prior(data, labels))


@cli.command()
@click.argument("runs", type=PATH, nargs=-1, required=True)
@option("--out", "Folder to write; it then holds a run like any other.", required=True)
def merge(runs: tuple[Path, ...], out: Path) -> None:
    """Average the weights of runs with a common beginning."""
    from export.networks import merge as run

    run(runs, out)


@cli.command()
@click.argument("runs", type=PATH, nargs=-1, required=True)
@option("--out", "File to write. [default: RUN/NAME-VERSION.onnx]", FILE)
@option("--temperature", "Divides the logits of the sun's softmax.", click.FloatRange(0.1, 10), 1.0)
@option("--version", "Version of the network, if not the run's: another temperature makes another network.", str)
@option("--camera", "Run of a further network, which answers for the camera instead of the others.", multiple=True)
@option("--elevation-scale", "Degrees of `prior`. [default: no prior]", click.FloatRange(10), math.inf)
def onnx(
    runs: tuple[Path, ...],
    out: Path | None,
    temperature: float,
    version: str | None,
    camera: tuple[Path, ...],
    elevation_scale: float,
) -> None:
    """Write the averaged network of one or several runs as ONNX, and compare it with torch."""
    from export.networks import read_spec, write_onnx

    spec = read_spec(runs[0])
    target = out or runs[0] / f"{spec.name}-{version or spec.version}.onnx"
    difference = write_onnx(
        runs, target, temperature=temperature, version=version, cameras=camera, elevation_scale=elevation_scale
    )
    click.echo(f"{target}: {target.stat().st_size / 1e6:.1f} MB, largest difference to torch {difference:.1e}")


@cli.command()
@data
@labels
@option("--model", "Network to score. [default: the one in the package]")
@option("--compare", "Further networks, such as the CVPR 2017 one.", multiple=True)
@option("--out", "Folder for the report and the crops' errors.", default="runs/evaluation")
@flag("--with-metadata", "Also score answers with simulated time, place, compass and lens, and with several views.")
@flag("--relight", "Also relight objects with the estimated environment maps, and judge their light by weather.")
@flag("--failures", "Also write the worst crops; they show pictures of the data, so do not publish them.")
@flag("--card", "Also write the model card and figures beside the network, the reliability diagram into docs.")
def evaluate(model: Path | None, compare: tuple[Path, ...], card: bool, **given: Any) -> None:
    """Print the accuracy on the `val` split, whose places training never saw."""
    from export.evaluation import Options, write_card
    from export.evaluation import evaluate as run
    from lighting.model import packaged_model

    options = Options(**given, models=(model or packaged_model(), *compare))
    evaluation = run(options)
    click.echo(evaluation.report)
    if card:
        write_card(evaluation, options)


@cli.command()
@click.argument("name", type=click.Choice(FITS))
@data
@labels
@network
@option("--seen", "Folder of panoramas that the network learnt from; `ground` leaves their places out. [default: none]")
def fit(name: str, data: Path, labels: Path, model: Path | None, seen: Path | None) -> None:
    """Fit constants of the light; print them and what they gain.

    ground: how far the network tells the ground's brightness better than the photo does. sky-color: how far the color
    of the sky in a photo may be trusted for the whole sky. sun-color: how far the sun's color goes to that of a clear
    sky's sun. sun-power: by how much the network understates a sun that shines.
    """
    from export.evaluation import fit_constants
    from lighting.model import Model

    if seen and name != "ground":
        raise click.UsageError(f"--seen is for the fit ground, not for {name}.")
    more = {"seen": seen} if seen else {}
    click.echo(fit_constants.FITS[name](Model.load(model), data, labels, **more))


@cli.group()
def report() -> None:
    """Print how exact something besides the network is."""


@report.command()
def probe() -> None:
    """How exactly skies are merged, aligned and oriented; a few minutes on two cores."""
    from export.reports.probe import report_probe

    for line in report_probe():
        click.echo(line)


@report.command("shadow-mask")
@option("--count", "Photos of rendered places.", click.IntRange(1), 24)
@network
def shadow_mask(count: int, model: Path | None) -> None:
    """How well the shade on the ground is found, and what shadows that are put there then look like."""
    from export.reports.shadow_mask import render_ground_scenes, report_shadow_mask
    from lighting.model import Model

    click.echo(report_shadow_mask(Model.load(model), list(render_ground_scenes(count))))


@report.command()
@data
@option("--count", "Clips of each kind.", click.IntRange(1), 8)
@click.option("--kind", "kinds", type=click.Choice(CLIP_KINDS), multiple=True, help="Only clips of these kinds. [all]")
@option("--only", "One part of the report. [all]", click.Choice(VIDEO_PARTS))
@network
def video(data: Path, count: int, kinds: tuple[str, ...], only: str | None, model: Path | None) -> None:
    """How well clips are followed, by cameras moved in `val` panoramas and rendered places."""
    from export.reports.video import report_video
    from lighting.model import Model

    for part in report_video(data, count, kinds or CLIP_KINDS, Model.load(model), only):
        click.echo(part + "\n")


@report.command("photo-sets")
@data
@option("--split", "Split of the panoramas.", click.Choice(["train", "val"]), "val")
@option("--last", "Only the last rows of the index, which a network did not see.", click.IntRange(1))
@option("--count", "At most so many places and walks. [all]", click.IntRange(1))
@network
@click.argument("parts", nargs=-1, type=click.Choice(PHOTO_SET_PARTS))
def photo_sets(parts: tuple[str, ...], **asked: Any) -> None:
    """How well turns between photos are found, and what they are worth."""
    from export.reports.photo_sets import PhotoSetOptions, report_photo_sets

    click.echo(report_photo_sets(PhotoSetOptions(parts=parts or PHOTO_SET_PARTS, **asked)))


def main() -> None:
    """Run the command line; expected errors end it with one sentence."""
    try:
        cli(prog_name="python -m export")
    except (LightingError, OSError) as error:
        sys.exit(f"Error: {error}")


if __name__ == "__main__":
    main()
