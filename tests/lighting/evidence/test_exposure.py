"""Daylight by the exposure that the camera noted."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from lighting.evidence import Given, estimate_of, fuse, fuse_together, known
from lighting.evidence.exposure import daylight_probability, too_dark
from lighting.photo import PhotoFacts
from lighting.records import Light, Lighting
from tests.lighting.evidence.samples import FACTS, prediction

SUITS = replace(prediction(), light=Light(np.ones(3), np.ones(3), 0.0, 0.99))
DARK = "The photo was exposed for a dark scene (EV 5.0 at ISO 100): night, indoors, or a dark filter on the lens."


def answered(facts: PhotoFacts, given: Given | None = None) -> Lighting:
    found = known(facts, given or Given())
    return estimate_of(fuse(SUITS, found.evidence), found).lighting


@pytest.mark.parametrize(
    ("exposure_value", "low", "high"),
    [(15.0, 0.99, 1.0), (12.0, 0.99, 1.0), (10.0, 0.95, 1.0), (8.0, 0.5, 0.5), (6.0, 0.0, 0.05), (-20.0, 0.0, 1e-9)],
)
def test_daylight_is_bright(exposure_value: float, low: float, high: float) -> None:
    assert low <= daylight_probability(exposure_value) <= high


def test_only_dark_scenes_are_told_of() -> None:
    assert too_dark(12.0, "photo") == ()
    assert too_dark(5.0, "photo") == (DARK,)


def test_a_photo_of_a_dark_scene_does_not_suit() -> None:
    light = answered(PhotoFacts(exposure_value=5.0))
    assert light.suitable == pytest.approx(0.99 * daylight_probability(5.0), rel=1e-5)
    assert light.warnings[0] == DARK
    assert "the answer may mean nothing" in light.warnings[1]
    assert light.evidence == ("pixels", "camera exposure")


def test_a_bright_one_suits_as_the_pixels_say() -> None:
    light = answered(PhotoFacts(exposure_value=14.0))
    assert light.suitable == pytest.approx(0.99, abs=1e-4)
    assert light.warnings == ()


def test_without_exif_the_exposure_does_not_count() -> None:
    light = answered(PhotoFacts(exposure_value=5.0), Given(use_exif=False))
    assert (light.suitable, light.warnings, light.evidence) == (0.99, (), ("pixels",))


def test_an_exposure_is_not_used_where_the_network_does_not_say_what_suits() -> None:
    found = known(PhotoFacts(exposure_value=5.0), Given())
    light = estimate_of(fuse(prediction(), found.evidence), found).lighting
    assert (light.suitable, light.warnings, light.evidence) == (None, (), ("pixels",))


def test_in_twilight_no_photo_suits() -> None:
    """The sun sets at 19:07 UTC."""
    light = answered(replace(FACTS, utc_time=datetime(2024, 6, 1, 19, 25, tzinfo=UTC)))
    assert light.suitable == 0.1
    assert "civil twilight" in light.warnings[0]


def test_each_of_several_photos_has_its_own_exposure() -> None:
    found = [known(PhotoFacts(exposure_value=value), Given()) for value in (14.0, 5.0)]
    fused = fuse_together([SUITS, SUITS], [k.evidence for k in found], [0.0, 0.0])
    bright, dark = (estimate_of(f, k).lighting for f, k in zip(fused, found, strict=True))
    assert bright.suitable == pytest.approx(0.99, abs=1e-4)
    assert dark.suitable == pytest.approx(0.99 * daylight_probability(5.0), rel=1e-5)
    assert dark.evidence == ("pixels", "camera exposure", "other photos")
