"""The camera's elevation and roll by pixels and metadata together."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lighting.decoding import lighting_from
from lighting.evidence import Given, camera_evidence, estimate_of, fuse, fuse_photo, known
from lighting.evidence.fusion import Evidence, stand
from lighting.evidence.gravity import CAMERA_SPREAD, Gravity, contrary, held, tilt_spread
from lighting.evidence.together import fuse_together
from lighting.geometry import Pinhole, angle_between, camera_pixel, direction
from lighting.photo import PhotoFacts
from lighting.records import Prediction, warning_code
from tests.lighting.evidence.test_fusion import UNIFORM, lobe, prediction

PHONE = PhotoFacts(
    camera_elevation=-6.0, camera_roll=5.0, gravity_source="accelerometer", gravity_spread=1.0, vertical_fov=53.0
)


def said(elevation: float = 4.0, roll: float = -1.0) -> Prediction:
    return replace(prediction(UNIFORM), camera_elevation=elevation, camera_roll=roll)


def apart(above: float, aside: float = 0.0) -> str | None:
    return contrary(said(), Gravity(4.0 + above, -1.0 + aside, 1.0))


def test_both_are_weighted_by_their_errors() -> None:
    both = held(said(10.0, 6.0), Gravity(0.0, 0.0, 1.0))
    assert both == pytest.approx((10.0 * 1.0 / (1.0 + 3.5**2), 6.0 * 1.0 / (1.0 + 2.0**2)))
    assert held(said(10.0, 6.0), Gravity(0.0, None, 1.0)) == (both[0], 6.0)
    assert held(said(10.0, 6.0), Gravity(0.0, 0.0, 3.5))[0] == pytest.approx(5.0)
    assert held(said(0.0, 179.0), Gravity(0.0, -179.0, 2.0))[1] == pytest.approx(180.0)
    assert tilt_spread(None) == CAMERA_SPREAD
    assert tilt_spread(Gravity(0.0, 0.0, 1.0)) == pytest.approx((1.0 + 3.5**-2.0) ** -0.5)


def test_a_steep_camera_has_no_roll_and_the_network_does_not_contradict_it() -> None:
    """It learnt elevations within 35 deg, and says as much as it can."""
    down = Gravity(-90.0, None, 1.0)
    assert contrary(said(-33.0, 8.0), down) is None
    elevation, roll = held(said(-33.0, 8.0), down)
    assert elevation == pytest.approx(-90.0, abs=0.5)
    assert roll == 0.0
    assert contrary(said(0.0), down) is not None
    assert held(said(-30.0), Gravity(-60.0, 20.0, 1.0)) == pytest.approx((-59.6, 15.8), abs=0.1)


@pytest.mark.parametrize(("above", "aside"), [(19.0, 0.0), (-19.0, 0.0), (0.0, 19.0), (13.0, 13.0)])
def test_what_chance_explains_is_no_contradiction(above: float, aside: float) -> None:
    assert apart(above, aside) is None


@pytest.mark.parametrize(("above", "aside"), [(21.0, 0.0), (-21.0, 0.0), (0.0, 91.0), (0.0, 180.0), (15.0, 15.0)])
def test_what_chance_does_not_explain_is_told_and_not_used(above: float, aside: float) -> None:
    gravity = Gravity(4.0 + above, -1.0 + aside, 1.0)
    pixels = said()
    stood = stand(pixels, Evidence(gravity=gravity))
    assert stood.prediction is pixels
    assert stood.evidence == Evidence()
    fused = fuse(said(), Evidence(gravity=gravity))
    assert fused.used == ("pixels",)
    assert "cropped, turned or edited" in fused.warnings[0]
    assert warning_code(fused.warnings[0]) == "gravity-contradicted"
    assert fused.prediction.camera_elevation == 4.0


def test_the_sentence_names_both() -> None:
    assert (apart(-40.0, 3.0) or "").startswith(
        "By its metadata the camera looks 36° down with a roll of 2°, by the pixels it looks 4° up with a roll of -1°:"
    )
    said_alone = contrary(said(), Gravity(-36.0, None, 1.0)) or ""
    assert "looks 36° down, by the pixels it looks 4° up:" in said_alone


def test_facts_become_evidence_and_the_record_says_so() -> None:
    found = known(PHONE, Given())
    assert found.evidence.gravity == camera_evidence(PHONE, Given()).gravity == Gravity(-6.0, 5.0, 1.0)
    light = estimate_of(fuse_photo(said(), found.evidence), found).lighting
    assert light.evidence == ("pixels", "focal length", "gravity")
    assert light.camera_elevation == pytest.approx(-5.2, abs=0.1)
    assert light.camera_roll == pytest.approx(3.8, abs=0.1)
    assert light.warnings == ()


def test_the_pixels_alone_where_metadata_are_not_to_be_used() -> None:
    found = known(PHONE, Given(use_exif=False))
    assert found.evidence.gravity is camera_evidence(PHONE, Given(use_exif=False)).gravity is None
    assert estimate_of(fuse_photo(said(), found.evidence), found).lighting == lighting_from(said())


def test_a_sun_outside_the_picture_stays_where_it_is() -> None:
    behind = lobe(150.0, 30.0, 300.0)
    fused = fuse_photo(behind, Evidence(gravity=Gravity(-10.0, 5.0, 1.0)))
    assert fused.sun == fuse(behind, Evidence()).sun
    assert fused.prediction.camera_elevation < -8.0


@pytest.mark.parametrize("sun", [(20.0, 15.0), (-15.0, 20.0), (0.0, 8.0)])
@pytest.mark.parametrize("gravity", [Gravity(-7.0, 9.0, 0.5), Gravity(14.0, None, 1.0)])
def test_a_sun_in_the_picture_keeps_its_pixel(sun: tuple[float, float], gravity: Gravity) -> None:
    shows = lobe(*sun, 300.0)

    def pixel(camera: Prediction, azimuth: float, elevation: float) -> Any:
        seen_by = Pinhole(400, 300, 50.0, 0.0, camera.camera_elevation, camera.camera_roll)
        return camera_pixel(direction(azimuth, elevation), seen_by)

    fused = fuse_photo(shows, Evidence(gravity=gravity))
    after = pixel(fused.prediction, fused.sun.azimuth, max(fused.sun.elevation, 0.1))
    there = pixel(shows, *sun)
    if sun[1] + fused.prediction.camera_elevation - shows.camera_elevation > 4.0:  # else the horizon holds it
        assert np.hypot(*(after - there)) < 12
    assert angle_between(direction(*sun), direction(fused.sun.azimuth, fused.sun.elevation)) > 3.0
    assert fused.probability.sum() == pytest.approx(1.0, abs=1e-5)


def test_gravity_leaves_the_ephemeris_little_to_tilt() -> None:
    shows = lobe(0.0, 15.0, 300.0)
    free, stated = (
        fuse_photo(shows, Evidence(((9.0, 200.0),), gravity=gravity))
        for gravity in (None, Gravity(shows.camera_elevation, shows.camera_roll, 1.0))
    )
    assert free.prediction.camera_elevation < shows.camera_elevation - 4.0
    assert shows.camera_elevation - 2.0 < stated.prediction.camera_elevation < shows.camera_elevation


def test_photos_together_use_it_each() -> None:
    evidence = [Evidence(gravity=Gravity(-6.0, 5.0, 1.0)), Evidence(), Evidence(gravity=Gravity(4.0, 90.0, 1.0))]
    answers = fuse_together([said()] * 3, evidence, [0.0, 30.0, 60.0])
    assert ["gravity" in a.used for a in answers] == [True, False, False]
    assert [round(a.prediction.camera_elevation, 1) for a in answers] == [-5.2, 4.0, 4.0]
    assert [len(a.warnings) for a in answers] == [0, 0, 1]
