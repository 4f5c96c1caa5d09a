"""The command that finds normals from the photos of a day."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

from lighting.cli.given import read_zone
from lighting.cli.options import FiniteRange, quiet_option, results_folder
from lighting.cli.silence import silence
from lighting.cli.stereo import stereo
from lighting.cli.words import shown

if TYPE_CHECKING:
    from lighting.stereo import Network, Solved, Told, Watch

_FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)


@stereo.command()
@click.argument("day", type=_FOLDER)
@results_folder
@click.option("--overwrite", is_flag=True, help="Replace results in FOLDER; its other files stay.")
@click.option("--lat", "latitude", type=FiniteRange(-90, 90), metavar="DEG", help="Where, if EXIF lacks it.")
@click.option("--lon", "longitude", type=FiniteRange(-180, 180), metavar="DEG", help="Longitude, positive east.")
@click.option("--heading", type=FiniteRange(-360, 360), metavar="DEG", help="Where the camera looks, if EXIF lacks it.")
@click.option("--pitch", type=FiniteRange(-90, 90), default=0.0, metavar="DEG", help="How far it looks up.")
@click.option("--roll", type=FiniteRange(-360, 360), default=0.0, metavar="DEG", help="How far it is turned clockwise.")
@click.option("--utc-offset", metavar="HOURS", callback=read_zone, help="Of the camera's clock: +02:00 or 2.")
@click.option("--sky", type=click.Choice(["clear"]), help="Modelled sky. [clear]")
@click.option("--turbidity", type=FiniteRange(1, 10), help="Of the modelled sky. [what the photos fit best]")
@click.option("--probes", type=_FOLDER, metavar="DIR", help="Measured skies: DIR/YYYYMMDD/HHMMSS/envmap.exr.")
@click.option("--mask", type=click.Path(exists=True, dir_okay=False, path_type=Path), help="White where the thing is.")
@click.option("--curve", type=click.Choice(["linear", "srgb"]), help="How values are coded, against what files say.")
@click.option("--size", type=click.IntRange(0), metavar="PIXELS", help="Longer side; 0 keeps all. [1024]")
@click.option("--noise", type=FiniteRange(0.01, 50), metavar="PERCENT", help="Least, of the brightest pixel. [1]")
@click.option("--network/--no-network", default=True, help="Let the network answer where it expects to err less.")
@quiet_option
def normals(day: Path, output: str, overwrite: bool, network: bool, quiet: bool, **said: Any) -> None:
    """Find the normals of a thing from photos of one DAY, taken by a camera that stood still.

    DAY holds RAW, 16-bit PNG or TIFF, EXR or JPEG photos. Times and place come from EXIF, times else from times.csv,
    the mask from mask.png. FOLDER receives normals, albedo, uncertainty and a mesh.
    """
    if said["probes"] and (said["sky"] or said["turbidity"]):
        raise click.UsageError("--sky and --turbidity are of modelled skies; --probes takes measured ones.")
    from lighting.stereo import check_folder, solve_day, write_solved

    folder = Path(output)
    if folder.resolve() == day.resolve():
        raise click.UsageError(f"{folder} holds the photos; the results need another folder.")
    check_folder(folder, overwrite=overwrite)
    with silence() as stderr:
        solved = solve_day(day, _told(**said), _network() if network else None, _watch(quiet, stderr))
    write_solved(folder, solved)
    for warning in solved.warnings:
        click.echo(f"Warning: {warning}", err=True)
    if not quiet:
        click.echo(_in_words(day, folder, solved))


def _told(sky: str | None, noise: float | None, size: int | None, **said: Any) -> "Told":  # noqa: ARG001
    """What was said; what was not keeps its default."""
    from lighting.stereo import Told

    given = {name: value for name, value in said.items() if value is not None}
    if noise is not None:
        given["noise"] = noise / 100
    if size is not None:
        given["size"] = size or None
    return Told(**given)


def _network() -> "Network":
    from lighting.stereo import Network

    return Network.load()


def _watch(quiet: bool, stderr: TextIO) -> "Watch":
    from tqdm import tqdm

    from lighting.stereo import Watch

    shows: dict[str, Any] = {"disable": quiet or not stderr.isatty(), "file": stderr}

    def photos(paths: Sequence[Path]) -> Any:
        return tqdm(paths, desc="photos", unit="photo", **shows)

    def pixels(parts: Iterable[Any], count: int) -> Any:
        return tqdm(parts, total=count, desc="search", unit="block", **shows)

    return Watch(photos, pixels)


def _in_words(day: Path, output: Path, solved: "Solved") -> str:
    record = solved.record
    count = f"{record['pixels']} normals from {len(record['photos'])} photos"
    words = f"{shown(str(day))}: {count} in {shown(str(output))}; "
    words += f"expected error of the median pixel {record['expected_error_median']:.1f} deg"
    if record["by_network"]:
        words += f", {100 * record['by_network']:.0f} % by the network"
    return words + "."
