"""Work for the processes of a pool. They import this file, so it imports little."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

from lighting.errors import ModelError

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
