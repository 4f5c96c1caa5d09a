"""What commands read and write."""

import errno
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import click

from lighting.cli.process import ending_at_once
from lighting.cli.words import shown
from lighting.errors import EnvironmentMapError, ErrorCode, ParameterError, PhotoError, ProbeError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.envmap import Place
    from lighting.evidence import Given
    from lighting.model import Model
    from lighting.photo import Photo
    from lighting.pipeline import Estimator
    from lighting.records import Estimate, Lighting, Prediction


@contextmanager
def opened(name: str) -> Iterator[BinaryIO]:
    """The file, or stdin for "-", to read from."""
    if name == "-":
        yield stdin()
    elif not name:  # which would be the current folder
        raise FileNotFoundError(errno.ENOENT, "The name of the file is empty")
    else:
        with Path(name).open("rb") as stream:
            yield stream


def picture_bytes(name: str) -> bytes:
    """What the file of an EXR or HDR holds, or that of a photo as far as a photo may; PhotoTooLargeError or OSError."""
    from lighting.files import MAGIC, MAGIC_HDR
    from lighting.photo import MAX_BYTES

    with opened(name) as stream:
        head = stream.read(len(MAGIC))
        return head + (stream.read() if head.startswith((MAGIC, MAGIC_HDR)) else stream.read(MAX_BYTES))


def photo_bytes(name: str) -> bytes:
    """What the file of a photo holds, as far as a photo may; PhotoError, PhotoTooLargeError or OSError."""
    from lighting.photo import photo_data

    with opened(name) as stream:
        return photo_data(stream)


@contextmanager
def naming(file: str) -> Iterator[None]:
    """Errors of what is in the file begin with its name."""
    try:
        yield
    except (EnvironmentMapError, PhotoError, ProbeError) as error:
        raise error.prefixed(shown(file)) from error


def open_photo(name: str, target: int | None = None) -> "Photo":
    """The photo in a file; `target` pixels of its longer side are kept where the network's own need is not enough."""
    from lighting.photo import read_photo

    data = photo_bytes(name)
    return read_photo(data) if target is None else read_photo(data, target=target)


def stdin() -> BinaryIO:
    if sys.stdin is None:
        raise PhotoError("There is no stdin to read.")
    return sys.stdin.buffer


def open_lighting(name: str) -> "Lighting":
    """The record in a JSON file, bare or in the line that `estimate --json` printed; ParameterError names the file."""
    from lighting.files import MAX_RECORD_BYTES

    with opened(name) as stream:
        return lighting_of(stream.read(MAX_RECORD_BYTES + 1), name)


def lighting_of(data: bytes, name: str) -> "Lighting":
    """The same of what a file of that name holds."""
    from lighting.files import MAX_RECORD_BYTES, named_once, one_record
    from lighting.records import Lighting

    if len(data) > MAX_RECORD_BYTES:
        sentence = f"{shown(name)} is larger than a lighting record, which has at most 1 MB."
        raise ParameterError(sentence, code=ErrorCode.TOO_LARGE)
    try:
        return Lighting.from_dict(one_record(json.loads(data, object_pairs_hook=named_once)))  # PowerShell: UTF-16
    except ParameterError as error:
        raise error.prefixed(shown(name)) from error
    except (ValueError, RecursionError) as error:
        raise ParameterError(f"{shown(name)} {_fault(error)}.", code=ErrorCode.UNREADABLE) from error


def _fault(error: Exception) -> str:
    """What is wrong with a file whose JSON cannot be read."""
    if isinstance(error, UnicodeDecodeError):
        return "does not hold a JSON record: it is not text in UTF-8"
    if isinstance(error, json.JSONDecodeError) and error.msg == "Extra data":
        return "holds more than one record, and one is read at a time"
    return f"does not hold one JSON record: {error}"


def load_estimator(model: str | None) -> "Estimator":
    from lighting.model import Model
    from lighting.pipeline import Estimator

    return Estimator(Model.load(model))


def estimated(
    photo: bytes, given: "Given", model: str | None, meanwhile: Callable[[], object] = lambda: None
) -> "tuple[Photo, Estimate]":
    """The photo in bytes and its estimate.

    The network is loaded in a thread while the photo is decoded. While it answers, what comes after it is imported, and
    `meanwhile` is called. Ctrl-C ends the process at once, for nothing is written yet.
    """
    from concurrent.futures import ThreadPoolExecutor

    with ending_at_once(), ThreadPoolExecutor(1) as pool:
        network = pool.submit(_load_for_one_photo, model)
        from lighting.photo import read_photo

        picture = read_photo(photo)
        said = pool.submit(lambda: _said_of(network.result(), picture, given))
        from lighting.pipeline import estimate_from

        meanwhile()
    return picture, estimate_from(picture, said.result(), given)


def _load_for_one_photo(model: str | None) -> "Model":
    from lighting.model import Model, packaged_model
    from lighting.start import started_session

    started = started_session() if model is None else None
    if started is None:
        return Model.load(model, for_one_photo=True)
    return Model.from_session(started, packaged_model())


def _said_of(network: "Model", photo: "Photo", given: "Given") -> "Prediction":
    from lighting.evidence import said_of

    return said_of(network, photo, given)


def rehearse() -> None:
    """Render and pack a small map, so that all it takes is imported and read."""
    from lighting.envmap import render
    from lighting.files import encode_envmap
    from lighting.records import MIN_HEIGHT, Lighting

    light = Lighting(sun_azimuth=0.0, sun_elevation=45.0, turbidity=3.0, exposure=1.0)
    encode_envmap(render(light, MIN_HEIGHT), light)


def refuse_collisions(source: str, *outputs: str | None) -> None:
    """Raise UsageError where an output would replace the input or the other output."""
    files = [name for name in (source, *outputs) if name is not None and name != "-"]
    if any(is_same_file(*two) for two in combinations(files, 2)) or outputs.count("-") > 1:
        raise click.UsageError("The input and the outputs must be different files.")


def is_same_file(one: str, other: str) -> bool:
    """Whether two names are of one file, also where links or a disk that knows no case hide it."""
    if os.path.realpath(one) == os.path.realpath(other):
        return True
    return Path(one).exists() and Path(other).exists() and Path(one).samefile(other)


def place_in(data: bytes, photo: "Photo", estimate: "Estimate", height: int, wanted: bool | None) -> "Place | None":
    """The place for a map of a photo with these bytes, as `envmap.place_of` has it."""
    from lighting.envmap import place_of
    from lighting.photo import read_photo

    def finer(side: int) -> "NDArray[np.uint8]":
        return read_photo(data, target=side).pixels

    return place_of(estimate, photo.pixels, height, finer, wanted=wanted)


def refuse_idle_compression(output: str, compression: str | None) -> None:
    """Raise UsageError for a compression where no file takes one."""
    from lighting.files import MAP_FORMATS

    packed = [f".{name}" for name, entry in MAP_FORMATS.items() if entry.takes_compression]
    if compression is not None and output != "-" and not output.lower().endswith(tuple(packed)):
        raise click.UsageError(f"--compression goes with {' and '.join(packed)} alone.")


def write_map(output: str, lighting: "Lighting", compression: str | None, **view_options: Any) -> None:
    """Render and write; with a yaw, the record in the file is turned with the map."""
    from lighting.envmap import view
    from lighting.files import encode_envmap, write_envmap
    from lighting.files.compression import round_in_place

    image, lighting = view(lighting, **view_options)
    if compression in (None, "zip") and (output == "-" or output.lower().endswith(".exr")):
        round_in_place(image)  # which spares a copy of a large map
    if output == "-":
        write_stdout(encode_envmap(image, lighting, "exr", compression=compression or "zip"))
    else:
        write_envmap(output, image, lighting, compression=compression or "zip")


def write_preview(output: str, photo: bytes, estimate: "Estimate", surroundings: bool | None) -> None:
    from lighting.photo import read_photo
    from lighting.preview import PHOTO_SIDE, preview_png

    pixels = read_photo(photo, target=PHOTO_SIDE).pixels
    write_png(output, preview_png(pixels, estimate, surroundings=surroundings))


def write_png(output: str, data: bytes) -> None:
    from lighting.files import replacing

    if output == "-":
        write_stdout(data)
    else:
        with replacing(output) as path:
            path.write_bytes(data)


def write_stdout(data: bytes) -> None:
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()
