"""What a photo shows goes on beside it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lighting.colour import srgb_decode
from lighting.envmap.continued import RATIO, continued
from tests.lighting.envmap.test_render import lighting

ROWS = 24
AHEAD = slice(22, 26)  # columns that a view of 60° by 45° shows for certain
RED, BLUE = (200, 40, 30), (60, 90, 200)
LIGHT = replace(lighting(), camera_elevation=0.0, camera_roll=0.0, vertical_fov=45.0)


def cells(value: float = 0.2) -> np.ndarray:
    return np.full((ROWS, 2 * ROWS, 3), value, np.float32)


def photo(above: tuple[int, int, int], below: tuple[int, int, int]) -> np.ndarray:
    pixels = np.empty((90, 120, 3), np.uint8)
    pixels[:45], pixels[45:] = above, below
    return pixels


def linear(colour: tuple[int, int, int]) -> np.ndarray:
    return np.asarray(srgb_decode(np.array(colour) / 255.0))


def test_the_cells_that_a_photo_shows_become_its_own() -> None:
    there = continued(cells(), photo(BLUE, RED), LIGHT) * cells()
    np.testing.assert_allclose(there[10:12, AHEAD], np.broadcast_to(linear(BLUE), (2, 4, 3)), rtol=1e-3)
    np.testing.assert_allclose(there[12:14, AHEAD], np.broadcast_to(linear(RED), (2, 4, 3)), rtol=1e-3)


def test_beside_it_they_fade_with_the_distance_on_their_side_of_the_horizon() -> None:
    factors = continued(cells(), photo(BLUE, RED), LIGHT)
    above, below = (np.log(factors[row, :24] / factors[row, :24, 1:2]) for row in (11, 12))
    for line, strongest in ((above, 2), (below, 0)):
        assert (np.diff(line[:, strongest]) >= -1e-6).all()  # from behind, at column 0, to ahead
        assert 0.3 * line[23, strongest] > line[0, strongest] > 0.0
        assert line[18, strongest] > 0.7 * line[23, strongest]
    assert (above[:, 2] > 0).all() and (above[:, 0] < 0).all() and (below[:, 0] > 0).all()  # noqa: PT018


def test_a_tree_at_the_edge_goes_on_at_its_own_height() -> None:
    pixels = photo((128, 128, 128), (128, 128, 128))
    pixels[20:45, 100:] = 10  # at the right, up to 15°
    factors = continued(cells(), pixels, LIGHT)[..., 1]
    assert factors[11, 30] < 0.3 * factors[11, 17]
    assert factors[4, 30] > 0.8 * factors[4, 17]


def test_white_pixels_darken_nothing() -> None:
    factors = continued(cells(3.0), photo((255, 255, 255), (255, 255, 255)), LIGHT)
    np.testing.assert_allclose(factors, 1.0, rtol=1e-5)


def test_no_factor_leaves_its_range() -> None:
    dark, light = continued(cells(50.0), photo(RED, RED), LIGHT), continued(cells(1e-6), photo(RED, RED), LIGHT)
    assert dark.min() == pytest.approx(RATIO[0])
    assert light.max() == pytest.approx(RATIO[1])


@pytest.mark.parametrize(("change", "same"), [({"vertical_fov": 1.0}, False), ({"camera_elevation": 80.0}, True)])
def test_the_half_that_a_photo_does_not_show_stays(change: dict[str, Any], same: bool) -> None:
    factors = continued(cells(), photo(RED, RED), replace(LIGHT, **change))
    assert np.isfinite(factors).all()
    assert bool((factors[12:] == 1).all()) == same
