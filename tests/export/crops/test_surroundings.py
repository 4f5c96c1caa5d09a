"""The light around the camera: it turns with the camera, mirrors with the crop, and is the same for both kinds."""

from pathlib import Path

import numpy as np
import pytest

from export.crops.cameras import Camera
from export.crops.sources import Source
from export.crops.surroundings import CELLS, COLUMNS, ROWS, light_around, seen_from
from export.data.panoramas import Panorama
from lighting.colour import tone_map
from tests.export.crops.examples import label


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
    light, colour = seen_from(light_around(lit_at(90.0)), camera).reshape(ROWS, COLUMNS, 2).transpose(2, 0, 1)
    for plane in (light, colour):
        centre = np.average(np.arange(COLUMNS) + 0.5, weights=(plane[: ROWS // 2] - plane.min()).sum(axis=0))
        assert centre == pytest.approx(column, abs=0.3)
        assert np.ptp(plane[ROWS // 2 :]) < 1e-4
    assert light.size == CELLS


def test_brightness_and_tint_of_the_whole_do_not_count() -> None:
    plain = lit_at(0.0)
    tinted = Source(plain.panorama, (plain.levels[0] * np.array([30, 20, 10], np.float32),), plain.label)
    one, other = light_around(plain), light_around(tinted)
    np.testing.assert_allclose(one.mean(axis=(0, 1)), 0.0, atol=1e-5)
    assert np.abs(one - other).mean() < 0.3 * np.abs(one).mean()


def test_ldr_and_hdr_panoramas_show_the_same_light() -> None:
    np.testing.assert_allclose(light_around(lit_at(0.0, "ldr")), light_around(lit_at(0.0)), atol=0.05)
