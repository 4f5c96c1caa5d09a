"""`python -m export`: from panoramas to networks (label, train, onnx, ...), and what they are worth (evaluate, ...)."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from lighting.cli import Group
from lighting.errors import LightingError

PATH = click.Path(path_type=Path)  # a folder, or a file to read
FILE = click.Path(path_type=Path, dir_okay=False)  # to write
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
FITS = ("ground", "photo-radii", "sky-color", "sun-color", "sun-power")  # of export.evaluation.fit_constants


def _option(name: str, meaning: str, kind: Any = PATH, default: Any = None, **more: Any) -> Decorator:
    """An option with its meaning; the default is shown if there is one."""
    if default is not None:  # an explicit None would count as user input, also where the option is required
        more |= {"default": default, "show_default": True}
    return click.option(name, type=kind, help=meaning, **more)


def _share(name: str, default: float, meaning: str) -> Decorator:
    """An option that is a share, 0 to 1."""
    return _option(name, meaning, click.FloatRange(0, 1), default)


def _flag(name: str, meaning: str) -> Decorator:
    """An option that is off by default."""
    return click.option(name, is_flag=True, help=meaning)


_data = _option("--data", "Folder with panoramas.csv and the pictures.", required=True)
_network = _option("--model", "Network to ask. [default: the one in the package]")
_labels = _option("--labels", "CSV file of `label`.", default="runs/labels.csv")


@click.group(cls=Group)
def export_cli() -> None:
    """From a folder of panoramas to the network that ships. export/README.md describes the folder's format."""


@export_cli.command("label")
@_data
@_option("--out", "CSV file to write.", FILE, "runs/labels.csv")
@_option("--workers", "Processes.", click.IntRange(1), 2)
def _label(data: Path, out: Path, workers: int) -> None:
    """Find suns and fit skies; print how well both agree with what is known."""
    from export.data.labels import label_folder

    label_folder(data, out, workers)


@export_cli.group("data")
def _data_group() -> None:
    """Say what a folder of training data holds."""


@_data_group.command("list")
@_data
@_option("--out", "CSV file to write.", FILE, "export/data/sources.csv")
@_option("--taught", "Version of a network and the folder it learned from; repeatable.", (str, PATH), multiple=True)
def _list(data: Path, out: Path, taught: tuple[tuple[str, Path], ...]) -> None:
    """List every panorama and photo: address, licence, label, checksum, and which networks learnt from it."""
    from export.data.sources import list_sources

    click.echo(list_sources(data, out, taught))


@export_cli.command("synthesize")
@_option("--out", "Folder to fill.", default="runs/places")
@_option("--count", "Panoramas, two of a place; every third place is for `evaluate`.", click.IntRange(1), 120)
@_option("--height", "Rows of each panorama.", click.IntRange(32), 256)
def _synthesize(out: Path, count: int, height: int) -> None:
    """Render simple places under a sky, to try training without data of one's own; each takes a second."""
    from export.data.rendered_panoramas import render_folder

    render_folder(out, count, height)


@export_cli.command("train")
@_data
@_labels
@_option("--out", "Folder of the run; a run with a checkpoint is resumed. [default: runs/NETWORK]")
@_option("--network", "Network to train.", click.Choice(["outdoor", "transformer"]), "outdoor")
@_option("--crops", "Crops drawn in all.", click.IntRange(1), 100_000)
@_option("--batch", "Crops per step.", click.IntRange(2), 32)
@_option("--learning-rate", "Highest learning rate.", click.FloatRange(0, 1), 8e-4)
@_option("--version", "Version of the network, for its metadata.", str, "1.0.0")
@_flag("--licensed-only", "Train on permissively licensed panoramas and photos only.")
@_option("--first-width", "Degrees by which sun targets are wider at first.", click.FloatRange(0, 90), 0.0)
@_option("--start", "Folder of an earlier run to start from. [default: ImageNet's weights]")
@_option("--teacher", "Folder of a finished run to learn from as well; repeatable.", multiple=True)
@_share("--aimed", 0.2, "Share of the crops of panoramas with a visible sun whose camera is turned towards it.")
@_share("--joined", 0.0, "Share of the crops divided by a line between two places under the same sun.")
@_flag("--surroundings", "Also learn the light all around the camera and its power.")
@_share("--photos-share", 0.0, "Share of the crops that show the photos of photos_train.csv.")
@_flag("--mirrored", "Also learn from every crop's mirror image; needs --teacher or --only-camera.")
@_flag("--only-camera", "Train only for the camera's elevation, roll and field of view.")
@_share("--tune-share", 0.08, "Share of the places that are held out for the log.")
@_option("--workers", "Processes that cut crops.", click.IntRange(0), 2)
def _train(out: Path | None, network: str, teacher: tuple[Path, ...], **settings: Any) -> None:
    """Train a network, or resume a run that was stopped. Uses a GPU if there is one."""
    from export.training.dataset import TrainConfig
    from export.training.loop import train_network as run

    if teacher and settings["only_camera"]:
        raise click.UsageError("--teacher answers for all heads; leave out --only-camera.")
    if settings["mirrored"] and not (teacher or settings["only_camera"]):
        raise click.UsageError("--mirrored needs --teacher or --only-camera: crops say nothing of a mirrored sun.")
    settings |= {"out": out or Path("runs") / network, "teachers": tuple(map(str, teacher))}
    settings |= {name: str(settings[name] or "") for name in ("data", "labels", "out", "start")}
    run(TrainConfig(**settings, network=network))


@export_cli.command("unpack")
@click.argument("file", type=PATH)
@click.argument("number", type=click.IntRange(0))
@_data
@_labels
@_option("--out", "Folder to write; `train --start` continues from it.", required=True)
def _unpack(file: Path, number: int, data: Path, labels: Path, out: Path) -> None:
    """Read network NUMBER (from 0) of the ONNX file FILE back, so that its training can go on."""
    from export.training.dataset import TrainConfig
    from export.training.onnx_import import unpack_network as run

    run(file, number, TrainConfig(str(data), str(labels), str(out), aimed=0.2))


@export_cli.command("suitable")
@click.argument("file", type=PATH)
@_data
@_option("--more", "Further folder with unsuitable.csv, whose pictures are learnt from.", multiple=True)
@_option("--version", "Version of the network, if not the file's.", str)
@_option("--out", "File to write. [default: FILE]", FILE)
def _suitable(file: Path, data: Path, more: tuple[Path, ...], version: str | None, out: Path | None) -> None:
    """Fit the head that says whether a photo suits, on what the networks of an ONNX file see, and write it there.

    Prints what it catches.
    """
    from export.training.suitability_head import fit_suitability_head

    click.echo(fit_suitability_head(file, data, more, out or file, version))


@export_cli.command("segments")
@_data
@_option("--teacher", "ONNX file of the network that answers for pictures without grids.", required=True)
@_option("--out", "Folder to write, for `onnx --segments`.", PATH, "runs/segments")
def _segments(data: Path, teacher: Path, out: Path) -> None:
    """Train the head that says what each part of a photo shows; ten minutes on two cores."""
    from export.training.segmentation import train_segmentation

    click.echo(train_segmentation(data, teacher, out))


@export_cli.command("kinds")
@_data
@_network
def _kinds(data: Path, model: Path | None) -> None:
    """Fit what tells kinds of places apart, and write it into the library of detail.

    Prints what it tells of `val`.
    """
    from export.training.place_kinds import fit_place_kinds
    from lighting.model import Model

    click.echo(fit_place_kinds(data, Model.load(model)))


@export_cli.command("prior")
@_data
@_labels
def _prior(data: Path, labels: Path) -> None:
    """Fit how much lower the sun stands in the photos of photos_train.csv than in training crops."""
    from export.crops.photos import fit_elevation_prior

    click.echo(fit_elevation_prior(data, labels))


@export_cli.command("onnx")
@click.argument("runs", type=PATH, nargs=-1, required=True)
@_option("--out", "File to write. [default: RUN/NAME-VERSION.onnx]", FILE)
@_option("--temperature", "Divides the logits of the sun's softmax.", click.FloatRange(0.1, 10), 1.0)
@_option("--version", "Version of the network, if not the run's: another temperature makes another network.", str)
@_option("--camera", "Run of a further network, which answers for the camera instead of the others.", multiple=True)
@_option(
    "--sun",
    "Run of a further network, which answers for the sun and the light beside the others, and for nothing else.",
    multiple=True,
)
@_option("--segments", "Run of `segments`, whose head tells what photos show. [default: nothing tells it]")
@_option("--elevation-scale", "Degrees of `prior`. [default: no prior]", click.FloatRange(10), math.inf)
def _onnx(
    runs: tuple[Path, ...],
    out: Path | None,
    version: str | None,
    camera: tuple[Path, ...],
    sun: tuple[Path, ...],
    segments: Path | None,
    **numbers: float,
) -> None:
    """Write the averaged network of one or several runs as ONNX, and compare it with torch."""
    from export.networks.onnx_export import write_onnx
    from export.networks.weights import read_spec
    from lighting.onnx_session import weights_path

    spec = read_spec(runs[0])
    target = out or runs[0] / f"{spec.name}-{version or spec.version}.onnx"
    difference = write_onnx(runs, target, version=version, cameras=camera, segments=segments, suns=sun, **numbers)
    size = sum(file.stat().st_size for file in (target, weights_path(target)))
    click.echo(f"{target}: {size / 1e6:.1f} MB, largest difference to torch {difference:.1e}")


@export_cli.command("evaluate")
@_data
@_labels
@_option("--model", "Network to score. [default: the one in the package]")
@_option("--compare", "Further networks.", multiple=True)
@_option("--out", "Folder for the report and the crops' errors.", default="runs/evaluation")
@_flag("--with-metadata", "Also score answers with simulated time, place, compass and lens, and with several views.")
@_flag("--relight", "Also relight objects with the estimated environment maps, and judge their light by weather.")
@_flag("--failures", "Also write the worst crops; they show pictures of the data, so do not publish them.")
@_flag("--card", "Also write the model card, metrics.json, and the pages' figures and diagram.")
def _evaluate(model: Path | None, compare: tuple[Path, ...], card: bool, **settings: Any) -> None:
    """Print the accuracy on the `val` split, whose places training never saw."""
    from export.data.labels import check_labels
    from export.evaluation.evaluate import Options
    from export.evaluation.evaluate import evaluate_networks as run
    from export.evaluation.model_card import publish_evaluation
    from lighting.model import packaged_model

    ours = model or packaged_model()
    if card and ours.resolve() != packaged_model().resolve():
        raise click.UsageError("--card is for the network in the package; leave out --model.")
    options = Options(**settings, models=(ours, *compare))
    click.echo(run(options))
    if card:
        publish_evaluation(options.out, check_labels(options.data, options.labels))


@export_cli.command("card")
@_option("--evaluation", "Folder of `evaluate` to take over first, such as runs/evaluation.")
def _card(evaluation: Path | None) -> None:
    """Write the model card and the figures of README and docs again, from metrics.json beside the network."""
    from export.evaluation.model_card import publish_evaluation, write_card

    click.echo(publish_evaluation(evaluation) if evaluation else write_card())


@export_cli.command("fit")
@click.argument("name", type=click.Choice(FITS))
@_data
@_labels
@_network
@_option(
    "--seen", "Folder of panoramas that the network learnt from; `ground` leaves their places out. [default: none]"
)
def _fit(name: str, data: Path, labels: Path, model: Path | None, seen: Path | None) -> None:
    """Fit constants of the light; print them and what they gain.

    For ground: how far the network tells the ground's brightness better than the photo does. For sky-color: how far
    the color of the sky in a photo may be trusted for the whole sky. For sun-color: how far the sun's color goes to
    that of a clear sky's sun. For sun-power: by how much the network understates a sun that shines. For photo-radii:
    how much wider the sun's distribution is in photos.
    """
    from export.evaluation import fit_constants
    from lighting.model import Model

    if seen and name != "ground":
        raise click.UsageError(f"--seen is for the fit ground, not for {name}.")
    more = {"seen": seen} if seen else {}
    click.echo(fit_constants.FIT_REPORTS[name](Model.load(model), data, labels, **more))


@export_cli.group("report")
def _report() -> None:
    """Print how exact something besides the network is."""


@_report.command("ground")
@_data
@_option("--split", "Rows of `ground.csv`.", click.Choice(["val", "train"]), "val")
@_option(
    "--folds",
    "All rows instead, by heads that are trained for it without the photographers and places they are judged on.",
    click.IntRange(2),
)
@_network
def _ground(data: Path, split: str, folds: int | None, model: Path | None) -> None:
    """How well photos' ground is found, and the spot where an object may stand."""
    from export.reports.ground import report_ground, report_ground_by_folds
    from lighting.model import Model

    network = Model.load(model)
    click.echo(report_ground(network, data, split) if folds is None else report_ground_by_folds(network, data, folds))


@_report.command("shadows")
@_data
@_network
def _shadows(data: Path, model: Path | None) -> None:
    """How near the sun is with one shadow that a person marked."""
    from export.reports.shadows import report_shadows
    from lighting.model import Model

    click.echo(report_shadows(Model.load(model), data))


@_report.command("map-detail")
@_data
@_option("--count", "Crops, each of another panorama.", click.IntRange(4), 100)
@_option(
    "--split", "Panoramas that are cropped; choose nothing by those of val.", click.Choice(["val", "train"]), "val"
)
@_option("--cache", "Folder that keeps estimates and truths.", default="runs/map-detail")
@_flag("--balance", "Say by crops of train what the library's panoramas cost, and write it into the library.")
@_option("--earlier", "`judged.npz` of an earlier run's cache, to compare maps of the same crops.")
@_network
def _map_detail(
    data: Path, count: int, split: str, cache: Path, balance: bool, earlier: Path | None, model: Path | None
) -> None:
    """How real maps look around the photo, and how near objects lit by them come to the truth."""
    from export.data.panoramas import DataError
    from export.reports.map_detail import balance_detail, report_map_detail
    from export.reports.map_judge import report_map_judge
    from lighting.model import Model

    network = Model.load(model)
    if balance:
        click.echo(balance_detail(data, network, count, cache))
    else:
        click.echo(report_map_detail(data, network, count, split, cache))
        try:
            click.echo("\n" + report_map_judge(data, network, count, split, cache, earlier))
        except DataError as error:  # the judge's wheel is not installed
            click.echo(f"\nNot judged by a network. {error}")


@_report.command("light-balls")
@_data
@_option("--count", "HDR panoramas of `val`. [all]", click.IntRange(1))
@_network
def _light_balls(data: Path, count: int | None, model: Path | None) -> None:
    """How near three balls come to the truth, by the public protocol of pictures."""
    from export.reports.light_balls import report_light_balls
    from lighting.model import Model

    click.echo(report_light_balls(data, Model.load(model), count))


@export_cli.group("stereo", cls=Group)
def _stereo() -> None:
    """Outdoor photometric stereo: its normals, its network."""


@_stereo.command("train")
@click.option("--out", type=PATH, default="runs/normals", show_default=True, help="Resumed if it has a checkpoint.")
@click.option("--meshes", type=PATH, default=None, help="Folder of OBJ files to learn from as well. [reliefs alone]")
@click.option("--minutes", type=click.FloatRange(0), default=70.0, show_default=True, help="Of training in all.")
@click.option("--seed", type=int, default=1, show_default=True)
@click.option("--threads", type=click.IntRange(1), default=1, show_default=True)
def _normals_train(out: Path, meshes: Path | None, minutes: float, seed: int, threads: int) -> None:
    """Train the network of normals on simulated days, or go on where a run stopped."""
    from export.stereo.train import Config, train_normals

    config = Config(out=str(out), meshes=str(meshes or ""), minutes=minutes, seed=seed, threads=threads)
    click.echo(train_normals(config))


@_stereo.command("onnx")
@click.argument("run", type=PATH)
@click.option("--version", default="1.0.0", show_default=True)
@click.option("--out", type=FILE, default=None, help="File to write. [RUN/normals-VERSION.onnx]")
def _normals_onnx(run: Path, version: str, out: Path | None) -> None:
    """Write the averaged network of a run as ONNX; compare it with torch."""
    from export.stereo.train import export_normals

    target = out or run / f"normals-{version}.onnx"
    difference = export_normals(run, target, version)
    click.echo(f"{target}: {target.stat().st_size / 1e6:.1f} MB, largest difference to torch {difference:.1e}")


@_stereo.command("evaluate")
@click.option("--data", type=PATH, required=True, help="Folder with scanned_objects and meshes.")
@click.option("--network", type=PATH, default=None, help="Network to score. [the one in the package]")
@click.option("--table", "tables", multiple=True, metavar="NAME", help="Print only this table, or these. [all]")
def _normals_evaluate(data: Path, network: Path | None, tables: tuple[Any, ...]) -> None:
    """Print how far normals are off on shapes and latitudes that training never saw; a quarter of an hour.

    Tables: seasons, expected.
    """
    from export.stereo.evaluate import TABLES
    from export.stereo.evaluate import evaluate_normals as run
    from lighting.stereo.normal_network import Network

    if unknown := set(tables).difference(TABLES):
        raise click.BadParameter(f"{min(unknown)} is no table; give one of {', '.join(TABLES)}.", param_hint="--table")
    run(data, Network.load(network), click.echo, tables or TABLES)


def _run_export() -> None:
    """Run the command line; expected errors end it with one sentence."""
    try:
        export_cli(prog_name="python -m export")
    except (LightingError, OSError) as error:
        sys.exit(f"Error: {error}")


if __name__ == "__main__":
    _run_export()
