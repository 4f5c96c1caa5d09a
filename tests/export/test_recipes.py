"""The scripts that made the networks: today's commands take each of their lines."""

import os
import shlex
import subprocess
from pathlib import Path

import click
import pytest

from export.__main__ import export_cli
from tests.helpers.pages import ROOT

RECIPES = sorted((ROOT / "export").glob("recipe_*.sh"))


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda path: path.stem)
def test_each_command_of_a_recipe_is_right_usage(recipe: Path, tmp_path: Path) -> None:
    """Parsed only, with a `python` that prints how it is called: to run them takes a day."""
    python = tmp_path / "python"
    python.write_text('#!/bin/sh\nprintf "%s\\n" "$*"\n', encoding="utf-8")
    python.chmod(0o755)
    done = subprocess.run(
        [recipe, "data", "network.onnx", "out.onnx"],
        cwd=tmp_path,
        env={"PATH": f"{tmp_path}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=True,
    )
    runs = set()
    for line in done.stdout.splitlines():
        module, name, *arguments = shlex.split(line.removeprefix("-m "))
        assert module == "export"
        with click.Context(export_cli) as parent:
            context = export_cli.commands[name].make_context(name, arguments, parent=parent)
        started = context.params.get("start")
        assert started is None or str(started) in runs, line
        runs.add(str(context.params.get("out") or f"runs/{context.params.get('network')}"))
    assert {"network.onnx", "out.onnx"} & runs  # the second or the third argument


def test_a_recipe_without_data_says_what_it_takes() -> None:
    done = subprocess.run([RECIPES[0]], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "Usage: " in done.stderr
