"""A picture of three spheres, mirror, glossy and diffuse, on the ground under an environment map.

The camera keeps the photo's heading and, as far as the ground stays in view, its pitch, so that light and shadow fall
as in the photo. The ground has the colour of the map's own ground, so it meets the horizon without a seam.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Pinhole, camera_axes, camera_directions, focal_length
from lighting.records import Lighting
from lighting.spheres.bounces import lit_stage
from lighting.spheres.shading import Stage, trace

VERTICAL_FOV = 40.0  # deg
PITCH = (-20.0, -5.0)  # deg, range of the camera's elevation that keeps ground and sky in view
SPACING = 2.6  # between neighbouring centres, in radii
CENTRE_HEIGHT = 0.60  # of the middle sphere in the picture, 0 = top, 1 = bottom
PICTURE_WIDTH = 8.6  # at the spheres' distance, in radii


def render_spheres(
    envmap: NDArray[np.float32],
    lighting: Lighting,
    width: int,
    height: int,
    supersampling: int = 2,
    centres: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Linear picture (supersampling x height, supersampling x width, 3) of the spheres under a map (H, 2H, 3).

    They stand where `sphere_centres` says, or at `centres` (3, 3) from the camera, on the same ground.
    """
    centres = sphere_centres(width / height, pitch_of(lighting)) if centres is None else centres
    stage = lit_stage(envmap, lighting.sun_direction, centres.astype(np.float64))
    return render_stage(stage, lighting, width, height, supersampling)


def render_stage(
    stage: Stage, lighting: Lighting, width: int, height: int, supersampling: int = 2
) -> NDArray[np.float32]:
    """The same picture of a stage that is lit already."""
    columns, rows = width * supersampling, height * supersampling
    camera = Pinhole(columns, rows, VERTICAL_FOV, elevation=pitch_of(lighting))
    rays = camera_directions(camera).astype(np.float32).reshape(-1, 3)
    picture = trace(np.zeros(3, np.float32), rays, replace(stage, centres=stage.centres.astype(np.float32)))
    return np.asarray(picture.reshape(rows, columns, 3), dtype=np.float32)


def pitch_of(lighting: Lighting) -> float:
    """Elevation [deg] of the stage's camera: the photo's, as far as the ground stays in view."""
    return float(np.clip(lighting.camera_elevation, *PITCH))


def sphere_centres(aspect: float, pitch: float) -> NDArray[np.float32]:
    """The spheres' centres (3, 3) as seen from a camera at the origin whose elevation is `pitch` [deg]."""
    right, up, forward = camera_axes(0.0, pitch, 0.0)
    height = PICTURE_WIDTH / aspect
    middle = forward * focal_length(height, VERTICAL_FOV) + up * (0.5 - CENTRE_HEIGHT) * height
    return np.asarray(middle + np.array([[-SPACING], [0.0], [SPACING]]) * right, dtype=np.float32)
