"""docs/learn/train.md, typed line by line with six places and 64 crops."""

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from export.__main__ import export_cli
from export.evaluation.metrics_file import read_metrics
from lighting.cli import cli
from scripts.book import ROOT, read_code_blocks

PAGE = ROOT / "docs" / "learn" / "train.md"
SMALL = {"places": "6", "rows": "64", "crops": "64"}  # in place of the page's numbers


def read_lines() -> list[str]:
    """The commands of the page, with small numbers."""
    blocks = read_code_blocks(PAGE.read_text(encoding="utf-8"))
    sizes, *commands = (line for block in blocks for line in block.text.replace("\\\n", " ").splitlines())
    assert dict(pair.split("=") for pair in sizes.split()).keys() == SMALL.keys()
    return [re.sub(r"\$(\w+)", lambda name: SMALL[name[1]], line) for line in commands]


@pytest.mark.slow
@pytest.mark.usefixtures("llvm")
def test_the_tutorial_ends_with_a_network_that_is_scored_and_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    lines = read_lines()
    for line in lines:
        program, *words = shlex.split(line.replace("python -m export", "export"))
        result = CliRunner().invoke({"export": export_cli, "lighting": cli}[program], words)
        assert result.exit_code == 0, (line, result.output, result.exception)
    assert lines[-1].startswith("lighting estimate")
    assert "examples/wide_street.jpg: sun " in result.output
    metrics = read_metrics(Path("runs/score/metrics.json"))
    assert (metrics.version, metrics.data["train"], metrics.data["val"]) == ("0.1.0", 5, 1)
    assert metrics.accuracy["paper"]["crops"] == 8
    assert metrics.figure("Protocol `paper`", "Sun [", "zenith", "median")
    assert Path("runs/score/reliability.png").read_bytes().startswith(b"\x89PNG")
