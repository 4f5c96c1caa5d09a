"""What commands read and print: standard streams, inputs, summaries, warnings."""

import errno
import json
import os
import re
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict
from datetime import timedelta, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import click

from lighting.errors import EnvironmentMapError, ErrorCode, ParameterError, PhotoError, ProbeError, describe_error
from lighting.files import CLIP_SUFFIXES, escape_undecodable

if TYPE_CHECKING:
    from lighting.fields import Json
    from lighting.photo.reader import Photo, PhotoCrop
    from lighting.records import Lighting, LightProbe

_CONTROLS = re.compile("[\\x00-\\x1f\\x7f-\\x9f\\u2028-\\u202e\\u2066-\\u2069]")  # and what turns writing round


def photo_progress(items: Sequence[str], quiet: bool) -> Any:
    """Put items behind a progress bar, which appears only if stderr is a terminal and the results go elsewhere.

    Args:
        items: names of photos.
        quiet: show no bar.
    """
    if quiet or len(items) < 2 or not sys.stderr.isatty() or sys.stdout.isatty():
        return nullcontext(items)
    from tqdm import tqdm  # 20 ms, which a command for one photo is spared

    return tqdm(items, unit="photo")


def print_estimate(
    name: str,
    lighting: "Lighting",
    warnings: Sequence[str] = (),
    outputs: Mapping[str, str] = {},
    *,
    probe: "LightProbe | None" = None,
    crop: "PhotoCrop | None" = None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Print a photo's light: a line of JSON, or a line for people with its warnings on stderr.

    Args:
        name: of the photo.
        lighting: its light.
        warnings: for people; JSON has those of the record.
        outputs: the files that were written, by their names in JSON; with some, quiet hides the line for people.
        probe: for JSON; None: without.
        crop: for JSON, the photo's part of the picture; None where it has no border.
        as_json: which of both; stdout must hold nothing else.
        quiet: print no warnings.
    """
    if as_json:
        click.echo(format_record(name, lighting, outputs, probe=probe, crop=crop))
        return
    closed = bool(outputs) and not sys.stdout.writable()  # what matters is written
    if not (outputs and quiet) and not closed and "-" not in outputs.values():
        click.echo(_format_summary(name, lighting))
    report_warnings(name, warnings, quiet)


def format_record(
    name: str,
    answer: "Lighting | Exception",
    outputs: Mapping[str, str] = {},
    *,
    probe: "LightProbe | None" = None,
    crop: "PhotoCrop | None" = None,
) -> str:
    """Return a photo's light, or why it has none, as a line of JSON.

    Args:
        name: of the photo.
        answer: its light, or why it has none.
        outputs: the files that were written, by their names in JSON.
        probe: of the light; None: without.
        crop: the photo's part of the picture; None where it has no border.
    """
    from lighting.record_json import json_line

    files = {key: escape_undecodable(file) for key, file in outputs.items()}
    light = escape_undecodable(describe_error(answer)) if isinstance(answer, Exception) else answer
    return json_line(escape_undecodable(name), light, probe, files, crop=asdict(crop) if crop else None)


def record_with_probe(lighting: "Lighting") -> "Json":
    """Return the record of a light, with the light probe of its sky and ground.

    Args:
        lighting: any.
    """
    from lighting.light_probe import compute_light_probe
    from lighting.record_json import record_with_coefficients

    return record_with_coefficients(lighting, compute_light_probe(lighting))


def report_failure(name: str, error: Exception, progress: Any) -> None:
    """Print on stderr why a photo has no estimate.

    Args:
        name: of the photo.
        error: the reason.
        progress: what `photo_progress` gave; a bar makes way.
    """
    sentence, subject = escape_control_chars(describe_error(error)), escape_path(name)
    with progress.external_write_mode(file=sys.stderr) if hasattr(progress, "external_write_mode") else nullcontext():
        click.echo(
            f"Error: {sentence}" if sentence.startswith(f"{subject}: ") else f"Error: {subject}: {sentence}", err=True
        )


def _format_summary(name: str, lighting: "Lighting") -> str:
    """Describe a light in one line for people.

    Args:
        name: of the photo.
        lighting: its light.
    """
    from lighting.formatting import format_tilt
    from lighting.records import describe_candidates, describe_sun, describe_trust

    candidates, by_hand = describe_candidates(lighting), lighting.radius_90 == 0.0
    trust = "" if by_hand else f"; {describe_trust(lighting)}; "
    evidence = f"; from {', '.join(lighting.evidence)}" if len(lighting.evidence) > 1 else ""
    tilt, roll = format_tilt(lighting.camera_elevation, 1), round(lighting.camera_roll, 1) + 0.0  # without -0.0
    return (
        f"{escape_path(name)}: {describe_sun(lighting)}{candidates and ', '}{candidates}{trust or ', '}"
        f"direct sunlight {100 * lighting.sun_visibility:.0f} %, turbidity {lighting.turbidity:.1f}; "
        f"camera looks {tilt}, roll {roll:.1f}°, "
        f"vertical field of view {lighting.vertical_fov:.1f}°{_format_headings(lighting)}"
        f"{_format_time(lighting)}{evidence}"
    )


def _format_headings(lighting: "Lighting") -> str:
    text = ""
    if lighting.camera_heading is not None:
        text += f", heading {round(lighting.camera_heading) % 360}°"
    if lighting.camera_heading_radius_50 is not None:
        text += f" (50 % within {lighting.camera_heading_radius_50:.0f}°)"
    if lighting.relative_heading is not None:
        text += f", {round(lighting.relative_heading) % 360}° clockwise from the first photo"
    return text


def _format_time(lighting: "Lighting") -> str:
    """When the photo was taken, as the answer believes, on the clock of its offset from UTC."""
    if lighting.utc_time is None:
        return ""
    from lighting.formatting import format_utc_offset

    offset = timedelta(hours=lighting.utc_offset or 0.0)
    local = lighting.utc_time.astimezone(timezone(offset))
    source = f" ({lighting.time_source})" if lighting.time_source else ""
    return f"; taken {local:%Y-%m-%d %H:%M} {format_utc_offset(lighting.utc_offset or 0.0)}{source}"


def report_warnings(name: str, warnings: Sequence[str], quiet: bool = False) -> None:
    """Print warnings on stderr.

    Args:
        name: of the photo.
        warnings: sentences.
        quiet: print none.
    """
    for warning in () if quiet else warnings:
        click.echo(f"Warning: {escape_path(name)}: {warning}", err=True)


def escape_path(name: str) -> str:
    """Return the name of a file for a terminal, without anything that the terminal would obey.

    Args:
        name: as the user typed it; "-" is stdin.
    """
    return {"-": "stdin", "": "''"}.get(name) or escape_control_chars(click.format_filename(name))


def escape_control_chars(text: str) -> str:
    """Return a text with control characters as escapes such as \\x1b, so that a terminal obeys none of them.

    Args:
        text: any.
    """
    return _CONTROLS.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def format_error(error: Exception) -> str:
    """Return an error as one sentence for a terminal, behind the name of its file, if it carries one.

    Args:
        error: any.
    """
    file = getattr(error, "filename", None)
    prefix = f"{click.format_filename(file)}: " if file else ""
    return escape_control_chars(prefix + describe_error(error))


def is_broken_pipe(error: Exception) -> bool:
    """Tell whether nobody reads stdout any more.

    Args:
        error: any.
    """
    return isinstance(error, OSError) and error.errno == errno.EPIPE


@contextmanager
def _open_input(name: str) -> Iterator[BinaryIO]:
    """The file, or stdin for "-", to read from."""
    if name == "-":
        yield _stdin()
    elif not name:  # which would be the current folder
        raise _no_name()
    else:
        check_file_there(name)
        with Path(name).open("rb") as stream:
            yield stream


def read_small_file(name: str, most: int) -> bytes:
    """Read a file that is no photo.

    Args:
        name: of the file; "-" is stdin.
        most: bytes that it may have.

    Raises:
        OSError: it cannot be read.
        ParameterError: it has more bytes.
    """
    with _open_input(name) as stream:
        data = stream.read(most + 1)
    if len(data) > most:
        sentence = f"{escape_path(name)} has over {most / 1e6:.0f} MB, which is too much."
        raise ParameterError(sentence, code=ErrorCode.TOO_LARGE)
    return data


def check_there(name: str) -> None:
    """Raise FileNotFoundError for a file that is not there, which says what was probably meant.

    Args:
        name: of the file, as the user typed it.
    """
    if not Path(name).exists():
        from lighting.cli.hints import describe_missing_file

        raise FileNotFoundError(errno.ENOENT, describe_missing_file(name) or os.strerror(errno.ENOENT), name)


def check_file_there(name: str) -> None:
    """Raise an error for a file that is not there, and for a folder.

    Args:
        name: of the file, as the user typed it.
    """
    check_there(name)
    if Path(name).is_dir():
        raise IsADirectoryError(errno.EISDIR, f"It is a folder: try `lighting batch {shlex.quote(name)}`", name)


def check_photo_file(name: str) -> None:
    """Raise an error for a photo that is not there, for a folder, and for a clip.

    Args:
        name: of the file, as the user typed it.
    """
    check_file_there(name)
    if name.lower().endswith(CLIP_SUFFIXES):
        raise PhotoError(f"It is a clip: try `lighting video {shlex.quote(name)}`.")


def read_picture_bytes(name: str) -> bytes:
    """Read the file of an EXR or HDR, or that of a photo as far as a photo may be long.

    Args:
        name: of the file; "-" is stdin.

    Raises:
        OSError: it cannot be read.
    """
    from lighting.files.exr import EXR_MAGIC
    from lighting.files.radiance_hdr import HDR_MAGIC
    from lighting.photo.reader import MAX_BYTES

    with _open_input(name) as stream:
        head = stream.read(len(EXR_MAGIC))
        return head + (stream.read() if head.startswith((EXR_MAGIC, HDR_MAGIC)) else stream.read(MAX_BYTES))


def read_photo_file(name: str, target: int | None = None) -> "Photo":
    """Read the photo in a file.

    Args:
        name: of the file, beside which sidecars may lie; "-" is stdin.
        target: pixels of its longer side to keep; None keeps what the network needs.

    Raises:
        PhotoError: it is no photo, or there is no stdin.
        PhotoTooLargeError: it has more bytes than a photo may.
        OSError: it cannot be read.
    """
    import lighting.photo.reader as reader

    if name == "-":
        data = reader.read_bytes(_stdin())
    elif not name:
        raise _no_name()
    else:
        check_photo_file(name)
        data = reader.read_bytes(Path(name))
    return reader.read_photo(data, target=target or reader.TARGET, path=None if name == "-" else name)


@contextmanager
def prefix_errors(file: str) -> Iterator[None]:
    """Let errors about a file begin with its name.

    Args:
        file: as the user typed it.
    """
    try:
        yield
    except (EnvironmentMapError, PhotoError, ProbeError) as error:
        raise error.prefixed(escape_path(file)) from error


def _no_name() -> FileNotFoundError:
    return FileNotFoundError(errno.ENOENT, "The name of the file is empty")


def _stdin() -> BinaryIO:
    if sys.stdin is None:
        raise PhotoError("There is no stdin to read.")
    return sys.stdin.buffer


def read_lighting(name: str) -> "Lighting":
    """Read the record in a JSON file, bare or in the line that `estimate --json` printed.

    Args:
        name: of the file; "-" is stdin.

    Raises:
        ParameterError: it holds no such record; the sentence names the file.
    """
    from lighting.record_json import MAX_RECORD_BYTES

    with _open_input(name) as stream:
        return parse_lighting(stream.read(MAX_RECORD_BYTES + 1), name)


def parse_lighting(data: bytes, name: str) -> "Lighting":
    """Read a record as `read_lighting` does.

    Args:
        data: what the file holds.
        name: of the file, for errors.
    """
    from lighting.record_json import MAX_RECORD_BYTES, reject_duplicate_keys, unwrap_record
    from lighting.records import Lighting

    if sentence := _describe_other_file(data, name):
        raise ParameterError(sentence, code=ErrorCode.UNREADABLE)
    if len(data) > MAX_RECORD_BYTES:
        sentence = f"{escape_path(name)} is larger than a lighting record, which has at most 1 MB."
        raise ParameterError(sentence, code=ErrorCode.TOO_LARGE)
    try:
        content = json.loads(data, object_pairs_hook=reject_duplicate_keys)  # UTF-16, too: PowerShell writes it
        return Lighting.from_dict(unwrap_record(content))
    except ParameterError as error:
        raise error.prefixed(escape_path(name)) from error
    except (ValueError, RecursionError) as error:
        sentence = f"{escape_path(name)} {_describe_json_error(error)}."
        raise ParameterError(sentence, code=ErrorCode.UNREADABLE) from error


def _describe_other_file(data: bytes, name: str) -> str | None:
    """What a file is that stands in a record's place, and what to do with it; None where it may be a record."""
    from lighting.files.exr import EXR_MAGIC
    from lighting.photo.formats import HEAD_BYTES, begins_as_photo, kind_name

    shown, typed = escape_path(name), escape_control_chars(shlex.quote(name))
    if data.startswith(EXR_MAGIC):
        return f"{shown} is an EXR, not a record (.json). Its record: `lighting info {typed}`."
    kind = kind_name(data)
    if kind is None and begins_as_photo(data[:HEAD_BYTES]):
        return f"{shown} is a photo, not a record (.json). Its map: `lighting envmap {typed}`."
    zeros = data.count(0) == len(data)  # whose kind says nothing of the file
    return None if kind in (None, "a JSON file", "a text") or zeros else f"{shown} is {kind}, not a record (.json)."


def _describe_json_error(error: Exception) -> str:
    """What is wrong with a file whose JSON cannot be read."""
    if isinstance(error, UnicodeDecodeError):
        return "does not hold a JSON record: it is not text in UTF-8"
    if isinstance(error, json.JSONDecodeError) and error.msg == "Extra data":
        return "holds more than one record, and one is read at a time"
    return f"does not hold one JSON record: {error}"
