"""The sky's colour from a photo's upper part."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from lighting.colour import luminance, tone_map
from lighting.envmap import photo_sky
from lighting.envmap.sky_colour import sky_ratio
from lighting.records import Lighting
from tests.lighting.envmap.test_render import given_light

SAID = np.array([0.4, 0.5, 0.8])  # of given_light
SUNSET = np.array([0.3, 0.2, 0.1])


def photo(sky: Sequence[float] | np.ndarray, detail: float = 0.0) -> np.ndarray:
    """A sky of one colour over dark ground; `detail` alternates its brightness from pixel to pixel."""
    linear = np.full((60, 80, 3), 0.03, np.float32)
    rows, columns = np.indices((30, 80))
    linear[:30] = np.asarray(sky) * (1 + detail * (-1.0) ** (rows // 2 + columns // 2))[..., None]
    return tone_map(linear)


def overcast(**changes: float) -> Lighting:
    return given_light(sky_cover=1.0, **changes)


def seen_sky(picture: np.ndarray, light: Lighting) -> np.ndarray:
    """The sky's irradiance with the factors that the photo gives."""
    factors = photo_sky(picture, light)
    assert factors is not None
    return np.asarray(factors * np.array(light.sky_irradiance))


def colour_of(values: np.ndarray) -> np.ndarray:
    return np.asarray(values / values[1])


def test_under_cloud_the_sky_takes_most_of_the_photos_colour() -> None:
    found = seen_sky(photo(SUNSET), overcast())
    trust = 0.11 + 0.51
    expected = colour_of(SAID) * (colour_of(SUNSET) / colour_of(SAID)).clip(0.5, 2.0) ** trust
    assert colour_of(found) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(("cover", "trust"), [(0.0, 0.11), (0.5, 0.11 + 0.51 / 4), (1.0, 0.11 + 0.51)])
def test_the_photos_colour_counts_by_the_square_of_the_cover(cover: float, trust: float) -> None:
    light = given_light(sky_cover=cover)
    off = sky_ratio(photo(SUNSET), light)
    assert off is not None
    assert np.ptp(off) > 0.3
    assert colour_of(seen_sky(photo(SUNSET), light)) == pytest.approx(colour_of(SAID) * off**trust, rel=1e-6)


def test_its_brightness_stays() -> None:
    for light in (overcast(), given_light()):
        found = seen_sky(photo(SUNSET), light)
        assert luminance(found) == pytest.approx(luminance(SAID), rel=1e-6)


def test_a_clear_sky_changes_less_and_towards_the_photo() -> None:
    clear, cloudy = seen_sky(photo(SUNSET), given_light(sky_cover=0.0)), seen_sky(photo(SUNSET), overcast())
    reds = [colour_of(sky)[0] for sky in (SAID, clear, cloudy, SUNSET)]
    assert reds == sorted(reds)
    assert reds[1] > 1.03 * reds[0]


def test_a_sky_of_the_colour_that_was_said_changes_nothing() -> None:
    found = seen_sky(photo(SAID / np.pi), overcast())
    assert found == pytest.approx(SAID, rel=0.02)


@pytest.mark.parametrize(
    ("picture", "changes"),
    [
        pytest.param(photo(SUNSET / 8), {}, id="a wall, too dark for sky"),
        pytest.param(photo([0.99, 0.99, 0.99]), {}, id="clipped"),
        pytest.param(photo(SUNSET, detail=0.5), {}, id="leaves, not smooth"),
        pytest.param(photo(SUNSET), {"camera_elevation": -50.0}, id="looks down"),
        pytest.param(np.zeros((40, 60, 3), np.uint8), {}, id="black"),
        pytest.param(np.zeros((1, 1, 3), np.uint8), {}, id="one pixel"),
        pytest.param(np.zeros((3000, 1, 3), np.uint8), {}, id="one column"),
    ],
)
def test_without_sky_nothing_is_known(picture: np.ndarray, changes: dict[str, float]) -> None:
    assert photo_sky(picture, overcast(**changes)) is None


def test_a_black_sky_stays_black() -> None:
    factors = photo_sky(photo(SUNSET), replace(overcast(), sky_irradiance=(0.0, 0.0, 0.0)))
    assert factors is not None
    assert np.isfinite(factors).all()


def test_without_irradiances_nothing_is_known() -> None:
    assert photo_sky(photo(SUNSET), Lighting(0.0, 30.0, 3.0, 1.0)) is None


def test_a_sky_without_green_gives_bounded_factors() -> None:
    violet = np.zeros((40, 60, 3), np.uint8)
    violet[..., 2] = 248
    factors = photo_sky(violet, overcast(camera_elevation=40.0))
    assert factors is not None
    assert np.isfinite(factors).all()
    assert (factors > 0).all()
