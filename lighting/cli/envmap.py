"""The commands that make pictures of a light: envmap, preview, render; and light probes for engines and phones."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

import lighting.cli.console as console
import lighting.cli.outputs as outputs
from lighting.cli import cli
from lighting.cli import options as common
from lighting.cli.options import usage_errors
from lighting.cli.photos import PhotoOptions, estimate_file, photo_options, process_photos, user_input_options
from lighting.files import FileOptions
from lighting.map_options import DEFAULT_MAP, Around, MapOptions
from lighting.runtime import return_memory

if TYPE_CHECKING:
    from lighting.fusion.user_input import UserInput
    from lighting.photo_estimate import Estimate, RenderedMap
    from lighting.records import LightProbe


@cli.command(
    "envmap",
    epilog="""
    lighting envmap photo.jpg                           # photo.exr beside it
    lighting envmap photo.jpg -o warm.exr --sun 40,25 --exposure +0.5
    lighting envmap *.jpg -o maps/ --height 1024        # a map of each photo
    """,
)
@common.file_output(outputs.MAPS, several=True)
@common.file_options("compression", "colors")
@photo_options()
@click.option("--preview", metavar="FILE.png", callback=common.check_file_name, help="Also draw the preview.")
@click.pass_context
def _envmap(ctx: click.Context, /, chosen: PhotoOptions, file: FileOptions, preview: str | None) -> None:
    """Render the environment map of each PHOTO."""
    names = outputs.choose_files(chosen.photos, chosen.output, outputs.MAPS, overwrite=chosen.overwrite)
    outputs.check_json(chosen.as_json, (*names, preview))
    if preview is not None:
        _check_preview(chosen, names, preview)
    files = [_file_of(file, name) for name in names]

    def work(number: int, name: str, estimate: "Estimate") -> list[str]:
        output = names[number]
        return_memory()  # the network's
        _write_map(output, estimate.render(chosen.view), files[number])
        written = {"output": output}
        if preview:
            _write_preview(preview, estimate, replace(chosen.view, yaw=DEFAULT_MAP.yaw, height=DEFAULT_MAP.height))
            written["preview"] = preview
        chosen.print_estimate(name, estimate, estimate.warnings, written)
        return list(written.values())

    process_photos(ctx, chosen, work, meanwhile=_import_renderer)


def _check_preview(chosen: PhotoOptions, names: Sequence[str], preview: str) -> None:
    """Raise an error where the preview is not a file of its own."""
    if len(chosen.photos) > 1:
        raise click.UsageError("--preview is of one photo; `lighting preview` draws those of several.")
    outputs.check_file(preview, outputs.PREVIEWS.suffixes, "'--preview'")
    outputs.check_apart(chosen.photos, (*names, preview))
    outputs.check_absent([preview], overwrite=chosen.overwrite)


@cli.command(
    "preview",
    epilog="""
    lighting preview photo.jpg                          # photo-preview.png beside it
    lighting preview photo.jpg --overcast -o gray.png   # under clouds
    lighting preview *.jpg -o previews/                 # one of each photo
    """,
)
@common.file_output(outputs.PREVIEWS, several=True)
@click.option("--candidates", is_flag=True, help="Draw the suns that --pick chooses from, side by side.")
@photo_options("sun", "sky", "around", "backdrop", "adjustments")
@click.pass_context
def _preview(ctx: click.Context, /, chosen: PhotoOptions, candidates: bool) -> None:
    """Draw each PHOTO, its light and three spheres lit by it."""
    from lighting.ground import spot_warnings

    stated = chosen.view.adjustments
    if candidates and (stated.sun is not None or stated.pick is not None or stated.overcast):
        raise click.UsageError("--candidates draws the suns to choose from; leave out --sun, --pick and --overcast.")
    names = outputs.choose_files(chosen.photos, chosen.output, outputs.PREVIEWS, overwrite=chosen.overwrite)
    outputs.check_json(chosen.as_json, names)

    def work(number: int, name: str, estimate: "Estimate") -> list[str]:
        output = names[number]
        _write_preview(output, estimate, chosen.view, candidates=candidates)
        warnings = (*estimate.warnings, *spot_warnings(estimate.lighting))
        chosen.print_estimate(name, estimate, warnings, {"output": output})
        return [output]

    process_photos(ctx, chosen, work)


@cli.command(
    "render",
    epilog="""
    lighting estimate photo.jpg -o light.json           # a record, to keep or to edit
    lighting render light.json --photo photo.jpg        # light.exr, the map that envmap makes
    lighting render light.json -o sky.exr               # the sky alone
    """,
)
@click.argument("record", metavar="LIGHTING.json", type=common.FileName())
@common.file_output(outputs.MAPS)
@click.option(
    "--photo",
    metavar="PHOTO",
    type=common.FileName(),
    callback=common.check_file_name,
    help="The record's photo: the map then shows the place. Without it, sky and ground.",
)
@common.map_options()
@common.file_options("compression", "colors")
@user_input_options
@common.model_option
@common.json_option
@common.silent_option
def _render(
    record: str,
    output: str | None,
    overwrite: bool,
    photo: str | None,
    view: MapOptions,
    file: FileOptions,
    user_input: "UserInput",
    model: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Render the environment map of a lighting record.

    LIGHTING.json holds one record, or one line that "estimate --json" printed.
    """
    sources = [record] if photo is None else [record, photo]
    if sources.count("-") > 1:
        raise click.UsageError("The record and the photo cannot both be stdin.")
    stored = console.read_lighting(record) if output is None else None  # whose error says more than one of the output
    (name,) = outputs.choose_files([record], output, outputs.MAPS, overwrite=overwrite)
    outputs.check_apart(sources, [name])
    file = _file_of(file, name)
    outputs.check_json(as_json, [name])
    if photo is None:
        _refuse_place(view, user_input, model)
    from lighting.envmap.relighting import adjust_lighting
    from lighting.photo_estimate import compute_map_probe, render_map

    lighting = stored or console.read_lighting(record)
    estimate = None if photo is None else estimate_file(photo, user_input, model).replace(lighting=lighting)
    context = None if estimate is None else estimate.context(view)
    _write_map(name, render_map(lighting, view) if estimate is None else estimate.render(view), file)
    light = adjust_lighting(lighting, view.adjustments)
    probe = compute_map_probe(lighting, view.of_record(), context) if as_json else None
    console.print_estimate(record, light, (), {"output": name}, probe=probe, as_json=as_json, quiet=quiet)
    if photo is None and view.around != Around.PLAIN and not quiet:
        click.echo("Sky only: the place needs the photo (--photo PHOTO).", err=True)
    outputs.report_written([name], quiet=quiet or as_json)


def _refuse_place(view: MapOptions, user_input: "UserInput", model: str | None) -> None:
    """Raise UsageError for an option that would do nothing without a photo."""
    from lighting.fusion.user_input import NO_USER_INPUT

    place = view.around in (Around.PLACE, Around.PHOTO) or view.backdrop is not None
    if place or model is not None or user_input != NO_USER_INPUT:
        sentence = "--around place and photo, --backdrop, --model and what is known of the photo need --photo."
        raise click.UsageError(sentence)


def _formats() -> list[str]:
    from lighting.light_probe import LIGHT_PROBE_FORMATS

    return list(LIGHT_PROBE_FORMATS)


@cli.command(
    "light-probe",
    epilog="""
    lighting light-probe photo.jpg -o probe.json
    lighting light-probe photo.jpg --for unity -o probe.json
    lighting light-probe light.json --for threejs
    """,
)
@click.argument("source", metavar="PHOTO|LIGHTING.json", type=common.FileName())
@click.option(
    "--for",
    "format",
    default="record",
    show_default=True,
    type=common.RegistryChoice(_formats),
    help="The engine that takes it.",
)
@common.record_output("Write it to FILE.json.  [default: stdout]")
@common.map_options("sun", "around")
@user_input_options
@common.model_option
@click.option("--json", is_flag=True, expose_value=False, help="JSON, which is all that it prints.")
@common.silent_option
def _light_probe(
    source: str,
    format: str,
    output: str | None,
    overwrite: bool,
    view: MapOptions,
    user_input: "UserInput",
    model: str | None,
    quiet: bool,
) -> None:
    """Print the light of PHOTO for an engine or a phone, as JSON.

    It holds nine spherical-harmonics coefficients of all light but the sun's, and the sun as the main light. Of a
    record it is the sky's alone.
    """
    from lighting.light_probe import encode_light_probe

    output = None if output == "-" else output
    outputs.check_records([source], output, overwrite=overwrite)
    if source.lower().endswith((".json", ".jsonl")):
        probe = _probe_of_record(source, view, user_input, model)
    else:
        estimate = estimate_file(source, user_input, model)
        probe = estimate.probe(view)
        console.report_warnings(source, estimate.warnings, quiet)
    text = encode_light_probe(probe, format)
    if output is None:
        click.echo(text)
    else:
        outputs.write_records(output, [text], quiet=quiet)


def _probe_of_record(source: str, view: MapOptions, user_input: "UserInput", model: str | None) -> "LightProbe":
    from lighting.fusion.user_input import NO_USER_INPUT
    from lighting.photo_estimate import compute_map_probe

    if model is not None or view.around is not None or user_input != NO_USER_INPUT:
        raise click.UsageError("A record holds the light already; leave out the options about a photo.")
    return compute_map_probe(console.read_lighting(source), view)


def _file_of(file: FileOptions, output: str) -> FileOptions:
    """The options of a map's file, by whose name the format is; "-" is EXR on stdout. UsageError if they do not fit."""
    with usage_errors():
        return file if output == "-" else file.for_path(output)


def _make_parent(name: str) -> None:
    """Make the folder of an output where it is missing, if its own folder is there; "-" is stdout."""
    if name != "-":
        Path(name).parent.mkdir(exist_ok=True)


def _write_map(output: str, rendered: "RenderedMap", file: FileOptions) -> None:
    """Write a map to a file, or to stdout for "-"."""
    if output == "-":
        outputs.write_bytes(output, rendered.encode(file))
    else:
        _make_parent(output)
        rendered.write(output, file)


def _write_preview(output: str, estimate: "Estimate", view: MapOptions, *, candidates: bool = False) -> None:
    """Draw a photo, its light and three spheres lit by it, as a PNG's file; "-" is stdout."""
    import numpy as np

    from lighting.files.deflate import encode_png

    _make_parent(output)
    picture = estimate.preview_candidates(view) if candidates else estimate.preview(view)
    outputs.write_bytes(output, encode_png(np.asarray(picture)))


def _import_renderer() -> None:
    """Import what renders maps. The library of detail and OpenEXR come when the network is gone, for their memory."""
    import fractions  # noqa: F401 - OpenEXR imports it to write a header

    import lighting.photo_estimate  # noqa: F401 - with all that it needs
