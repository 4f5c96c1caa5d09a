"""The model card and the pages' figures are those of metrics.json."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

import export.evaluation.model_card as model_card
from export.__main__ import export_cli
from export.data.panoramas import DataError
from export.evaluation.metrics_file import read_metrics, write_metrics
from lighting.model import METRICS, MODEL_CARD, network_sha256, packaged_model
from lighting.onnx_session import weights_path

FOLDER = packaged_model().parent
MOST_WORDS = 600


def test_the_card_is_that_of_the_figures_and_short() -> None:
    metrics, text = read_metrics(FOLDER / METRICS), (FOLDER / MODEL_CARD).read_text(encoding="utf-8")
    assert text == model_card._render_card(metrics)
    assert len(text.split()) <= MOST_WORDS
    assert len(re.findall(r"^\| --- ", text, re.MULTILINE)) == 1
    assert f"| sun | {metrics.accuracy['paper']['sun_median']} (" in text
    assert str(metrics.network["sha256"]) in text
    for heading in ("Model Details", "Uses", "Bias, Risks, and Limitations", "Training Details", "Evaluation"):
        assert f"\n## {heading}\n" in text


def test_the_figures_are_of_the_network_that_ships() -> None:
    assert read_metrics(FOLDER / METRICS).network["sha256"] == network_sha256(packaged_model())


def test_the_pages_cite_the_figures_as_they_are() -> None:
    metrics = read_metrics(FOLDER / METRICS)
    for name in model_card.PAGES:
        page = model_card.ROOT / name
        if page.is_file():
            text = page.read_text(encoding="utf-8")
            assert model_card._fill_figures(text, metrics) == text, "run `python -m export card`"


def test_a_page_says_which_figures_it_cites() -> None:
    metrics = read_metrics(FOLDER / METRICS)
    page = "<!--metrics:line-->\nold\n<!--/metrics-->\n\nNot this.\n\n<!--metrics:table--><!--/metrics-->\n"
    text = model_card._fill_figures(page, metrics)
    assert f"within {metrics.accuracy['paper']['sun_median']}°" in text
    assert "old" not in text
    assert "Not this." in text
    assert text.count("| sun |") == 1
    assert model_card._fill_figures(text, metrics) == text
    with pytest.raises(DataError, match="no figures 'all', only line, scope, scored"):
        model_card._fill_figures(page.replace("line", "all"), metrics)


def test_a_report_without_metadata_photos_and_other_networks_makes_a_card() -> None:
    metrics = read_metrics(FOLDER / METRICS)
    few = replace(metrics, sections=tuple(s for s in metrics.sections if s.title.startswith("Protocol")))
    text = model_card._render_card(few)
    assert "too high" in text
    assert "time and place |" not in text
    assert "single photos" not in text


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository of its own, with a copy of the network's graph; returns the network's folder."""
    folder = tmp_path / "package" / "lighting" / "data"
    folder.mkdir(parents=True)
    (tmp_path / "package" / "docs" / "images").mkdir(parents=True)
    for path in (packaged_model(), weights_path(packaged_model())):
        (folder / path.name).symlink_to(path)
    monkeypatch.setattr(model_card, "ROOT", tmp_path / "package")
    monkeypatch.setattr(model_card, "packaged_model", lambda: folder / packaged_model().name)
    return folder


def test_one_command_takes_an_evaluation_over(package: Path, tmp_path: Path) -> None:
    metrics = read_metrics(FOLDER / METRICS)
    facts = {**metrics.network, "sha256": network_sha256(packaged_model())}
    metrics = replace(metrics, date="2030-01-02", network=facts)
    write_metrics(metrics, tmp_path)
    (tmp_path / "reliability.png").write_bytes(b"curves")
    (model_card.ROOT / "README.md").write_text("<!--metrics:line-->\nold\n<!--/metrics-->\n", encoding="utf-8")
    result = CliRunner().invoke(export_cli, ["card", "--evaluation", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert read_metrics(package / METRICS) == metrics
    assert "2030-01-02" in (package / MODEL_CARD).read_text(encoding="utf-8")
    assert "(2030-01-02)" in (model_card.ROOT / "README.md").read_text(encoding="utf-8")
    assert (model_card.ROOT / model_card.RELIABILITY).read_bytes() == b"curves"
    model_card.publish_evaluation(tmp_path, ["Given suns: all"])
    assert read_metrics(package / METRICS).labels == ("Given suns: all",)


def test_the_evaluation_of_another_network_is_refused(package: Path, tmp_path: Path) -> None:
    metrics = read_metrics(FOLDER / METRICS)
    write_metrics(replace(metrics, network={**metrics.network, "sha256": "0", "file": "mine.onnx"}), tmp_path)
    with pytest.raises(DataError, match=r"is of mine\.onnx, not of"):
        model_card.publish_evaluation(tmp_path)
    assert not (package / METRICS).exists()
    result = CliRunner().invoke(
        export_cli, ["evaluate", "--data", str(tmp_path), "--model", str(tmp_path / "mine.onnx"), "--card"]
    )
    assert result.exit_code == 2
    assert "--card is for the network in the package" in result.output
