"""From pixels to a prediction, and from a posterior to an Estimate."""

import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.decoding import sun_from_prediction
from lighting.errors import warning_code
from lighting.estimator import Estimator
from lighting.fusion.estimate import _choose_lens, build_estimate, photo_temperature, refine_camera, screen_prediction
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.multi_view import fuse_views
from lighting.fusion.single_view import fuse
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, Pinhole, angle_between, camera_axes, camera_pixel, direction
from lighting.model import Model, preprocess
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import photo_from_array
from lighting.prediction import Light, Prediction
from lighting.records import Lighting
from lighting.sun_grid import soft_label
from tests.conftest import TINY
from tests.helpers.cameras import poles
from tests.helpers.predictions import METADATA, answer, clock, lobe_prediction, prediction

TROMSO_NOON: dict[str, Any] = {"latitude": 69.65, "longitude": 18.96, "time": datetime(2024, 12, 21, 11, 0, tzinfo=UTC)}


def test_the_answer_says_what_it_rests_on() -> None:
    assert answer().evidence == ("pixels", "time+place", "heading", "focal length")
    assert answer(metadata=False).evidence == ("pixels",)
    assert answer(replace(METADATA, vertical_fov=None, heading=None)).evidence == ("pixels", "time+place")


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
    found = observations_from_metadata(replace(METADATA, heading=None), UserInput())
    elevation, azimuth = found.observations.candidates[0]
    ahead = soft_label([math.sin(math.radians(30)), 0.6, -math.cos(math.radians(30))], 80.0, TINY.sun_grid)
    light = build_estimate(fuse(prediction(ahead), found.observations), found).lighting
    assert light.camera_heading == pytest.approx(azimuth - light.sun_azimuth, abs=1.0)
    assert light.camera_heading == pytest.approx(azimuth - 30, abs=15.0)
    assert light.sun_elevation == pytest.approx(elevation, abs=0.1)


def test_the_suns_colour_follows_its_known_elevation() -> None:
    """Pixels that have it at 37 deg, a record of the hour in which it sets."""
    ahead = soft_label([0.0, 0.6, -0.8], 80.0, TINY.sun_grid)
    predicted = replace(prediction(ahead), light=Light(np.full(3, 2.0), np.ones(3), 0.0, 1.0))
    evening = observations_from_metadata(
        replace(METADATA, local_time=clock(datetime(2024, 6, 1, 18, 30, tzinfo=UTC))), UserInput()
    )
    alone, told = (
        build_estimate(fuse(predicted, k.observations), k).lighting
        for k in (observations_from_metadata(PhotoMetadata(), UserInput()), evening)
    )
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
    """One has it at 37 deg, the other at 8: both get the color that the time asks of their common light."""
    evening = observations_from_metadata(
        replace(METADATA, local_time=clock(datetime(2024, 6, 1, 18, 30, tzinfo=UTC))), UserInput()
    )
    suns = [soft_label([0.0, math.sin(e), -math.cos(e)], 80.0, TINY.sun_grid) for e in np.radians([37.0, 8.0])]
    light = Light(np.full(3, 2.0), np.ones(3), 0.0, 1.0)
    predicted = [replace(prediction(sun), light=light) for sun in suns]
    fused = fuse_views(predicted, [evening.observations] * 2, [0.0, 0.0])
    first, second = (build_estimate(f, evening).lighting.sun_irradiance for f in fused)
    assert first == second
    assert first is not None
    assert first[0] > 2.0 > first[2]


def test_the_place_is_told_only_if_asked_for() -> None:
    assert answer().latitude is None
    assert "place" not in answer().to_dict()
    assert "48.1" not in repr(observations_from_metadata(METADATA, UserInput(keep_location=True)))
    kept = answer(keep_location=True)
    assert (kept.latitude, kept.longitude) == (48.14, 11.575)
    assert kept.to_dict()["place"] == {"latitude": 48.14, "longitude": 11.575}
    assert "48.1" not in repr(kept)


def test_no_direct_sunlight_in_twilight() -> None:
    light = answer(PhotoMetadata(), **TROMSO_NOON)
    assert light.sun_visibility == 0.0
    assert light.sun_elevation == pytest.approx(-3.1, abs=0.2)
    assert "twilight" in light.warnings[0]


SIZE = (400, 300)


def sunny(elevation: float, azimuth: float, sun: float) -> Prediction:
    """A camera that is predicted to look 4 deg too high, with a sure sun."""
    return replace(
        lobe_prediction(azimuth, sun, 300.0), camera_elevation=elevation + 4.0, camera_roll=0.0, vertical_fov=50.0
    )


def with_glare(predicted: Prediction, azimuth: float, sun: float) -> NDArray[np.uint8]:
    """Poles seen by a level camera, and a white disc where the predicted camera has the sun."""
    pixels = poles(0.0, 0.0, 50.0, SIZE)
    camera = Pinhole(*SIZE, 50.0, 0.0, predicted.camera_elevation, 0.0)
    x, y = camera_pixel(direction(azimuth, sun), camera)
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    pixels[np.hypot(rows - y, columns - x) < 16] = 255
    return pixels


@pytest.mark.parametrize("sun", [8.0, 14.0])
def test_a_sun_in_the_picture_stays_on_its_pixel_by_the_corrected_camera(sun: float) -> None:
    predicted = sunny(0.0, 10.0, sun)
    known = refine_camera(predicted, with_glare(predicted, 10.0, sun))
    assert known.camera_elevation == pytest.approx(0.0, abs=1.0)
    before = camera_axes(0.0, predicted.camera_elevation, predicted.camera_roll) @ direction(10.0, sun)
    after = camera_axes(0.0, known.camera_elevation, known.camera_roll) @ seen_sun(known)
    assert np.degrees(np.arccos(np.clip(before @ after, -1, 1))) < 1.5
    assert angle_between(seen_sun(known), direction(10.0, sun - 4.0)) < 1.5
    assert known.sun_probability.sum() == pytest.approx(1.0, abs=1e-4)


def test_a_sun_outside_the_picture_stays_where_it_is() -> None:
    predicted = sunny(0.0, 170.0, 40.0)
    known = refine_camera(predicted, poles(0.0, 0.0, 50.0, SIZE))
    assert known.camera_elevation == pytest.approx(0.0, abs=1.0)
    assert known.sun_probability is predicted.sun_probability


def test_a_network_s_answer_has_the_camera_by_the_straight_lines(network: Path) -> None:
    """And an empty frame keeps the network's own."""
    model = Model.load(network)
    photo = photo_from_array(poles(10.0, 0.0, 50.0, SIZE))
    alone = model.predict(preprocess(photo, model.spec))[0]
    known = Estimator(model).predict(photo)
    assert known.camera_elevation == refine_camera(alone, photo.pixels).camera_elevation != alone.camera_elevation
    empty = photo_from_array(np.full((60, 80, 3), 128, dtype=np.uint8))
    assert (
        Estimator(model).predict(empty).camera_elevation
        == model.predict(preprocess(empty, model.spec))[0].camera_elevation
    )


def test_a_lens_of_the_file_or_of_the_user_enters_the_camera(network: Path) -> None:
    """The user's counts where both are known, and the file's not where it is not to be used."""
    model = Model.load(network)
    plain = photo_from_array(poles(20.0, 0.0, 60.0, SIZE))
    stated = replace(plain, metadata=PhotoMetadata(vertical_fov=60.0))
    alone = model.predict(preprocess(plain, model.spec))[0]
    by_lens = {fov: refine_camera(alone, plain.pixels, fov).camera_elevation for fov in (None, 60.0, 45.0)}
    assert len(set(by_lens.values())) == 3
    assert Estimator(model).predict(stated).camera_elevation == by_lens[60.0]
    assert Estimator(model).predict(stated, UserInput(vertical_fov=45.0)).camera_elevation == by_lens[45.0]
    assert Estimator(model).predict(stated, UserInput(metadata=False)).camera_elevation == by_lens[None]


def test_a_photo_without_direct_sun_says_less_of_it_than_the_network() -> None:
    assert [photo_temperature(visibility) for visibility in (0.0, 0.45, 0.9, 1.0)] == pytest.approx(
        [2.0, 1.5, 1.0, 1.0]
    )
    photo = np.random.default_rng(0).integers(60, 190, (240, 320, 3), dtype=np.uint8)
    hidden, clear = (replace(sunny(0.0, 40.0, 30.0), sun_visibility=visibility) for visibility in (0.2, 0.95))
    shade, sun = (sun_from_prediction(screen_prediction(one, photo)) for one in (hidden, clear))
    assert sun.radius_90 == sun_from_prediction(clear).radius_90
    assert shade.radius_50 > 1.2 * sun.radius_50
    assert shade.radius_90 > 1.2 * sun.radius_90
    assert angle_between(direction(shade.azimuth, shade.elevation), direction(sun.azimuth, sun.elevation)) < 3.0


def seen_sun(predicted: Prediction) -> Floats:
    return predicted.sun_direction


def lens(*fovs: float, is_consistent: bool = True) -> PhotoMetadata:
    return PhotoMetadata(
        focal_length=26.0, vertical_fov=fovs[0], other_vertical_fovs=fovs[1:], is_lens_consistent=is_consistent
    )


@pytest.mark.parametrize(
    ("metadata", "pixel_fov", "chosen"),
    [
        (lens(54.0), 60.0, 54.0),
        (lens(29.0), 66.0, None),
        (lens(14.0), 34.0, 14.0),  # a long lens, of which the file says more than its 35 mm value
        (lens(14.0, is_consistent=False), 34.0, None),
        (lens(14.0), 66.0, None),
        (lens(7.0, is_consistent=False), 54.0, None),
        (lens(85.0), 50.0, None),  # the photo was cropped
        (lens(85.0, 69.0), 68.0, 69.0),
        (lens(64.0, 35.0), 66.0, 64.0),
        (lens(120.0, 100.0), 40.0, None),
    ],
)
def test_a_lens_that_the_pixels_exclude_is_not_used(
    metadata: PhotoMetadata, pixel_fov: float, chosen: float | None
) -> None:
    settled, warnings = _choose_lens(metadata, pixel_fov)
    assert settled.vertical_fov == chosen
    assert settled.other_vertical_fovs == ()
    assert settled.focal_length == 26.0
    code = "lens-contradicted" if chosen is None else "lens-open"
    assert [warning_code(w) for w in warnings] == [code] * (chosen != metadata.vertical_fov)


def test_of_lenses_that_the_pixels_hardly_part_a_warning_tells() -> None:
    settled, (warning,) = _choose_lens(lens(62.0, 58.0), 64.0)
    assert settled.vertical_fov in (62.0, 58.0)
    assert "62° or 58°" in warning


def test_a_focal_length_that_a_crop_made_useless_is_told() -> None:
    _, (warning,) = _choose_lens(PhotoMetadata(focal_length=26.0), 50.0)
    assert "was cropped" in warning
    assert _choose_lens(PhotoMetadata(), 50.0) == (PhotoMetadata(), ())
