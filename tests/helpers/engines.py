"""Programs in the chroot of scripts/engines.sh, for the tests that need Godot or Blender's newest."""

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.helpers.requirements import find

CHROOT = Path(find("engines") or "/nonexistent")


def needs_engines(test: Callable[..., None]) -> Callable[..., None]:
    """A slow test that is skipped where there is no such chroot.

    Args:
        test: that runs a program in it.
    """
    marked: Callable[..., None] = pytest.mark.needs("engines")(test)
    for mark in (pytest.mark.slow, pytest.mark.engines, pytest.mark.timeout(1800)):
        marked = mark(marked)
    return marked


@contextmanager
def folder_in_chroot() -> Iterator[Path]:
    """A folder that programs in the chroot can read and write, removed at the end."""
    path = Path(tempfile.mkdtemp(dir=CHROOT / "tmp"))
    try:
        yield path
    finally:
        shutil.rmtree(path)


def run_in_chroot(folder: Path, command: str, seconds: float = 900.0) -> str:
    """What a shell command prints, run in a folder of `folder_in_chroot`; an error where it fails.

    Args:
        folder: the working folder, as it is called out here.
        command: for bash in the chroot.
        seconds: that it may take.
    """
    inside = f"/{folder.relative_to(CHROOT)}"
    script = f"cd {inside}; export HOME={inside}; {command}"
    enter = 'mount -t proc proc "$0/proc" && exec chroot "$0" bash -euo pipefail -c "$1"'  # which Mono wants
    shell = ["unshare", "--mount", "bash", "-c", enter, str(CHROOT), script]
    result = subprocess.run(shell, capture_output=True, text=True, timeout=seconds, check=False)
    assert result.returncode == 0, (result.stdout + result.stderr)[-3000:]
    return result.stdout + result.stderr


PYTHON = find("blender") or ""


def needs_blender(test: Callable[..., None]) -> Callable[..., None]:
    """A test that is skipped where there is no such Python.

    Args:
        test: that runs it.
    """
    marked: Callable[..., None] = pytest.mark.blender(pytest.mark.needs("blender")(test))
    return marked
