"""The pages of docs/reference/, from the code: `python -m scripts.reference`."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from enum import StrEnum
from inspect import cleandoc
from pathlib import Path
from typing import Any

import click
from annotated_types import Ge, Gt, Le

import lighting
import lighting.errors as errors
from lighting.cli import Command, Group, cli
from lighting.errors import ErrorCode, LightingError, WarningCode
from lighting.fields import field_docstrings
from lighting.files import FileOptions
from lighting.map_options import Adjustments
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import Photo, PhotoCrop
from lighting.prediction import SunDistribution
from lighting.records import LightProbe, MainLight
from lighting.scene.records import Scene
from scripts.markdown import WRITTEN, escape_marks, link_terms, write_table
from scripts.reference_http import write_http
from scripts.reference_python import write_python
from server import problems
from server.settings import PREFIX, Settings

FOLDER = Path(__file__).parents[1] / "docs" / "reference"
_RECORDS: tuple[Any, ...] = (
    *(
        lighting.Lighting,
        lighting.Estimate,
        SunDistribution,
        lighting.UserInput,
        lighting.MapOptions,
        Adjustments,
        FileOptions,
    ),
    *(Photo, PhotoCrop, PhotoMetadata, LightProbe, MainLight, Scene),
)
_ARRAY = re.compile(r"numpy\.ndarray\[.*?numpy\.dtype\[numpy\.(\w+)(?:\[typing\.Any\])?\]\]")  # any numpy's name of one
_NAMED_ARRAY = re.compile(r"NDArray\[numpy\.(\w+)(?:\[typing\.Any\])?\]")  # as NumPy 2.5 has it
_RANGE = re.compile(r"\bx[<>]|[<>]=?x\b")  # as click writes one
_BOUNDS = ((Ge, "ge", "at least"), (Gt, "gt", "over"), (Le, "le", "at most"))
_WIDTH = 10_000  # columns: nothing is wrapped


def write_command_line() -> str:
    """Return the page of commands: usage, options with defaults, and examples, as `--help` prints them."""
    context = click.Context(cli, info_name="lighting", terminal_width=_WIDTH, max_content_width=_WIDTH)
    commands = list(_walk(cli, context))
    index = [f"- [`{c.command_path}`](#{c.command_path.replace(' ', '-')}): {_short_help(c.command)}" for c in commands]
    head = [
        "# Command line",
        "",
        "What `--help` prints of every command. In a usage line `PHOTO...` is one or more; `[OUT]` may be left out.",
        WRITTEN,
        "",
        *index,
        "",
    ]
    return "\n".join([*head, *(line for c in commands for line in _command_section(c))])


def _short_help(command: click.Command) -> str:
    return escape_marks(command.get_short_help_str(_WIDTH))


def _walk(command: click.Command, context: click.Context) -> Iterator[click.Context]:
    """A command and the commands of a group, each by its context, without those that no help shows."""
    yield context
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            part = command.get_command(context, name)
            assert part is not None
            yield from _walk(part, click.Context(part, info_name=name, parent=context))


def _command_section(context: click.Context) -> Iterator[str]:
    command = context.command
    yield from (f"## {context.command_path}", "")
    yield from ("```", command.get_usage(context).removeprefix("Usage: "), "```", "")
    for paragraph in cleandoc(command.help or "").split("\n\n"):
        kept = paragraph.removeprefix("\b\n")  # whose lines click does not wrap
        yield from ([escape_marks(paragraph)] if kept == paragraph else ["```text", kept, "```"])
        yield ""
    command._help_option = None  # which click keeps by the names of the context that asked first
    for title, records in _option_sections(command, context).items():
        if title != "Options":
            yield from (f"**{title}**", "")
        yield from write_table(("option", "default", "meaning"), (_option_row(*record) for record in records))
    if isinstance(command, Command) and (old := _old_names(command)):
        yield from (f"Old names, until 0.4.0: {old}.", "")
    if isinstance(command, Command | Group) and command.examples:
        yield from ("```sh", *command.examples, "```", "")


def _option_sections(command: click.Command, context: click.Context) -> dict[str, list[tuple[str, str]]]:
    """The names and meanings of a command's options, by the title of their section in the help."""
    if isinstance(command, Command):
        return command.option_sections(context)
    options = [p for p in command.get_params(context) if isinstance(p, click.Option)]
    return {"Options": [record for option in options if (record := option.get_help_record(context))]}


def _option_row(names: str, text: str) -> tuple[str, str, str]:
    """The cells of an option, from the two columns of its help."""
    parts = re.split(r"(, | / )(?=-)", names)
    cell = "".join(part if number % 2 else f"`{part}`" for number, part in enumerate(parts))
    meaning, brackets = _split_brackets(text)
    notes = [note for bracket in brackets for note in bracket.split("; ")]
    others = [note for note in notes if note == "required" or _RANGE.search(note)]
    default = "; ".join(note.removeprefix("default: ") for note in notes if note not in others)
    return cell, default, " ".join([escape_marks(meaning), *(f"[{note}]" for note in others)]).strip()


def _split_brackets(text: str) -> tuple[str, list[str]]:
    """A help text without the brackets at its end, and what they hold."""
    found = re.search(r"(?:\s*\[[^\[\]]*\])+$", text)
    return (text[: found.start()], re.findall(r"\[(.*?)\]", found[0])) if found else (text, [])


def _old_names(command: Command) -> str:
    names = {name for option in command.params for name in option.opts}
    return ", ".join(f"`{old}` is `{new}`" for old, new in sorted(command.renamed.items()) if new in names)


def write_settings() -> str:
    """Return the page of the service's settings: variables, defaults, ranges and meanings."""
    rows = (
        (f"`{PREFIX}{name.upper()}`", _default(field.default), _range(field.metadata), field.description or "")
        for name, field in Settings.model_fields.items()
    )
    head = f"""# Settings of the service

Settings are environment variables. A wrong value stops the service at its start with one sentence. So does a variable
`{PREFIX}...` that is not in this list.
{WRITTEN}
"""
    return "\n".join([head, *write_table(("variable", "default", "range", "meaning"), rows)])


def _default(value: object) -> str:
    return "" if value in (None, "", ()) else f"`{value}`"


def _range(metadata: Sequence[Any]) -> str:
    """The bounds of a number, in words."""
    bounds = {type(bound): bound for bound in metadata}
    found = ((word, getattr(bounds[kind], name)) for kind, name, word in _BOUNDS if kind in bounds)
    return ", ".join(f"{word} {bound:.0f}" for word, bound in found)


def write_problems() -> str:
    """Return the page of the service's problems, by status."""
    head = f"""# Problems

Errors of the service are `application/problem+json` (RFC 9457). Read the end of `type`: it is one of these names, which
do not change.
{WRITTEN}
"""
    kinds = sorted(problems.KINDS, key=lambda kind: kind.status)
    rows = ((str(kind.status), f"`{kind.name}`", kind.title, kind.meaning) for kind in kinds)
    codes = [
        "## Codes",
        "",
        "A 422 has such a `code` for each field in `errors`. Exceptions of Python have it, too.",
        "",
    ]
    table = write_table(("status", "name", "title", "when"), rows)
    return "\n".join([head, *table, *codes, *_members(ErrorCode)])


def write_exceptions() -> str:
    """Return the page of the package's exceptions, and of the codes of errors and warnings."""
    head = f"""# Exceptions

What the Python package raises on purpose. All are in `lighting.errors`. Show `str(error)` to people: it is one
sentence. In programs read `error.code` and `error.field`: what is wrong, and with which parameter.
{WRITTEN}
"""
    rows = (
        (f"`{kind.__name__}`", _bases(kind), f"`{kind.default_code}`", _first_paragraph(kind)) for kind in _exceptions()
    )
    table = write_table(("exception", "is also", "code", "when"), rows)
    codes = ["## Codes of errors", "", *_members(ErrorCode)]
    warned = [
        "## Codes of warnings",
        "",
        "`lighting.errors.warning_code(warning)` tells it of each of `estimate.warnings`.",
        "",
    ]
    return "\n".join([head, *table, *codes, *warned, *_members(WarningCode)])


def _exceptions() -> list[type[LightingError]]:
    """The package's public errors, in the order of their definition."""
    found = [value for value in vars(errors).values() if isinstance(value, type) and issubclass(value, LightingError)]
    return [kind for kind in found if kind.__module__ == errors.__name__ and not kind.__name__.startswith("_")]


def _first_paragraph(kind: type) -> str:
    return escape_marks(cleandoc(kind.__doc__ or "").partition("\n\n")[0])


def _bases(kind: type) -> str:
    return ", ".join(f"`{base.__name__}`" for base in kind.__bases__)


def _members(codes: type[StrEnum]) -> list[str]:
    """The table of an enumeration's values."""
    told = field_docstrings(codes)
    return write_table(("code", "meaning"), ((f"`{code}`", escape_marks(told[code.name])) for code in codes))


def write_fields() -> str:
    """Return the page of records: a table of fields for each record of the public face."""
    head = f"""# Fields

What the records of the Python package hold, as `help` prints it.
{WRITTEN}
"""
    return "\n".join([head, *(line for record in _RECORDS for line in _record_section(record))])


def _record_section(record: Any) -> list[str]:
    told = field_docstrings(record)
    types = {field.name: field.type for field in fields(record)}
    rows = ((f"`{name}`", f"`{_type(types[name])}`", escape_marks(text)) for name, text in told.items())
    return [f"## {record.__name__}", "", *write_table(("field", "type", "meaning"), rows)]


def _type(content: Any) -> str:
    """A field's type as a reader writes it."""
    text = content.__name__ if isinstance(content, type) and "[" not in str(content) else str(content).strip("\"'")
    return _NAMED_ARRAY.sub(r"NDArray[\1]", _ARRAY.sub(r"NDArray[\1]", text))


def write_page(name: str) -> str:
    """Return a page of reference as it is stored, with links to the glossary.

    Args:
        name: one of PAGES.
    """
    return link_terms(PAGES[name](), "../words.md")


PAGES: dict[str, Callable[[], str]] = {
    "command-line.md": write_command_line,
    "exceptions.md": write_exceptions,
    "fields.md": write_fields,
    "http.md": write_http,
    "problems.md": write_problems,
    "python.md": write_python,
    "settings.md": write_settings,
}


if __name__ == "__main__":
    for name in PAGES:
        (FOLDER / name).write_text(write_page(name), encoding="utf-8")
