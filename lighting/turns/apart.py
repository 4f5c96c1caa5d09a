"""Where photos look, found in a process of its own, which ends with the answer or is killed.

Features and matches take seconds and hundreds of megabytes, of some photos far more, and nothing in Python interrupts
OpenCV. The process is a new one for each set, so that all it took is given back.
"""

import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from io import BytesIO
from time import monotonic
from typing import TYPE_CHECKING, BinaryIO

from lighting.errors import ErrorCode, LightingError, TurnsError
from lighting.processes import bound, ending_after, held, leave_signals, own_stdout, python
from lighting.turns.match import opencv
from lighting.turns.sets import Placed, Shot, View, place

if TYPE_CHECKING:
    from subprocess import Popen

SECONDS = 10.0  # for a set; eight photos that overlap take half of it on a free CPU
MEMORY = 400_000_000  # bytes beside those that the process has when it starts
PER_PHOTO = 2_000_000  # bytes of MAX_FEATURES features, and of their matches

CODE = "from lighting.turns.apart import main; main()"

_STEP = 0.1  # seconds after which whoever waits looks up


def nothing() -> None:
    """No reason to stop."""


def place_apart(
    views: Sequence[View], seconds: float = SECONDS, check: Callable[[], None] = nothing
) -> tuple[Placed, ...]:
    """Where each photo looks, as `place` finds it.

    `check` is called while the process works, and what it raises ends it. Raises TurnsError where the photos take
    longer than `seconds` or, on Linux, more memory than MEMORY and PER_PHOTO; and MissingExtraError without OpenCV.
    """
    request = _request(views, seconds)
    try:
        process = python(CODE)
    except OSError as error:
        raise TurnsError("The process that matches photos with each other does not start.") from error
    said = _told(process, request, seconds, check)
    if said is None:
        raise TurnsError(
            f"Matching the photos with each other takes longer than {seconds:g} seconds.", code=ErrorCode.TIMEOUT
        )
    try:
        answer: tuple[Placed, ...] | LightingError = pickle.loads(said)
    except (EOFError, pickle.UnpicklingError) as error:
        raise TurnsError("Matching the photos with each other needs too much memory, or ended its process.") from error
    if isinstance(answer, LightingError):
        raise answer
    return answer


def _request(views: Sequence[View], seconds: float) -> bytes:
    """What the process reads: the seconds after which nobody waits any more, the memory it may take, and the views."""
    request = BytesIO()
    for part in (seconds, MEMORY + PER_PHOTO * len(views), *views):
        pickle.dump(part, request, pickle.HIGHEST_PROTOCOL)
    return request.getvalue()


def _told(process: "Popen[bytes]", request: bytes, seconds: float, check: Callable[[], None]) -> bytes | None:
    """What the process says to the request; None where it does not say it in time."""
    until = monotonic() + seconds
    with ThreadPoolExecutor(1) as pool:
        said = pool.submit(process.communicate, request)
        try:
            while not said.done() and monotonic() < until:
                check()
                wait([said], _STEP)
            return said.result()[0] if said.done() else None
        finally:
            process.kill()  # which ends the talk, too


def main() -> None:
    """Answer the one request on stdin; the process ends with it, or a second after nobody waits for it any more."""
    leave_signals()
    requests, answers = sys.stdin.buffer, own_stdout()
    pickle.dump(_answer(requests), answers)
    answers.flush()


def _answer(requests: BinaryIO) -> tuple[Placed, ...] | LightingError:
    try:
        opencv().setNumThreads(1)
        seconds, memory = pickle.load(requests), pickle.load(requests)
        with ending_after(seconds):
            bound(held() + memory)
            return place(list(_shots(requests)))
    except LightingError as error:
        return error


def _shots(requests: BinaryIO) -> Iterator[Shot]:
    """The photos' features, one photo in memory at a time."""
    with suppress(EOFError):
        while True:
            yield pickle.load(requests).shot()
