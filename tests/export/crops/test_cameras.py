"""Cameras are drawn as their protocol says."""

import math

import numpy as np
import pytest

from export.crops.cameras import (
    _MAX_TILTED_ROLL,
    MAX_HORIZONTAL_FOV,
    _phone_camera,
    aimed_camera,
    paper_camera,
    training_camera,
)
from export.crops.crops import crop_rng
from tests.helpers.panoramas import crop


@pytest.mark.parametrize("draw", [paper_camera, _phone_camera, training_camera])
def test_cameras_stay_inside_their_protocol(draw: object) -> None:
    drawn = [draw(crop_rng("name", i, "test")) for i in range(300)]  # type: ignore[operator]
    elevation, fov = 20 if draw is paper_camera else 35, (25, 90)
    roll = {paper_camera: 0.0, _phone_camera: 10.0, training_camera: _MAX_TILTED_ROLL}[draw]  # type: ignore[index]
    assert all(
        abs(c.elevation) <= elevation and abs(c.roll) <= roll and fov[0] <= c.vertical_fov <= fov[1] for c in drawn
    )
    widths = [2 * math.degrees(math.atan(c.aspect * math.tan(math.radians(c.vertical_fov / 2)))) for c in drawn]
    assert max(widths) <= MAX_HORIZONTAL_FOV + 0.01
    assert min(c.elevation for c in drawn) < -0.9 * elevation
    assert max(c.elevation for c in drawn) > 0.9 * elevation


def test_aimed_cameras_hold_the_sun() -> None:
    rng = np.random.default_rng(1)
    in_view = 0
    for azimuth, elevation in [(0.0, 5.0), (100.0, 30.0), (-170.0, 45.0)]:
        for _ in range(20):
            camera = aimed_camera(rng, azimuth, elevation)
            in_view += crop(camera, azimuth - camera.azimuth, elevation).sun_pixel is not None
    assert in_view > 55
