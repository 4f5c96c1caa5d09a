"""The command that writes scenes."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import lighting.cli.console as console
import lighting.cli.outputs as outputs
from lighting.cli import Command, cli
from lighting.cli import options as common
from lighting.cli.photos import PhotoOptions, photo_options, process_photos
from lighting.map_options import MAX_WHOLE_HEIGHT
from lighting.scene import EXPORTERS, unsupported_options

if TYPE_CHECKING:
    from lighting.photo_estimate import Estimate
    from lighting.scene import ExporterOption


class _SceneCommand(Command):
    """A command whose own options are followed by those of the tools in EXPORTERS."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        params = super().get_params(ctx)
        after = 1 + [param.name for param in params].index("record")
        exporters = EXPORTERS.items()
        of_tools = [_tool_option(tool, *option) for tool, entry in exporters for option in entry.options.items()]
        return [*params[:after], *of_tools, *params[after:]]


def _tool_option(tool: str, name: str, option: "ExporterOption") -> click.Option:
    names = [f"--{name.replace('_', '-')}"]
    if not option.choices:
        return click.Option(names, is_flag=True, default=None, help=f"With --for {tool}: {option.help}.")
    kind = click.Choice(option.choices, case_sensitive=False)
    return click.Option(names, type=kind, help=f"With --for {tool}; {option.default} by default.")


@cli.command(
    "scene",
    cls=_SceneCommand,
    epilog="""
    lighting scene photo.jpg --for blender              # photo-blender/ beside it
    lighting scene photo.jpg --for page -o sent.html    # one file, for any browser
    lighting scene *.jpg --for blender -o scenes/       # a folder for each photo
    """,
)
@click.option(
    "--for", "tool", required=True, type=common.RegistryChoice(EXPORTERS), help="The tool that opens the scene."
)
@common.folder_output(
    "PHOTO-TOOL",
    "Must be new or empty without --overwrite. Several photos get a folder each in it. --for page may write FILE.html.",
)
@click.option(
    "--lighting",
    "record",
    metavar="LIGHTING.json",
    type=common.FileName(),
    callback=common.check_file_name,
    help="Take the light from this record. PHOTO gives the background and the ground.",
)
@photo_options("height", "sun", "sky", "around", "backdrop", "adjustments", max_height=MAX_WHOLE_HEIGHT)
@click.pass_context
def _scene(ctx: click.Context, /, chosen: PhotoOptions, tool: str, record: str | None, **of_tool: Any) -> None:
    """Write a photo and its light as a scene for another tool.

    The folder holds a camera with PHOTO behind it, a sun, and the environment map without the sun. A ground catches
    shadows, and a placeholder stands where your own object goes.
    """
    stated = {name: value for name, value in of_tool.items() if value is not None}
    _check(chosen, tool, record, stated)
    inputs = [name for name in (*chosen.photos, record, chosen.model) if name]
    is_file = _is_file(chosen, tool)
    folders = (_choose_file if is_file else _choose_folders)(chosen, tool, inputs)
    stored = console.read_lighting(record) if record else None

    def work(number: int, name: str, estimate: "Estimate") -> list[str]:
        from lighting.scene.writer import encode_scene_file, write_scene

        shown = estimate.replace(lighting=stored) if stored else estimate
        scene = shown.make_scene(chosen.view)
        if is_file:
            outputs.write_bytes(folders[number], encode_scene_file(scene, tool, **stated))
        else:
            write_scene(scene, tool, folders[number], overwrite=chosen.overwrite, **stated)
        chosen.print_estimate(name, shown, scene.warnings, {"output": folders[number]})
        return [folders[number]]

    def how_to_open(name: str) -> str | None:
        if stated.get("blend"):
            return outputs.open_command(str(Path(name, "scene.blend")))
        return outputs.open_command(name) if is_file else EXPORTERS[tool].opening_command(name)

    process_photos(ctx, chosen, work, how_to_open)


def _is_file(chosen: PhotoOptions, tool: str) -> bool:
    """Whether -o names a file, of a tool whose scenes are one."""
    first, *others = EXPORTERS[tool].files
    output = chosen.output or ""
    return not others and output.lower().endswith(Path(first).suffix) and not Path(output).is_dir()


def _choose_file(chosen: PhotoOptions, tool: str, inputs: Sequence[str]) -> list[str]:
    """The file of the only photo's scene, before any work."""
    output = chosen.output
    assert output is not None
    if len(chosen.photos) > 1:
        raise click.UsageError("Several photos need a folder: -o FOLDER/.")
    outputs.check_file(output, (Path(EXPORTERS[tool].files[0]).suffix,))
    outputs.check_apart(inputs, [output])
    outputs.check_absent([output], overwrite=chosen.overwrite)
    return [output]


def _choose_folders(chosen: PhotoOptions, tool: str, inputs: Sequence[str]) -> list[str]:
    """The folder of each photo's scene, before any work: where it could not be written later, an error says so."""
    from lighting.scene.writer import check_scene_folder

    if len(chosen.photos) > 1 and chosen.output is not None:
        outputs.check_parent(chosen.output)
        folders = [str(Path(chosen.output, "stdin" if name == "-" else Path(name).stem)) for name in chosen.photos]
        Path(chosen.output).mkdir(exist_ok=True)
    else:
        folders = [outputs.choose_folder(name, chosen.output, f"-{tool}") for name in chosen.photos]
    outputs.check_apart((), folders)
    for folder, photo in zip(folders, chosen.photos, strict=True):
        if chosen.output is not None or Path(photo).exists():  # else the photo's error says more
            check_scene_folder(Path(folder), overwrite=chosen.overwrite)
        if chosen.overwrite:
            _check_inputs(folder, tool, inputs)
    return folders


def _check(chosen: PhotoOptions, tool: str, record: str | None, stated: dict[str, Any]) -> None:
    """Raise UsageError for an option that would do nothing, or stdin read twice."""
    outputs.check_stdin([*chosen.photos, *([record] if record else [])])
    for name, other in unsupported_options(stated, tool).items():
        raise click.UsageError(f"--{name.replace('_', '-')} goes with --for {other}.")
    if record and len(chosen.photos) > 1:
        raise click.UsageError("--lighting holds the light of one photo; give one photo.")


def _check_inputs(folder: str, tool: str, inputs: Sequence[str]) -> None:
    """Raise UsageError where a file of the scene would replace one that is read."""
    for source, name in product(inputs, EXPORTERS[tool].files):
        if outputs.is_same_file(str(Path(folder, name)), source):
            raise click.UsageError(f"The scene would replace {console.escape_path(source)}; choose another folder.")
