"""Tests of appearance."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lighting.color import luminance, tone_map
from lighting.envmap.appearance import (
    KIND_FEATURES,
    PLACE_KINDS,
    PhotoSamples,
    _quantiles,
    estimate_ground_albedo,
    ground_luminance,
    kind_features,
    kind_probability,
    shows_snow,
    sky_color_ratio,
    sky_white_balance,
    snow_gain,
)
from lighting.envmap.detail_library import load_detail_library
from lighting.estimator import Estimator
from lighting.photo.reader import read_photo
from lighting.prediction import SurfaceClass
from lighting.records import Lighting
from tests.helpers.predictions import SKY_IRRADIANCE, stated_light

EXAMPLES = Path(__file__).parents[3] / "examples"
LEVEL = np.array([0.4, 0.5, 0.8]) + np.sin(np.radians(33.0)) * np.array([1.9, 1.5, 0.9])


def photo(reflectance: list[float], sky: float = 0.8) -> np.ndarray:
    linear = np.full((60, 80, 3), sky, np.float32)
    linear[30:] = np.array(reflectance) * LEVEL / np.pi
    return tone_map(linear)


def albedo_of(
    picture: np.ndarray, light: Lighting, around: np.ndarray | None = None, segments: np.ndarray | None = None
) -> np.ndarray | None:
    return estimate_ground_albedo(PhotoSamples.of_photo(picture, light, segments), light, around)


def gain_of(picture: np.ndarray, light: Lighting) -> float:
    return snow_gain(PhotoSamples.of_photo(picture, light), light)


def is_snow(picture: np.ndarray, light: Lighting, segments: np.ndarray | None = None) -> bool:
    return shows_snow(PhotoSamples.of_photo(picture, light, segments), light)


def balance_of(picture: np.ndarray, light: Lighting, segments: np.ndarray | None = None) -> np.ndarray | None:
    return sky_white_balance(PhotoSamples.of_photo(picture, light, segments), light)


def ratio_of(picture: np.ndarray, light: Lighting) -> np.ndarray | None:
    return sky_color_ratio(PhotoSamples.of_photo(picture, light), light)


def test_the_ground_is_what_lies_below_the_horizon_over_its_light() -> None:
    assert albedo_of(photo([0.2, 0.15, 0.1]), stated_light()) == pytest.approx([0.2, 0.15, 0.1], rel=0.05)


def test_few_glints_do_not_count() -> None:
    spotted = photo([0.2, 0.2, 0.2])
    spotted[40:43] = 255
    assert albedo_of(spotted, stated_light()) == pytest.approx([0.2] * 3, rel=0.1)


def test_a_camera_that_looks_up_sees_no_ground() -> None:
    assert albedo_of(photo([0.2] * 3), stated_light(camera_elevation=50.0)) is None


@pytest.mark.parametrize("cover", [0.0, 0.5, 1.0])
def test_the_network_s_ground_counts_for_brightness_the_less_the_cloudier_and_not_for_colour(cover: float) -> None:
    picture, light = photo([0.2, 0.15, 0.1]), stated_light(sky_cover=cover)
    shown = albedo_of(picture, light)
    assert shown is not None
    radiance = shown * LEVEL / np.pi
    for stops in (-1.0, 0.0, 1.5):
        around = np.full((12, 24, 3), 9.0, np.float32)  # its sky does not count
        around[6:] = luminance(radiance) * 2.0 ** (stops - 0.2)
        found = albedo_of(picture, light, around)
        assert found == pytest.approx(shown * 2.0 ** (0.6 * (1 - cover) * stops), rel=1e-4)


def test_a_network_without_ground_stays_in_range() -> None:
    assert albedo_of(photo([0.2] * 3), stated_light(), np.zeros((12, 24, 3), np.float32)) == pytest.approx([0.02] * 3)


def test_brightness_below_is_that_of_a_level_surface_facing_down() -> None:
    around = np.ones((12, 24, 3), np.float32)
    assert ground_luminance(around) == pytest.approx(1.0)
    around[11] = 0.0  # the lowest 15 deg: sin(15 deg) squared of the light
    assert ground_luminance(around) == pytest.approx(1 - np.sin(np.radians(15)) ** 2)


def test_without_irradiances_nothing_is_known() -> None:
    assert albedo_of(photo([0.2] * 3), Lighting(0.0, 30.0, 3.0, 1.0)) is None


def test_a_black_or_white_picture_stays_in_range() -> None:
    assert albedo_of(np.zeros((40, 60, 3), np.uint8), stated_light()) == pytest.approx([0.02] * 3)
    assert albedo_of(np.full((40, 60, 3), 255, np.uint8), stated_light(1.0)) is not None


@pytest.mark.parametrize("count", [1, 2, 3, 50, 999])
def test_quantiles_are_numpys(count: int) -> None:
    values = np.random.default_rng(count).integers(0, 40, count).astype(np.float32) / 7
    assert _quantiles(values, (0.25, 0.75)) == pytest.approx(np.quantile(values, (0.25, 0.75)))


def test_clipped_ground_is_grey() -> None:
    light = stated_light(sun_irradiance=(1.0, 1.2, 1.6), sky_irradiance=(1.5, 2.0, 3.0))
    half = np.full((40, 60, 3), 255, np.uint8)
    half[:, ::2] = (150, 150, 150)
    clear, mixed, clipped = (
        albedo_of(picture, light)
        for picture in (np.full((40, 60, 3), 150, np.uint8), half, np.full((40, 60, 3), 255, np.uint8))
    )
    assert clear is not None
    assert mixed is not None
    assert clipped is not None
    assert clear[0] > 1.5 * clear[2]
    assert 1.1 < mixed[0] / mixed[2] < clear[0] / clear[2]
    assert np.ptp(clipped) == pytest.approx(0.0, abs=1e-6)


def test_snow_says_how_bright_the_light_is_at_least() -> None:
    """Ground that is white reflects 85 % and no more, so the light is brighter than was said."""
    assert gain_of(photo([1.2, 1.2, 1.2]), stated_light()) == pytest.approx(1.2 / 0.85, rel=0.05)
    assert gain_of(photo([0.8, 0.8, 0.8]), stated_light()) == 1.0
    assert gain_of(photo([1.2, 1.2, 0.6]), stated_light()) == 1.0  # yellow
    spotted = photo([1.2, 1.2, 1.2])
    spotted[:, ::2] = (30, 60, 20)  # half of it is grass
    assert gain_of(spotted, stated_light()) == 1.0
    assert gain_of(np.full((40, 60, 3), 255, np.uint8), stated_light(sky_irradiance=(0.01,) * 3)) <= 4.0
    assert gain_of(photo([1.2, 1.2, 1.2]), Lighting(0.0, 30.0, 3.0, 1.0)) == 1.0


def test_snow_is_white_ground_without_buildings() -> None:
    white = photo([0.8, 0.8, 0.8])
    buildings, ground = (
        np.broadcast_to(np.eye(len(SurfaceClass), dtype=np.float32)[kinds], (12, 16, len(SurfaceClass)))
        for kinds in ([[SurfaceClass.BUILDING] * 8 + [SurfaceClass.GROUND] * 8] * 12, SurfaceClass.GROUND)
    )
    assert is_snow(white, stated_light())
    assert is_snow(white, stated_light(), ground)
    assert not is_snow(white, stated_light(), buildings)
    assert not is_snow(photo([0.3, 0.3, 0.3]), stated_light())
    assert is_snow(photo([0.65, 0.75, 1.0]), stated_light())  # in shade
    assert is_snow(photo([0.45, 0.5, 0.58]), stated_light())  # darker than it is, but blue
    assert not is_snow(photo([0.9, 0.75, 0.65]), stated_light())  # pavement


SKY = np.array(SKY_IRRADIANCE)
SUNSET = np.array([0.3, 0.2, 0.1])


def photo_of_sky(sky: Sequence[float] | np.ndarray, detail: float = 0.0) -> np.ndarray:
    """A sky of one color over dark ground; `detail` alternates its brightness from pixel to pixel."""
    linear = np.full((60, 80, 3), 0.03, np.float32)
    rows, columns = np.indices((30, 80))
    linear[:30] = np.asarray(sky) * (1 + detail * (-1.0) ** (rows // 2 + columns // 2))[..., None]
    return tone_map(linear)


def overcast(**changes: float) -> Lighting:
    return stated_light(sky_cover=1.0, **changes)


def balanced_sky(picture: np.ndarray, light: Lighting) -> np.ndarray:
    """The sky's irradiance with the factors that the photo gives."""
    factors = balance_of(picture, light)
    assert factors is not None
    return np.asarray(factors * np.array(light.sky_irradiance))


def relative_to_green(values: np.ndarray) -> np.ndarray:
    return np.asarray(values / values[1])


def test_under_cloud_the_sky_takes_most_of_the_photos_colour() -> None:
    found = balanced_sky(photo_of_sky(SUNSET), overcast())
    trust = 0.13 + 0.31
    expected = relative_to_green(SKY) * (relative_to_green(SUNSET) / relative_to_green(SKY)).clip(0.5, 2.0) ** trust
    assert relative_to_green(found) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(("cover", "trust"), [(0.0, 0.13), (0.5, 0.13 + 0.31 / 4), (1.0, 0.13 + 0.31)])
def test_the_photos_colour_counts_by_the_square_of_the_cover(cover: float, trust: float) -> None:
    light = stated_light(sky_cover=cover)
    off = ratio_of(photo_of_sky(SUNSET), light)
    assert off is not None
    assert np.ptp(off) > 0.3
    assert relative_to_green(balanced_sky(photo_of_sky(SUNSET), light)) == pytest.approx(
        relative_to_green(SKY) * off**trust, rel=1e-6
    )


ORANGE = np.array([0.42, 0.2, 0.08])


@pytest.mark.parametrize(("elevation", "trust"), [(3.0, 0.9), (20.0, 0.9), (25.0, 0.45)])
def test_an_orange_sky_of_a_low_sun_makes_the_sky_orange(elevation: float, trust: float) -> None:
    light = replace(stated_light(sky_cover=0.0), sun_elevation=elevation, sun_azimuth=150.0)
    found = balanced_sky(photo_of_sky(ORANGE), light)
    off = (relative_to_green(ORANGE) / relative_to_green(SKY)).clip(0.5, 2.0)
    assert relative_to_green(found) == pytest.approx(relative_to_green(SKY) * off**trust, rel=0.02)
    assert luminance(found) == pytest.approx(luminance(SKY), rel=1e-6)


def test_a_mild_sunset_warms_the_sky() -> None:
    """A sky that is hardly orange, as most of a photo at dusk is, counts for more than half."""
    light = replace(stated_light(sky_cover=0.0), sun_elevation=5.0, sun_azimuth=0.0)
    found = balanced_sky(photo_of_sky([0.34, 0.3, 0.27]), light)
    assert 1.4 * SKY[0] / SKY[2] < found[0] / found[2] < 0.34 / 0.27


def test_an_orange_wall_is_no_sunset() -> None:
    """What is orange below a blue sky tints it only where nothing says that it is a wall."""
    light = replace(stated_light(sky_cover=0.0, camera_elevation=20.0), sun_elevation=5.0)
    picture = photo_of_sky(SKY / np.pi)
    picture[8:] = photo_of_sky(ORANGE)[20]
    segments = np.zeros((15, 20, len(SurfaceClass)), np.float32)
    segments[:2, :, SurfaceClass.SKY] = 1
    segments[2:, :, SurfaceClass.BUILDING] = 1
    with_wall, without = (balance_of(picture, light, known) for known in (segments, None))
    assert with_wall is not None
    assert without is not None
    assert with_wall[0] / with_wall[2] < 0.8 * without[0] / without[2]


def test_an_orange_sky_counts_beside_the_glow_of_the_map() -> None:
    """The map's sky is far brighter there than the photo's, which is still the sky."""
    light = replace(stated_light(3.0, sky_cover=0.0), sun_elevation=6.0, sun_azimuth=0.0)
    found = balanced_sky(photo_of_sky(0.5 * ORANGE), light)
    assert found[0] / found[2] > 3 * SKY[0] / SKY[2]
    assert ratio_of(photo_of_sky(0.5 * SKY / np.pi), light) is None


def test_its_brightness_stays() -> None:
    for light in (overcast(), stated_light()):
        found = balanced_sky(photo_of_sky(SUNSET), light)
        assert luminance(found) == pytest.approx(luminance(SKY), rel=1e-6)


def test_a_clear_sky_changes_less_and_towards_the_photo() -> None:
    clear, cloudy = (
        balanced_sky(photo_of_sky(SUNSET), stated_light(sky_cover=0.0)),
        balanced_sky(photo_of_sky(SUNSET), overcast()),
    )
    reds = [relative_to_green(sky)[0] for sky in (SKY, clear, cloudy, SUNSET)]
    assert reds == sorted(reds)
    assert reds[1] > 1.03 * reds[0]


def test_a_sky_of_the_colour_that_was_said_changes_nothing() -> None:
    found = balanced_sky(photo_of_sky(SKY / np.pi), overcast())
    assert found == pytest.approx(SKY, rel=0.02)


@pytest.mark.parametrize(
    ("picture", "changes"),
    [
        pytest.param(photo_of_sky(SUNSET / 8), {}, id="a wall, too dark for sky"),
        pytest.param(photo_of_sky([0.99, 0.99, 0.99]), {}, id="clipped"),
        pytest.param(photo_of_sky(SUNSET, detail=0.5), {}, id="leaves, not smooth"),
        pytest.param(photo_of_sky(SUNSET), {"camera_elevation": -50.0}, id="looks down"),
        pytest.param(np.zeros((40, 60, 3), np.uint8), {}, id="black"),
        pytest.param(np.zeros((1, 1, 3), np.uint8), {}, id="one pixel"),
        pytest.param(np.zeros((3000, 1, 3), np.uint8), {}, id="one column"),
    ],
)
def test_without_sky_nothing_is_known(picture: np.ndarray, changes: dict[str, float]) -> None:
    assert balance_of(picture, overcast(**changes)) is None


def test_a_black_sky_stays_black() -> None:
    factors = balance_of(photo_of_sky(SUNSET), replace(overcast(), sky_irradiance=(0.0, 0.0, 0.0)))
    assert factors is not None
    assert np.isfinite(factors).all()


def test_sky_colour_without_irradiances_nothing_is_known() -> None:
    assert balance_of(photo_of_sky(SUNSET), Lighting(0.0, 30.0, 3.0, 1.0)) is None


def test_a_sky_without_green_gives_bounded_factors() -> None:
    violet = np.zeros((40, 60, 3), np.uint8)
    violet[..., 2] = 248
    factors = balance_of(violet, overcast(camera_elevation=40.0))
    assert factors is not None
    assert np.isfinite(factors).all()
    assert (factors > 0).all()


def test_an_orange_jacket_does_not_colour_the_ground() -> None:
    """Gray ground, most of it hidden by people in orange; without knowing what the photo shows it is brown."""
    light = replace(stated_light(40.0), camera_elevation=-10.0, vertical_fov=50.0)
    picture = np.full((90, 120, 3), 110, dtype=np.uint8)
    picture[36:, 24:96] = (230, 120, 20)
    segments = np.zeros((18, 24, 10), dtype=np.float32)
    segments[..., SurfaceClass.GROUND] = 1.0
    segments[7:, 4:20] = np.eye(10, dtype=np.float32)[SurfaceClass.PERSON]
    masked, plain = (albedo_of(picture, light, segments=one) for one in (segments, None))
    bare = albedo_of(np.full_like(picture, 110), light)
    assert masked is not None
    assert plain is not None
    assert masked == pytest.approx(bare, rel=1e-3)
    assert plain[0] > 2 * plain[2]


def test_ground_that_is_all_people_has_no_colour_and_all_plants_has_theirs() -> None:
    light = replace(stated_light(40.0), camera_elevation=-30.0)
    green = np.broadcast_to(np.array([40, 90, 30], dtype=np.uint8), (90, 120, 3))
    colors = {}
    for kind in (SurfaceClass.PERSON, SurfaceClass.PLANTS):
        segments = np.zeros((18, 24, 10), dtype=np.float32)
        segments[..., kind] = 1.0
        colors[kind] = albedo_of(green, light, segments=segments)
    assert colors[SurfaceClass.PERSON] is None
    assert colors[SurfaceClass.PLANTS] == pytest.approx(albedo_of(green, light))


def flat_segments(surface: SurfaceClass) -> np.ndarray:
    segments = np.zeros((12, 9, len(SurfaceClass)), np.float32)
    segments[..., list(SurfaceClass).index(surface)] = 1
    return segments


def test_features_are_rows_of_classes_and_rings_of_light() -> None:
    around = np.ones((12, 24, 3), np.float32)
    around[:2] = (1.0, 1.0, 2.0)
    features = kind_features(flat_segments(SurfaceClass.WATER), around)
    assert features.shape == (KIND_FEATURES,)
    shares, gray, colors = np.split(features, [4 * len(SurfaceClass), KIND_FEATURES - 12])
    assert shares.sum() == 4  # one class in each part
    assert gray.sum() == pytest.approx(0)
    assert gray[0] > gray[1]  # the blue ring is brighter, and bluer
    np.testing.assert_allclose(colors.reshape(6, 2)[0], (0.0, np.log(2.0)), atol=0.03)
    np.testing.assert_allclose(colors.reshape(6, 2)[1:], 0.0, atol=1e-9)


def test_the_scale_of_what_is_around_does_not_matter() -> None:
    around = np.random.default_rng(0).uniform(0.1, 1, (12, 24, 3)).astype(np.float32)
    one, other = (kind_features(flat_segments(SurfaceClass.SKY), around * np.float32(k)) for k in (1, 8))
    np.testing.assert_allclose(one, other, atol=1e-5)


def test_probabilities_are_those_of_a_softmax() -> None:
    weights = np.zeros((KIND_FEATURES + 1, len(PLACE_KINDS)))
    weights[0, 1], weights[-1, 2] = np.log(2.0), np.log(5.0)
    features = np.zeros(KIND_FEATURES)
    features[0] = 1
    np.testing.assert_allclose(kind_probability(features, weights), np.array([1, 2, 5, 1, 1, 1, 1, 1]) / 13)


@pytest.mark.parametrize(
    ("example", "kind"),
    [("beach_evening", "shore"), ("venice_alley", "city"), ("meadow_edge", "meadow"), ("snow_field", "snow")],
)
def test_examples_are_of_their_kinds(example: str, kind: str) -> None:
    context = Estimator()(read_photo(EXAMPLES / f"{example}.jpg")).context()
    assert context is not None
    assert context.segments is not None
    assert context.coarse_panorama is not None
    features = kind_features(context.segments, context.coarse_panorama)
    likely = kind_probability(features, load_detail_library().kind_weights)
    assert PLACE_KINDS[int(likely.argmax())] == kind
