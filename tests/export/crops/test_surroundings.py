"""The light around the camera: it turns with the camera, mirrors with the crop, and has the photo's exposure."""

from pathlib import Path

import numpy as np
import pytest

from export.crops.cameras import Camera
from export.crops.sources import Source
from export.crops.surroundings import BRIGHTEST, CELLS, COLUMNS, DARKEST, ROWS, light_around, seen_from
from export.data.panoramas import Panorama
from lighting.colour import tone_map
from tests.export.crops.examples import label

ONE = np.ones(3)


def lit_at(azimuth: float, kind: str = "hdr") -> Source:
    """Bright and blue towards an azimuth [deg] above the horizon, dark and red elsewhere."""
    picture = np.tile(np.array([0.2, 0.1, 0.05], np.float32), (192, 384, 1))
    column = int((azimuth / 360 + 0.5) * 384)
    picture[:96, column - 20 : column + 20] = (0.5, 0.6, 0.8)
    levels = (tone_map(picture),) if kind == "ldr" else (picture,)
    return Source(Panorama("p", Path("p"), kind, "a", "train"), levels, label())


@pytest.mark.parametrize(("looking", "mirrored", "column"), [(90, False, 12), (30, False, 16), (30, True, 8)])
def test_the_map_is_seen_from_the_camera(looking: float, mirrored: bool, column: int) -> None:
    camera = Camera(looking, 10.0, 0.0, 50.0, 4 / 3, mirrored)
    cells = seen_from(light_around(lit_at(90.0)), camera, ONE)
    assert cells.size == 3 * CELLS
    for plane in cells.reshape(ROWS, COLUMNS, 3).transpose(2, 0, 1):
        centre = np.average(np.arange(COLUMNS) + 0.5, weights=(plane[: ROWS // 2] - plane.min()).sum(axis=0))
        assert centre == pytest.approx(column, abs=0.3)
        assert np.ptp(plane[ROWS // 2 :]) < 1e-4


def test_the_photo_s_exposure_and_white_balance_count() -> None:
    around, gains = light_around(lit_at(0.0)), np.array([3.0, 2.0, 1.0])
    camera = Camera(0.0, 0.0, 0.0, 50.0, 1.0)
    one, other = (np.exp(seen_from(around, camera, g)).reshape(-1, 3) - DARKEST for g in (ONE, gains))
    np.testing.assert_allclose(other, one * gains, rtol=1e-3)


def test_a_sun_counts_as_a_few_whites_at_most() -> None:
    source = lit_at(0.0)
    source.levels[0][40:44, 180:184] = 1e4
    cells = seen_from(light_around(source), Camera(0.0, 0.0, 0.0, 50.0, 1.0), ONE)
    assert np.exp(cells.max()) <= BRIGHTEST + DARKEST + 1e-4


def test_ldr_and_hdr_panoramas_show_the_same_light() -> None:
    np.testing.assert_allclose(light_around(lit_at(0.0, "ldr")), light_around(lit_at(0.0)), atol=0.05)
