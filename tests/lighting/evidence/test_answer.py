"""All evidence as one answer."""

import math
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from lighting.evidence import Given
from lighting.evidence.answer import estimate_of
from lighting.evidence.fusion import fuse
from lighting.evidence.metadata import known
from lighting.evidence.together import fuse_together
from lighting.photo.exif import PhotoFacts
from lighting.records import Light, Lighting
from lighting.sun_grid import soft_label
from tests.conftest import TINY
from tests.lighting.evidence.samples import FACTS, answer, prediction

TROMSO_NOON: dict[str, Any] = {"latitude": 69.65, "longitude": 18.96, "time": datetime(2024, 12, 21, 11, 0, tzinfo=UTC)}


def test_the_answer_says_what_it_rests_on() -> None:
    assert answer().evidence == ("pixels", "time+place", "heading", "focal length")
    assert answer(use_exif=False).evidence == ("pixels",)
    assert answer(replace(FACTS, vertical_fov=None, heading=None)).evidence == ("pixels", "time+place")


def test_the_answer_holds_sun_lens_and_heading() -> None:
    light = answer()
    assert light.sun_elevation == pytest.approx(35.9, abs=0.2)
    assert light.vertical_fov == 53.0
    assert light.camera_heading == pytest.approx(60.0, abs=1.0)
    assert sum(light.camera_heading_probability) == pytest.approx(1.0, abs=1e-3)
    assert light.camera_heading_radius_50 is not None
    assert light.camera_heading_radius_90 is not None
    assert light.camera_heading_radius_50 < light.camera_heading_radius_90
    assert Lighting.from_dict(light.to_dict()) == light


def test_the_sun_is_a_compass() -> None:
    """With a sun seen 30 deg to the right, the camera points 30 deg left of the sun's compass azimuth."""
    found = known(replace(FACTS, heading=None), Given())
    elevation, azimuth = found.evidence.candidates[0]
    ahead = soft_label([math.sin(math.radians(30)), 0.6, -math.cos(math.radians(30))], 80.0, TINY.sun_grid)
    light = estimate_of(fuse(prediction(ahead), found.evidence), found).lighting
    assert light.camera_heading == pytest.approx(azimuth - light.sun_azimuth, abs=1.0)
    assert light.camera_heading == pytest.approx(azimuth - 30, abs=15.0)
    assert light.sun_elevation == pytest.approx(elevation, abs=0.1)


def test_the_suns_colour_follows_its_known_elevation() -> None:
    """Pixels that have it at 37 deg, a record of the hour in which it sets."""
    ahead = soft_label([0.0, 0.6, -0.8], 80.0, TINY.sun_grid)
    said = replace(prediction(ahead), light=Light(np.full(3, 2.0), np.ones(3), 0.0, 1.0))
    evening = known(replace(FACTS, utc_time=datetime(2024, 6, 1, 18, 30, tzinfo=UTC)), Given())
    alone, told = (estimate_of(fuse(said, k.evidence), k).lighting for k in (known(PhotoFacts(), Given()), evening))
    assert told.sun_elevation < 10
    assert alone.sun_irradiance is not None
    assert told.sun_irradiance is not None
    said_red, _, said_blue = alone.sun_irradiance
    assert said_red == pytest.approx(said_blue, rel=0.2)
    red, green, blue = told.sun_irradiance
    assert red > said_red > said_blue > blue
    assert red > green > blue
    assert told.sky_irradiance == alone.sky_irradiance


def test_photos_taken_together_keep_the_colour_of_one_low_sun() -> None:
    """One has it at 37 deg, the other at 8: both get the colour that the time asks of their common light."""
    evening = known(replace(FACTS, utc_time=datetime(2024, 6, 1, 18, 30, tzinfo=UTC)), Given())
    suns = [soft_label([0.0, math.sin(e), -math.cos(e)], 80.0, TINY.sun_grid) for e in np.radians([37.0, 8.0])]
    light = Light(np.full(3, 2.0), np.ones(3), 0.0, 1.0)
    said = [replace(prediction(sun), light=light) for sun in suns]
    fused = fuse_together(said, [evening.evidence] * 2, [0.0, 0.0])
    first, second = (estimate_of(f, evening).lighting.sun_irradiance for f in fused)
    assert first == second
    assert first is not None
    assert first[0] > 2.0 > first[2]


def test_the_place_is_told_only_if_asked_for() -> None:
    assert answer().latitude is None
    assert "place" not in answer().to_dict()
    assert "48.1" not in repr(known(FACTS, Given(keep_location=True)))
    kept = answer(keep_location=True)
    assert (kept.latitude, kept.longitude) == (48.14, 11.575)
    assert kept.to_dict()["place"] == {"latitude": 48.14, "longitude": 11.575}
    assert "48.1" not in repr(kept)


def test_no_direct_sunlight_in_twilight() -> None:
    light = answer(PhotoFacts(), **TROMSO_NOON)
    assert light.sun_visibility == 0.0
    assert light.sun_elevation == pytest.approx(0.0, abs=0.01)
    assert "twilight" in light.warnings[0]
