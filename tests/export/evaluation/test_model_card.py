"""The model card and the pages' figures are those of metrics.json."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

import export.evaluation.model_card as model_card
from export.__main__ import export_cli
from export.data.panoramas import DataError
from export.evaluation.evaluate import Evaluation, Options
from export.evaluation.metrics_file import read_metrics
from lighting.model import METRICS, MODEL_CARD, packaged_model

FOLDER = packaged_model().parent
MOST_WORDS = 600


def test_the_card_is_that_of_the_figures_and_short() -> None:
    metrics, text = read_metrics(FOLDER / METRICS), (FOLDER / MODEL_CARD).read_text(encoding="utf-8")
    assert text == model_card.render_card(metrics)
    assert len(text.split()) <= MOST_WORDS
    assert len(re.findall(r"^\| --- ", text, re.MULTILINE)) == 1
    assert f"| sun | {metrics.accuracy['paper']['sun_median']} (" in text
    assert str(metrics.network["sha256"]) in text
    for heading in ("Model Details", "Uses", "Bias, Risks, and Limitations", "Training Details", "Evaluation"):
        assert f"\n## {heading}\n" in text


def test_the_pages_cite_the_figures_as_they_are() -> None:
    metrics = read_metrics(FOLDER / METRICS)
    for name in model_card.PAGES:
        page = model_card.ROOT / name
        if page.is_file():
            text = page.read_text(encoding="utf-8")
            assert model_card.fill_figures(text, metrics) == text, "run `python -m export card`"


def test_a_page_says_which_figures_it_cites() -> None:
    metrics = read_metrics(FOLDER / METRICS)
    page = "<!--metrics:line-->\nold\n<!--/metrics-->\n\nNot this.\n\n<!--metrics:table--><!--/metrics-->\n"
    text = model_card.fill_figures(page, metrics)
    assert f"within {metrics.accuracy['paper']['sun_median']}°" in text
    assert "old" not in text
    assert "Not this." in text
    assert text.count("| sun |") == 1
    assert model_card.fill_figures(text, metrics) == text
    with pytest.raises(DataError, match="no figures 'all', only line, scope, table"):
        model_card.fill_figures(page.replace("line", "all"), metrics)


def test_a_report_without_metadata_photos_and_other_networks_makes_a_card() -> None:
    metrics = read_metrics(FOLDER / METRICS)
    few = replace(metrics, sections=tuple(s for s in metrics.sections if s.title.startswith("Protocol")))
    text = model_card.render_card(few)
    assert "too high" in text
    assert "time and place |" not in text
    assert "ordinary photos the" not in text


def test_one_command_writes_the_figures_beside_a_network(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    metrics = read_metrics(FOLDER / METRICS)
    (tmp_path / "docs" / "images").mkdir(parents=True)
    (tmp_path / "reliability.png").write_bytes(b"curves")
    monkeypatch.setattr(model_card, "ROOT", tmp_path)
    monkeypatch.setattr(model_card, "check_rendered", lambda: "all")
    options = Options(data, data / "labels.csv", (tmp_path / "outdoor.onnx",), tmp_path)
    card = model_card.publish_evaluation(Evaluation("", replace(metrics, version="9.9.9")), options)
    written = read_metrics(tmp_path / METRICS)
    assert (written.version, written.sections) == ("9.9.9", metrics.sections)
    assert written.labels[1] == "Skies that the project renders: all"
    assert "# outdoor 9.9.9\n" in card.read_text(encoding="utf-8")
    assert (tmp_path / "docs" / "images" / "reliability.png").read_bytes() == b"curves"


def test_the_card_is_written_again_from_the_figures(tmp_path: Path) -> None:
    shutil.copy(FOLDER / METRICS, tmp_path)
    result = CliRunner().invoke(export_cli, ["card", "--folder", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert (tmp_path / MODEL_CARD).read_bytes() == (FOLDER / MODEL_CARD).read_bytes()
