"""The command that writes scenes."""

from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from lighting.cli import cli, console
from lighting.cli import options as common
from lighting.scene import EXPORTERS, unsupported_options

if TYPE_CHECKING:
    from lighting.fusion.user_input import UserInput


@dataclass(frozen=True)
class _Options:
    """The command's options."""

    photo: str
    tool: str
    output: str
    overwrite: bool
    record: str | None  # the name of a file, or "-"
    height: int
    sun: bool | None
    surroundings: bool | None
    detail: bool
    user_input: "UserInput"
    model: str | None
    quiet: bool
    of_tool: dict[str, str]  # options of the tools that the user stated


class _SceneCommand(click.Command):
    """A command whose own options are followed by those of the tools in EXPORTERS."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        params = super().get_params(ctx)
        after = 1 + [param.name for param in params].index("record")
        return [*params[:after], *_tool_options(), *params[after:]]


def _tool_options() -> list[click.Option]:
    return [
        click.Option(
            [f"--{name.replace('_', '-')}"],
            type=click.Choice(option.choices, case_sensitive=False),
            help=f"With --for {tool}; {option.default} by default.",
        )
        for tool, entry in EXPORTERS.items()
        for name, option in entry.options.items()
    ]


@cli.command("scene", cls=_SceneCommand)
@click.argument("photo")
@click.option(
    "--for", "tool", required=True, type=common.RegistryChoice(lambda: EXPORTERS), help="The tool that opens the scene."
)
@common.results_folder
@click.option("--overwrite", is_flag=True, help="Replace a scene in FOLDER; other files in it stay.")
@click.option(
    "--lighting",
    "record",
    metavar="LIGHTING.json",
    callback=common.check_file_name,
    help="Take the light from this record, not from PHOTO.",
)
@common.height_option
@common.sun_option
@common.surroundings_option
@common.detail_option
@common.user_input_options
@common.model_option
@common.silent_option
def _scene(**options: Any) -> None:
    """Write PHOTO and its light as a scene for another tool.

    The folder holds the camera with PHOTO behind it, the sun, the environment map without the sun's disc, a ground that
    catches shadows, and a placeholder where your own object goes.
    """
    names = [name for entry in EXPORTERS.values() for name in entry.options]
    of_tool = {name: value for name in names if (value := options.pop(name)) is not None}
    chosen = _Options(**options, of_tool=of_tool)
    _check(chosen)
    from lighting.envmap.surroundings import photo_context
    from lighting.photo.reader import read_photo
    from lighting.scene.records import PLATE_SIDE, make_scene
    from lighting.scene.writer import check_scene_folder, write_scene

    check_scene_folder(Path(chosen.output), overwrite=chosen.overwrite)
    with console.prefix_errors(chosen.photo):
        data = console.read_photo_bytes(chosen.photo)
        plate = read_photo(data, target=PLATE_SIDE)
        estimate = (
            None if chosen.record else console.estimate_photo(chosen.photo, data, chosen.user_input, chosen.model)[1]
        )
        lighting = estimate.lighting if estimate else console.read_lighting(chosen.record or "-")
    context = segments = None
    if estimate:
        context = photo_context(estimate, plate.pixels, surroundings=chosen.surroundings, detail=chosen.detail)
        segments = estimate.segments
    scene = make_scene(plate, lighting, map_height=chosen.height, sun=chosen.sun, context=context, segments=segments)
    write_scene(scene, chosen.tool, chosen.output, overwrite=chosen.overwrite, **chosen.of_tool)
    if not chosen.quiet:
        click.echo(console.format_summary(chosen.photo, lighting))
    console.report_warnings(chosen.photo, scene.warnings, chosen.quiet)


def _check(options: _Options) -> None:
    """Raise UsageError for an option that would do nothing, where an input would be lost, or stdin read twice."""
    entry = EXPORTERS[options.tool]
    for name, tool in unsupported_options(options.of_tool, options.tool).items():
        raise click.UsageError(f"--{name.replace('_', '-')} goes with --for {tool}.")
    height = click.get_current_context().get_parameter_source("height")
    if height is ParameterSource.COMMANDLINE and not entry.has_map:
        raise click.UsageError(f"--height is the map's, and a scene for {options.tool} holds no map.")
    for name in _explicit_map_options(options) if not entry.has_map else ():
        raise click.UsageError(f"{name} is the map's, and a scene for {options.tool} holds no map.")
    if options.record:
        _check_record(options)
    if options.overwrite:
        _check_inputs(options)


def _check_inputs(options: _Options) -> None:
    """Raise UsageError where a file of the scene would replace one that is read."""
    sources = filter(None, (options.photo, options.record, options.model))
    for source, name in product(sources, EXPORTERS[options.tool].files):
        if console.is_same_file(str(Path(options.output, name)), source):
            raise click.UsageError(f"The scene would replace {console.escape_path(source)}; choose another folder.")


def _explicit_map_options(options: _Options) -> list[str]:
    """The options about what lies around that the user stated."""
    stated = click.get_current_context().get_parameter_source("detail") is ParameterSource.COMMANDLINE
    return ["--surroundings"] * (options.surroundings is not None) + ["--detail"] * stated


def _check_record(options: _Options) -> None:
    from lighting.fusion.user_input import NO_USER_INPUT

    if options.model is not None:
        raise click.UsageError("--lighting states the light; no network is run, so --model does not go with it.")
    for name in _explicit_map_options(options):
        raise click.UsageError(f"--lighting states the light; what lies around is not in it: leave out {name}.")
    if options.user_input != NO_USER_INPUT:
        raise click.UsageError("--lighting states the light; time, place, heading and the like do not go with it.")
    if options.photo == options.record == "-":
        raise click.UsageError("The photo and the record cannot both be stdin.")
