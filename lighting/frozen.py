"""The frozen dataclasses of this package, whose methods are few functions for all of them.

The standard library writes and compiles six functions for each frozen class. That takes .4 ms a class, and a command
defines a hundred. Here only `__init__` is written so.
"""

import dataclasses
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass"]

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
            return dataclasses.dataclass(record, eq=False, repr=False, **options)

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
