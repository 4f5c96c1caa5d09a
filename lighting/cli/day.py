"""The command that writes the light of a day at a photo's place."""

import json
import re
import shlex
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

import click

import lighting.cli.console as console
import lighting.cli.outputs as outputs
from lighting.cli import cli
from lighting.cli import options as common
from lighting.cli.options import usage_errors
from lighting.cli.photos import estimate_file, user_input_options
from lighting.files import escape_undecodable, output_folder_error
from lighting.map_options import MAX_WHOLE_HEIGHT, MapOptions
from lighting.scene import EXPORTERS

if TYPE_CHECKING:
    from lighting.fusion.user_input import UserInput

_MINUTES = {"h": 60.0, "min": 1.0}


def _minutes(text: str) -> float:
    match = re.fullmatch(r"(\d+(?:\.\d+)?)(h|min)", text.strip())
    if match is None:
        raise ValueError(text)
    return float(match[1]) * _MINUTES[match[2]]


_read_date = common.read_by(date.fromisoformat, "{text!r} is not a date such as 2026-12-21.")
_read_step = common.read_by(_minutes, "{text!r} is not a time such as 1h or 30min.")


@cli.command(
    "day",
    epilog="""
    lighting day photo.jpg --date 2026-12-21            # where the file says place and heading
    lighting day photo.jpg --date 2026-06-21 --every 30min --lat 48.14 --lon 11.58 --heading 134
    lighting day photo.jpg --date 2026-03-20 --time 2024-06-01T18:30+02:00 --lat 48.14 --lon 11.58 -o march/
    """,
)
@click.argument("photo", metavar="PHOTO", type=common.FileName())
@common.folder_output("PHOTO-DATE")
@click.option("--date", "day", required=True, metavar="YYYY-MM-DD", callback=_read_date, help="The day, there.")
@click.option(
    "--every", default="1h", show_default=True, metavar="TIME", callback=_read_step, help="Between maps: 1h, 30min."
)
@common.map_options("height", "sky", "around", max_height=MAX_WHOLE_HEIGHT)
@user_input_options
@common.model_option
@common.json_option
@common.silent_option
def _day(
    photo: str,
    output: str | None,
    overwrite: bool,
    day: date,
    every: float,
    view: MapOptions,
    user_input: "UserInput",
    model: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Write the light of another day at a photo's place.

    FOLDER gets a map of each hour from sunrise to sunset, their records, and usd/day.usda, in which the sun moves.
    Place and heading come from the photo's metadata, from --time with --lat and --lon, or from --heading. The place
    around is relit, which is a guess.
    """
    from lighting.errors import SceneError
    from lighting.sun_study import STAGE_FOLDER, plan_study, write_sun_study

    folder = outputs.choose_folder(photo, output, f"-{day}")
    if objection := output_folder_error(Path(folder), overwrite=overwrite, what="the study"):
        raise SceneError(objection)
    scene = (str(Path(folder, STAGE_FOLDER, name)) for name in EXPORTERS["usd"].files)
    if photo != "-" and any(outputs.is_same_file(name, photo) for name in scene):
        raise click.UsageError("The scene would replace the photo; choose another folder.")
    estimate = estimate_file(photo, replace(user_input, keep_location=True), model)
    keep = user_input.keep_location
    with usage_errors():
        study = plan_study(estimate.lighting, day, every, heading=user_input.heading, keep_location=keep)
    if not keep:
        estimate = estimate.replace(lighting=replace(estimate.lighting, latitude=None, longitude=None))
    stage, *_ = write_sun_study(estimate, study, folder, view, overwrite=overwrite, name=photo)
    if as_json:
        hours = [{"time": hour.time.isoformat(), "map": hour.map_name} for hour in study.hours]
        record = {"file": escape_undecodable(photo), "output": escape_undecodable(folder), "hours": hours}
        click.echo(json.dumps({**record, "warnings": [*estimate.warnings, *study.warnings]}))
        return
    console.report_warnings(photo, (*estimate.warnings, *study.warnings), quiet)
    first, last = study.hours[0].time, study.hours[-1].time
    if not quiet:
        click.echo(f"{len(study.hours)} maps from {first:%H:%M} to {last:%H:%M} {first:%Z}.")
    outputs.report_written([folder], lambda _: f"usdview {shlex.quote(str(stage))}", quiet=quiet)
