"""The command that writes scenes."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from lighting.cli.files import estimated, naming, open_lighting, photo_bytes
from lighting.cli.given import given_options
from lighting.cli.group import cli
from lighting.cli.options import height_option, model_option, quiet_option, sun_option
from lighting.cli.words import in_words, report_warnings
from lighting.scene import TOOLS

if TYPE_CHECKING:
    from lighting.evidence import Given


@cli.command()
@click.argument("photo")
@click.option("--for", "tool", required=True, type=click.Choice(TOOLS), help="The tool that opens it.")
@click.option("-o", "--output", required=True, metavar="FOLDER", help="New or empty unless --overwrite.")
@click.option("--overwrite", is_flag=True, help="Replace a scene in FOLDER; its other files stay.")
@click.option("--lighting", "record", metavar="LIGHTING.json", help="Take the light from a record, not from PHOTO.")
@click.option("--up-axis", type=click.Choice(("Y", "Z"), case_sensitive=False), help="usd: Y unless told.")
@height_option
@sun_option
@given_options
@model_option
@quiet_option
def scene(
    photo: str,
    tool: str,
    output: str,
    overwrite: bool,
    record: str | None,
    up_axis: str | None,
    height: int,
    sun: bool | None,
    given: "Given",
    model: str | None,
    quiet: bool,
) -> None:
    """Write PHOTO and its light as a scene for another tool.

    The folder holds the camera with PHOTO behind it, the sun, the map without the sun's disc, a ground that catches
    shadows, and a placeholder where one's own object goes.
    """
    options = _tool_options(tool, up_axis)
    _check_map_options(tool)
    _check_record(record, given, model)
    if "-" in (photo, record) and photo == record:
        raise click.UsageError("The photo and the record cannot both be stdin.")
    from lighting.photo import read_photo
    from lighting.scene.common import PLATE_SIDE, make_scene
    from lighting.scene.files import check_target, write_scene

    check_target(Path(output), overwrite=overwrite)
    with naming(photo):
        data = photo_bytes(photo)
        plate = read_photo(data, target=PLATE_SIDE)
        lighting = open_lighting(record) if record else estimated(data, given, model).lighting
    made = make_scene(plate, lighting, map_height=height, sun=sun)
    write_scene(made, tool, output, overwrite=overwrite, **options)
    if not quiet:
        click.echo(in_words(photo, lighting))
    report_warnings(photo, lighting.warnings, quiet)


def _tool_options(tool: str, up_axis: str | None) -> dict[str, Any]:
    """What was asked for, as the tool's `write` takes it; UsageError for an option of another tool."""
    if up_axis and tool != "usd":
        raise click.UsageError("--up-axis goes with --for usd.")
    return {"up_axis": up_axis} if up_axis else {}


def _check_map_options(tool: str) -> None:
    """Raise UsageError if the height of a map is given for a scene that holds none."""
    asked = click.get_current_context().get_parameter_source("height") is ParameterSource.COMMANDLINE
    if asked and tool == "gltf":
        raise click.UsageError("--height is the map's, and a glTF scene holds no map.")


def _check_record(record: str | None, given: "Given", model: str | None) -> None:
    """Raise UsageError where metadata or a network is given for a light that a record tells."""
    from lighting.evidence import Given

    if record and model is not None:
        raise click.UsageError("--lighting tells the light; no network is asked, so --model does not go with it.")
    if record and given != Given():
        raise click.UsageError("--lighting tells the light; time, place, heading and the like do not go with it.")
