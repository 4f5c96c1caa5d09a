"""The command that writes scenes."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from lighting.cli.files import estimated, is_same_file, naming, open_lighting, photo_bytes
from lighting.cli.given import given_options
from lighting.cli.group import cli
from lighting.cli.options import (
    file_name,
    height_option,
    model_option,
    results_folder,
    sun_option,
    surroundings_option,
    unwarned_option,
)
from lighting.cli.words import in_words, report_warnings, shown
from lighting.scene import TOOL_OF_OPTION, TOOLS, TOOLS_WITHOUT_MAP, UP_AXES, Tool, UpAxis, misplaced, pictures_of

if TYPE_CHECKING:
    from lighting.evidence import Given


@dataclass(frozen=True)
class _Options:
    """What the user asked for."""

    photo: str
    tool: Tool
    output: str
    overwrite: bool
    record: str | None  # the name of a file, or "-"
    up_axis: UpAxis | None
    height: int
    sun: bool | None
    surroundings: bool | None
    given: "Given"
    model: str | None
    quiet: bool

    @property
    def of_tool(self) -> dict[str, Any]:
        """Those of the options that only one tool takes which were given."""
        given = {name: getattr(self, name) for name in TOOL_OF_OPTION}
        return {name: value for name, value in given.items() if value is not None}


@cli.command()
@click.argument("photo")
@click.option("--for", "tool", required=True, type=click.Choice(TOOLS), help="The tool that opens the scene.")
@results_folder
@click.option("--overwrite", is_flag=True, help="Replace a scene in FOLDER; other files in it stay.")
@click.option(
    "--lighting",
    "record",
    metavar="LIGHTING.json",
    callback=file_name,
    help="Take the light from this record, not from PHOTO.",
)
@click.option("--up-axis", type=click.Choice(UP_AXES, case_sensitive=False), help="With --for usd; Y by default.")
@height_option
@sun_option
@surroundings_option
@given_options
@model_option
@unwarned_option
def scene(**options: Any) -> None:
    """Write PHOTO and its light as a scene for another tool.

    The folder holds the camera with PHOTO behind it, the sun, the environment map without the sun's disc, a ground that
    catches shadows, and a placeholder where your own object goes.
    """
    asked = _Options(**options)
    _check(asked)
    from lighting.envmap import known_place
    from lighting.photo import read_photo
    from lighting.scene import PLATE_SIDE, check_target, make_scene, write_scene

    check_target(Path(asked.output), overwrite=asked.overwrite)
    with naming(asked.photo):
        data = photo_bytes(asked.photo)
        plate = read_photo(data, target=PLATE_SIDE)
        estimate = None if asked.record else estimated(data, asked.given, asked.model)[1]
        lighting = estimate.lighting if estimate else open_lighting(asked.record or "-")
    place = known_place(estimate, plate.pixels, wanted=asked.surroundings) if estimate else None
    made = make_scene(plate, lighting, map_height=asked.height, sun=asked.sun, place=place)
    write_scene(made, asked.tool, asked.output, overwrite=asked.overwrite, **asked.of_tool)
    if not asked.quiet:
        click.echo(in_words(asked.photo, lighting))
    report_warnings(asked.photo, made.warnings, asked.quiet)


def _check(asked: _Options) -> None:
    """Raise UsageError for an option that would do nothing, and where the photo would be lost or stdin read twice."""
    for name, tool in misplaced(asked.of_tool, asked.tool).items():
        raise click.UsageError(f"--{name.replace('_', '-')} goes with --for {tool}.")
    height = click.get_current_context().get_parameter_source("height")
    if height is ParameterSource.COMMANDLINE and asked.tool in TOOLS_WITHOUT_MAP:
        raise click.UsageError(f"--height is the map's, and a scene for {asked.tool} holds no map.")
    if asked.surroundings is not None and asked.tool in TOOLS_WITHOUT_MAP:
        raise click.UsageError(f"--surroundings is the map's, and a scene for {asked.tool} holds no map.")
    if any(is_same_file(str(Path(asked.output, name)), asked.photo) for name in pictures_of(asked.tool)):
        raise click.UsageError(f"The scene would replace {shown(asked.photo)}; choose another folder.")
    if asked.record:
        _check_record(asked)


def _check_record(asked: _Options) -> None:
    from lighting.evidence import NOTHING_GIVEN

    if asked.model is not None:
        raise click.UsageError("--lighting states the light; no network is run, so --model does not go with it.")
    if asked.surroundings is not None:
        raise click.UsageError("--lighting states the light; what lies around is not in it: leave out --surroundings.")
    if asked.given != NOTHING_GIVEN:
        raise click.UsageError("--lighting states the light; time, place, heading and the like do not go with it.")
    if asked.photo == asked.record == "-":
        raise click.UsageError("The photo and the record cannot both be stdin.")
