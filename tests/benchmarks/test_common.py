"""What the benchmarks share."""

from pathlib import Path

import pytest

from benchmarks.common import run_lighting


def test_a_command_that_fails_has_no_time(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="ended with status 1"):
        run_lighting("envmap", tmp_path / "absent.jpg")
