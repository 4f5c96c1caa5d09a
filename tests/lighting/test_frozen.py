"""Records behave as frozen dataclasses of the standard library do; one of these stands beside them."""

import copy
import dataclasses
import pickle
from typing import Any

import pytest

from lighting.frozen import dataclass


@dataclass(frozen=True)
class _Mark:
    """A record."""

    x: float
    """Column."""
    name: str = dataclasses.field(default="spot", repr=False)
    """Its name."""
    note: str = dataclasses.field(default="", compare=False)
    """For people."""
    parts: tuple[Any, ...] = dataclasses.field(default_factory=tuple)
    """Of it."""


@dataclasses.dataclass(frozen=True)
class _Twin:
    x: float
    name: str = dataclasses.field(default="spot", repr=False)
    note: str = dataclasses.field(default="", compare=False)
    parts: tuple[Any, ...] = dataclasses.field(default_factory=tuple)


@dataclass(frozen=True, eq=False)
class _Unequal:
    """A record that equals itself alone."""

    x: float
    """Column."""


@pytest.mark.parametrize("kind", [_Mark, _Twin])
def test_no_field_changes_and_none_is_added(kind: Any) -> None:
    mark = kind(1.0)
    for name in ("x", "note", "other"):
        with pytest.raises(dataclasses.FrozenInstanceError, match=f"cannot assign to field '{name}'"):
            setattr(mark, name, 2.0)
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot delete field 'x'"):
        del mark.x
    assert dataclasses.asdict(mark) == {"x": 1.0, "name": "spot", "note": "", "parts": ()}


def test_equality_and_hash_are_of_the_compared_fields() -> None:
    assert _Mark(1.0, note="a") == _Mark(1.0, note="b")
    assert _Mark(1.0) != _Mark(2.0)
    other: Any = _Twin(1.0)
    assert _Mark(1.0) != other
    assert hash(_Mark(1.0, note="a")) == hash(_Twin(1.0, note="b"))
    assert _Unequal(1.0) != _Unequal(1.0)


def test_text_has_the_shown_fields() -> None:
    assert repr(_Mark(1.0, parts=(_Mark(2.0),))) == "_Mark(x=1.0, note='', parts=(_Mark(x=2.0, note='', parts=()),))"
    parts: list[Any] = []
    parts.append(mark := _Mark(1.0, parts=(parts,)))
    assert repr(mark) == "_Mark(x=1.0, note='', parts=([...],))"


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda mark: pickle.loads(pickle.dumps(mark))])
def test_copies_are_equal_and_frozen(copied: Any) -> None:
    mark = copied(_Mark(1.0, parts=(2,)))
    assert mark == dataclasses.replace(_Mark(0.0, parts=(2,)), x=1.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        mark.x = 2.0
