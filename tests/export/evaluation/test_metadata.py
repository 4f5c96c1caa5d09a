"""Tests of metadata."""

from datetime import UTC, timedelta

import numpy as np
import pytest

from export.evaluation.metadata import (
    OUTLIER_RATE,
    SUBSETS,
    _warning_shares,
    evidence_report,
    in_view_evidence,
    keep_evidence,
    simulate_metadata,
)
from export.evaluation.metrics import Truth
from export.evaluation.multi_view import CORRELATIONS, _correlation_report, _group_crops, groups_report
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.user_input import UserInput
from lighting.geometry import angles, direction, wrap_azimuth
from lighting.photo.metadata import PhotoMetadata
from lighting.prediction import Prediction
from lighting.solar_position import sun_position
from tests.helpers.panoramas import AZIMUTH, EACH, erring, truth_of
from tests.helpers.predictions import lobe_prediction


def seeing(truth: Truth, off: float = 0.0, concentration: float = 60.0) -> list[Prediction]:
    """Networks that put each sun `off` [deg] too high."""
    azimuth, elevation = angles(truth.sun)
    return [lobe_prediction(float(a), float(e) + off, concentration) for a, e in zip(azimuth, elevation, strict=True)]


def twice(said: list[Prediction]) -> list[tuple[Prediction, Prediction]]:
    """Networks that say the same of a camera whose lens is known."""
    return list(zip(said, said, strict=True))


def test_all_subsets_of_the_evidence_are_there() -> None:
    plain = {s for s in SUBSETS if "local time+place" not in s}
    assert len(plain) == len(SUBSETS) - 2 == 8
    assert max(plain, key=len) == ("time+place", "heading", "focal length")


def test_time_and_place_correct_an_elevation_that_is_too_high() -> None:
    truth = truth_of(2)
    report = evidence_report("paper", truth, twice(seeing(truth, off=12.0)), simulate_metadata(truth, EACH))
    rows = {cells[1].strip(): cells[2:] for line in report.splitlines() if len(cells := line.split("|")) > 5}
    columns = [name.strip() for name in rows[""]]
    elevation, heading = columns.index("elevation"), columns.index("heading")
    assert float(rows["pixels"][elevation]) == pytest.approx(12.0, abs=1.0)
    assert float(rows["pixels + time+place"][elevation]) == 0.0
    assert rows["pixels + heading"] == rows["pixels"]
    assert rows["pixels"][heading].strip() == "-"
    assert float(rows["pixels + time+place"][heading]) < 2.0
    assert "95 % interval" in report


def test_sharp_pixels_find_out_false_records_and_pass_true_ones() -> None:
    truth = truth_of(4)
    high = np.arange(len(truth.sun)) % (2 * EACH) < EACH
    truth.sun[high] = truth_of(4, 75.0).sun[high]
    shares = _warning_shares(truth, seeing(truth, concentration=300.0), simulate_metadata(truth, EACH))
    assert [row["true"] for row in shares.values()] == [0.0, 0.0, 0.0, 0.0]
    assert [row["false"] for row in shares.values()] == pytest.approx([100.0, 100.0, 100.0, 100.0], abs=10.0)


def test_a_seen_sun_moves_with_the_lens_only_where_the_picture_is_white() -> None:
    """The focal length is told; the network's own is 50 deg, the true one another."""
    truth = truth_of(2, 15.0)
    truth.sun[:] = direction(20.0, 15.0)
    truth.camera[:] = (2.0, 0.0, 65.0)
    said = twice([lobe_prediction(20.0, 15.0, 300.0)] * len(truth.sun))
    rows = {}
    for name, level in (("grey", 120), ("white", 255)):
        pictures = [np.full((300, 400, 3), level, np.uint8)] * len(said)
        table = in_view_evidence(truth, said, pictures)
        rows[name] = [float(line.split("|")[2]) for line in table.splitlines() if "focal length" in line]
    assert rows["grey"][0] < 1.0 < 3.0 < rows["white"][0]


def test_gravity_tells_the_camera_of_crops_that_show_the_sun() -> None:
    truth = truth_of(2, 15.0)
    truth.camera[:] = (9.0, 0.0, 50.0)  # the networks say 2 deg
    white = [np.full((300, 400, 3), 255, np.uint8)] * len(truth.sun)
    table = in_view_evidence(truth, twice([lobe_prediction(20.0, 15.0, 300.0)] * len(truth.sun)), white)
    tilt = {cells[1].strip(): float(cells[3]) for line in table.splitlines()[2:] if (cells := line.split("|"))}
    assert tilt["pixels"] > 4.0
    assert tilt["pixels + gravity"] < 2.0


@pytest.mark.parametrize("elevation", [0.5, 23.0, 71.0])
def test_the_ephemeris_puts_the_sun_where_it_was_asked_for(elevation: float) -> None:
    truth = truth_of(1, elevation)
    for simulated, sun in zip(simulate_metadata(truth, EACH), truth.sun, strict=True):
        seen = simulated.metadata
        assert seen.local_time is not None
        assert seen.utc_offset is not None
        utc = (seen.local_time - timedelta(hours=seen.utc_offset)).replace(tzinfo=UTC)
        assert seen.location is not None
        azimuth, height = sun_position(utc, *seen.location)
        assert float(height) == pytest.approx(elevation, abs=0.01)
        assert float(wrap_azimuth(float(azimuth) - simulated.heading - float(angles(sun)[0]))) == pytest.approx(
            0, abs=1e-6
        )


def test_evidence_of_the_metadata_is_the_panoramas_sun() -> None:
    truth = truth_of(2)
    for i, simulated in enumerate(simulate_metadata(truth, EACH)):
        ((elevation, compass),) = observations_from_metadata(
            keep_evidence(simulated.metadata, ("time+place",)), UserInput()
        ).observations.candidates
        assert elevation == pytest.approx(40.0, abs=0.01)
        relative = -np.arange(0, 360, 45.0)[i % EACH]
        assert float(wrap_azimuth(compass - simulated.heading - relative)) == pytest.approx(0.0, abs=1e-6)


def test_metadata_are_decided_by_name_and_index() -> None:
    assert simulate_metadata(truth_of(2), EACH) == simulate_metadata(truth_of(3), EACH)[: 2 * EACH]


def test_one_of_the_zones_without_offset_is_the_true_one() -> None:
    for simulated in simulate_metadata(truth_of(3), EACH)[::5]:
        candidates = observations_from_metadata(
            keep_evidence(simulated.metadata, ("local time+place",)), UserInput()
        ).observations.candidates
        assert min(abs(elevation - 40.0) for elevation, _ in candidates) < 0.01


@pytest.mark.slow
def test_compasses_err_as_measured() -> None:
    simulated = simulate_metadata(truth_of(25), EACH)
    error = [abs(float(wrap_azimuth((t.metadata.heading or 0.0) - t.heading))) for t in simulated if not t.gross]
    assert np.median(error) == pytest.approx(17.0, abs=3.0)
    assert np.mean([t.gross for t in simulated]) == pytest.approx(OUTLIER_RATE, abs=0.04)


def test_crops_without_a_sun_get_no_metadata() -> None:
    assert {t.metadata for t in simulate_metadata(truth_of(1, scored=False), EACH)} == {PhotoMetadata()}


def test_only_keeps_what_is_named() -> None:
    metadata = simulate_metadata(truth_of(1), EACH)[0].metadata
    assert keep_evidence(metadata, ()) == PhotoMetadata()
    assert keep_evidence(metadata, ("time+place", "heading", "focal length")) == metadata
    assert keep_evidence(metadata, ("heading",)).heading == metadata.heading
    assert keep_evidence(metadata, ("heading",)).latitude is None
    assert keep_evidence(metadata, ("focal length",)).vertical_fov == 50.0


@pytest.mark.slow
@pytest.mark.parametrize(("shared", "expected"), [(False, CORRELATIONS[0]), (True, 1.0)])
def test_the_correlation_of_errors_is_found(shared: bool, expected: float) -> None:
    truth = truth_of(8)
    report = _correlation_report(truth, erring(truth, shared), np.tile(AZIMUTH, 8), EACH)
    correlations = [float(cell) for cell in report.splitlines()[-1].split("|")[3:6]]
    assert correlations == pytest.approx([expected] * 3, abs=0.3)


@pytest.mark.parametrize("size", [1, 2, 4, 8])
def test_every_scored_crop_is_dealt_once_with_its_own_panorama(size: int) -> None:
    truth = truth_of(3)
    truth.scored[:EACH] = False
    groups = _group_crops(truth, EACH, size)
    assert sorted(np.concatenate(groups)) == list(range(EACH, 3 * EACH))
    assert all(len(g) == size and len({*truth.panorama[g]}) == 1 for g in groups)


@pytest.mark.slow
def test_more_views_find_the_sun_better() -> None:
    truth = truth_of(2)
    azimuth = np.tile(AZIMUTH, 2)
    report = groups_report("paper", truth, erring(truth, shared=False), simulate_metadata(truth, EACH), azimuth, EACH)
    rows = {cells[1].strip(): cells[2:] for line in report.splitlines() if len(cells := line.split("|")) > 5}
    error = {name: float(cells[1]) for name, cells in rows.items() if "headings" in name}
    assert error["8, headings known"] < error["2, headings known"]
    assert error["8, headings known, time+place"] < error["8, headings known"]
    assert float(rows["8, headings known, time+place"][2]) == 0.0
