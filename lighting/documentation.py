"""Fields of records in what `help` prints: their docstrings, which Python itself keeps nowhere."""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from dataclasses import fields
from enum import Enum
from typing import Any, TypeVar

Record = TypeVar("Record")


class _RecordDoc:
    """A class's `__doc__` that lists the fields; the source is read when somebody asks for it."""

    def __init__(self, summary: str) -> None:
        self._summary = summary
        self._text: str | None = None

    def __get__(self, _instance: object, owner: type) -> str:
        if self._text is None:
            self._text = _list_fields(owner, inspect.cleandoc(self._summary))
        return self._text


def describe_fields(record: type[Record]) -> type[Record]:
    """Let `help` list the fields of a dataclass with their docstrings.

    Args:
        record: a dataclass; the decorator stands above `dataclass`.
    """
    record.__doc__ = _RecordDoc(record.__doc__ or "")  # type: ignore[assignment]  # Python asks it, as any descriptor
    return record


def field_docstrings(record: type) -> dict[str, str]:
    """Return the docstrings of a record's fields, by name, those of its bases too; none where there is no source.

    Args:
        record: a dataclass, or an enumeration, whose members count.
    """
    found: dict[str, str] = {}
    for owner in reversed(record.__mro__):
        found |= _own_docstrings(owner)
    names = record.__members__ if issubclass(record, Enum) else [field.name for field in fields(_as_dataclass(record))]
    return {name: found[name] for name in names if name in found}


def _as_dataclass(record: type) -> Any:
    return record


def _own_docstrings(owner: type) -> dict[str, str]:
    """The docstrings below the names of a class."""
    try:
        source = inspect.getsource(owner)
    except (OSError, TypeError):  # of a class that C defines, or a program without its sources
        return {}
    (definition,) = ast.parse(textwrap.dedent(source)).body
    return dict(_attribute_docstrings(definition)) if isinstance(definition, ast.ClassDef) else {}


def _attribute_docstrings(definition: ast.ClassDef) -> Iterator[tuple[str, str]]:
    for statement, below in zip(definition.body, definition.body[1:], strict=False):
        match statement, below:
            case ((ast.AnnAssign(ast.Name(name)) | ast.Assign([ast.Name(name)])), ast.Expr(ast.Constant(str(text)))):
                yield name, inspect.cleandoc(text)


def _list_fields(record: type, summary: str) -> str:
    lines = [f"    {name}: {text}" for name, text in field_docstrings(record).items()]
    return "\n".join([summary, "", "Fields:", *lines]) if lines else summary
