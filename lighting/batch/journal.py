"""The results of a batch: one line of JSON per finished photo, appended, so that a killed batch can be resumed."""

import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from lighting.errors import BatchError
from lighting.files import replacing

JOURNAL = "lighting.jsonl"


class Journal:
    """The names of the finished photos, and the open file to which their lines are appended."""

    def __init__(self, file: BinaryIO) -> None:
        """Truncates the file after its last whole line; a photo whose line was cut short counts as not done."""
        self.done: set[str] = set()
        self.failed = 0
        self._file = file
        kept = end = 0
        for record, line in _first(_whole_lines(file)):
            self._count(record["file"], "error" in record)
            kept += len(line)
            end = file.tell()
        file.truncate(end)
        self.ragged = kept < end  # whether there is something else between the lines

    def append(self, name: str, line: str, *, failed: bool) -> None:
        """Add a photo's line and flush it to the operating system, so that killing this process does not lose it."""
        self._file.write(line.encode() + b"\n")
        self._file.flush()
        self._count(name, failed)

    def clear(self) -> None:
        """Discard all lines."""
        self._file.truncate(0)
        self.done.clear()
        self.failed = 0

    def _count(self, name: str, failed: bool) -> None:
        self.done.add(name)
        self.failed += failed


@contextmanager
def open_journal(path: Path) -> Iterator[Journal]:
    """The journal in a file, which is created if it does not exist. Raises BatchError if another process holds it open.

    The lines of photos that failed are removed, so that these photos are tried again, and so is what is no line.
    """
    with path.open("a+b") as file:
        _lock(file, path)
        file.seek(0)
        journal = Journal(file)
        if not journal.failed and not journal.ragged:
            yield journal
            return
        with _without_failures(file, path) as rest:
            yield Journal(rest)


@contextmanager
def _without_failures(file: BinaryIO, path: Path) -> Iterator[BinaryIO]:
    """A locked file with the lines of photos that did not fail alone, which has replaced the first one."""
    file.seek(0)
    with ExitStack() as stack:
        with replacing(path) as temporary:
            rest = stack.enter_context(temporary.open("a+b"))
            _lock(rest, path)
            rest.writelines(line for _, line in _first(pair for pair in _whole_lines(file) if "error" not in pair[0]))
            rest.flush()
        rest.seek(0)
        yield rest


def has_lights(lines: Iterable[bytes]) -> bool:
    """Whether a photo that did not fail is among a journal's lines."""
    return any("error" not in record for record, _ in _whole_lines(lines))


def _whole_lines(lines: Iterable[bytes]) -> Iterator[tuple[dict[str, Any], bytes]]:
    """The records in whole lines, with these."""
    for line in lines:
        if (record := _record(line)) is not None:
            yield record, line


def _first(pairs: Iterable[tuple[dict[str, Any], bytes]]) -> Iterator[tuple[dict[str, Any], bytes]]:
    """Of records with their lines the first one of each photo."""
    seen: set[str] = set()
    for record, line in pairs:
        if record["file"] not in seen:
            seen.add(record["file"])
            yield record, line


def read_records(path: Path) -> Iterator[dict[str, Any]]:
    """The records of a journal, in the order in which the photos were finished."""
    with path.open("rb") as file:
        yield from map(json.loads, file)


def _record(line: bytes) -> dict[str, Any] | None:
    """The record in a line; None for an incomplete one."""
    try:
        record = json.loads(line)
    except ValueError:
        return None
    named = isinstance(record, dict) and isinstance(record.get("file"), str)
    return record if named and line.endswith(b"\n") else None


def _lock(file: BinaryIO, path: Path) -> None:
    if sys.platform == "win32":
        return
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise BatchError(f"Another batch is running in {path.parent}.") from error
