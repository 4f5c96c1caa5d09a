"""The command that describes a file."""

import json
from codecs import BOM_UTF8
from dataclasses import asdict
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lighting.cli import cli
from lighting.cli.console import (
    parse_lighting,
    path_of,
    prefix_errors,
    read_lighting,
    read_picture_bytes,
)
from lighting.cli.options import FileName
from lighting.cli.process import silence_libraries
from lighting.errors import ErrorCode, PhotoError
from lighting.formatting import escape_undecodable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.photo.metadata import PhotoMetadata
    from lighting.photo.reader import Photo
    from lighting.records import Json, Lighting


@cli.command(
    "info",
    examples=(
        "lighting info photo.jpg                             # its metadata, and the time that is believed",
        "lighting info photo.exr                             # size, and the record in the header",
        "lighting info light.json",
    ),
)
@click.argument("file", type=FileName())
@click.option("--json", is_flag=True, expose_value=False, help="JSON, which is all that it prints.")
@click.option("-q", "--quiet", is_flag=True, expose_value=False, help="No warnings, of which it prints none.")
def _info(file: str) -> None:
    """Describe an EXR, HDR, network, record or photo as JSON."""
    describe = _BY_SUFFIX.get(Path(file).suffix.lower(), _describe_picture)
    click.echo(json.dumps({"file": escape_undecodable(file), **describe(file)}, indent=2))


def _describe_record(file: str) -> "Json":
    return _describe_lighting(read_lighting(file))


def _describe_lighting(lighting: "Lighting") -> "Json":
    return {"kind": "lighting record", "lighting": _record_with_probe(lighting)}


def _record_with_probe(lighting: "Lighting") -> "Json":
    """The record with the light probe of its sky and ground."""
    from lighting.light_probe import compute_light_probe
    from lighting.records import record_with_coefficients

    return record_with_coefficients(lighting, compute_light_probe(lighting))


def _describe_network(file: str) -> "Json":
    from lighting.model import Model

    return {"kind": "network", **json.loads(Model.load(file).spec.to_json())}


def _describe_picture(file: str) -> "Json":
    from lighting.files.exr import EXR_MAGIC
    from lighting.files.radiance_hdr import HDR_MAGIC, decode_hdr

    data = read_picture_bytes(file)
    if data.startswith(EXR_MAGIC):
        return _describe_map(file, data)
    if data.startswith(HDR_MAGIC) or Path(file).suffix.lower() == ".hdr":
        with prefix_errors(file):
            return _describe_image(decode_hdr(data))
    if data.removeprefix(BOM_UTF8).lstrip().startswith(b"{"):
        return _describe_lighting(parse_lighting(data, file))
    with prefix_errors(file):
        photo = _read_photo(data, file)
    size: Json = {"format": photo.format, "width": photo.width, "height": photo.height}
    if photo.crop is not None:
        size["crop"] = asdict(photo.crop)
    return {"kind": "photo", **size, "metadata": _describe_metadata(photo.metadata)}


def _read_photo(data: bytes, file: str) -> "Photo":
    """The photo; the error about a file of no known kind names all that could be described."""
    from lighting.photo.formats import UNREADABLE, unreadable_sentence
    from lighting.photo.reader import read_photo

    try:
        return read_photo(data, path=path_of(file))
    except PhotoError as error:
        if data and error.code is ErrorCode.UNREADABLE and unreadable_sentence(data) == UNREADABLE:
            sentence = "This is no photo, EXR, Radiance HDR, network (.onnx) or record (.json), which info describes."
            raise PhotoError(sentence) from error
        raise


def _describe_metadata(metadata: "PhotoMetadata") -> "Json":
    """The metadata that estimates use; of the place only whether it is known, since output may be passed on."""
    from lighting.fusion.instants import resolve_instants
    from lighting.fusion.user_input import NO_USER_INPUT

    values = {**asdict(metadata), "location": metadata.latitude is not None}
    del values["latitude"], values["longitude"], values["locations"]
    likeliest = resolve_instants(metadata, NO_USER_INPUT).likeliest
    values["utc_time"], values["time_source"] = (likeliest.utc_time, likeliest.source) if likeliest else (None, None)
    return {name: value.isoformat() if isinstance(value, datetime) else value for name, value in values.items()}


def _describe_map(file: str, data: bytes) -> "Json":
    """What a map is, and its header's record; the light probe in it is that of the map, with the place."""
    from lighting.files.exr import read_exr, read_exr_attributes

    with prefix_errors(file), silence_libraries():
        image, lighting = read_exr(BytesIO(data))
        header = read_exr_attributes(BytesIO(data))
    if lighting is None:
        return {**_describe_image(image), "lighting": None}
    probe = json.loads(header["lighting.json"]).get("light_probe")
    record = _record_with_probe(lighting)
    return {**_describe_image(image), "lighting": record | ({"light_probe": probe} if probe else {})}


def _describe_image(image: "NDArray[np.float32]") -> "Json":
    """What an HDR picture (H, W, 3) is by its shape, and its size."""
    height, width = image.shape[:2]
    return {"kind": "environment map" if width == 2 * height else "picture", "width": width, "height": height}


_BY_SUFFIX = {".onnx": _describe_network, ".json": _describe_record, ".jsonl": _describe_record}
