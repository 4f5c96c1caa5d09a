"""Where commands write: names by default, folders, what is never replaced unasked, and the line that says it.

One rule for all commands: a file that is there is not replaced without --overwrite, and "-" is stdout.
"""

import os
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from typing import Any

import click

from lighting.cli.console import escape_control_chars, escape_path
from lighting.files import MAP_FORMATS

_MAPS_OF_PROGRAMS = (".exr", ".hdr")  # which systems have no program for
_EMPTY_NAME = "the name of the file is empty."
_HINT = "'-o' / '--output'"  # how click names the option in an error
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


@dataclass(frozen=True)
class _OutputKind:
    """What a command writes of one source."""

    ending: str
    """Behind the source's name without its suffix."""
    suffixes: tuple[str, ...]
    """That a name may end in."""

    def beside(self, source: str) -> Path:
        """Return the default: beside the source.

        Args:
            source: the file that is read.
        """
        return Path(source).with_name(self.within(source))

    def within(self, source: str) -> str:
        """Return the name in a folder.

        Args:
            source: the file that is read; "-" is stdin.
        """
        return ("stdin" if source == "-" else Path(source).stem) + self.ending


MAPS = _OutputKind(".exr", tuple(f".{name}" for name in MAP_FORMATS))
PREVIEWS = _OutputKind("-preview.png", (".png",))

overwrite_option = click.option("--overwrite", is_flag=True, help="Replace files that are there.")


def file_output(kind: _OutputKind, *, several: bool = False) -> Decorator:
    """Add -o for a file, and --overwrite.

    Args:
        kind: of file.
        several: whether several sources go to a folder.
    """
    folder = ", or FOLDER/" if several else ""
    text = f'{join_words(kind.suffixes)}{folder}; "-" is stdout.  [default: {kind.ending} beside the input]'
    if kind is MAPS:
        text = f'{join_words(kind.suffixes)}{folder}; "-" is EXR on stdout.  [default: .exr beside the input]'
    option = click.option("-o", "--output", metavar="FILE", callback=check_file_name, help=text)
    return lambda command: option(overwrite_option(command))


def folder_output(default: str, text: str = "New or empty unless --overwrite.") -> Decorator:
    """Add -o for a folder, and --overwrite.

    Args:
        default: how the help names the default.
        text: what the help says.
    """
    option = click.option(
        "-o", "--output", metavar="FOLDER", callback=check_folder_name, help=f"{text}  [default: {default}]"
    )
    return lambda command: option(overwrite_option(command))


def check_folder_name(_ctx: click.Context, _param: click.Parameter, name: str | None) -> str | None:
    """Refuse what names no folder, as an empty variable of a shell, which would be the current one.

    Args:
        _ctx: of click.
        _param: of click.
        name: of the folder; None where not stated.
    """
    if name == "":
        raise click.BadParameter("the name of the folder is empty.")
    if name == "-":
        raise click.BadParameter("the results are a folder, which stdout cannot be.")
    return name


def check_file_name(_ctx: click.Context, _param: click.Parameter, name: str | None) -> str | None:
    """Refuse an empty name, as an empty variable of a shell is.

    Args:
        _ctx: of click.
        _param: of click.
        name: of the file; None where not stated.
    """
    if name == "":
        raise click.BadParameter(_EMPTY_NAME)
    return name


def choose_files(sources: Sequence[str], output: str | None, kind: _OutputKind, *, overwrite: bool) -> list[str]:
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
    for name, source in zip(names, sources, strict=True):
        if not folder and (output is not None or Path(source).exists()):
            check_file(name, kind.suffixes)
    check_apart(sources, names)
    check_absent(names, overwrite=overwrite)
    return names


def _default_file(source: str, kind: _OutputKind) -> str:
    if source == "-":
        raise click.UsageError("What is read from stdin needs an output: -o FILE, or -o - for stdout.")
    name = str(kind.beside(source))
    if is_same_file(name, source):
        raise click.UsageError(f"{escape_path(source)} would be replaced by its own result; choose another name by -o.")
    return name


def _check_folder(output: str, kind: _OutputKind) -> None:
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


def join_words(words: Sequence[str], link: str = "or") -> str:
    """Return words as a choice or a list: a, b or c.

    Args:
        words: one or more.
        link: before the last one.
    """
    return f" {link} ".join(filter(None, (", ".join(words[:-1]), words[-1])))


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
    return str(Path(source).with_name(Path(source).stem + ending))


def open_command(name: str) -> str:
    """Say how to open a file that a command wrote.

    Args:
        name: of the file.
    """
    if name.lower().endswith(_MAPS_OF_PROGRAMS):
        return "as Blender's World texture, or in any program that reads HDR pictures"
    program = {"darwin": "open", "win32": "start"}.get(sys.platform, "xdg-open")
    return f"{program} {shlex.quote(name)}"


def report_written(
    names: Sequence[str],
    how_to_open: Callable[[str], str] = open_command,
    *,
    quiet: bool = False,
    err: bool = False,
) -> None:
    """Print the last line: what was written, and how to open it; of several files, the first that people look at.

    Args:
        names: of files or folders; "-" is stdout, about which nothing is printed.
        how_to_open: of one of them.
        quiet: print nothing.
        err: print on stderr, where a command's words go there.
    """
    if quiet or not names or "-" in names or not sys.stdout.writable():
        return
    first, *others = (escape_path(name) + "/" * (_is_folder(name) and not name.endswith("/")) for name in names)
    shown = f"{first} and {len(others)} more" if len(others) > 1 else " and ".join([first, *others])
    chosen = next((name for name in names if not name.lower().endswith(_MAPS_OF_PROGRAMS)), names[0])
    it = escape_path(Path(chosen).name) if others else "it"
    click.echo(f"Wrote {shown}. Open {it}: {escape_control_chars(how_to_open(chosen))}", err=err)
