"""The whole report, on rendered panoramas."""

from pathlib import Path

import numpy as np
import pytest

from export.crops.crops import crop_panorama, load_sources
from export.data.panoramas import DataError, read_index
from export.evaluation.evaluate import Options, evaluate_networks
from export.evaluation.predictions import (
    CROPS_EACH,
    SUN_VIEWS_EACH,
    collect_truth,
    decode_answers,
    load_models,
    predict_crops,
    protocol_views,
    sun_centered_views,
)
from lighting.geometry import wrap_azimuth
from lighting.model import Model
from tests.conftest import TINY, write_network


@pytest.mark.slow
def test_evaluation_reports_every_method_and_group(
    data: Path, trained_network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(evaluate_networks.__globals__, "light_report", lambda *_: "## Light")  # needs HDR panoramas
    options = Options(
        data, data / "labels.csv", (trained_network,), tmp_path, with_metadata=True, failures=True, relight=True
    )
    report = evaluate_networks(options)
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
    assert report.endswith("\n\n## Light\n")
    assert (tmp_path / "report.md").read_text() == report
    lines = (tmp_path / "crops-paper.csv").read_text().splitlines()
    assert len(lines) == 1 + 8 * len(read_index(data, "val"))


def test_networks_of_one_name_and_version_are_not_compared(tmp_path: Path) -> None:
    paths = [write_network(tmp_path / name) for name in ("a.onnx", "b.onnx")]
    with pytest.raises(DataError, match="Two networks are"):
        load_models(paths)


def test_cameras_go_around_evenly_and_are_the_same_every_time(data: Path) -> None:
    sources = load_sources(read_index(data, "val"), data / "labels.csv")
    views = protocol_views(sources, "phone")
    assert len(views) == CROPS_EACH * len(sources)
    azimuth = np.array([camera.azimuth for _, camera in views[:CROPS_EACH]])
    np.testing.assert_allclose(wrap_azimuth(np.diff(azimuth)), 360 / CROPS_EACH, atol=1e-9)
    assert protocol_views(sources[1:], "phone") == views[CROPS_EACH:]  # whatever other panoramas there are


def test_aimed_views_show_the_sun(data: Path) -> None:
    sources = load_sources(read_index(data), data / "labels.csv")
    views = sun_centered_views(sources)
    assert len(views) == SUN_VIEWS_EACH * sum(s.panorama.sun == "visible" for s in sources)
    crops = [crop_panorama(source, camera, TINY) for source, camera in views]
    truth = collect_truth([source.panorama for source, _ in views], crops)
    assert np.mean(truth.in_view == "sun in view") > 0.8  # a camera tilts by 35 deg at most: the highest suns stay out
    assert not any(camera.mirrored for _, camera in views)


def test_a_network_is_asked_about_every_view(data: Path, network: Path) -> None:
    sources = load_sources(read_index(data, "val"), data / "labels.csv")
    views = protocol_views(sources, "paper")
    truth, said = predict_crops(Model.load(network), views)
    assert len(said) == len(views) == len(truth.sun)
    found = decode_answers(said, truth.sun)
    known = np.isfinite(truth.sun[:, 0])
    assert (np.isfinite(found.nll) == known).all()
    np.testing.assert_allclose(np.linalg.norm(found.sun, axis=1), 1.0)
    assert found.radius_50 == pytest.approx([p for p in found.radius_50 if p >= 0])
    assert truth.scored[known].all()
