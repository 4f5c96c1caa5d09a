"""Steps of long work, timed for who listens: photos decoded, networks run, maps rendered, files encoded.

A service makes spans of traces of them. Where nobody listens a step costs a microsecond and is not kept. Who listens is
known within one thread and its copied contexts. Steps of another process are sent over, and reported again.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from time import time_ns
from typing import NamedTuple

STEP_NAMES = frozenset({"decode", "network", "map", "encode"})


class Step(NamedTuple):
    """A step that is over."""

    name: str
    """One of STEP_NAMES."""
    start: int
    """Nanoseconds since 1970."""
    end: int
    """The same."""
    error: str = ""
    """The class of the error that ended it; empty if none did."""


StepListener = Callable[[Step], object]

_LISTENER: ContextVar[StepListener | None] = ContextVar("listener", default=None)


@contextmanager
def listen_to_steps(listener: StepListener) -> Iterator[None]:
    """Have all steps of the block reported.

    Args:
        listener: is called with each step when it is over, the inner one of two nested steps first.
    """
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


@contextmanager
def trace_step(name: str) -> Iterator[None]:
    """Time what is done in the block as one step.

    Args:
        name: one of STEP_NAMES.
    """
    if _LISTENER.get() is None:
        yield
        return
    start = time_ns()
    try:
        yield
    except BaseException as error:
        report_step(Step(name, start, time_ns(), type(error).__name__))
        raise
    report_step(Step(name, start, time_ns()))


def report_step(step: Step) -> None:
    """Tell who listens of a step, such as one of another process.

    Args:
        step: one that is over.
    """
    if (listener := _LISTENER.get()) is not None:
        listener(step)
