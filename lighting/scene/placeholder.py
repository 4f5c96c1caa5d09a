"""What stands on a scene's spot until the user puts an object there: a ball and, to its right, an upright stick."""

from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats
from lighting.scene.common import BALL, Scene
from lighting.spheres import DIFFUSE_REFLECTANCE

PLACEHOLDER_ALBEDO = DIFFUSE_REFLECTANCE  # of ball and stick: that of the previews' grey ball


@dataclass(frozen=True, eq=False)
class Placeholder:
    """Lengths in metres, points (3,) from the scene's spot, +Y up."""

    ball_radius: float

    @property
    def ball_centre(self) -> Floats:
        """The ball rests on the spot."""
        return np.array([0.0, self.ball_radius, 0.0])

    @property
    def stick_foot(self) -> Floats:
        """The middle of the stick's lower end."""
        return np.array([2.5 * self.ball_radius, 0.0, 0.0])

    @property
    def stick_height(self) -> float:
        return 2.5 * self.ball_radius

    @property
    def stick_radius(self) -> float:
        return 0.06 * self.ball_radius


def placeholder_of(scene: Scene) -> Placeholder:
    """The placeholder of a scene, which always takes up the same part of the picture."""
    distance = float(np.linalg.norm(scene.spot - scene.camera_position))
    return Placeholder(2 * BALL * distance * float(np.tan(np.radians(scene.vertical_fov) / 2)))
