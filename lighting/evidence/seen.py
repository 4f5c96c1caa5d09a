"""A sun that the picture shows stays on its pixel when more is known of the camera.

The network's distribution is in directions, by the camera that the network estimates. Where the picture shows the sun,
the evidence is a pixel: another field of view, elevation or roll of the camera moves its direction, and the ephemeris's
elevation says how the camera is tilted. A sun outside the picture is known by shadows and shading, whose directions
are the world's: it stays where it is.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance
from lighting.decoding import best_guess
from lighting.evidence.fusion import Evidence, Fused, fuse_stood, stand
from lighting.evidence.gravity import tilt_spread
from lighting.geometry import Floats, Pinhole, angles, camera_axes, camera_pixel, direction, wrap_azimuth
from lighting.ranges import RANGES
from lighting.records import Prediction
from lighting.sun_grid import grid_directions, over_cells, soft_label

PIXEL_SPREAD = 2.0  # deg, of the seen sun's pixel: the network says its cell, 16 of 224 pixels
_SHOWN = 0.6  # least share of the probability near the answer from which the picture counts as showing the sun
_NEAR = 12.0  # deg around the answer
_MOVED = 25.0  # deg around the answer in which the probability moves with the pixels
_WIDEST = 16 / 9  # aspect ratio of the widest picture; the prediction does not know the photo's own
_SAME = 0.02  # share by which two focal lengths may differ and count as one, and rad by which two axes may
_GLARE = 3.0  # deg around its pixel in which a seen sun makes the picture white
_WHITE = 245  # of 255, coded luminance
_WHITE_SHARE = 0.03  # least share of the pixels there; 97 % of the crops that show the sun have more
_FAR = (15.0, 12.0)  # deg of azimuth and elevation, from which the sun of time and place is not the one seen


def fuse_photo(prediction: Prediction, evidence: Evidence, pixels: NDArray[np.uint8] | None = None) -> Fused:
    """Fuse one photo's prediction with its evidence; errors as in `fuse`.

    With its `pixels` (h, w, 3), a photo that is not white where the network has the sun counts as not showing it: then
    the network knows the direction by more than a pixel.
    """
    stood, sun = stand(prediction, evidence), shown_sun(prediction, pixels)
    if sun is None:
        return fuse_stood(stood)
    lens = stood.evidence.vertical_fov or prediction.vertical_fov
    probability = through_camera(prediction, replace(stood.prediction, vertical_fov=lens), sun)
    moved = replace(stood.prediction, sun_probability=probability)
    fused = fuse_stood(replace(stood, prediction=moved))
    return _levelled(fused, moved, tilt_spread(stood.evidence.gravity))


def shown_sun(prediction: Prediction, pixels: NDArray[np.uint8] | None = None) -> Floats | None:
    """Unit vector (3,) towards the sun by the pixels alone if the picture shows it, else None.

    With its `pixels` (h, w, 3), a photo that is not white there does not show it.
    """
    if prediction.sun_visibility < 0.5:
        return None
    probability, cells = prediction.sun_probability, grid_directions(prediction.spec.sun_grid)
    sun = best_guess(probability, prediction.spec.sun_grid)
    right, up, forward = camera_axes(0.0, prediction.camera_elevation, prediction.camera_roll) @ sun
    edge = forward * math.tan(math.radians(prediction.vertical_fov) / 2)
    inside = abs(up) <= edge and abs(right) <= _WIDEST * edge
    sure = float(probability @ (cells @ sun >= math.cos(math.radians(_NEAR)))) >= _SHOWN
    if not (inside and sure):
        return None
    return sun if pixels is None or _glares(pixels, prediction, sun) else None


def _glares(pixels: NDArray[np.uint8], prediction: Prediction, sun: Floats) -> bool:
    """Whether the picture is white around the pixel of the sun (3,) by the network's own camera."""
    height, width = pixels.shape[:2]
    camera = Pinhole(width, height, prediction.vertical_fov, 0.0, prediction.camera_elevation, prediction.camera_roll)
    x, y = camera_pixel(sun, camera)
    reach = camera.focal_length * math.tan(math.radians(_GLARE))
    rows, columns = (slice(max(0, int(at - reach)), max(0, int(at + reach) + 1)) for at in (y, x))
    around = pixels[rows, columns]
    return around.size > 0 and float(np.mean(luminance(around) >= _WHITE)) >= _WHITE_SHARE


def through_camera(prediction: Prediction, known: Prediction, sun: Floats) -> NDArray[np.float32]:
    """The sun's probability with the seen sun (3,) and what lies around it where their pixels look by `known`'s camera.

    What the network said is in directions by the camera of `prediction`.
    """
    ratio = math.tan(math.radians(known.vertical_fov) / 2) / math.tan(math.radians(prediction.vertical_fov) / 2)
    said, there = (camera_axes(0.0, p.camera_elevation, p.camera_roll) for p in (prediction, known))
    if abs(math.log(ratio)) < _SAME and float(np.abs(said - there).max()) < _SAME:
        return prediction.sun_probability
    cells = grid_directions(prediction.spec.sun_grid)
    right, up, forward = (cells @ said.T).T
    near = (cells @ sun >= math.cos(math.radians(_MOVED))) & (forward > 0)
    rays = np.stack([ratio * right, ratio * up, forward], axis=-1)[near] @ there
    rays[:, 1] = np.maximum(rays[:, 1], 0.0)  # no sun stands below the horizon
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    p = np.asarray(prediction.sun_probability, dtype=np.float64)
    moved = np.where(near, 0.0, p) + over_cells(p[near], rays, prediction.spec.sun_grid)
    return np.asarray(moved, dtype=np.float32)


def _levelled(fused: Fused, prediction: Prediction, spread: float) -> Fused:
    """The answer with the camera tilted so that the seen sun stands at the elevation of time and place.

    The tilt, known to `spread` [deg], and the pixel's are weighted by their errors (Kalman's gain). The sun is looked
    for where its probability would be seen to stand: on the horizon half of that is cut off, so it seems higher.
    """
    if fused.camera_heading is None:
        return fused
    grid = prediction.spec.sun_grid
    seen = best_guess(prediction.sun_probability, grid)
    known = soft_label(direction(fused.sun.azimuth, fused.sun.elevation), _width(prediction, seen) ** -2, grid)
    (azimuth, elevation), (known_azimuth, known_elevation) = (angles(s) for s in (seen, best_guess(known, grid)))
    aside, above = float(wrap_azimuth(known_azimuth - azimuth)), float(known_elevation - elevation)
    if abs(aside) > _FAR[0] or abs(above) > _FAR[1]:
        return fused
    turn = float(np.cos(np.radians(azimuth)))  # deg of the sun's elevation for each deg of tilt
    gain = turn * spread**2 / (turn**2 * spread**2 + PIXEL_SPREAD**2)
    tilt = float(np.clip(fused.prediction.camera_elevation + gain * above, *RANGES["camera_elevation"]))
    return replace(fused, prediction=replace(fused.prediction, camera_elevation=tilt))


def _width(prediction: Prediction, sun: Floats) -> float:
    """How wide [rad] the probability of the seen sun (3,) is to its sides, where no horizon cuts it off."""
    probability, cells = prediction.sun_probability, grid_directions(prediction.spec.sun_grid)
    near = cells @ sun >= math.cos(math.radians(_NEAR))
    aside = cells[near] @ direction(float(angles(sun)[0]) + 90.0, 0.0)
    return max(math.sqrt(float(np.average(aside**2, weights=probability[near]))), math.radians(PIXEL_SPREAD))
