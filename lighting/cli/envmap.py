"""The commands that make pictures of a light: envmap, preview, render; and light probes for engines and phones."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import lighting.cli.console as console
from lighting.cli import cli
from lighting.cli import options as common
from lighting.cli.options import PhotoOptions
from lighting.cli.photos import EstimatedPhoto, estimate_file, process_photos
from lighting.files import MAP_FORMATS, encode_envmap, write_envmap
from lighting.runtime import return_memory

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.envmap.surroundings import PhotoContext
    from lighting.fusion.user_input import UserInput
    from lighting.light_probe import LightProbe
    from lighting.records import Lighting


@cli.command(
    "envmap",
    epilog="""
    lighting envmap photo.jpg                           # photo.exr beside it
    lighting envmap photo.jpg -o warm.exr --sun 40,25 --exposure +0.5
    lighting envmap *.jpg -o maps/ --height 1024        # a map of each photo
    """,
)
@common.file_output(console.MAPS, several=True)
@common.map_options
@common.photo_options
@click.option("--preview", metavar="FILE.png", callback=common.check_file_name, help="Also draw the preview.")
@click.pass_context
def _envmap(ctx: click.Context, /, chosen: PhotoOptions, preview: str | None, **view: Any) -> None:
    """Render the environment map of each PHOTO."""
    names = console.choose_files(chosen.photos, chosen.output, console.MAPS, overwrite=chosen.overwrite)
    console.check_json(chosen.as_json, (*names, preview))
    if preview is not None:
        _check_preview(chosen, names, preview)
    for name in names:
        _check_exr_options(name, view["compression"], view["colours"])

    def work(number: int, photo: EstimatedPhoto) -> list[str]:
        context = _map_context(photo, view["height"], chosen.surroundings, chosen.detail)
        lighting, output = chosen.adjust(photo.estimate.lighting), names[number]
        _make_parent(output)
        _write_output_map(output, lighting, sun=chosen.sun, context=context, **view)
        files = {"output": output}
        if preview:
            _write_preview(preview, photo, lighting, chosen)
            files["preview"] = preview
        chosen.print_estimate(photo.name, photo.estimate, lighting, photo.estimate.lighting.warnings, files)
        return list(files.values())

    process_photos(ctx, chosen, work, meanwhile=_import_renderer)


def _check_preview(chosen: PhotoOptions, names: Sequence[str], preview: str) -> None:
    """Raise an error where the preview is not a file of its own."""
    if len(chosen.photos) > 1:
        raise click.UsageError("--preview is of one photo; `lighting preview` draws those of several.")
    console.check_file(preview, console.PREVIEWS.suffixes, "'--preview'")
    console.check_apart(chosen.photos, (*names, preview))
    console.check_absent([preview], overwrite=chosen.overwrite)


@cli.command(
    "preview",
    epilog="""
    lighting preview photo.jpg                          # photo-preview.png beside it
    lighting preview photo.jpg --overcast -o gray.png   # under clouds
    lighting preview *.jpg -o previews/                 # one of each photo
    """,
)
@common.file_output(console.PREVIEWS, several=True)
@common.photo_options
@click.pass_context
def _preview(ctx: click.Context, /, chosen: PhotoOptions) -> None:
    """Draw each PHOTO, its light and three spheres lit by it."""
    from lighting.ground import spot_warnings

    names = console.choose_files(chosen.photos, chosen.output, console.PREVIEWS, overwrite=chosen.overwrite)
    console.check_json(chosen.as_json, names)

    def work(number: int, photo: EstimatedPhoto) -> list[str]:
        lighting, output = chosen.adjust(photo.estimate.lighting), names[number]
        _make_parent(output)
        _write_preview(output, photo, lighting, chosen)
        warnings = (*photo.estimate.warnings, *spot_warnings(lighting))
        chosen.print_estimate(photo.name, photo.estimate, lighting, warnings, {"output": output})
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
@common.file_output(console.MAPS)
@click.option(
    "--photo",
    metavar="PHOTO",
    type=common.FileName(),
    callback=common.check_file_name,
    help="The record's photo: the map then shows the place. Without it, sky and ground.",
)
@common.map_options
@common.adjustment_options
@common.surroundings_option
@common.detail_option
@common.user_input_options
@common.model_option
@common.json_option
@common.silent_option
def _render(record: str, output: str | None, overwrite: bool, photo: str | None, **options: Any) -> None:
    """Render the environment map of a lighting record.

    LIGHTING.json holds one record, or one line that "estimate --json" printed.
    """
    sources = [record] if photo is None else [record, photo]
    if sources.count("-") > 1:
        raise click.UsageError("The record and the photo cannot both be stdin.")
    stored = console.read_lighting(record) if output is None else None  # whose error says more than one of the output
    (name,) = console.choose_files([record], output, console.MAPS, overwrite=overwrite)
    console.check_apart(sources, [name])
    _check_exr_options(name, options["compression"], options["colours"])
    as_json, quiet, adjustments = (options.pop(key) for key in ("as_json", "quiet", "adjustments"))
    console.check_json(as_json, [name])
    place = {key: options.pop(key) for key in ("surroundings", "detail", "user_input", "model")}
    if photo is None:
        _refuse_place(**place)
    lighting = stored or console.read_lighting(record)
    if adjustments is not None:
        from lighting.envmap.relighting import adjust_lighting

        lighting = adjust_lighting(lighting, adjustments)
    context = None if photo is None else _context_of_record(photo, options["height"], **place)
    _write_output_map(name, lighting, context=context, **options)
    probe = None
    if as_json:
        from lighting.light_probe import compute_light_probe

        probe = compute_light_probe(lighting, context, sun=options["sun"])
    console.print_estimate(record, lighting, (), {"output": name}, probe=probe, as_json=as_json, quiet=quiet)
    if photo is None and place["surroundings"] is None and not quiet:
        click.echo("Sky only: the place needs the photo (--photo PHOTO).", err=True)
    console.report_written([name], quiet=quiet or as_json)


def _refuse_place(surroundings: bool | None, detail: bool, user_input: "UserInput", model: str | None) -> None:
    """Raise UsageError for an option that would do nothing without a photo."""
    from lighting.fusion.user_input import NO_USER_INPUT

    if surroundings or not detail or model is not None or user_input != NO_USER_INPUT:
        sentence = "--surroundings, --no-detail, --model and what is known of the photo need --photo."
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
@common.no_sun_option
@common.surroundings_option
@common.user_input_options
@common.model_option
@click.option("--json", is_flag=True, expose_value=False, help="JSON, which is all that it prints.")
@common.silent_option
def _light_probe(
    source: str,
    format: str,
    output: str | None,
    overwrite: bool,
    sun: bool | None,
    surroundings: bool | None,
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
    console.check_records([source], output, overwrite=overwrite)
    if source.lower().endswith((".json", ".jsonl")):
        probe = _probe_of_record(source, sun, surroundings, user_input, model)
    else:
        estimate = estimate_file(source, user_input, model).estimate
        probe = estimate.light_probe(sun=sun, surroundings=surroundings)
        console.report_warnings(source, estimate.warnings, quiet)
    text = encode_light_probe(probe, format)
    if output is None:
        click.echo(text)
    else:
        console.write_records(output, [text], quiet=quiet)


def _probe_of_record(
    source: str, sun: bool | None, surroundings: bool | None, user_input: "UserInput", model: str | None
) -> "LightProbe":
    from lighting.fusion.user_input import NO_USER_INPUT
    from lighting.light_probe import compute_light_probe

    if model is not None or surroundings is not None or user_input != NO_USER_INPUT:
        raise click.UsageError("A record holds the light already; leave out the options about a photo.")
    return compute_light_probe(console.read_lighting(source), sun=sun)


def _check_exr_options(output: str, compression: str | None, colours: str | None) -> None:
    """Raise UsageError for a compression or colours where no file takes them.

    Args:
        output: the map's file.
        compression: that the user stated; None without.
        colours: the same.
    """
    packed = [f".{name}" for name, entry in MAP_FORMATS.items() if entry.takes_compression]
    if compression is not None and not _ends_in(output, packed):
        raise click.UsageError(f"--compression needs an output in {' or '.join(packed)}.")
    if colours is not None and not _ends_in(output, _headed_suffixes()):
        raise click.UsageError(f"--colours needs an output in {' or '.join(_headed_suffixes())}.")


def _headed_suffixes() -> list[str]:
    """Of files that hold lighting and probe, and say in which colours they are."""
    return [f".{name}" for name, entry in MAP_FORMATS.items() if entry.has_header]


def _ends_in(output: str, suffixes: Sequence[str]) -> bool:
    """Whether a map's name ends in a suffix; "-" is EXR on stdout."""
    return output == "-" or output.lower().endswith(tuple(suffixes))


def _make_parent(name: str) -> None:
    """Make the folder of an output where it is missing, if its own folder is there; "-" is stdout."""
    if name != "-":
        Path(name).parent.mkdir(exist_ok=True)


def _write_preview(output: str, photo: EstimatedPhoto, lighting: "Lighting", chosen: PhotoOptions) -> None:
    """Draw a photo, its light and three spheres lit by it.

    Args:
        output: the PNG's file; "-" is stdout.
        photo: estimated.
        lighting: of the photo, perhaps changed since.
        chosen: says whether sun, place and detail are in its map.
    """
    from lighting.photo.reader import read_photo
    from lighting.preview.picture import PHOTO_SIDE, draw_preview_pixels, encode_preview_png

    pixels = read_photo(photo.data, target=PHOTO_SIDE).pixels
    surroundings, detail, sun = chosen.surroundings, chosen.detail, chosen.sun
    picture = draw_preview_pixels(
        pixels, photo.estimate, surroundings=surroundings, detail=detail, lighting=lighting, sun=sun
    )
    console.write_bytes(output, encode_preview_png(picture))


def _context_of_record(
    photo: str, height: int, user_input: "UserInput", model: str | None, surroundings: bool | None, detail: bool
) -> "PhotoContext | None":
    """Return what a map of a stored light shows of the place: the network says it again of the photo.

    Args:
        photo: name of the file of which the record is; "-" is stdin.
        height: rows of the map.
        user_input: what the user states of the photo.
        model: a network's file; None is the one in this package.
        surroundings: whether the map shows the place; None where the network predicts it.
        detail: whether the map then has detail all around the photo.
    """
    return _map_context(estimate_file(photo, user_input, model), height, surroundings, detail)


def _import_renderer() -> None:
    """Import what renders maps. The library of detail and OpenEXR come when the network is gone, for their memory."""
    import fractions  # noqa: F401 - OpenEXR imports it to write a header

    import lighting.envmap.detail_library
    import lighting.envmap.surroundings
    import lighting.light_probe  # noqa: F401 - all three


def _map_context(photo: EstimatedPhoto, height: int, surroundings: bool | None, detail: bool) -> "PhotoContext | None":
    """Return the surroundings for a photo's map, as `photo_context_for_height` does.

    Args:
        photo: estimated.
        height: rows of the map.
        surroundings: whether the map shows them; None where the network predicts them.
        detail: whether the map then has detail all around the photo.
    """
    from lighting.envmap.surroundings import photo_context_for_height
    from lighting.photo.reader import read_photo

    def finer(side: int) -> "NDArray[np.uint8]":
        return read_photo(photo.data, target=side).pixels

    pixels = photo.picture.pixels
    return photo_context_for_height(photo.estimate, pixels, height, finer, surroundings=surroundings, detail=detail)


def _write_output_map(
    output: str, lighting: "Lighting", compression: str | None, colours: str | None, **view_options: Any
) -> None:
    """Render a map and write it; with a yaw, the record in the file is rotated with the map.

    Args:
        output: the map's file; "-" is stdout.
        lighting: what is rendered.
        compression: of an EXR; None is zip.
        colours: of an EXR; None is rec709.
        view_options: of `render_view`.
    """
    from lighting.envmap.latlong import column_blocks
    from lighting.envmap.surroundings import render_view
    from lighting.light_probe import compute_light_probe

    probe = None
    if _ends_in(output, _headed_suffixes()):
        probe = compute_light_probe(lighting, **{name: v for name, v in view_options.items() if name != "height"})
    if len(column_blocks(view_options["height"])) > 1:  # which takes hundreds of megabytes
        return_memory()
    image, lighting = render_view(lighting, **view_options)
    file: Any = {"compression": compression or "zip", "colours": colours or "rec709", "probe": probe, "overwrite": True}
    if output == "-":
        console.write_bytes(output, encode_envmap(image, lighting, "exr", **file))
    else:
        write_envmap(output, image, lighting, **file)
