"""What libraries print on their own."""

import os
import sys

import pytest

from lighting.cli.silence import silence


def chatter(words: str) -> None:
    """Print as Python does, and as a library in C."""
    sys.stdout.write(words)
    os.write(2, words.encode())


def fail_silently() -> None:
    with silence():
        chatter("early")
        raise ValueError("failed")


def test_nothing_is_printed_until_the_end_even_of_a_failure(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="failed"):
        fail_silently()
    chatter("later")
    assert tuple(capfd.readouterr()) == ("later", "later")


def test_a_closed_stderr_stays_closed(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.stderr", None)
    with silence():
        chatter("to another file")
    assert tuple(capfd.readouterr()) == ("", "to another file")
