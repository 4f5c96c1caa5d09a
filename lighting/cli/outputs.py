"""What commands write: names, folders and checks of outputs, and the last line about them.

One rule for all commands: a file that is there is not replaced without --overwrite, and "-" is stdout.
"""

import os
import shlex
import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path

import click

from lighting.cli.console import check_photo_file, check_there, escape_control_chars, escape_path
from lighting.files import MAP_FILE_SUFFIXES, MAP_FORMATS, PREVIEW_ENDING, join_words, write_file

RECORD_SUFFIXES = (".json", ".jsonl")
_HINT = "'-o' / '--output'"  # how click names the option in an error


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
PREVIEWS = OutputKind(PREVIEW_ENDING, (".png",), ".png")


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
    if output is None:
        names = [_default_file(source, kind) for source in sources]
        checked = [name for name, source in zip(names, sources, strict=True) if Path(source).exists()]
    elif output != "-" and (len(sources) > 1 or _is_folder(output)):
        if output.lower().endswith(kind.suffixes) and not _is_folder(output):
            raise click.UsageError(f"Several photos need a folder: -o FOLDER/, not {output}.")
        check_parent(output)
        names, checked = [str(Path(output, kind.within(source))) for source in sources], []
    elif len(sources) > 1:
        raise click.UsageError("Several photos need a folder: -o FOLDER/.")
    elif output != "-" and not Path(output).suffix:
        hint = f"-o {output}/ makes it, and -o {output}{kind.suffixes[0]} writes a file."
        raise click.BadParameter(f"There is no folder {output}. {hint}", param_hint=_HINT)
    else:
        names = checked = [output]
    for name in checked:
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
        write_file(output, data)
