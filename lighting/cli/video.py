"""The command about a clip."""

import json
import shlex
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import lighting.cli.console as console
import lighting.cli.outputs as outputs
from lighting.cli import cli
from lighting.cli import options as common
from lighting.cli.console import escape_path
from lighting.cli.options import FiniteRange, RegistryChoice
from lighting.cli.photos import DRAWN, exit_status, input_options_but
from lighting.files import escape_undecodable, join_words, output_folder_error
from lighting.map_options import MAX_WHOLE_HEIGHT, Around
from lighting.scene import EXPORTERS, animated_tools

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from lighting.fields import Json
    from lighting.fusion.user_input import UserInput
    from lighting.video.output import VideoResult
    from lighting.video.shot import Shot


_TOLD = 5  # maps that were removed are named, of more their number


def _curves() -> tuple[str, ...]:
    from lighting.color import DECODE_CURVES

    return tuple(DECODE_CURVES)


@cli.command(
    "video",
    epilog="""
    lighting video shot.mp4                             # shot-lighting/ beside it
    lighting video shot.mp4 -o out --for blender --preview
    lighting video shot.mp4 -o dusk --sun -70,5 --exposure -1
    """,
)
@click.argument("clip", metavar="SHOT.mp4", type=common.FileName())
@common.folder_output("SHOT-lighting")
@click.option(
    "--every",
    type=FiniteRange(0.04, 60.0),
    default=0.2,
    show_default=True,
    metavar="SECONDS",
    help="The network sees a frame this often; all are followed and get a record.",
)
@click.option(
    "--curve",
    type=RegistryChoice(_curves),
    help="How the clip is coded, such as d-log or s-log3.  [default: as its files say]",
)
@click.option("--for", "tool", type=RegistryChoice(animated_tools), help="Also a scene, its camera with key frames.")
@click.option("--frames-exr", is_flag=True, help="Also a map a frame, as frames/NUMBER.exr.")
@click.option("--preview", "film", is_flag=True, help="Also the clip with horizon, sun and balls drawn in.")
@common.map_options("height", "sun", "around", "adjustments", without_detail=Around.PLAIN, max_height=MAX_WHOLE_HEIGHT)
@input_options_but(*DRAWN)
@common.model_option
@common.strict_option
@common.json_option
@common.silent_option
@click.pass_context
def _video(
    ctx: click.Context,
    /,
    clip: str,
    output: str | None,
    user_input: "UserInput",
    model: str | None,
    strict: bool,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Estimate the light and camera of a clip.

    FOLDER gets lighting.jsonl, a record a frame, and shot-1.exr, the light in the world's axes. Its center is true
    north if it is known, else the first frame's heading. All maps of a shot show its sharpest suitable frame. A cut
    starts another shot. What --time and --heading say is of the first frame. Time, place and lens are taken from the
    clip's metadata and from DJI's subtitles beside it, unless given here. The exit status is 1 where part of the clip
    has no answer.
    """
    from lighting.batch.photo_search import PHOTO_SUFFIXES
    from lighting.errors import VideoError
    from lighting.model import Model
    from lighting.video import output as results

    if clip == "-":
        raise click.UsageError("A clip is read from a file, not from stdin.")
    console.check_file_there(clip)
    if clip.lower().endswith(PHOTO_SUFFIXES):
        raise click.UsageError(f"{escape_path(clip)} is a photo: try `lighting envmap {shlex.quote(clip)}`.")
    every, curve, overwrite = options.pop("every"), options.pop("curve"), options.pop("overwrite")
    folder = Path(outputs.choose_folder(clip, output, "-lighting"))
    job = results.VideoJob(Path(clip), folder, user_input, every, results.OutputOptions(**options), curve)
    if objection := output_folder_error(job.folder, overwrite=overwrite):
        raise VideoError(objection)
    outputs.check_apart([clip], [str(job.folder / results.FILM_FILE)] if job.options.film else [])
    network = Model.load(model)
    try:
        with _progress(clip, quiet) as progress:
            result = results.process_video(job, network, progress)
    except VideoError as error:
        raise VideoError(f"{escape_path(clip)}: {error}") from error
    except KeyboardInterrupt:
        _report_interrupt(job.folder / results.PARTIAL_FILE)
        raise
    if as_json:
        click.echo(json.dumps(_result_record(clip, folder, result), allow_nan=False))
    _report(clip, result, quiet=quiet or as_json)
    if result.lights:
        outputs.report_written([str(folder)], lambda name: _how_to_open(name, options), quiet=quiet or as_json)
    answers = [(light.suitable, light.trust) for light in result.lights]
    ctx.exit(1 if result.failed else exit_status(answers, strict, None))


def _how_to_open(folder: str, options: "Json") -> str | None:
    """How to open the best of what a folder holds."""
    if options["film"]:
        return outputs.open_command(str(Path(folder, "preview.mp4")))
    if options["tool"]:
        return EXPORTERS[options["tool"]].opening_command(str(Path(folder, f"shot-1-{options['tool']}")))
    return f"{shlex.quote(str(Path(folder, 'shot-1.exr')))} {outputs.open_command('shot-1.exr')}"


def _result_record(clip: str, folder: Path, result: "VideoResult") -> "Json":
    """What became of a clip, for JSON: a light or the reason for each shot; lighting.jsonl has the frames."""
    from lighting.video.shot import Shot, shot_lighting

    shots = [
        {"lighting": console.record_with_probe(shot_lighting(shot)), "frames": len(shot.frames)}
        if isinstance(shot, Shot)
        else {"error": escape_undecodable(str(shot))}
        for shot in result.shots
    ]
    record = {"file": escape_undecodable(clip), "output": escape_undecodable(str(folder)), "shots": shots}
    record |= {"removed": list(result.removed)} if result.removed else {}
    return record | ({"damage": result.damage} if result.damage else {})


def _report_interrupt(records: Path) -> None:
    """Where the records of what was read lie, if there are any."""
    if records.is_file() and records.stat().st_size:
        name = escape_path(str(records))
        click.echo(f"Interrupted: what was read so far is in {name}; --overwrite starts over.", err=True)


@contextmanager
def _progress(clip: str, quiet: bool) -> "Iterator[Callable[[float], object] | None]":
    """What shows seconds of the clip behind a bar; None where no terminal shows it."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(desc=escape_path(clip), bar_format="{desc}: {n:.1f} s of the clip [{elapsed}]") as bar:
        yield lambda time: bar.update(round(time, 2) - bar.n)


def _report(clip: str, result: "VideoResult", quiet: bool) -> None:
    """A line a shot, and what went wrong."""
    name = escape_path(clip)
    if len(result.shots) > 1:
        click.echo(f"{name}: {len(result.shots)} shots; the clip has cuts or dissolves.", err=True)
    for number, shot in enumerate(result.shots, 1):
        if isinstance(shot, Exception):
            click.echo(f"Error: {name}: {shot}", err=True)
        elif not quiet:
            click.echo(f"{name}: {_format_shot(number, shot)}")
            for warning in result.warnings(number):
                click.echo(f"Warning: {name}: {warning}", err=True)
    if result.removed:
        others = len(result.removed) - _TOLD
        names = join_words([*result.removed[:_TOLD], *([f"{others} more"] if others > 0 else [])], "and")
        click.echo(f"{name}: removed maps of an earlier run: {names}.", err=True)
    if result.damage:
        click.echo(f"Error: {name}: {result.damage}", err=True)


def _format_shot(number: int, shot: "Shot") -> str:
    """One line for people about a shot."""
    from lighting.formatting import format_side, format_sun_elevation
    from lighting.video.shot import shot_lighting

    path, light = shot.path, shot_lighting(shot)
    rotation = path.heading.max() - path.heading.min()
    north = "" if shot.north is None else f", first heading {round(shot.north + path.heading[0]) % 360}°"
    frames = "1 frame" if len(shot.frames) == 1 else f"{len(shot.frames)} frames"
    bridged = f", {path.bridged.sum()} bridged" if path.bridged.any() else ""
    low, high = shot.zoom.min(), shot.zoom.max()
    zoom = f" at first, zoomed by {low:.2f} to {high:.2f}" if low < high else ""
    return (
        f"shot {number}, {path.time[0]:.1f} to {path.time[-1]:.1f} s, {frames}{bridged}: "
        f"sun {format_sun_elevation(light.sun_elevation, 1)} and {format_side(light.sun_azimuth, 1)} of the first "
        f"frame (50 % within {light.radius_50:.1f}°, 90 % within {light.radius_90:.1f}°), "
        f"direct sunlight {100 * light.sun_visibility:.0f} %; "
        f"camera turns by {rotation:.1f}°, vertical field of view {shot.vertical_fov:.1f}° ± {shot.fov_std:.1f}°"
        f"{zoom}{north}"
    )
