"""The ball and the stick, as large in every picture."""

import numpy as np
import pytest

from lighting.scene.placeholder import PLACEHOLDER_ALBEDO, placeholder_of
from lighting.spheres import DIFFUSE_REFLECTANCE
from tests.scenes import plain_scene


def test_the_ball_always_has_the_same_size_in_the_picture() -> None:
    for scene in (plain_scene(), plain_scene(vertical_fov=25.0), plain_scene(camera_elevation=-40.0)):
        distance = np.linalg.norm(scene.spot - scene.camera_position)
        half_picture = distance * np.tan(np.radians(scene.vertical_fov) / 2)
        assert placeholder_of(scene).ball_radius / half_picture == pytest.approx(0.16)


@pytest.mark.parametrize("elevation", [-90.0, -12.0, 0.0, 90.0])
def test_both_stand_on_the_ground_apart_from_each_other(elevation: float) -> None:
    placeholder = placeholder_of(plain_scene(camera_elevation=elevation))
    assert placeholder.ball_radius > 0.05
    assert placeholder.ball_centre[1] == placeholder.ball_radius
    assert placeholder.stick_foot[1] == 0.0
    assert placeholder.stick_foot[0] - placeholder.stick_radius > placeholder.ball_radius
    assert placeholder.stick_height > 2 * placeholder.ball_radius


def test_it_is_as_grey_as_the_ball_of_previews() -> None:
    """So pictures of both can be compared, and less sunlight burns out."""
    assert PLACEHOLDER_ALBEDO == DIFFUSE_REFLECTANCE
