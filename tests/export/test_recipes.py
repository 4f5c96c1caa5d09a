"""The scripts that made the networks: today's commands take each of their lines."""

import os
import re
import shlex
import subprocess
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from export.__main__ import export_cli
from export.evaluation.metrics_file import read_metrics
from lighting.cli import cli
from scripts.book import read_code_blocks
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


DOCS = ROOT / "docs"
SMALL = {"panoramas": "6", "rows": "64", "crops": "64"}  # in place of the tutorial's numbers
SMALLER = {
    "--surroundings": "--surroundings --crops 64 --batch 8",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A reader's clone, in which they work."""
    monkeypatch.chdir(tmp_path)
    for name in ("examples", "lighting"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def read_lines(page: str) -> list[str]:
    """The commands of a page's blocks that are marked as training."""
    blocks = read_code_blocks((DOCS / page).read_text(encoding="utf-8"))
    texts = [block.text for block in blocks if block.mark == "train"]
    assert texts
    return [line for text in texts for line in text.replace("\\\n", " ").splitlines()]


def type_line(line: str) -> str:
    """Run a command; returns what it prints."""
    program, *words = shlex.split(line.replace("python -m export", "export"))
    result = CliRunner().invoke({"export": export_cli, "lighting": cli}[program], words)
    assert result.exit_code == 0, (line, result.output, result.exception)
    return result.output


@pytest.mark.slow
@pytest.mark.training
def test_the_tutorial_ends_with_a_network_that_is_scored_and_answers(folder: Path) -> None:
    sizes, *lines = read_lines("learn/train.md")
    assert dict(pair.split("=") for pair in sizes.split()).keys() == SMALL.keys()
    printed = [type_line(re.sub(r"\$(\w+)", lambda name: SMALL[name[1]], line)) for line in lines]
    assert lines[-1].startswith("lighting estimate")
    assert "examples/wide_street.jpg: sun " in printed[-1]
    metrics = read_metrics(folder / "runs/score/metrics.json")
    assert (metrics.version, metrics.data["train"], metrics.data["val"]) == ("0.1.0", 4, 2)
    assert metrics.accuracy["paper"]["crops"] == 16
    assert metrics.figure("Protocol `paper`", "Sun [", "zenith", "median")
    assert (folder / "runs/score/reliability.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.training
def test_panoramas_of_ones_own_end_as_a_network_that_paints_a_map(folder: Path) -> None:
    """The panoramas in `DIR` are rendered ones."""
    type_line("python -m export synthesize --count 6 --height 64 --out DIR")
    (folder / "photo.jpg").write_bytes((ROOT / "examples" / "wide_street.jpg").read_bytes())
    lines = read_lines("do/your-own-panoramas.md")
    for long in SMALLER:
        assert any(long in line for line in lines)
    for line in lines:
        for long, short in SMALLER.items():
            line = line.replace(long, short)
        type_line(line)
    metrics = read_metrics(folder / "runs/evaluation/metrics.json")
    assert (metrics.data["train"], metrics.data["val"]) == (4, 2)
    assert (folder / "runs/evaluation/failures.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "photo.exr").read_bytes().startswith(b"\x76\x2f\x31\x01")
