"""The commands about one photo, one record or one file."""

import json
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import click

from lighting.cli.files import (
    estimated,
    load_estimator,
    open_lighting,
    open_photo,
    read_bytes,
    refuse_collisions,
    write_map,
    write_preview,
)
from lighting.cli.group import cli
from lighting.cli.options import map_options, map_output, model_option, preview_file, quiet_option
from lighting.cli.words import in_words, progress_over, report_failure
from lighting.errors import PhotoError
from lighting.lines import json_line

EXR_MAGIC = b"\x76\x2f\x31\x01"


@cli.command()
@click.argument("photos", nargs=-1, required=True, metavar="PHOTO...")
@click.option("--json", "as_json", is_flag=True, help="One JSON object a line instead of words.")
@model_option
@quiet_option
@click.pass_context
def estimate(ctx: click.Context, photos: Sequence[str], as_json: bool, model: str | None, quiet: bool) -> None:
    """Print the light of each PHOTO.

    A photo that cannot be read does not stop the others; the exit status is 1 then.
    """
    estimator = load_estimator(model)
    failed = 0
    with progress_over(photos, quiet) as progress:
        for name in progress:
            try:
                lighting = estimator(open_photo(name))
            except (PhotoError, OSError) as error:
                failed += 1
                report_failure(name, error, as_json, progress)
            else:
                click.echo(json_line(name, lighting=lighting.to_dict()) if as_json else in_words(name, lighting))
    if failed and len(photos) > 1:
        click.echo(f"{failed} of {len(photos)} photos could not be read.", err=True)
    ctx.exit(1 if failed else 0)


@cli.command()
@click.argument("photo")
@map_output
@map_options
@click.option("--preview", metavar="FILE.png", callback=preview_file, help="Also draw what `lighting preview` draws.")
@model_option
@quiet_option
def envmap(photo: str, output: str, preview: str | None, model: str | None, quiet: bool, **view: Any) -> None:
    """Estimate the light of PHOTO and render its environment map."""
    refuse_collisions(photo, output, preview)
    estimator = load_estimator(model)
    picture = open_photo(photo)
    prediction, lighting = estimated(estimator, picture)
    write_map(output, lighting, **view)
    if preview:
        write_preview(preview, picture, prediction, lighting)
    if not quiet and "-" not in (output, preview):
        click.echo(in_words(photo, lighting))


@cli.command()
@click.argument("record", metavar="LIGHTING.json")
@map_output
@map_options
def render(record: str, output: str, **view: Any) -> None:
    """Render a lighting record as an environment map.

    LIGHTING.json holds one record, or one line that "estimate --json" printed.
    """
    refuse_collisions(record, output)
    write_map(output, open_lighting(record), **view)


@cli.command()
@click.argument("photo")
@click.option("-o", "--output", required=True, metavar="FILE.png", callback=preview_file, help='"-" is stdout.')
@model_option
def preview(photo: str, output: str, model: str | None) -> None:
    """Draw PHOTO, its light and three spheres lit by it."""
    refuse_collisions(photo, output)
    estimator = load_estimator(model)
    picture = open_photo(photo)
    write_preview(output, picture, *estimated(estimator, picture))


@cli.command()
@click.argument("file")
def info(file: str) -> None:
    """Describe an EXR, a network (.onnx) or a photo as JSON."""
    described = _describe_network(file) if Path(file).suffix.lower() == ".onnx" else _describe_picture(file)
    click.echo(json.dumps({"file": file, **described}, indent=2))


def _describe_network(file: str) -> dict[str, Any]:
    from lighting.model import Model

    return {"kind": "network", **json.loads(Model.load(file).spec.to_json())}


def _describe_picture(file: str) -> dict[str, Any]:
    from lighting.photo import read_photo

    data = read_bytes(file)
    if data.startswith(EXR_MAGIC):
        return _describe_map(data)
    photo = read_photo(data)
    return {"kind": "photo", "format": photo.format, "width": photo.width, "height": photo.height}


def _describe_map(data: bytes) -> dict[str, Any]:
    from lighting.exr import read_exr

    image, lighting = read_exr(BytesIO(data))
    record = None if lighting is None else lighting.to_dict()
    return {"kind": "environment map", "width": image.shape[1], "height": image.shape[0], "lighting": record}
