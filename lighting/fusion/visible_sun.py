"""A sun that the picture shows: it stays on its pixel when more is known of the camera.

The network's distribution is in directions, by the camera that the network estimates. Where the picture shows the sun,
the evidence is a pixel: another field of view, elevation or roll moves its direction, and the ephemeris tells how the
camera is tilted. A sun outside the picture is inferred from shadows and shading, and stays where it is.
"""

import math

import numpy as np
from numpy.typing import NDArray

import lighting.geometry as geometry
from lighting.color import luminance
from lighting.fields import RANGES
from lighting.geometry import Floats, Pinhole, angles, camera_axes, direction, wrap_azimuth
from lighting.prediction import Prediction, SunEstimate
from lighting.sun_grid import bayes_direction, grid_directions, soft_label, splat_to_grid

_SUN_PIXEL_STD = 2.0  # deg, of the visible sun's pixel: the network predicts its cell, 16 of 224 pixels
_MIN_VISIBLE_SHARE = 0.6  # of the probability near the answer from which the picture counts as showing the sun
_NEAR_ANGLE = 12.0  # deg from the answer
_REPROJECTED_ANGLE = 25.0  # deg from the answer within which the probability moves with the pixels
_MAX_ASPECT_RATIO = 16 / 9  # of a picture; the prediction does not tell the photo's own
_SAME_CAMERA = 0.02  # share by which two focal lengths, and rad by which two axes, may differ and count as one
_GLARE_ANGLE = 3.0  # deg from its pixel within which a visible sun makes the picture white
_WHITE_LEVEL = 245  # of 255, coded luminance
_MIN_WHITE_SHARE = 0.03  # of the pixels within the glare; 97 % of the crops that show the sun have more
_MAX_SUN_DIFFERENCE = (15.0, 12.0)  # deg of azimuth and elevation up to which ephemeris and picture show one sun


def visible_sun(prediction: Prediction, pixels: NDArray[np.uint8] | None = None) -> Floats | None:
    """Unit vector (3,) towards the sun by the pixels alone if the picture shows it, else None.

    Args:
        prediction: of the network.
        pixels: (h, w, 3) sRGB. A photo that is not white there does not show the sun. None: as white.
    """
    if prediction.sun_visibility < 0.5:
        return None
    sun = prediction.sun_direction
    right, up, forward = camera_axes(0.0, prediction.camera_elevation, prediction.camera_roll) @ sun
    edge = forward * math.tan(math.radians(prediction.vertical_fov) / 2)
    if abs(up) > edge or abs(right) > _MAX_ASPECT_RATIO * edge:
        return None
    near = grid_directions(prediction.spec.sun_grid) @ sun >= math.cos(math.radians(_NEAR_ANGLE))
    if float(prediction.sun_probability @ near) < _MIN_VISIBLE_SHARE:
        return None
    if pixels is None:
        return sun
    height, width = pixels.shape[:2]
    camera = Pinhole(width, height, prediction.vertical_fov, 0.0, prediction.camera_elevation, prediction.camera_roll)
    x, y = geometry.camera_pixel(sun, camera)  # by the network's own camera
    reach = camera.focal_length * math.tan(math.radians(_GLARE_ANGLE))
    rows, columns = (slice(max(0, int(at - reach)), max(0, int(at + reach) + 1)) for at in (y, x))
    window = pixels[rows, columns]
    is_white = window.size > 0 and float(np.mean(luminance(window) >= _WHITE_LEVEL)) >= _MIN_WHITE_SHARE
    return sun if is_white else None


def reproject_sun(prediction: Prediction, camera: Prediction, sun: Floats) -> NDArray[np.float32]:
    """Move the probability near a visible sun to where its pixels look by another camera.

    Args:
        prediction: of the network, in directions by its own camera.
        camera: the same with the elevation, roll and field of view that are better known.
        sun: (3,) unit vector towards the visible sun by the network's camera.

    Returns:
        Probabilities (N,) of the network's cells.
    """
    ratio = math.tan(math.radians(camera.vertical_fov) / 2) / math.tan(math.radians(prediction.vertical_fov) / 2)
    axes_before, axes_after = (camera_axes(0.0, p.camera_elevation, p.camera_roll) for p in (prediction, camera))
    if abs(math.log(ratio)) < _SAME_CAMERA and float(np.abs(axes_before - axes_after).max()) < _SAME_CAMERA:
        return prediction.sun_probability
    cells = grid_directions(prediction.spec.sun_grid)
    right, up, forward = (cells @ axes_before.T).T
    near = (cells @ sun >= math.cos(math.radians(_REPROJECTED_ANGLE))) & (forward > 0)
    rays = np.stack([ratio * right, ratio * up, forward], axis=-1)[near] @ axes_after
    rays[:, 1] = np.maximum(rays[:, 1], 0.0)  # no sun is below the horizon
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    p = np.asarray(prediction.sun_probability, dtype=np.float64)
    moved = np.where(near, 0.0, p) + splat_to_grid(p[near], rays, prediction.spec.sun_grid)
    return np.asarray(moved, dtype=np.float32)


def tilt_by_sun(prediction: Prediction, sun: SunEstimate, camera_elevation: float, tilt_std: float) -> float:
    """The camera's elevation [deg] by which the visible sun has the elevation of time and place.

    The tilt and the pixel's are weighted by their variances (Kalman's gain). The sun is compared with the mean of a
    lobe at the known sun: the horizon cuts half of a low one off, so it seems higher. A sun too far from the known one
    tells nothing.

    Args:
        prediction: whose picture shows the sun.
        sun: by time and place.
        camera_elevation: deg, by network and gravity.
        tilt_std: deg, one standard deviation of that.
    """
    grid = prediction.spec.sun_grid
    visible = prediction.sun_direction
    lobe = soft_label(direction(sun.azimuth, sun.elevation), _lobe_std(prediction, visible) ** -2, grid)
    (azimuth, elevation), (true_azimuth, true_elevation) = (angles(s) for s in (visible, bayes_direction(lobe, grid)))
    lateral, vertical = float(wrap_azimuth(true_azimuth - azimuth)), float(true_elevation - elevation)
    if abs(lateral) > _MAX_SUN_DIFFERENCE[0] or abs(vertical) > _MAX_SUN_DIFFERENCE[1]:
        return camera_elevation
    slope = float(np.cos(np.radians(azimuth)))  # deg of the sun's elevation for each deg of tilt
    gain = slope * tilt_std**2 / (slope**2 * tilt_std**2 + _SUN_PIXEL_STD**2)
    return float(np.clip(camera_elevation + gain * vertical, *RANGES["camera_elevation"]))


def _lobe_std(prediction: Prediction, sun: Floats) -> float:
    """How wide [rad] the probability of the visible sun (3,) is to its sides, where no horizon cuts it off."""
    probability, cells = prediction.sun_probability, grid_directions(prediction.spec.sun_grid)
    near = cells @ sun >= math.cos(math.radians(_NEAR_ANGLE))
    lateral = cells[near] @ direction(float(angles(sun)[0]) + 90.0, 0.0)
    return max(math.sqrt(float(np.average(lateral**2, weights=probability[near]))), math.radians(_SUN_PIXEL_STD))
