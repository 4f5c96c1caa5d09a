"""The sun and its probability lie at their places on the compass."""

import numpy as np
import pytest

from lighting.drawing import MUTED, TEXT
from lighting.geometry import direction
from lighting.preview.compass import _density, _heat, compass_panel
from lighting.sun_grid import grid_directions, soft_label
from tests.previews import GRID, amber, distribution, estimate, outdoors


@pytest.mark.parametrize(("azimuth", "elevation"), [(60.0, 30.0), (-60.0, 30.0), (135.0, 20.0), (0.0, 60.0)])
def test_probability_peaks_at_its_place_on_the_compass(azimuth: float, elevation: float) -> None:
    cell = grid_directions(GRID)[np.argmax(grid_directions(GRID) @ direction(azimuth, elevation))]
    heat = np.asarray(_heat(distribution(soft_label(cell, 60.0, GRID)))).astype(int)
    row, column = np.unravel_index(np.argmax(heat.sum(axis=-1)), heat.shape[:2])
    x, y = (column + 0.5) / heat.shape[1] * 2 - 1, (row + 0.5) / heat.shape[0] * 2 - 1
    reach = (90 - elevation) / 90
    expected = (reach * np.sin(np.radians(azimuth)), -reach * np.cos(np.radians(azimuth)))
    np.testing.assert_allclose((x, y), expected, atol=0.12)


@pytest.mark.parametrize("layout", ["fibonacci:64", "fibonacci:2048", "rings:5x32"])
def test_density_integrates_to_one(layout: str) -> None:
    cells = grid_directions("fibonacci:4000").astype(np.float32)
    density = _density(cells, distribution(soft_label(direction(20.0, 60.0), 12.0, layout), layout))
    assert density.mean() * 2 * np.pi == pytest.approx(1.0, abs=0.04)


def test_even_probability_is_colder_than_a_sure_one() -> None:
    even = np.asarray(_heat(distribution()))
    sure = np.asarray(_heat(distribution(soft_label(direction(0.0, 50.0), 300.0, GRID))))
    assert even.sum(axis=-1).max() < 0.7 * sure.sum(axis=-1).max()


def test_sun_is_marked_at_its_place_on_the_compass() -> None:
    size = 500
    panel = np.asarray(compass_panel(estimate(outdoors(70.0, 30.0)), 4 / 3, size))
    spot = (amber(panel.astype(np.int64)).mean(axis=0) - size / 2) / (size / 2 - 44)
    reach = (90 - 30) / 90
    expected = (-reach * np.cos(np.radians(70.0)), reach * np.sin(np.radians(70.0)))
    np.testing.assert_allclose(spot, expected, atol=0.02)


@pytest.mark.parametrize("azimuth", [4.0, 40.0, 90.0, 130.0, 176.0, -90.0, -140.0])
def test_the_rings_degrees_are_not_where_the_regions_have_their_shares(azimuth: float) -> None:
    """Those stand on the sun's meridian, also beyond the zenith."""
    size = 500
    panel = np.asarray(compass_panel(estimate(outdoors(azimuth, 10.0)), 4 / 3, size)).astype(np.int64)
    letters = np.argwhere(np.abs(panel - np.array(TEXT)).max(axis=-1) < 8) - size / 2
    letters = letters[np.hypot(*letters.T) < 0.75 * (size / 2 - 44)]
    assert len(letters) > 20
    off = letters @ (np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth)))
    assert np.abs(off).min() > 20


@pytest.mark.parametrize("azimuth", [0.0, 180.0])
def test_a_sun_on_the_horizon_does_not_touch_the_word_beside_it(azimuth: float) -> None:
    size = 500
    low, high = (
        np.asarray(compass_panel(estimate(outdoors(azimuth, elevation)), 4 / 3, size)).astype(np.int64)
        for elevation in (0.0, 60.0)
    )
    words = np.array([MUTED if azimuth else TEXT])
    beyond = slice(size - 42, size) if azimuth else slice(42, 0, -1)  # from the circle outwards
    rays = np.flatnonzero((low != high)[beyond].any(axis=(1, 2)))
    letters = np.flatnonzero((np.abs(high - words).max(axis=-1) < 60)[beyond].any(axis=1))
    assert 10 < rays.max() < letters.min()


def test_no_region_strikes_the_degrees_out() -> None:
    """The second region passes through the degrees of the upper ring."""
    size, radius = 500, 500 / 2 - 44
    counts = []
    for radius_90 in (25.0, 54.0):
        lighting = outdoors(0.0, 45.0, radius_50=10.0, radius_90=radius_90)
        panel = np.asarray(compass_panel(estimate(lighting), 4 / 3, size)).astype(np.int64)
        columns = slice(round(size / 2 + radius / 3 + 4), round(size / 2 + radius / 3 + 40))
        degrees = panel[size // 2 - 18 : size // 2 - 2, columns]
        counts.append(int((np.abs(degrees - np.array(TEXT)).max(axis=-1) < 8).sum()))
    assert counts[0] == counts[1] > 20
