"""The commands about photometric stereo outdoors: when to photograph, and normals from the photos of a day."""

import json
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

from lighting.cli.files import write_png
from lighting.cli.given import read_zone, wrong_usage
from lighting.cli.group import cli
from lighting.cli.options import preview_file, quiet_option
from lighting.cli.silence import silence

if TYPE_CHECKING:
    from lighting.stereo import AskedSkies, Plan, Progress, Window


@cli.group()
def stereo() -> None:
    """Photometric stereo: when to photograph, and normals.

    Directions are degrees clockwise from true north.
    """


def _day(_ctx: click.Context, _param: click.Parameter, text: str | None) -> datetime | None:
    try:
        return None if text is None else datetime.strptime(text, "%Y-%m-%d")
    except ValueError as error:
        raise click.BadParameter(f"{text!r} is not a day such as 2026-06-21.") from error


@stereo.command()
@click.option("--lat", "latitude", type=float, metavar="DEG", help="Where: latitude, positive north.")
@click.option("--lon", "longitude", type=float, metavar="DEG", help="Longitude, positive east.")
@click.option("--date", "first", callback=_day, metavar="DATE", help="The day: 2026-06-21.")
@click.option("--until", "last", callback=_day, metavar="DATE", help="Last day of a range, whose best day is planned.")
@click.option(
    "--sky", type=click.Choice(["clear", "overcast", "mixed"]), help="Modelled sky; mixed is broken cloud. [clear]"
)
@click.option(
    "--probes",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="DIR",
    help="Measured skies instead: DIR/YYYYMMDD/HHMMSS/envmap.exr.",
)
@click.option("--facing", type=float, metavar="DEG", help="Where the surface faces; else all around and up.")
@click.option("--shots", type=int, default=8, show_default=True, help="Photos of a window.")
@click.option(
    "--noise", type=float, default=1.0, show_default=True, metavar="PERCENT", help="Of a pixel, of the brightest light."
)
@click.option(
    "--utc-offset",
    metavar="HOURS",
    callback=read_zone,
    help="Of the clock: +02:00 or 2; else the longitude's, or UTC of --probes.",
)
@click.option("-o", "--output", metavar="FILE.png", callback=preview_file, help='Also draw it; "-" is stdout.')
@click.option("--json", "as_json", is_flag=True, help="JSON instead of words.")
@quiet_option
def plan(
    output: str | None, as_json: bool, quiet: bool, facing: float | None, shots: int, noise: float, **said: Any
) -> None:
    """When to photograph a thing so that its normals come out best.

    Compares windows of 1, 2, 3 and 6 hours of a day, or of the best day of a range, and says how far the normals will
    be off.
    """
    from lighting.stereo import Question, plan_photos, plan_record

    if output == "-" and as_json:
        raise click.UsageError('--json and "-o -" both go to stdout.')
    with wrong_usage():
        skies, question = _skies(**said), Question(facing, shots, noise)
    with silence() as stderr:
        found = plan_photos(skies, question, _progress(quiet, stderr))
    if output:
        _draw(output, skies, found)
    if as_json:
        click.echo(json.dumps(plan_record(skies, found), indent=2, allow_nan=False))
    elif output != "-" and not (quiet and output):
        click.echo(_in_words(skies, found))


def _skies(first: datetime | None, last: datetime | None, probes: Path | None, sky: Any, **place: Any) -> "AskedSkies":
    """The skies asked for; wrong usage where what they need is missing or would do nothing."""
    from lighting.stereo import MeasuredSkies, ModelledSkies

    days = first.date() if first else None, last.date() if last else None
    if last and not first:
        raise click.UsageError("--until needs --date.")
    if probes:
        if sky:
            raise click.UsageError("--sky is a modelled one; --probes takes measured ones.")
        if place["latitude"] is not None or place["longitude"] is not None:
            raise click.UsageError("--lat and --lon are of modelled skies; --probes takes measured ones.")
        return MeasuredSkies(probes, *days, utc_offset=place["utc_offset"] or 0.0)
    if days[0] is None or place["latitude"] is None or place["longitude"] is None:
        raise click.UsageError("A plan needs --lat, --lon and --date, or --probes.")
    return ModelledSkies(first=days[0], last=days[1] or days[0], sky=sky or "clear", **place)


def _progress(quiet: bool, stderr: TextIO) -> "Progress":
    from tqdm import tqdm

    return lambda days: tqdm(days, unit="day", disable=quiet or len(days) < 2 or not stderr.isatty(), file=stderr)


def _draw(output: str, skies: "AskedSkies", found: "Plan") -> None:
    from lighting.files import encode_png
    from lighting.stereo import conditions, draw_plan, title

    headline = f"When to photograph: {title(skies, found)}"
    write_png(output, encode_png(draw_plan(found, headline, conditions(skies, found.question))))


def _in_words(skies: "AskedSkies", found: "Plan") -> str:
    """A line for each window, and a table of the errors by orientation."""
    from lighting.stereo import conditions, shown_error, title

    names = [orientation.name for orientation in found.windows[0].orientations]
    width = max(map(len, names))
    table = [f"{'':{width}}" + "".join(f"{window.hours:>6} h" for window in found.windows)]
    for row, name in enumerate(names):
        errors = (shown_error(window.orientations[row].error) for window in found.windows)
        table.append(f"{name:{width}}" + "".join(f"{error:>8}" for error in errors))
    lines = [f"{title(skies, found)}; {conditions(skies, found.question)}.", *map(_line, found.windows)]
    return "\n".join([*lines, "Expected error of the normal by orientation:", *table, *_verdict(found)])


def _line(window: "Window") -> str:
    from lighting.stereo import clock, shown_error

    gain = f"{window.gain:.1f}" if window.gain < 1e4 else "infinite"
    return (
        f"{window.hours} h  {clock(window.start)} to {clock(window.end)}  "
        f"median error {shown_error(window.error)}, noise gain {gain}"
    )


def _verdict(found: "Plan") -> list[str]:
    """A sentence where no window is any good."""
    from lighting.stereo import HOPELESS

    if min(window.error for window in found.windows) <= HOPELESS:
        return []
    return ["No window resolves the normals: the light comes from nearly one direction or one plane all day."]
