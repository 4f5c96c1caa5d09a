"""The commands about photometric stereo: stereo plan, stereo normals."""

import json
from collections.abc import Iterable, Sequence
from datetime import date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

import lighting.cli.outputs as outputs
from lighting.cli import OLD_OPTIONS, Command, cli
from lighting.cli import options as common
from lighting.cli.console import escape_path
from lighting.cli.options import FiniteRange, number_option, quiet_option, usage_errors
from lighting.cli.outputs import write_bytes
from lighting.cli.photos import check_coordinates, parse_utc_offset_option
from lighting.errors import ErrorCode, ParameterError
from lighting.files import escape_undecodable, output_folder_error
from lighting.start import silence_libraries

if TYPE_CHECKING:
    from lighting.stereo.output import NormalsOptions, NormalsProgress, NormalsResult
    from lighting.stereo.planner import PlanSkies
    from lighting.stereo.schedule import DayProgress, Plan, Window


@cli.group(
    "stereo",
    epilog="""
    lighting stereo plan --lat 48 --lon 11 --date 2026-06-21
    lighting stereo plan --lat 48 --lon 11 --date 2026-05-01 --until 2026-08-31 -o plan.png
    lighting stereo normals day/ --heading 10
    """,
)
def _stereo() -> None:
    """Photometric stereo: when to photograph, and normals.

    Directions are degrees clockwise from true north.
    """


_day = common.read_by(
    lambda text: datetime.strptime(text, "%Y-%m-%d").date(), "{text!r} is not a day such as 2026-06-21."
)


@_stereo.command(
    "plan",
    epilog="""
    lighting stereo plan --lat 48 --lon 11 --date 2026-06-21
    lighting stereo plan --lat 48 --lon 11 --date 2026-05-01 --until 2026-08-31 -o plan.png
    lighting stereo plan --probes skies/ --facing 180 --json
    """,
)
@number_option("48.14", "DEG", "Where: positive north.", "--latitude", "--lat")
@number_option("11.58", "DEG", "Where: positive east.", "--longitude", "--lon")
@click.option("--date", "first", callback=_day, metavar="DATE", help="The day: 2026-06-21.")
@click.option("--until", "last", callback=_day, metavar="DATE", help="Last day of a range, whose best day is planned.")
@click.option(
    "--sky", type=click.Choice(["clear", "overcast", "mixed"]), help="Modeled sky; mixed is broken cloud. [clear]"
)
@click.option(
    "--probes",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="DIR",
    help="Measured skies instead: DIR/YYYYMMDD/HHMMSS/envmap.exr.",
)
@number_option("180", "DEG", "Where the surface faces; else all around and up.", "--facing")
@click.option("--shots", type=int, default=8, show_default=True, help="Photos of a window.")
@number_option("1", "PERCENT", "Of a pixel, of the brightest light.", "--noise", default=1.0, show_default=True)
@click.option(
    "--utc-offset",
    metavar="HOURS",
    callback=parse_utc_offset_option,
    help="Of the clock: +02:00 or 2; else the longitude's, or UTC of --probes.",
)
@click.option(
    "-o", "--output", metavar="FILE.png", callback=common.check_file_name, help='Also draw it; "-" is stdout.'
)
@common.overwrite_option
@common.json_option
@quiet_option
def _plan(
    output: str | None, as_json: bool, quiet: bool, facing: float | None, shots: int, noise: float, **options: Any
) -> None:
    """When to photograph a thing so that its normals come out best.

    Compares windows of 1, 2, 3 and 6 hours of a day, or of the best day of a range. It prints how far the normals
    will be off.
    """
    from lighting.stereo.planner import plan_photos, plan_record
    from lighting.stereo.schedule import PlanRequest

    outputs.check_json(as_json, [output])
    overwrite = options.pop("overwrite")
    if output is not None:
        outputs.check_file(output, outputs.PREVIEWS.suffixes)
        outputs.check_absent([output], overwrite=overwrite)
    check_coordinates(options["latitude"], options["longitude"])
    with usage_errors():
        skies, question = _skies(**options), PlanRequest(facing, shots, noise)
    with silence_libraries() as stderr:
        plan = plan_photos(skies, question, _progress(quiet, stderr))
    if output:
        _draw(output, skies, plan)
    if as_json:
        click.echo(json.dumps(plan_record(skies, plan), indent=2, allow_nan=False))
    elif output != "-" and not (quiet and output):
        click.echo(_format_plan(skies, plan))
    outputs.report_written([output] if output else [], quiet=quiet or as_json)


def _skies(first: date | None, last: date | None, probes: Path | None, sky: Any, **location: Any) -> "PlanSkies":
    """The skies to plan for; wrong usage where what they need is missing or would do nothing."""
    from lighting.stereo.planner import MeasuredSkies, ModelledSkies

    if last and not first:
        raise click.UsageError("--until needs --date.")
    if probes:
        if sky:
            raise click.UsageError("--sky is a modeled one; --probes takes measured ones.")
        if location["latitude"] is not None or location["longitude"] is not None:
            raise click.UsageError("--lat and --lon are of modeled skies; --probes takes measured ones.")
        return MeasuredSkies(probes, first, last, utc_offset=location["utc_offset"] or 0.0)
    if first is None or location["latitude"] is None or location["longitude"] is None:
        raise click.UsageError("A plan needs --lat, --lon and --date, or --probes.")
    return ModelledSkies(first=first, last=last or first, sky=sky or "clear", **location)


def _progress(quiet: bool, stderr: TextIO) -> "DayProgress":
    from tqdm import tqdm

    return lambda days: tqdm(days, unit="day", disable=quiet or len(days) < 2 or not stderr.isatty(), file=stderr)


def _draw(output: str, skies: "PlanSkies", plan: "Plan") -> None:
    from lighting.files.deflate import encode_png
    from lighting.stereo.planner import draw_plan, plan_conditions, plan_title

    headline = f"When to photograph: {plan_title(skies, plan)}"
    write_bytes(output, encode_png(draw_plan(plan, headline, plan_conditions(skies, plan.question))))


def _format_plan(skies: "PlanSkies", plan: "Plan") -> str:
    """A line for each window, and a table of the errors by orientation."""
    from lighting.stereo.planner import format_angle_error, plan_conditions, plan_title

    names = [orientation.name for orientation in plan.windows[0].orientations]
    width = max(map(len, names))
    table = [f"{'':{width}}" + "".join(f"{window.hours:>6} h" for window in plan.windows)]
    for row, name in enumerate(names):
        errors = (format_angle_error(window.orientations[row].error) for window in plan.windows)
        table.append(f"{name:{width}}" + "".join(f"{error:>8}" for error in errors))
    lines = [f"{plan_title(skies, plan)}; {plan_conditions(skies, plan.question)}.", *map(_line, plan.windows)]
    return "\n".join([*lines, "Expected error of the normal by orientation:", *table, *_verdict(plan)])


def _line(window: "Window") -> str:
    from lighting.stereo.planner import format_angle_error
    from lighting.stereo.schedule import format_clock

    gain = f"{window.gain:.1f}" if window.gain < 1e4 else "infinite"
    return (
        f"{window.hours} h  {format_clock(window.start)} to {format_clock(window.end)}  "
        f"median error {format_angle_error(window.error)}, noise gain {gain}"
    )


def _verdict(plan: "Plan") -> list[str]:
    """A sentence where no window is any good."""
    from lighting.stereo.planner import MAX_USEFUL_ERROR

    if min(window.error for window in plan.windows) <= MAX_USEFUL_ERROR:
        return []
    return ["No window resolves the normals: the light comes from nearly one direction or one plane all day."]


_FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)


class _NormalsCommand(Command):
    renamed = {  # noqa: RUF012 - of the class above
        **OLD_OPTIONS,
        "--pitch": "--camera-elevation",
        "--roll": "--camera-roll",
    }


@_stereo.command(
    "normals",
    cls=_NormalsCommand,
    epilog="""
    lighting stereo normals day/                        # day-normals/ beside it
    lighting stereo normals day/ --heading 10 -o relief
    lighting stereo normals day/ --probes skies/ --mask statue.png --overwrite -o relief
    """,
)
@click.argument("day", type=_FOLDER)
@common.folder_output("DAY-normals")
@click.option("--latitude", "--lat", type=FiniteRange(-90, 90), metavar="DEG", help="Where, if EXIF lacks it.")
@click.option("--longitude", "--lon", type=FiniteRange(-180, 180), metavar="DEG", help="Longitude, positive east.")
@click.option("--heading", type=FiniteRange(-360, 360), metavar="DEG", help="Where the camera looks, if EXIF lacks it.")
@click.option("--camera-elevation", type=FiniteRange(-90, 90), default=0.0, metavar="DEG", help="How far it looks up.")
@click.option(
    "--camera-roll", type=FiniteRange(-360, 360), default=0.0, metavar="DEG", help="How far it is turned clockwise."
)
@click.option(
    "--utc-offset", metavar="HOURS", callback=parse_utc_offset_option, help="Of the camera's clock: +02:00 or 2."
)
@click.option("--sky", type=click.Choice(["clear"]), help="Modeled sky. [clear]")
@click.option("--turbidity", type=FiniteRange(1, 10), help="Of the modeled sky. [what the photos fit best]")
@click.option("--probes", type=_FOLDER, metavar="DIR", help="Measured skies: DIR/YYYYMMDD/HHMMSS/envmap.exr.")
@click.option("--mask", type=click.Path(exists=True, dir_okay=False, path_type=Path), help="White where the thing is.")
@click.option("--curve", type=click.Choice(["linear", "srgb"]), help="How values are coded, against what files say.")
@click.option("--size", type=click.IntRange(0), metavar="PIXELS", help="Longer side; 0 keeps all. [1024]")
@click.option("--noise", type=FiniteRange(0.01, 50), metavar="PERCENT", help="Least, of the brightest pixel. [1]")
@click.option("--network/--no-network", default=True, help="Let the network answer where it expects to err less.")
@common.json_option
@quiet_option
def _normals(
    day: Path, output: str | None, overwrite: bool, network: bool, as_json: bool, quiet: bool, **options: Any
) -> None:
    """Find the normals of a thing from photos of one DAY, taken by a camera that did not move.

    DAY holds RAW, 16-bit PNG or TIFF, EXR or JPEG photos. Times and place come from EXIF, times else from times.csv,
    the mask from mask.png. FOLDER receives normals, albedo, uncertainty and a mesh.
    """
    if options["probes"] and (options["sky"] or options["turbidity"]):
        raise click.UsageError("--sky and --turbidity are of modeled skies; --probes takes measured ones.")
    from lighting.stereo.normal_network import Network
    from lighting.stereo.output import estimate_normals, write_normals

    check_coordinates(options["latitude"], options["longitude"])
    folder = Path(outputs.choose_folder(str(day), output, "-normals"))
    if folder.resolve() == day.resolve():
        raise click.UsageError(f"{folder} holds the photos; the results need another folder.")
    if objection := output_folder_error(folder, overwrite=overwrite):
        raise ParameterError(objection, "folder", ErrorCode.UNWRITABLE)
    with silence_libraries() as stderr:
        learned = Network.load() if network else None
        result = estimate_normals(day, _normals_options(**options), learned, _watch(quiet, stderr))
    write_normals(folder, result)
    for warning in result.warnings:
        click.echo(f"Warning: {warning}", err=True)
    if as_json:
        record = {"file": escape_undecodable(str(day)), "output": escape_undecodable(str(folder)), **result.record}
        click.echo(json.dumps(record))
    elif not quiet:
        click.echo(_format_normals(day, folder, result))
    best = str(folder / "normals_camera.png")
    outputs.report_written([str(folder)], lambda _: outputs.open_command(best), quiet=quiet or as_json)


def _normals_options(sky: str | None, noise: float | None, size: int | None, **options: Any) -> "NormalsOptions":  # noqa: ARG001
    """The options that the user stated; the others keep their defaults."""
    from lighting.stereo.output import NormalsOptions

    stated = {name: value for name, value in options.items() if value is not None}
    if noise is not None:
        stated["noise"] = noise / 100
    if size is not None:
        stated["size"] = size or None
    return NormalsOptions(**stated)


def _watch(quiet: bool, stderr: TextIO) -> "NormalsProgress":
    from tqdm import tqdm

    from lighting.stereo.output import NormalsProgress

    hidden = quiet or not stderr.isatty()

    def photos(paths: Sequence[Path]) -> Any:
        return tqdm(paths, desc="photos", unit="photo", disable=hidden, file=stderr)

    def pixels(parts: Iterable[Any], count: int) -> Any:
        return tqdm(parts, total=count, desc="search", unit="block", disable=hidden, file=stderr)

    return NormalsProgress(photos, pixels)


def _format_normals(day: Path, output: Path, result: "NormalsResult") -> str:
    record = result.record
    count = f"{record['pixels']} normals from {len(record['photos'])} photos"
    text = f"{escape_path(str(day))}: {count} in {escape_path(str(output))}; "
    text += f"expected error of the median pixel {record['expected_error_median']:.1f} deg"
    if record["by_network"]:
        text += f", {100 * record['by_network']:.0f} % by the network"
    return text + "."
