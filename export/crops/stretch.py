"""A place as it would look if the world were stretched: the same picture under another sun, with shadows that agree.

A stretch of the world upwards or along the ground is linear. It keeps straight lines, upright things and what lies on
the ground, and it turns the sun's rays as it turns the shadows that they cast. Seen from the camera, where it is
centred, it moves directions by themselves, whatever their depth. So a panorama tells exactly what its stretched world
looks like: a place whose sun stands at 30 degrees shows it at 22 or 39, with the shadows of such suns.
"""

from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats, direction

UPWARDS = 0.6  # octaves, largest stretch or squeeze upwards
ALONG = 0.25  # octaves, along the ground


@dataclass(frozen=True)
class Stretch:
    """By how much the world is stretched upwards, and along the ground in one heading of the panorama's frame."""

    upwards: float = 1.0
    along: float = 1.0
    heading: float = 0.0  # deg

    @property
    def largest(self) -> float:
        """The largest factor by which the panorama's pixels grow, 1 at least."""
        return max(self.upwards, self.along, 1.0 / self.along, 1.0)

    def applied(self, vectors: Floats) -> Floats:
        """Vectors (..., 3) of the world as vectors of the stretched world; unit vectors do not stay unit vectors."""
        return np.asarray(vectors @ self._matrix)

    def undone(self, vectors: Floats) -> Floats:
        """Vectors (..., 3) of the stretched world as vectors of the world, of any length."""
        return np.asarray(vectors @ np.linalg.inv(self._matrix).astype(vectors.dtype))

    @property
    def _matrix(self) -> Floats:
        """The stretch (3, 3), which is symmetric."""
        ahead = direction(self.heading, 0.0)
        matrix = np.eye(3) + (self.along - 1.0) * np.outer(ahead, ahead)
        matrix[1, 1] = self.upwards
        return matrix


NOT_STRETCHED = Stretch()


def any_stretch(rng: np.random.Generator) -> Stretch:
    """A stretch or a squeeze, each as likely, by at most UPWARDS and ALONG."""
    upwards, along = 2.0 ** rng.uniform((-UPWARDS, -ALONG), (UPWARDS, ALONG))
    return Stretch(float(upwards), float(along), rng.uniform(0.0, 180.0))
