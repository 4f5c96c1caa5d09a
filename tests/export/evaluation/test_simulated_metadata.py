"""Simulated metadata: where and when, and what a phone's compass says."""

import numpy as np
import pytest

from export.evaluation.simulated_metadata import GROSS, only, sighting, take_metadata
from lighting.evidence import Given
from lighting.evidence.ephemeris import sun_position
from lighting.evidence.metadata import known
from lighting.geometry import wrap_azimuth
from lighting.photo.exif import PhotoFacts
from tests.export.evaluation.examples import EACH, truth_of


@pytest.mark.parametrize("elevation", [0.5, 23.0, 71.0])
def test_the_ephemeris_puts_the_sun_where_it_was_asked_for(elevation: float) -> None:
    seen = sighting(elevation, np.random.default_rng(3))
    azimuth, height = sun_position(seen.time, seen.latitude, seen.longitude)
    assert float(height) == pytest.approx(elevation, abs=0.01)
    assert float(azimuth) == pytest.approx(seen.compass, abs=1e-6)


def test_evidence_of_the_metadata_is_the_panoramas_sun() -> None:
    truth = truth_of(2)
    for i, taken in enumerate(take_metadata(truth, EACH)):
        ((elevation, compass),) = known(only(taken.facts, ("time+place",)), Given()).evidence.candidates
        assert elevation == pytest.approx(40.0, abs=0.01)
        relative = -np.arange(0, 360, 45.0)[i % EACH]
        assert float(wrap_azimuth(compass - taken.heading - relative)) == pytest.approx(0.0, abs=1e-6)


def test_metadata_are_decided_by_name_and_index() -> None:
    assert take_metadata(truth_of(2), EACH) == take_metadata(truth_of(3), EACH)[: 2 * EACH]


def test_one_of_the_zones_without_offset_is_the_true_one() -> None:
    for taken in take_metadata(truth_of(3), EACH)[::5]:
        candidates = known(only(taken.facts, ("local time+place",)), Given()).evidence.candidates
        assert len(candidates) > 1
        assert min(abs(elevation - 40.0) for elevation, _ in candidates) < 0.01


@pytest.mark.slow
def test_compasses_err_as_measured() -> None:
    taken = take_metadata(truth_of(25), EACH)
    error = [abs(float(wrap_azimuth((t.facts.heading or 0.0) - t.heading))) for t in taken if not t.gross]
    assert np.median(error) == pytest.approx(17.0, abs=3.0)
    assert np.mean([t.gross for t in taken]) == pytest.approx(GROSS, abs=0.04)


def test_crops_without_a_sun_get_no_metadata() -> None:
    assert {t.facts for t in take_metadata(truth_of(1, scored=False), EACH)} == {PhotoFacts()}


def test_only_keeps_what_is_named() -> None:
    facts = take_metadata(truth_of(1), EACH)[0].facts
    assert only(facts, ()) == PhotoFacts()
    assert only(facts, ("time+place", "heading", "focal length")) == facts
    assert only(facts, ("heading",)).heading == facts.heading
    assert only(facts, ("heading",)).latitude is None
    assert only(facts, ("focal length",)).vertical_fov == 50.0
