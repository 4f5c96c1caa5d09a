"""What commands read, print and write: standard streams, summaries, warnings; names, folders and checks of outputs.

One rule for all commands: a file that is there is not replaced without --overwrite, and "-" is stdout.
"""

import errno
import json
import os
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, dataclass
from datetime import timedelta, timezone
from itertools import combinations, product
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Self, TextIO

import click

from lighting.errors import (
    EnvironmentMapError,
    ErrorCode,
    ParameterError,
    PhotoError,
    ProbeError,
    describe_error,
)
from lighting.files import CLIP_SUFFIXES, MAP_FILE_SUFFIXES, MAP_FORMATS, atomic_write, escape_undecodable, join_words

if TYPE_CHECKING:
    from lighting.photo.reader import Photo, PhotoCrop
    from lighting.records import Lighting, LightProbe

_CONTROLS = re.compile("[\\x00-\\x1f\\x7f-\\x9f\\u2028-\\u202e\\u2066-\\u2069]")  # and what turns writing round
RECORD_SUFFIXES = (".json", ".jsonl")
_HINT = "'-o' / '--output'"  # how click names the option in an error


def photo_progress(items: Sequence[str], quiet: bool) -> Any:
    """Put items behind a progress bar, which appears only if stderr is a terminal and the results go elsewhere.

    Args:
        items: names of photos.
        quiet: show no bar.
    """
    if quiet or len(items) < 2 or not sys.stderr.isatty() or sys.stdout.isatty():
        return _HiddenBar(items)
    from tqdm import tqdm  # 20 ms, which a command for one photo is spared

    return tqdm(items, unit="photo")


class _HiddenBar(list[str]):
    """Items without a bar, as far as a bar of tqdm is used here."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def external_write_mode(self, file: TextIO) -> AbstractContextManager[None]:  # noqa: ARG002
        return nullcontext()


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
    lighting: "Lighting",
    outputs: Mapping[str, str] = {},
    *,
    probe: "LightProbe | None" = None,
    crop: "PhotoCrop | None" = None,
) -> str:
    """Return a photo's light as a line of JSON.

    Args:
        name: of the photo.
        lighting: its light.
        outputs: the files that were written, by their names in JSON.
        probe: of the light; None: without.
        crop: the photo's part of the picture; None where it has no border.
    """
    from lighting.records import json_line

    files = {key: escape_undecodable(file) for key, file in outputs.items()}
    return json_line(escape_undecodable(name), lighting, probe, files, crop=asdict(crop) if crop else None)


def format_json_error(name: str, error: Exception) -> str:
    """Return why a file has no answer as a line of JSON.

    Args:
        name: of the file.
        error: the reason.
    """
    from lighting.records import json_line

    return json_line(escape_undecodable(name), escape_undecodable(describe_error(error)))


def report_failure(name: str, error: Exception, progress: Any) -> None:
    """Print on stderr why a photo has no estimate.

    Args:
        name: of the photo.
        error: the reason.
        progress: the bar of `photo_progress`, which makes way.
    """
    sentence, subject = escape_control_chars(describe_error(error)), escape_path(name)
    with progress.external_write_mode(file=sys.stderr):
        click.echo(
            f"Error: {sentence}" if sentence.startswith(f"{subject}: ") else f"Error: {subject}: {sentence}", err=True
        )


def _format_summary(name: str, lighting: "Lighting") -> str:
    """Describe a light in one line for people.

    Args:
        name: of the photo.
        lighting: its light.
    """
    from lighting.fields import format_azimuth, format_sun_elevation, format_tilt
    from lighting.records import describe_candidates, describe_trust

    candidates, by_hand = describe_candidates(lighting), lighting.radius_90 == 0.0
    trust = "" if by_hand else f"; {describe_trust(lighting)}; "
    sun = f"sun {format_azimuth(lighting.sun_azimuth, 1)}, {format_sun_elevation(lighting.sun_elevation, 1)}"
    tilt, roll = format_tilt(lighting.camera_elevation, 1), round(lighting.camera_roll, 1) + 0.0  # without -0.0
    return (
        f"{escape_path(name)}: {sun}{_format_radii(lighting)}{candidates and ', '}{candidates}{trust or ', '}"
        f"direct sunlight {100 * lighting.sun_visibility:.0f} %, turbidity {lighting.turbidity:.1f}; "
        f"camera looks {tilt}, roll {roll:.1f}°, "
        f"vertical field of view {lighting.vertical_fov:.1f}°{_format_headings(lighting)}"
        f"{_format_time(lighting)}{_format_evidence(lighting)}"
    )


def _format_radii(lighting: "Lighting") -> str:
    """The radii around the sun; a record that was written by hand may have none."""
    if lighting.radius_90 == 0.0:
        return ""
    return f" (50 % within {lighting.radius_50:.1f}°, 90 % within {lighting.radius_90:.1f}°)"


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
    from lighting.fields import format_utc_offset

    offset = timedelta(hours=lighting.utc_offset or 0.0)
    local = lighting.utc_time.astimezone(timezone(offset))
    source = f" ({lighting.time_source})" if lighting.time_source else ""
    return f"; taken {local:%Y-%m-%d %H:%M} {format_utc_offset(lighting.utc_offset or 0.0)}{source}"


def _format_evidence(lighting: "Lighting") -> str:
    return f"; from {', '.join(lighting.evidence)}" if len(lighting.evidence) > 1 else ""


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


def read_photo_bytes(name: str) -> bytes:
    """Read the file of a photo.

    Args:
        name: of the file; "-" is stdin.

    Raises:
        PhotoError: there is no stdin.
        PhotoTooLargeError: it has more bytes than a photo may.
        OSError: it cannot be read.
    """
    from lighting.photo.reader import read_bytes

    if name == "-":
        return read_bytes(_stdin())
    if not name:
        raise _no_name()
    check_photo_file(name)
    return read_bytes(Path(name))


def read_photo_file(name: str, target: int | None = None) -> "Photo":
    """Read the photo in a file; raises as `read_photo_bytes`, and PhotoError for what is no photo.

    Args:
        name: of the file, beside which sidecars may lie; "-" is stdin.
        target: pixels of its longer side to keep; None keeps what the network needs.
    """
    import lighting.photo.reader as reader

    data = read_photo_bytes(name)
    return reader.read_photo(data, target=target or reader.TARGET, path=path_of(name))


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


def path_of(name: str) -> str | None:
    """Return the path of a photo, beside which sidecars may lie; None for stdin.

    Args:
        name: of the file; "-" is stdin.
    """
    return None if name == "-" else name


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
    from lighting.records import MAX_RECORD_BYTES

    with _open_input(name) as stream:
        return parse_lighting(stream.read(MAX_RECORD_BYTES + 1), name)


def parse_lighting(data: bytes, name: str) -> "Lighting":
    """Read a record as `read_lighting` does.

    Args:
        data: what the file holds.
        name: of the file, for errors.
    """
    from lighting.records import MAX_RECORD_BYTES, Lighting, reject_duplicate_keys, unwrap_record

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


def write_bytes(output: str, data: bytes) -> None:
    """Write a file that is whole or not at all.

    Args:
        output: its name; "-" is stdout.
        data: what it holds.
    """
    if output == "-":
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
    else:
        with atomic_write(output) as path:
            path.write_bytes(data)


# Outputs.


@dataclass(frozen=True, eq=False, repr=False)
class OutputKind:
    """What a command writes of one source."""

    ending: str
    """Behind the source's name without its suffix."""
    suffixes: tuple[str, ...]
    """That a name may end in."""
    names: str
    """The same in words."""

    def beside(self, source: str) -> Path:
        """Return the default: beside the source.

        Args:
            source: the file that is read.
        """
        return Path(source).parent / self.within(source)

    def within(self, source: str) -> str:
        """Return the name in a folder.

        Args:
            source: the file that is read; "-" is stdin.
        """
        return ("stdin" if source == "-" else Path(source).stem) + self.ending


_MAP_SUFFIXES = tuple(f".{name}" for name in MAP_FORMATS)
MAPS = OutputKind(".exr", _MAP_SUFFIXES, join_words(_MAP_SUFFIXES))
PREVIEWS = OutputKind("-preview.png", (".png",), ".png")


def check_stdin(photos: Sequence[str]) -> None:
    """Raise UsageError where stdin is read twice.

    Args:
        photos: names of files; "-" is stdin.
    """
    if photos.count("-") > 1:
        raise click.UsageError("Only one of the photos can be stdin.")


def check_json(as_json: bool, names: Sequence[str | None]) -> None:
    """Raise UsageError where JSON and a file both go to stdout.

    Args:
        as_json: whether JSON is wanted.
        names: of the files; "-" is stdout.
    """
    if as_json and "-" in names:
        raise click.UsageError("--json and the file would both go to stdout.")


def check_records(sources: Sequence[str], output: str | None, *, overwrite: bool) -> None:
    """Raise an error, before any work, where JSON about the sources could not be written to a file.

    Args:
        sources: the files that are read; "-" is stdin.
        output: the file's name; None where nothing is written.
        overwrite: whether it may be replaced.
    """
    if output is not None:
        check_file(output, RECORD_SUFFIXES if len(sources) == 1 else RECORD_SUFFIXES[1:])
        check_apart(sources, [output])
        check_absent([output], overwrite=overwrite)


def write_records(output: str, lines: Sequence[str], *, quiet: bool) -> None:
    """Write lines of JSON, and say so.

    Args:
        output: the file's name.
        lines: without their ends.
        quiet: say nothing.
    """
    write_bytes(output, "".join(f"{line}\n" for line in lines).encode())
    if not quiet:
        click.echo(f"Wrote {escape_path(output)}.")


def choose_files(sources: Sequence[str], output: str | None, kind: OutputKind, *, overwrite: bool) -> list[str]:
    """Return the file for each source, before any work: where it could not be written later, an error says so.

    Args:
        sources: the files that are read; "-" is stdin.
        output: what -o says: a file for one source, a folder for several, "-" for stdout; None: beside each source.
        kind: of output.
        overwrite: whether files that are there may be replaced.

    Raises:
        click.UsageError: the outputs are no such files.
        click.ClickException: a file is there.
    """
    check_stdin(sources)
    check_not_written(sources, output, kind.suffixes)
    if len(sources) == 1 and sources[0] and Path(sources[0]).is_dir():
        check_photo_file(sources[0])
    for name in sources:
        if name.lower().endswith(MAP_FILE_SUFFIXES):
            hint = f"try `lighting info {shlex.quote(name)}`"
            raise click.UsageError(f"{escape_path(name)} is a map, not a photo: {hint}.")
    folder = output is not None and output != "-" and (len(sources) > 1 or _is_folder(output))
    if folder:
        assert output is not None
        _check_folder(output, kind)
        names = [str(Path(output, kind.within(source))) for source in sources]
    elif output is None:
        names = [_default_file(source, kind) for source in sources]
    elif len(sources) > 1:
        raise click.UsageError("Several photos need a folder: -o FOLDER/.")
    else:
        names = [output]
    if not folder and output not in (None, "-") and not Path(str(output)).suffix:
        sentence = (
            f"There is no folder {output}. -o {output}/ makes it, and -o {output}{kind.suffixes[0]} writes a file."
        )
        raise click.BadParameter(sentence, param_hint=_HINT)
    for name, source in zip(names, sources, strict=True):
        if not folder and (output is not None or Path(source).exists()):
            check_file(name, kind.suffixes)
    check_apart(sources, names)
    if len(sources) == 1 and sources[0] not in ("", "-") and Path(names[0]).is_file():
        check_there(sources[0])  # whose error says more than that of an output that is there
    check_absent(names, overwrite=overwrite)
    return names


def check_not_written(sources: Sequence[str], output: str | None, suffixes: Sequence[str]) -> None:
    """Raise UsageError where the name of an output stands among the inputs.

    Args:
        sources: the files that are read.
        output: what -o says; None: nothing.
        suffixes: of outputs.
    """
    for name in sources if output is None and len(sources) > 1 else ():
        if name.lower().endswith(tuple(suffixes)) and (not Path(name).exists() or not name.lower().endswith(".png")):
            raise click.UsageError(f"To write {escape_path(name)}, type -o before its name.")


def _default_file(source: str, kind: OutputKind) -> str:
    if source == "-":
        raise click.UsageError("What is read from stdin needs an output: -o FILE, or -o - for stdout.")
    name = str(kind.beside(source))
    if is_same_file(name, source):
        raise click.UsageError(f"{escape_path(source)} would be replaced by its own result; choose another name by -o.")
    return name


def _check_folder(output: str, kind: OutputKind) -> None:
    if output.lower().endswith(kind.suffixes) and not _is_folder(output):
        raise click.UsageError(f"Several photos need a folder: -o FOLDER/, not {output}.")
    check_parent(output)


def check_parent(output: str) -> None:
    """Raise an error where no folder of this name is or can be made.

    Args:
        output: name of a folder for several outputs.
    """
    if Path(output).exists() and not Path(output).is_dir():
        raise click.UsageError(f"Several photos need a folder: -o FOLDER/, and {output} is a file.")
    parent = Path(output) if Path(output).is_dir() else Path(output).absolute().parent
    if not parent.is_dir():
        raise click.BadParameter(f"There is no folder {parent}.", param_hint=_HINT)
    if not os.access(parent, os.W_OK | os.X_OK):
        raise click.BadParameter(f"The folder {parent} cannot be written to.", param_hint=_HINT)


def check_file(name: str, suffixes: Sequence[str], option: str = _HINT) -> None:
    """Raise BadParameter for an output that could not be written later.

    Args:
        name: of the file; "-" is stdout.
        suffixes: that it may end in.
        option: that names it.
    """
    if sentence := _file_error(name, suffixes):
        raise click.BadParameter(sentence, param_hint=option)


def _file_error(name: str, suffixes: Sequence[str]) -> str | None:
    path = Path(name)
    if name == "-":
        if not sys.stdout.writable():
            return "There is no stdout to write to, it is closed."
        return "Binary data needs a file or a pipe, not a terminal." if sys.stdout.isatty() else None
    if path.is_dir():
        return f"{name} is a folder."
    if path.exists() and not path.is_file():
        return f"{name} is a pipe or a device, not a file."
    if path.suffix.lower() not in suffixes:
        return f"{name} must end in {join_words(suffixes)}."
    folder = Path(os.path.realpath(name)).parent if path.is_symlink() else path.parent
    if not folder.is_dir():
        return f"There is no folder {folder}."
    return None if os.access(folder, os.W_OK) else f"The folder {folder} cannot be written to."


def _is_folder(name: str) -> bool:
    """Tell whether a name is that of a folder, which may not be there yet.

    Args:
        name: as the user typed it.
    """
    return name.endswith(("/", os.sep)) or Path(name).is_dir()


def check_apart(sources: Sequence[str], outputs: Sequence[str | None]) -> None:
    """Raise UsageError where an output would replace an input or another output.

    Args:
        sources: the files that are read; "-" is stdin.
        outputs: files that are written, "-" is stdout; None where not.
    """
    written = [name for name in outputs if name is not None and name != "-"]
    read = [name for name in sources if name != "-"]
    if outputs.count("-") > 1 or any(is_same_file(*pair) for pair in product(written, read)):
        raise click.UsageError("The input and the outputs must be different files.")
    for one, other in combinations(written, 2):
        if is_same_file(one, other):
            raise click.UsageError(f"Two outputs would be one file, {escape_path(one)}; write them apart.")


def is_same_file(one: str, other: str) -> bool:
    """Tell whether two names are of one file, also where links or a disk that knows no case hide it.

    Args:
        one: a name.
        other: another one.
    """
    if os.path.realpath(one) == os.path.realpath(other):
        return True
    return Path(one).exists() and Path(other).exists() and Path(one).samefile(other)


def check_absent(names: Sequence[str | None], *, overwrite: bool) -> None:
    """Raise ClickException for a file that is there.

    Args:
        names: of files that are to be written; "-" is stdout; None where not.
        overwrite: whether they may be replaced.
    """
    for name in () if overwrite else names:
        if name is not None and name != "-" and Path(name).is_file():
            raise click.ClickException(f"{escape_path(name)} is there already; --overwrite replaces it.")


def choose_folder(source: str, output: str | None, ending: str) -> str:
    """Return the folder for results: what -o says, else one beside the source.

    Args:
        source: the file or folder that is read; "-" is stdin.
        output: what -o says; None: not stated.
        ending: behind the source's name without its suffix.
    """
    if output is not None:
        return output
    if source == "-":
        raise click.UsageError("What is read from stdin needs an output: -o FOLDER.")
    return str(Path(source).parent / f"{Path(source).stem}{ending}")


def open_command(name: str) -> str | None:
    """Say how to open a file that a command wrote; None where this machine has no program for it.

    Args:
        name: of the file.
    """
    if name.lower().endswith(MAP_FILE_SUFFIXES):
        return "as Blender's World texture, or in any program that reads HDR pictures"
    program = {"darwin": "open", "win32": "start"}.get(sys.platform) or shutil.which("xdg-open")
    return program and f"{Path(program).name} {shlex.quote(name)}"


def report_written(
    names: Sequence[str],
    how_to_open: Callable[[str], str | None] = open_command,
    *,
    quiet: bool = False,
    err: bool = False,
) -> None:
    """Print the last line: what was written, and how to open it; of several files, the first that people look at.

    Args:
        names: of files or folders; "-" is stdout, about which nothing is printed.
        how_to_open: of one of them; None where nothing is to be said of it.
        quiet: print nothing.
        err: print on stderr, where a command's words go there.
    """
    if quiet or not names or "-" in names or not sys.stdout.writable():
        return
    first, *others = (escape_path(name) + "/" * (_is_folder(name) and not name.endswith("/")) for name in names)
    shown = f"{first} and {len(others)} more" if len(others) > 1 else " and ".join([first, *others])
    chosen = next((name for name in names if not name.lower().endswith(MAP_FILE_SUFFIXES)), names[0])
    it, how = escape_path(Path(chosen).name) if others else "it", how_to_open(chosen)
    click.echo(f"Wrote {shown}." + (f" Open {it}: {escape_control_chars(how)}" if how else ""), err=err)
