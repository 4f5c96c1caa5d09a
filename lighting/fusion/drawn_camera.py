"""The camera by what a person draws in a photo: its horizon, straight edges, a thing of known size; or by fSpy.

Lines are fused with the camera that the pixels show, by least squares over elevation, roll and field of view. A line of
the horizon has two ends without elevation. An upright line and the camera span a plane that holds the vertical; of
level lines that are parallel, the planes share a level direction. Two such directions that cross at nearly a right
angle do so: houses have corners. All are right up to the person's hand, so that a long line counts more than a short
one.

Upright lines and such a right angle also tell a cropped photo: its principal point [1] is off its middle. The answer is
then the camera that looks at the middle.

References:
    [1] Caprile and Torre, Using Vanishing Points for Camera Calibration, IJCV 1990.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from lighting.errors import ErrorCode, ParameterError
from lighting.fields import RANGES
from lighting.fusion.marks import DrawnCamera, KnownCamera, LevelLines, Line, Point, Reference, move_drawn
from lighting.geometry import Floats, Pinhole, pixel_ray

_HAND_STD = 0.003  # of an end of a line, as a share of the photo's longer side
_UPRIGHT_STD = 0.3  # deg, of things that stand upright, or are level and parallel
_CAMERA_STD = (3.5, 2.0)  # deg, of the camera by the pixels: elevation and roll
_FOV_STD, _KNOWN_FOV_STD = 0.08, 1e-4  # of the logarithm of the field of view's tangent: by the pixels, and known
_PRINCIPAL_STD = 0.15  # of the principal point from the middle, for photos may be cropped; of the longer side
_CORNER_STD = 0.5  # deg, of the right angle between two level directions
_MAX_CORNER = 20.0  # deg by which that angle may be off a right one by the pixels' camera, to be one
_MAX_SKEW = 5.0  # deg by which a line may be off the common direction of parallel ones
_MAX_LEAN = 30.0  # deg from the camera's vertical, of an upright line by the pixels' camera
MIN_DESCENT = 0.5  # deg below the horizon, from which on a point lies on the ground
_FARTHEST_HORIZON = 1.5  # longer sides of the picture from its middle; half a side is its edge
_STEPS, _MAX_STEP = 20, np.array([15.0, 15.0, 0.5, 0.1, 0.1])  # of Gauss and Newton
_DIFFERENCE = 1e-4  # of numerical derivatives


def fit_camera(camera: Pinhole, drawn: DrawnCamera, *, lens_known: bool) -> Pinhole:
    """Return the camera by pixels and by what a person drew.

    Args:
        camera: by the pixels; its azimuth is 0.
        drawn: in pixels of the camera's picture.
        lens_known: whether its field of view is known, and stays.

    Raises:
        ParameterError: a horizon far outside the picture, a line that is said to be upright and lies flat, or lines
            that are said to be parallel and are not.
    """
    if drawn.known is not None:
        known = drawn.known
        return replace(camera, elevation=known.elevation, roll=known.roll, vertical_fov=known.vertical_fov)
    if drawn.horizon is not None:
        left, top, end, bottom = drawn.horizon
        from_middle = (end - left) * (top - camera.height / 2) - (bottom - top) * (left - camera.width / 2)
        away = abs(from_middle) / math.hypot(end - left, bottom - top) / max(camera.width, camera.height)
        if away > _FARTHEST_HORIZON:
            sentence = "The horizon lies far outside the photo; leave it out where the photo does not show it."
            raise ParameterError(sentence, "horizon", ErrorCode.OUT_OF_RANGE)
    if any(abs(_lean(camera, line)) > _MAX_LEAN for line in drawn.verticals):
        sentence = "A line that is said to be upright lies flat in the photo; draw along a wall's edge or a post."
        raise ParameterError(sentence, "verticals", ErrorCode.CONTRADICTION)
    prior_std = (*_CAMERA_STD, _KNOWN_FOV_STD if lens_known else _FOV_STD)
    pairs = combinations(range(len(drawn.levels)), 2)
    corners = [pair for pair in pairs if abs(_off_right_angle(camera, drawn, *pair)) <= _MAX_CORNER]
    principal_std = (_PRINCIPAL_STD,) * 2 if drawn.verticals and corners and not lens_known else ()
    change = _least_squares(camera, drawn, corners, np.array([*prior_std, *principal_std]))
    fitted, shift = _change_camera(camera, change), _principal_shift(camera, change)
    skews = [angle for group in move_drawn(drawn.levels, *shift) for angle in _skews(fitted, group)]
    if max(map(abs, skews), default=0.0) > _MAX_SKEW:
        sentence = (
            "Lines that are said to be level and parallel do not meet on the horizon; draw along edges of one wall."
        )
        raise ParameterError(sentence, "verticals", ErrorCode.CONTRADICTION)
    if any(shift):
        fitted = _look_at_middle(fitted, shift)
    return replace(fitted, vertical_fov=camera.vertical_fov) if lens_known else fitted


def _least_squares(
    camera: Pinhole, drawn: DrawnCamera, corners: Sequence[tuple[int, int]], prior_std: Floats
) -> Floats:
    """The change of the camera, as long as the deviations of what may change.

    Corners are pairs of level directions that cross at right angles.
    """

    def residuals(change: Floats) -> Floats:
        lines, changed = move_drawn(drawn, *_principal_shift(camera, change)), _change_camera(camera, change)
        turned = [_off_right_angle(changed, lines, *pair) / _CORNER_STD for pair in corners]
        return np.concatenate([change / prior_std, _line_residuals(changed, lines), turned])

    change = np.zeros(len(prior_std))
    for _ in range(_STEPS):
        here = residuals(change)
        columns = [
            (residuals(change + _DIFFERENCE * unit) - residuals(change - _DIFFERENCE * unit)) / (2 * _DIFFERENCE)
            for unit in np.eye(len(change))
        ]
        step = np.linalg.lstsq(np.stack(columns, axis=1), -here, rcond=None)[0]
        change = change + np.clip(step, -_MAX_STEP[: len(change)], _MAX_STEP[: len(change)])
    return change


def _principal_shift(camera: Pinhole, change: Floats) -> tuple[float, float]:
    """By how many pixels right and down lines move, so that the principal point comes to the picture's middle."""
    side = max(camera.width, camera.height)
    return (-side * float(change[3]), -side * float(change[4])) if len(change) > 3 else (0.0, 0.0)


def _look_at_middle(camera: Pinhole, shift: tuple[float, float]) -> Pinhole:
    """The camera turned to look at the middle of a picture whose points were moved."""
    width, height = camera.width, camera.height

    def ray(x: float, y: float) -> Floats:
        return pixel_ray(camera, (x + shift[0], y + shift[1]))

    rays = ray(width / 2, height / 2), ray(width / 2, 0.0), ray(width / 2, height)
    known = camera_through(*rays, up=np.array([0.0, 1.0, 0.0]))
    return replace(camera, elevation=known.elevation, roll=known.roll, vertical_fov=known.vertical_fov)


def _change_camera(camera: Pinhole, change: Floats) -> Pinhole:
    """The camera with other elevation and roll [deg], and another logarithm of half its field of view's tangent."""
    elevation, roll, log_tangent = map(float, change[:3])
    half = math.atan(math.tan(math.radians(camera.vertical_fov / 2)) * math.exp(log_tangent))
    low, high = RANGES["vertical_fov"]
    return replace(
        camera,
        elevation=min(max(camera.elevation + elevation, -89.0), 89.0),
        roll=(camera.roll + roll + 180.0) % 360.0 - 180.0,
        vertical_fov=min(max(2 * math.degrees(half), low), high),
    )


def _line_residuals(camera: Pinhole, drawn: DrawnCamera) -> Floats:
    """How far (N,) the lines are from what they stand for, in standard deviations of the hand that drew them."""
    hand = _HAND_STD * max(camera.width, camera.height)
    found = []
    if drawn.horizon is not None:
        ends = (drawn.horizon[:2], drawn.horizon[2:])
        std = math.degrees(hand / camera.focal_length)
        found += [math.degrees(math.asin(pixel_ray(camera, end)[1])) / std for end in ends]
    leaning = [(_lean(camera, line), line) for line in drawn.verticals]
    for group in drawn.levels:
        leaning += zip(_skews(camera, group), group.lines, strict=True)
    for angle, line in leaning:
        turned = math.degrees(math.sqrt(2) * hand / math.dist(line[:2], line[2:]))
        found.append(angle / math.hypot(turned, _UPRIGHT_STD))
    return np.array(found)


def _skews(camera: Pinhole, group: LevelLines) -> list[float]:
    """The angles [deg] between the planes of lines and the camera, and the level direction that lies nearest to all."""
    x, z = _level_direction(normals := _plane_normals(camera, group))
    return [math.degrees(math.asin(float(np.clip(normal @ (x, 0.0, z), -1.0, 1.0)))) for normal in normals]


def _plane_normals(camera: Pinhole, group: LevelLines) -> Floats:
    """Unit vectors (N, 3) across the planes that lines and the camera span."""
    normals = np.array([np.cross(pixel_ray(camera, line[:2]), pixel_ray(camera, line[2:])) for line in group.lines])
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _level_direction(normals: Floats) -> Floats:
    """The level direction, x and z (2,), that lies nearest to planes."""
    return np.asarray(np.linalg.svd(normals[:, [0, 2]])[2][-1])


def _off_right_angle(camera: Pinhole, drawn: DrawnCamera, first: int, second: int) -> float:
    """By how much [deg] two level directions are off a right angle."""
    one, other = (_level_direction(_plane_normals(camera, drawn.levels[index])) for index in (first, second))
    return math.degrees(math.asin(float(np.clip(one @ other, -1.0, 1.0))))


def _lean(camera: Pinhole, line: Line) -> float:
    """The angle [deg] between the vertical and the plane that a line and the camera span."""
    low, high = sorted((line[:2], line[2:]), key=lambda end: pixel_ray(camera, end)[1])
    normal = np.cross(pixel_ray(camera, low), pixel_ray(camera, high))
    return math.degrees(math.asin(float(normal[1] / np.linalg.norm(normal))))


def height_by_reference(reference: Reference, camera: Pinhole) -> float:
    """Return the camera's height above the ground [m] by a thing of known size.

    Args:
        reference: in pixels of the camera's picture.
        camera: any.

    Raises:
        ParameterError: the thing does not stand or lie on the ground of this camera.
    """
    above = "The foot of the thing of known size lies at the horizon or over it, where no ground is."
    foot = ground_point(camera, reference.start, "reference", above)
    if reference.lies:
        size = float(np.linalg.norm(ground_point(camera, reference.end, "reference", above) - foot))
    else:
        if abs(_lean(camera, (*reference.start, *reference.end))) > _MAX_LEAN:
            sentence = "The thing of known size does not stand upright; write ground: before it if it lies."
            raise ParameterError(sentence, "reference", ErrorCode.CONTRADICTION)
        ray = pixel_ray(camera, reference.end)
        level = float(foot[0] * ray[0] + foot[2] * ray[2])
        size = 1.0 + float(ray[1] * (foot[0] ** 2 + foot[2] ** 2)) / level if level > 0 else 0.0
    low, high = RANGES["camera_height"]
    if size <= 0 or not low <= reference.meters / size <= high:
        sentence = "The thing of known size gives the camera no height; draw from its foot on the ground to its top."
        raise ParameterError(sentence, "reference", ErrorCode.CONTRADICTION)
    return reference.meters / size


def ground_point(camera: Pinhole, point: Point, field: str, sentence: str) -> Floats:
    """Return the point (3,) of the ground behind a pixel, of a camera that stands 1 above it.

    Args:
        camera: any.
        point: (x, y) pixels.
        field: of the error.
        sentence: of the error where the pixel lies at the horizon or over it.

    Raises:
        ParameterError: it does.
    """
    ray = pixel_ray(camera, point)
    if ray[1] > -math.sin(math.radians(MIN_DESCENT)):
        raise ParameterError(sentence, field, ErrorCode.OUT_OF_RANGE)
    return np.asarray(ray / -ray[1])


def camera_through(forward: Floats, top: Floats, bottom: Floats, up: Floats) -> KnownCamera:
    """The camera that looks along a ray, by those through the middles of the picture's upper and lower edge.

    Args:
        forward: (3,) unit vector along the ray.
        top: (3,) unit vector through the middle of the upper edge.
        bottom: (3,) the same of the lower edge.
        up: (3,) unit vector, upwards in the frame of the rays.
    """
    level = np.cross(forward, up)
    level = level / np.linalg.norm(level)
    right = np.cross(forward, top - bottom)
    right = right / np.linalg.norm(right)
    roll = math.atan2(-float(right @ np.cross(level, forward)), float(right @ level))
    return KnownCamera(
        math.degrees(math.asin(float(forward @ up))),
        math.degrees(roll),
        math.degrees(math.acos(float(np.clip(top @ bottom, -1.0, 1.0)))),
    )
