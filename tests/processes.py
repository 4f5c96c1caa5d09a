"""Processes that tests watch, by what Linux says of them in /proc."""

import time
from pathlib import Path

PATIENCE = 10.0  # seconds


def ended(pid: int) -> bool:
    """Whether a process is gone, or only its status is left."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


def wait_until_ended(pid: int) -> None:
    """Wait for the end of a process; AssertionError where it goes on."""
    deadline = time.monotonic() + PATIENCE
    while not ended(pid):
        assert time.monotonic() < deadline, f"process {pid} goes on"
        time.sleep(0.02)
