"""A batch's journal: whole lines count, what a kill leaves behind them does not."""

import json
from pathlib import Path

import pytest

from lighting.batch.journal import open_journal, read_records
from lighting.errors import BatchError

FAILED = json.dumps({"file": "c.jpg", "error": "No."})
LINES = [json.dumps({"file": name, "lighting": {}}) for name in ("a.jpg", "b/ä.jpg")]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "lighting.jsonl"


def fill(path: Path) -> bytes:
    with open_journal(path) as journal:
        journal.append("a.jpg", LINES[0], failed=False)
        journal.append("b/ä.jpg", LINES[1], failed=False)
    return path.read_bytes()


def test_lines_are_there_as_soon_as_they_are_appended(path: Path) -> None:
    with open_journal(path) as journal:
        journal.append("a.jpg", LINES[0], failed=False)
        assert path.read_text() == LINES[0] + "\n"
        assert journal.done == {"a.jpg"}


def test_what_is_done_is_known_again(path: Path) -> None:
    fill(path)
    with open_journal(path) as journal:
        journal.append("c.jpg", FAILED, failed=True)
        assert journal.done == {"a.jpg", "b/ä.jpg", "c.jpg"}
        assert journal.failed == 1
    assert [record["file"] for record in read_records(path)] == ["a.jpg", "b/ä.jpg", "c.jpg"]


def test_what_failed_is_forgotten_and_tried_again(path: Path) -> None:
    with open_journal(path) as journal:
        journal.append("c.jpg", FAILED, failed=True)
    whole = fill(path)
    assert whole == f"{LINES[0]}\n{LINES[1]}\n".encode()
    with open_journal(path) as journal:
        journal.append("c.jpg", FAILED, failed=True)
    with open_journal(path) as journal:
        assert (journal.done, journal.failed) == ({"a.jpg", "b/ä.jpg"}, 0)
        assert path.read_bytes() == whole
        with pytest.raises(BatchError, match="Another batch"), open_journal(path):
            pass
        journal.append("c.jpg", json.dumps({"file": "c.jpg", "lighting": {}}), failed=False)
    assert [record["file"] for record in read_records(path)] == ["a.jpg", "b/ä.jpg", "c.jpg"]
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_photo_that_failed_before_it_was_done_is_done(path: Path) -> None:
    """Such journals are put together by hand; the answer was thrown away with the failure."""
    done = json.dumps({"file": "c.jpg", "lighting": {}})
    path.write_text(f"{FAILED}\n{done}\n{LINES[0]}\n")
    with open_journal(path) as journal:
        assert (journal.done, journal.failed) == ({"c.jpg", "a.jpg"}, 0)
    assert path.read_text() == f"{done}\n{LINES[0]}\n"


def test_a_line_cut_anywhere_is_not_done(path: Path) -> None:
    whole = fill(path)
    first = len(LINES[0]) + 1
    for end in range(first, len(whole)):
        path.write_bytes(whole[:end])
        with open_journal(path) as journal:
            assert journal.done == {"a.jpg"}
            journal.append("b/ä.jpg", LINES[1], failed=False)
        assert path.read_bytes() == whole


@pytest.mark.parametrize(
    "tail", [b"\0" * 512, b"nonsense\n", b"[]\n", b'{"lighting": {}}\n', b'{"file": 3}\n', b"\xff\n"]
)
def test_a_damaged_tail_is_cut_off(path: Path, tail: bytes) -> None:
    whole = fill(path)
    path.write_bytes(whole + tail + whole)
    with open_journal(path) as journal:
        assert len(journal.done) == 2
    assert path.read_bytes() == whole


@pytest.mark.parametrize("damage", [b"\n", b"\0\0\n", b'{"file": "a.j\n', b"\xff\n"])
def test_what_stands_behind_a_damaged_line_is_not_lost(path: Path, damage: bytes) -> None:
    """A blank line from an editor, or a block of zeros after a power cut, cost all results behind it."""
    first, second = fill(path).splitlines(keepends=True)
    path.write_bytes(first + damage + second)
    with open_journal(path) as journal:
        assert journal.done == {"a.jpg", "b/ä.jpg"}
        assert path.read_bytes() == first + second
        journal.append("c.jpg", LINES[0].replace("a.jpg", "c.jpg"), failed=False)
    assert [record["file"] for record in read_records(path)] == ["a.jpg", "b/ä.jpg", "c.jpg"]


def test_clear_forgets_everything(path: Path) -> None:
    fill(path)
    with open_journal(path) as journal:
        journal.clear()
        assert (journal.done, journal.failed, path.read_bytes()) == (set(), 0, b"")
        journal.append("b/ä.jpg", LINES[1], failed=True)
    assert path.read_text() == LINES[1] + "\n"


def test_only_one_batch_at_a_time(path: Path) -> None:
    fill(path)
    with open_journal(path), pytest.raises(BatchError, match="Another batch"), open_journal(path):
        pass
    with open_journal(path) as journal:
        assert len(journal.done) == 2
