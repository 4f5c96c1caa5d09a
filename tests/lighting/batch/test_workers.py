"""The pool of processes: every item once, whatever becomes of the processes."""

import os
import signal
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from lighting.batch.workers import _dismiss, _interrupts_held, _start, work_through
from lighting.errors import BatchError, ModelError

pytestmark = pytest.mark.slow

ITEMS = [f"item {number}" for number in range(20)]


def shout() -> Callable[[str], str]:
    return str.upper


def mortal(folder: Path) -> Callable[[str], str]:
    """Dies on "poison" always, on "accident" once, and raises on "error"."""

    def work(item: str) -> str:
        if item == "error":
            raise ModelError("It failed.")
        mark = folder / "accident"
        if item == "poison" or (item == "accident" and not mark.exists()):
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return item.upper()

    return work


def unable() -> Callable[[str], str]:
    raise ModelError("There is no network.")


def stillborn() -> Callable[[str], str]:
    os._exit(3)


def second_attempt(folder: Path) -> Callable[[str], str]:
    """The first process dies."""
    try:
        (folder / "started").touch(exist_ok=False)
    except FileExistsError:
        return str.upper
    os._exit(3)


def environment() -> Callable[[str], str]:
    return lambda name: f"{os.environ[name]} {os.getpid()}"


@pytest.mark.parametrize("workers", [1, 3])
def test_each_item_once(workers: int) -> None:
    results = list(work_through(ITEMS, shout, workers))
    assert sorted(results) == sorted((item, item.upper()) for item in ITEMS)


def test_nothing_to_do() -> None:
    assert list(work_through([], shout, 2)) == []


def test_an_item_that_lost_its_worker_is_tried_again(tmp_path: Path) -> None:
    items = [*ITEMS[:5], "accident", *ITEMS[5:]]
    results = list(work_through(items, partial(mortal, tmp_path), 2))
    assert sorted(results) == sorted((item, item.upper()) for item in items)


def test_an_item_that_always_loses_its_worker_yields_none(tmp_path: Path) -> None:
    results = list(work_through([*ITEMS, "poison"], partial(mortal, tmp_path), 2))
    assert sorted(item for item, _ in results) == sorted([*ITEMS, "poison"])
    assert [item for item, result in results if result is None] == ["poison"]


def test_an_exception_ends_everything(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="It failed"):
        list(work_through(["error", *ITEMS], partial(mortal, tmp_path), 2))


def test_an_exception_of_the_preparation_is_raised() -> None:
    with pytest.raises(ModelError, match="There is no network"):
        list(work_through(ITEMS, unable, 2))


@pytest.mark.parametrize("workers", [1, 2])
def test_one_worker_that_dies_as_it_starts_costs_nothing(tmp_path: Path, workers: int) -> None:
    found = dict(work_through(ITEMS, partial(second_attempt, tmp_path), workers))
    assert found == {item: item.upper() for item in ITEMS}


def test_workers_that_die_as_they_start_end_everything() -> None:
    with pytest.raises(BatchError, match="exit status 3"):
        list(work_through(ITEMS, stillborn, 1))


def test_a_worker_is_never_interrupted_even_while_it_starts() -> None:
    """The shell's Ctrl-C reaches all processes; one that imported its modules then printed a traceback."""
    worker = _start(shout)
    try:
        for _ in range(20):
            os.kill(worker.process.pid or 0, signal.SIGINT)
            time.sleep(0.02)
        assert worker.connection.recv() == "ready"
    finally:
        _dismiss([worker])
    assert worker.process.exitcode == 0


def test_workers_are_other_processes_with_one_thread_each() -> None:
    ((_, answer),) = work_through(["OMP_NUM_THREADS"], environment, 1)
    threads, pid = str(answer).split()
    assert threads == "1"
    assert int(pid) != os.getpid()


def test_a_process_that_starts_is_not_left_half_told() -> None:
    """Ctrl-C reached a thread of numpy's, cut the start short, and the new process printed a traceback."""
    leave, ended = threading.Event(), threading.Event()
    other = threading.Thread(target=leave.wait)

    def start() -> None:
        with _interrupts_held():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1.0)
            ended.set()

    other.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            start()
    finally:
        leave.set()
        other.join()
    assert ended.is_set()
