"""The whole report, on rendered panoramas."""

from pathlib import Path

import pytest

from export.data.panoramas import read_index
from export.evaluation.evaluate import Options, evaluate_networks


@pytest.mark.slow
def test_evaluation_reports_every_method_and_group(
    data: Path, trained_network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("relight", "light_report"):  # which need HDR panoramas
        monkeypatch.setitem(evaluate_networks.__globals__, name, lambda *_, name=name: f"## By {name}")
    options = Options(
        data, data / "labels.csv", (trained_network,), tmp_path, with_metadata=True, failures=True, relight=True
    )
    evaluation = evaluate_networks(options)
    report = evaluation.report
    for part in ("`paper`", "`phone`", "| zenith |", "| random azimuth |", "| constant direction |"):
        assert part in report
    for part in ("## Metadata, protocol `phone`", "| pixels + time+place |", "| 8, headings unknown |", "| half A |"):
        assert part in report
    for part in (
        "in 90 % region",
        "## Reliability",
        "## Temperature",
        "## Turbidity, protocol `paper`",
        "## Where it fails",
        "## Sun in the picture: ",
    ):
        assert part in report
    for name in ("reliability.png", "failures.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "failures.csv").read_text().startswith("panorama,azimuth,error,")
    assert report.endswith("\n\n## By relight\n\n## By light_report\n")
    assert (tmp_path / "report.md").read_text() == report
    lines = (tmp_path / "crops-paper.csv").read_text().splitlines()
    assert len(lines) == 1 + 8 * len(read_index(data, "val"))
