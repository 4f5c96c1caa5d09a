"""A stranger's machine: where it cannot be made, and what goes into it."""

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

from scripts.bare_debian import ADDRESS, HOME, main, run_commands


def test_where_no_system_can_be_made_one_line_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000, raising=False)
    monkeypatch.setattr("sys.argv", ["bare_debian", "trixie", str(tmp_path / "root"), str(tmp_path), "true"])
    main()
    assert capsys.readouterr().out == "skipped: no bare trixie can be made here: it needs root\n"
    assert not (tmp_path / "root").exists()


def test_commands_get_nothing_of_this_machine_and_the_first_failure_ends_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[list[str]] = []

    def run(argv: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        calls.append(argv)
        return subprocess.CompletedProcess(argv, len(calls) - 1)

    monkeypatch.setattr(subprocess, "run", run)
    assert run_commands(tmp_path, {"A": "1"}, ["first", "second", "third"]) == 1
    assert [argv[-1].split("; ") for argv in calls] == [
        [f"cd {HOME}", f"export ADDRESS={ADDRESS}", "first"],
        [f"cd {HOME}/lighting", f"export ADDRESS={ADDRESS}", "second"],
    ]
    for argv in calls:
        assert argv[:2] == ["chroot", "--userspec=1000:1000"]
        assert argv[argv.index("--ignore-environment") + 1] == "A=1"
