"""What commands read and print: standard streams, checks of files, summaries, warnings."""

import errno
import json
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import click

from lighting.cli.process import exit_on_interrupt
from lighting.errors import (
    EnvironmentMapError,
    ErrorCode,
    ParameterError,
    PhotoError,
    ProbeError,
    describe_error,
    install_command,
)
from lighting.formatting import format_azimuth, format_tilt

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.envmap.surroundings import PhotoContext
    from lighting.estimator import Estimator
    from lighting.fusion.user_input import UserInput
    from lighting.model import Model
    from lighting.photo.reader import Photo
    from lighting.records import Estimate, Lighting, Prediction

# What commands say: a line for people, a line of JSON, a sentence about an error.

_CONTROLS = re.compile("[\\x00-\\x1f\\x7f-\\x9f\\u2028-\\u202e\\u2066-\\u2069]")  # and what turns writing round


def photo_progress(items: Sequence[str], quiet: bool) -> Any:
    """The items behind a progress bar, which appears only if stderr is a terminal and the results go elsewhere."""
    from tqdm import tqdm

    hidden = quiet or len(items) < 2 or not sys.stderr.isatty() or sys.stdout.isatty()
    return tqdm(items, unit="photo", disable=hidden)


def print_estimate(name: str, estimate: "Estimate", as_json: bool, quiet: bool) -> None:
    """Print one photo's estimate: a line of JSON, or a line for people with its warnings on stderr."""
    from lighting.records import json_line

    if as_json:
        click.echo(json_line(name, estimate.lighting))
    else:
        click.echo(format_summary(name, estimate.lighting))
        report_warnings(name, estimate.warnings, quiet)


def report_failure(name: str, error: Exception, as_json: bool, progress: Any) -> None:
    from lighting.records import json_line

    if as_json:
        click.echo(json_line(name, describe_error(error)))
    with progress.external_write_mode(file=sys.stderr):
        click.echo(f"Error: {escape_path(name)}: {escape_control_chars(describe_error(error))}", err=True)


def format_summary(name: str, lighting: "Lighting") -> str:
    """One line for people."""
    roll = round(lighting.camera_roll, 1) + 0.0  # without -0.0
    return (
        f"{escape_path(name)}: sun {format_azimuth(lighting.sun_azimuth, 1)}, {lighting.sun_elevation:.1f}° high"
        f"{_spread(lighting)}, direct sunlight {100 * lighting.sun_visibility:.0f} %, "
        f"turbidity {lighting.turbidity:.1f}; "
        f"camera looks {format_tilt(lighting.camera_elevation, 1)}, roll {roll:.1f}°, "
        f"vertical field of view {lighting.vertical_fov:.1f}°{_headings(lighting)}{_evidence(lighting)}"
    )


def _spread(lighting: "Lighting") -> str:
    """The radii around the sun; a record that was written by hand may have none."""
    if lighting.radius_90 == 0.0:
        return ""
    return f" (50 % within {lighting.radius_50:.1f}°, 90 % within {lighting.radius_90:.1f}°)"


def _headings(lighting: "Lighting") -> str:
    words = ""
    if lighting.camera_heading is not None:
        words += f", heading {round(lighting.camera_heading) % 360}°"
    if lighting.camera_heading_radius_50 is not None:
        words += f" (50 % within {lighting.camera_heading_radius_50:.0f}°)"
    if lighting.relative_heading is not None:
        words += f", {round(lighting.relative_heading) % 360}° clockwise from the first photo"
    return words


def _evidence(lighting: "Lighting") -> str:
    return f"; from {', '.join(lighting.evidence)}" if len(lighting.evidence) > 1 else ""


def report_warnings(name: str, warnings: Sequence[str], quiet: bool = False) -> None:
    for warning in () if quiet else warnings:
        click.echo(f"Warning: {escape_path(name)}: {warning}", err=True)


def warn_unregistered(quiet: bool, together: bool, headings: Sequence[float] | None) -> None:
    """Say on stderr where photos taken together could have been matched, and what is missing for it."""
    from lighting.registration.features import has_opencv

    if together and headings is None and not quiet and not has_opencv():
        click.echo(
            "Warning: The photos were not matched with each other, because OpenCV is not installed: "
            f"{install_command('turns')}.",
            err=True,
        )


def escape_path(name: str) -> str:
    """The name of a file for a terminal, without anything that the terminal would obey."""
    return {"-": "stdin", "": "''"}.get(name) or escape_control_chars(click.format_filename(name))


def escape_control_chars(text: str) -> str:
    """The text with control characters as escapes such as \\x1b, so that a terminal obeys none of them."""
    return _CONTROLS.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def format_error(error: Exception) -> str:
    file = getattr(error, "filename", None)
    return escape_control_chars(
        f"{click.format_filename(file)}: {describe_error(error)}" if file else describe_error(error)
    )


def is_broken_pipe(error: Exception) -> bool:
    return isinstance(error, OSError) and error.errno == errno.EPIPE


# What commands read and write.


@contextmanager
def _open_input(name: str) -> Iterator[BinaryIO]:
    """The file, or stdin for "-", to read from."""
    if name == "-":
        yield _stdin()
    elif not name:  # which would be the current folder
        raise FileNotFoundError(errno.ENOENT, "The name of the file is empty")
    else:
        with Path(name).open("rb") as stream:
            yield stream


def read_picture_bytes(name: str) -> bytes:
    """What the file of an EXR or HDR holds, or that of a photo as far as a photo may; PhotoTooLargeError or OSError."""
    from lighting.files.exr import EXR_MAGIC
    from lighting.files.radiance_hdr import HDR_MAGIC
    from lighting.photo.reader import MAX_BYTES

    with _open_input(name) as stream:
        head = stream.read(len(EXR_MAGIC))
        return head + (stream.read() if head.startswith((EXR_MAGIC, HDR_MAGIC)) else stream.read(MAX_BYTES))


def read_photo_bytes(name: str) -> bytes:
    """What the file of a photo holds, as far as a photo may; PhotoError, PhotoTooLargeError or OSError."""
    from lighting.photo.reader import read_bytes

    with _open_input(name) as stream:
        return read_bytes(stream)


@contextmanager
def prefix_errors(file: str) -> Iterator[None]:
    """Errors of what is in the file begin with its name."""
    try:
        yield
    except (EnvironmentMapError, PhotoError, ProbeError) as error:
        raise error.prefixed(escape_path(file)) from error


def read_photo_file(name: str, target: int | None = None) -> "Photo":
    """The photo in a file; `target` pixels of its longer side are kept where the network's own need is not enough."""
    from lighting.photo.reader import read_photo

    data = read_photo_bytes(name)
    return read_photo(data) if target is None else read_photo(data, target=target)


def _stdin() -> BinaryIO:
    if sys.stdin is None:
        raise PhotoError("There is no stdin to read.")
    return sys.stdin.buffer


def read_lighting(name: str) -> "Lighting":
    """The record in a JSON file, bare or in the line that `estimate --json` printed; ParameterError names the file."""
    from lighting.records import MAX_RECORD_BYTES

    with _open_input(name) as stream:
        return parse_lighting(stream.read(MAX_RECORD_BYTES + 1), name)


def parse_lighting(data: bytes, name: str) -> "Lighting":
    """The same of what a file of that name holds."""
    from lighting.records import MAX_RECORD_BYTES, Lighting, reject_duplicate_keys, unwrap_record

    if len(data) > MAX_RECORD_BYTES:
        sentence = f"{escape_path(name)} is larger than a lighting record, which has at most 1 MB."
        raise ParameterError(sentence, code=ErrorCode.TOO_LARGE)
    try:
        return Lighting.from_dict(
            unwrap_record(json.loads(data, object_pairs_hook=reject_duplicate_keys))
        )  # PowerShell: UTF-16
    except ParameterError as error:
        raise error.prefixed(escape_path(name)) from error
    except (ValueError, RecursionError) as error:
        raise ParameterError(f"{escape_path(name)} {_fault(error)}.", code=ErrorCode.UNREADABLE) from error


def _fault(error: Exception) -> str:
    """What is wrong with a file whose JSON cannot be read."""
    if isinstance(error, UnicodeDecodeError):
        return "does not hold a JSON record: it is not text in UTF-8"
    if isinstance(error, json.JSONDecodeError) and error.msg == "Extra data":
        return "holds more than one record, and one is read at a time"
    return f"does not hold one JSON record: {error}"


def load_estimator(model: str | None) -> "Estimator":
    from lighting.estimator import Estimator
    from lighting.model import Model

    return Estimator(Model.load(model))


def estimate_photo(
    photo: bytes, given: "UserInput", model: str | None, meanwhile: Callable[[], object] = lambda: None
) -> "tuple[Photo, Estimate]":
    """The photo in bytes and its estimate.

    The network is loaded in a thread while the photo is decoded. While it answers, what comes after it is imported, and
    `meanwhile` is called. Ctrl-C ends the process at once, for nothing is written yet.
    """
    from concurrent.futures import ThreadPoolExecutor

    with exit_on_interrupt(), ThreadPoolExecutor(1) as pool:
        network = pool.submit(_load_for_one_photo, model)
        from lighting.photo.reader import read_photo

        picture = read_photo(photo)
        said = pool.submit(lambda: _predict(network.result(), picture, given))
        from lighting.estimator import estimate_from_prediction

        meanwhile()
    return picture, estimate_from_prediction(picture, said.result(), given)


def _load_for_one_photo(model: str | None) -> "Model":
    from lighting.model import Model, packaged_model
    from lighting.start import started_session

    started = started_session() if model is None else None
    if started is None:
        return Model.load(model, for_one_photo=True)
    return Model.from_session(started, packaged_model())


def _predict(network: "Model", photo: "Photo", given: "UserInput") -> "Prediction":
    from lighting.fusion.estimate import predict_photo

    return predict_photo(network, photo, given)


def warm_up() -> None:
    """Render and pack a small map, so that all it takes is imported and read."""
    from lighting.envmap.render import render
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


def photo_context_of(
    data: bytes, photo: "Photo", estimate: "Estimate", height: int, wanted: bool | None
) -> "PhotoContext | None":
    """The place for a map of a photo with these bytes, as `envmap.place_of` has it."""
    from lighting.envmap.surroundings import photo_context_for_height
    from lighting.photo.reader import read_photo

    def finer(side: int) -> "NDArray[np.uint8]":
        return read_photo(data, target=side).pixels

    return photo_context_for_height(estimate, photo.pixels, height, finer, surroundings=wanted)


def check_compression(output: str, compression: str | None) -> None:
    """Raise UsageError for a compression where no file takes one."""
    from lighting.files import MAP_FORMATS

    packed = [f".{name}" for name, entry in MAP_FORMATS.items() if entry.takes_compression]
    if compression is not None and output != "-" and not output.lower().endswith(tuple(packed)):
        raise click.UsageError(f"--compression goes with {' and '.join(packed)} alone.")


def write_output_map(output: str, lighting: "Lighting", compression: str | None, **view_options: Any) -> None:
    """Render and write; with a yaw, the record in the file is turned with the map."""
    from lighting.envmap.surroundings import render_view
    from lighting.files import encode_envmap, write_envmap
    from lighting.files.exr import round_in_place

    image, lighting = render_view(lighting, **view_options)
    if compression in (None, "zip") and (output == "-" or output.lower().endswith(".exr")):
        round_in_place(image)  # which spares a copy of a large map
    if output == "-":
        _write_stdout(encode_envmap(image, lighting, "exr", compression=compression or "zip"))
    else:
        write_envmap(output, image, lighting, compression=compression or "zip")


def write_preview(output: str, photo: bytes, estimate: "Estimate", surroundings: bool | None) -> None:
    from lighting.photo.reader import read_photo
    from lighting.preview.picture import PHOTO_SIDE, preview_png

    pixels = read_photo(photo, target=PHOTO_SIDE).pixels
    write_png(output, preview_png(pixels, estimate, surroundings=surroundings))


def write_png(output: str, data: bytes) -> None:
    from lighting.files.atomic import atomic_write

    if output == "-":
        _write_stdout(data)
    else:
        with atomic_write(output) as path:
            path.write_bytes(data)


def _write_stdout(data: bytes) -> None:
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()
