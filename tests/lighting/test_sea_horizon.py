"""The sea's horizon in a photo."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.calibration import shrink_to_gray
from lighting.geometry import Pinhole, camera_directions
from lighting.prediction import SurfaceClass
from lighting.sea_horizon import find_sea_horizon, level_by_sea, may_show_sea
from tests.helpers.predictions import prediction

CAMERA = Pinhole(480, 360, 55.0, elevation=4.0, roll=-2.0)


def seascape(camera: Pinhole = CAMERA, blur: float = 0.0) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """A sea with whitecaps under a pale sky over a beach, and its segments."""
    down = -np.degrees(np.arcsin(camera_directions(camera)[..., 1]))
    kinds = np.select([down < 0, down < 10], [SurfaceClass.SKY, SurfaceClass.WATER], SurfaceClass.GROUND)
    gray = np.select([down < -blur, down < 10], [190.0, 90.0], 150.0)
    hazy = np.abs(down) <= blur
    gray[hazy] = 140 - 50 * down[hazy] / max(blur, 1e-6)
    caps = np.random.default_rng(0).random(gray.shape) < 0.05
    gray[caps & (down > max(blur, 0.5)) & (down < 10)] = 240
    shares = np.eye(len(SurfaceClass), dtype=np.float32)[kinds]
    cells = shares.reshape(18, 20, 24, 20, -1).mean(axis=(1, 3))
    return np.repeat(gray[..., None], 3, axis=2).astype(np.uint8), cells


@pytest.mark.parametrize(("elevation", "roll"), [(4.0, -2.0), (-3.0, 3.0), (8.0, 0.0)])
def test_the_camera_is_level_with_the_sea(elevation: float, roll: float) -> None:
    camera = Pinhole(480, 360, 55.0, elevation=elevation, roll=roll)
    known = replace(prediction(), camera_elevation=elevation + 2, camera_roll=roll - 1)
    pixels, cells = seascape(camera)
    found = level_by_sea(known, shrink_to_gray(pixels), cells, 55.0, (480, 360))
    assert found.camera_elevation == pytest.approx(elevation, abs=0.15)
    assert found.camera_roll == pytest.approx(roll, abs=0.15)


def test_a_camera_that_is_known_to_be_far_off_stays() -> None:
    known = replace(prediction(), camera_elevation=14.0)
    pixels, cells = seascape()
    assert level_by_sea(known, shrink_to_gray(pixels), cells, 55.0, (480, 360)) is known


def test_haze_ponds_and_dry_land_have_no_sea_horizon() -> None:
    pixels, cells = seascape()
    assert find_sea_horizon(shrink_to_gray(pixels), cells) is not None
    hazy, _ = seascape(blur=1.5)
    assert find_sea_horizon(shrink_to_gray(hazy), cells) is None
    dry = cells.copy()
    dry[..., [SurfaceClass.GROUND, SurfaceClass.WATER]] = cells[..., [SurfaceClass.WATER, SurfaceClass.GROUND]]
    assert find_sea_horizon(shrink_to_gray(pixels), dry) is None
    assert find_sea_horizon(shrink_to_gray(pixels[::60, ::60]), cells) is None


def test_a_headland_before_the_sea_changes_nothing() -> None:
    pixels, cells = seascape()
    down = -np.degrees(np.arcsin(camera_directions(CAMERA)[..., 1]))
    pixels[(down > -1.5) & (down < 0.2) & (np.arange(480) < 140)] = 20
    line = find_sea_horizon(shrink_to_gray(pixels), cells)
    assert line is not None
    middle = 0.5 + 0.5 * math.tan(math.radians(4.0)) / math.tan(math.radians(27.5)) / math.cos(math.radians(2.0))
    assert sum(line) / 2 == pytest.approx(middle, abs=0.004)


@pytest.mark.parametrize(("share", "expected"), [(0.0, False), (0.2, False), (0.9, True)])
def test_without_water_on_the_canvas_no_sea_is_sought(share: float, expected: bool) -> None:
    canvas = np.zeros((28, 28, len(SurfaceClass)), np.float32)
    canvas[20, 3, SurfaceClass.WATER] = share
    assert may_show_sea(canvas) is expected
