"""The frozen dataclasses of this package, whose methods are few functions for all of them.

The standard library writes and compiles six functions for each frozen class. That takes .4 ms a class, and a command
defines a hundred. Here only `__init__` is written so. Python keeps the docstrings of fields nowhere: `help` of a public
class lists them, by its source.
"""

import dataclasses
from enum import Enum
from itertools import pairwise
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass", "field_docstrings"]

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(*, frozen, **options):
        """Return a decorator that does what `dataclasses.dataclass` does.

        Args:
            frozen: True.
            options: as there; `eq` and `repr` are True by default.
        """
        assert frozen
        methods = {"__setattr__": _set_once, "__delattr__": _keep}
        if options.pop("eq", True):
            methods |= {"__eq__": _equal, "__hash__": _hash}
        if options.pop("repr", True):
            methods["__repr__"] = _describe

        def decorate(record):
            for name, method in methods.items():
                if name not in vars(record):
                    setattr(record, name, method)
            made = dataclasses.dataclass(record, eq=False, repr=False, **options)
            if not made.__name__.startswith("_"):
                made.__doc__ = _RecordDoc(made.__doc__ or "")
            return made

        return decorate


def _set_once(record: Any, name: str, value: object) -> None:
    """Set a field that `__init__` has not set yet."""
    if name in vars(record) or name not in record.__dataclass_fields__:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    object.__setattr__(record, name, value)


def _keep(_record: object, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


def _equal(record: Any, other: Any) -> bool:
    return _compared(record) == _compared(other) if type(record) is type(other) else NotImplemented


def _hash(record: Any) -> int:
    return hash(_compared(record))


def _compared(record: Any) -> tuple[object, ...]:
    return tuple(getattr(record, field.name) for field in dataclasses.fields(record) if field.compare)


@recursive_repr()
def _describe(record: Any) -> str:
    shown = (field.name for field in dataclasses.fields(record) if field.repr)
    return f"{type(record).__qualname__}({', '.join(f'{name}={getattr(record, name)!r}' for name in shown)})"


class _RecordDoc:
    """A class's `__doc__` that lists the fields; the source is read when somebody asks for it."""

    def __init__(self, summary: str) -> None:
        self._summary = summary
        self._text: str | None = None

    def __get__(self, _instance: object, owner: type) -> str:
        if self._text is None:
            from inspect import cleandoc

            self._text = _list_fields(owner, cleandoc(self._summary))
        return self._text


def field_docstrings(record: type) -> dict[str, str]:
    """Return the docstrings of a record's fields, by name, those of its bases too; none where there is no source.

    Args:
        record: a dataclass, or an enumeration, whose members count.
    """
    found: dict[str, str] = {}
    for owner in reversed(record.__mro__):
        found |= _own_docstrings(owner)
    kind: Any = record
    names = kind.__members__ if issubclass(record, Enum) else [field.name for field in dataclasses.fields(kind)]
    return {name: found[name] for name in names if name in found}


def _own_docstrings(owner: type) -> dict[str, str]:
    """The docstrings below the names of a class."""
    import ast
    import inspect
    from textwrap import dedent

    try:
        source = inspect.getsource(owner)
    except (OSError, TypeError):  # of a class that C defines, or a program without its sources
        return {}
    (definition,) = ast.parse(dedent(source)).body
    body = definition.body if isinstance(definition, ast.ClassDef) else []
    found: dict[str, str] = {}
    for statement, below in pairwise(body):
        match statement, below:
            case ((ast.AnnAssign(ast.Name(name)) | ast.Assign([ast.Name(name)])), ast.Expr(ast.Constant(str(text)))):
                found[name] = inspect.cleandoc(text)
    return found


def _list_fields(record: type, summary: str) -> str:
    lines = [f"    {name}: {text}" for name, text in field_docstrings(record).items()]
    return "\n".join([summary, "", "Fields:", *lines]) if lines else summary
