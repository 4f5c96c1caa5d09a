"""Where an object may stand on the ground that a photo shows, and how much of it the photo shows.

What the photo shows is of `prediction.photo_segments`; the camera says where the ground lies and how far it is.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import lighting.geometry as geometry
from lighting.envmap.projection import photo_camera
from lighting.envmap.shadow_mask import box_means, shadow_receivers, stands_in_sun
from lighting.errors import ErrorCode, ParameterError
from lighting.fields import round_significant
from lighting.geometry import Floats, Pinhole
from lighting.photo.reader import Photo
from lighting.prediction import (
    THINGS,
    EstimatedLight,
    Prediction,
    Segments,
    SurfaceClass,
    class_share,
    photo_segments,
    pixel_share,
)
from lighting.records import Color, Lighting

OBJECT_RADIUS = 0.055  # of a ball that stands on the spot, in picture heights
_ROW_WIDTH = 3.6  # half the width of three such balls side by side, in radii

_MIN_RADIUS = 0.012  # of a ball, in picture heights; smaller ones are hardly seen
_MAX_RADIUS_METERS = 1.0  # of a ball; on ground that is farther away it is smaller in the picture
_MAX_RADIUS_SHARE = 0.4  # of the camera's height, so that no ball reaches above the horizon
_MAX_WIDTH_SHARE = 0.95  # of a narrow picture's width, which three balls fill at most
_MIN_DESCENT = 0.01  # sine of the angle below the horizon, from which on a stated spot lies on the ground
_MAX_FOOT_ROW = 0.97  # of the picture's height, where a foot may stand

_MIN_VISIBLE = 0.02  # share of a picture that shows ground to speak of
_STAGE = "objects get their own stage."

_SURE_GROUND = 160  # of 255, from which a cell of a mask counts as firm, and as in the sun
_ROOM = 2  # cells beside a lit spot that are to be so, too

_ROWS = 72  # of the picture in which the spot is sought
_MIN_GROUND = 0.5  # probability from which a cell counts as ground
_MIN_SUPPORT = 0.55  # probability of ground under a ball
_MAX_WATER = 0.15  # probability of water under it
_IN_FRONT = tuple(kind for kind in THINGS if kind != SurfaceClass.SKY)
_MAX_IN_FRONT = 0.6  # probability of things in front of a ball, which it would cover
_MIN_ROW_SUPPORT = 0.2  # the same under each of three of them side by side
_FOOT_HEIGHT = 0.7  # radii over and under a foot that must show ground
_LATERAL_COST = 0.15  # of probability that one is ready to lose for the picture's whole width
_VERTICAL_COST = 0.1  # the same for its height, from _BEST_ROW
_BEST_ROW = 0.8  # of the picture's height
_SIZE_COST = 0.03  # the same for half the size
_STRETCH_COST = 0.3  # the same for a ball that perspective draws twice as long as wide
_MAX_STRETCH = 1.3  # how much longer than wide a ball may be drawn; wide lenses draw eggs at their pictures' edges


def draw_ground_mask(lit: NDArray[np.float32], lighting: Lighting, segments: Segments | None) -> NDArray[np.uint8]:
    """Return what is known of a photo's ground as a picture (H, W, 3), 0 to 255.

    Red is the probability of firm, level ground. Green is how far the sun reaches the ground, and 0 on what stands
    before it. Blue is 255 where a ball would stand in the sun by the rule of `envmap.shadow_mask`, else 0.

    Args:
        lit: (H, W) the photo's `ground_shadow_mask`.
        lighting: of the photo, whose camera counts.
        segments: of the photo; None: all is ground.
    """
    height, width = lit.shape
    firm = np.ones_like(lit) if segments is None else pixel_share(segments, width, height, SurfaceClass.GROUND)
    mask = np.stack([firm, shadow_receivers(lit, segments), find_sunny_ground(lit, lighting)], axis=-1)
    return np.round(255 * mask.clip(0, 1)).astype(np.uint8)


def find_sunny_ground(lit: NDArray[np.float32], lighting: Lighting) -> NDArray[np.bool_]:
    """Return where (H, W) of a photo a ball would stand in the sun, by the rule of `envmap.shadow_mask`.

    Args:
        lit: (H, W) the photo's `ground_shadow_mask`.
        lighting: of the photo, whose camera counts.
    """
    camera = photo_camera(lighting, lit.shape[1], lit.shape[0])
    rays = geometry.camera_directions(camera)
    return stands_in_sun(lit, object_radius(camera, -rays[..., 1] / (rays @ camera.axes[2]), lighting.camera_height))


def find_lit_spot(mask: NDArray[np.uint8], near: tuple[float, float]) -> tuple[float, float] | None:
    """Return the nearest point where firm ground lies in the sun, with room beside it; None where there is none.

    Args:
        mask: (H, W, 3) of a picture, by `draw_ground_mask`.
        near: (x, y) of the point from which it is sought, in shares of the picture's width and height.

    Returns:
        (x, y) in the same shares.
    """
    rows, columns, _ = mask.shape
    sure = (mask >= _SURE_GROUND).all(axis=-1)
    steps = range(-_ROOM, _ROOM + 1, _ROOM)
    padded = np.pad(sure, _ROOM)
    fits = np.logical_and.reduce(
        [padded[_ROOM + y : _ROOM + y + rows, _ROOM + x : _ROOM + x + columns] for y in steps for x in steps]
    )
    if not fits.any():
        return None
    y, x = np.nonzero(fits)
    best = np.argmin((x + 0.5 - near[0] * columns) ** 2 + (y + 0.5 - near[1] * rows) ** 2)
    return float((x[best] + 0.5) / columns), float((y[best] + 0.5) / rows)


def is_in_sun(sunny: NDArray[np.bool_], foot: Floats) -> bool:
    """Return whether an object on the ground stands in the sun; outside of the photo, the nearest cell counts.

    Args:
        sunny: (H, W) of a photo, by `find_sunny_ground`.
        foot: (x, y) in shares of its width and height; NaN behind the camera, where it does.
    """
    if not np.isfinite(foot).all():
        return True
    column, row = np.clip(foot * sunny.shape[::-1], 0, np.array(sunny.shape[::-1]) - 1).astype(int)
    return bool(sunny[row, column])


class _Spot(NamedTuple):
    """Where an object may stand."""

    pixel: tuple[float, float]  # (x, y) in the picture
    direction: Color  # unit vector from the camera


def describe_ground(
    photo: Photo,
    estimate: EstimatedLight,
    prediction: Prediction,
    is_aerial: bool = False,
    stated: tuple[float, float] | None = None,
) -> EstimatedLight:
    """Return the estimate of a photo with what the photo shows, and where in it an object may stand.

    Without a stated spot the estimate stays as it is where the network does not predict what photos show.

    Args:
        photo: as `read_photo` returns it.
        estimate: of its light and camera.
        prediction: of the photo.
        is_aerial: whether the camera flies at an unknown height; only a stated spot counts then.
        stated: (x, y) where the user puts the object, in pixels of the photo; None: where the photo shows ground.

    Raises:
        ParameterError: the stated spot lies outside the photo, or where the camera sees no ground.
    """
    segments = photo_segments(prediction.segments, photo.width, photo.height)
    if segments is None and stated is None:
        return estimate
    light = estimate.lighting
    camera = photo_camera(light, photo.width, photo.height)
    spot = None if stated is None else _stated_spot(camera, stated)
    if spot is None and segments is not None and not is_aerial:
        spot = _find_ground_spot(segments, camera, light.camera_height)
    visible = None if segments is None else round_significant(_visible_ground(segments))
    pixel, ray = spot or (None, None)
    light = replace(light, ground_visible=visible, spot_pixel=pixel, spot_direction=ray)
    return replace(estimate, lighting=light, segments=segments)


def spot_warnings(lighting: Lighting) -> tuple[str, ...]:
    """Return why no object stands in a photo; nothing where its record states a spot, or the ground was not sought.

    Args:
        lighting: the photo's.
    """
    if lighting.spot_pixel is not None or lighting.ground_visible is None:
        return ()
    if lighting.ground_visible < _MIN_VISIBLE:
        return (f"The photo shows no firm, level ground near by: {_STAGE}",)
    return (f"The photo's ground is too small or too far: {_STAGE}",)


def _visible_ground(segments: Segments) -> float:
    """Return the share of a picture that shows firm, level ground near by.

    Args:
        segments: of the picture.
    """
    return float((class_share(segments, SurfaceClass.GROUND) >= _MIN_GROUND).mean())


def object_radius(camera: Pinhole, down: Floats, camera_height: float) -> Floats:
    """Return the radius [pixels] of balls (...) on the ground, so small that three side by side fit; 0 above it.

    Args:
        camera: whose picture it is.
        down: (...) how far directions point down for each length that they point ahead of the camera.
        camera_height: m above the ground.
    """
    most = min(OBJECT_RADIUS * camera.height, _MAX_WIDTH_SHARE * camera.width / (2 * _ROW_WIDTH))
    meters = max_object_meters(camera_height)
    return np.asarray(np.minimum(most, camera.focal_length * meters * np.maximum(down, 0.0) / camera_height))


def max_object_meters(camera_height: float) -> float:
    """Return the largest radius [m] of a ball on the ground: no giant, and none that reaches above the horizon.

    Args:
        camera_height: m above the ground.
    """
    return min(_MAX_RADIUS_METERS, _MAX_RADIUS_SHARE * camera_height)


def _find_ground_spot(segments: Segments, camera: Pinhole, camera_height: float) -> _Spot | None:
    """Return where an object may stand in a picture; None where it shows no ground for one.

    The ground must be below the horizon, and so near that a ball is seen there. Of such places the one counts most
    under and beside which the picture most surely shows ground; then the nearer to the lower middle, the better.

    Args:
        segments: of the picture.
        camera: that took it, at its size.
        camera_height: m above the ground.
    """
    small = replace(camera, width=max(1, round(camera.width * _ROWS / camera.height)), height=_ROWS)
    size = small.width, small.height
    rays = geometry.camera_directions(small)
    radius = object_radius(small, -rays[..., 1] / (rays @ small.axes[2]), camera_height)
    seen = np.flatnonzero(radius.max(axis=1) >= _MIN_RADIUS * _ROWS)
    if not len(seen):
        return None
    first, radius = int(seen[0]), radius[seen[0] :]  # of rows: no ball stands on those above
    ground, water = (pixel_share(segments, *size, kind) for kind in (SurfaceClass.GROUND, SurfaceClass.WATER))
    things = pixel_share(segments, *size, *_IN_FRONT)
    stretch = _stretches(small, radius)
    boxes = _Boxes.of_balls(radius)
    score = _spot_scores(ground, radius, boxes) - _STRETCH_COST * (stretch - 1)
    score[~((stretch <= _MAX_STRETCH) & _is_free(water, things, radius, boxes))] = -np.inf
    row, column = np.unravel_index(np.argmax(score), score.shape)
    if not np.isfinite(score[row, column]):
        return None
    x, y = (np.array([column, first + row]) + 0.5) * [camera.width / small.width, camera.height / small.height]
    return _spot_at(camera, float(x), float(y))


def _spot_at(camera: Pinhole, x: float, y: float) -> _Spot:
    """Return the spot at a pixel of a camera's picture."""
    lateral, vertical, depth = np.round(geometry.pixel_ray(camera, (x, y)), 6).tolist()
    return _Spot((round(x, 1), round(y, 1)), (lateral, vertical, depth))


def _stated_spot(camera: Pinhole, stated: tuple[float, float]) -> _Spot:
    """Return the spot at a pixel that the user states; ParameterError where the camera sees no ground."""
    x, y = stated
    if not (0 <= x < camera.width and 0 <= y < camera.height):
        sentence = f"The spot {x:g},{y:g} lies outside the photo of {camera.width} x {camera.height} pixels."
        raise ParameterError(sentence, "spot", ErrorCode.OUT_OF_RANGE)
    spot = _spot_at(camera, x, y)
    if spot.direction[1] > -_MIN_DESCENT:
        sentence = "The spot lies at the horizon or over it, where no ground is; state one below it."
        raise ParameterError(sentence, "spot", ErrorCode.OUT_OF_RANGE)
    return spot


def _stretches(camera: Pinhole, radius: Floats) -> Floats:
    """How much longer than wide (h, w) the picture of the outermost of three balls would be, by its radius (h, w).

    Here and below, the h rows are the lowest of _ROWS.
    """
    y, x = _middles(radius)
    outermost = np.abs(x - camera.width / 2) + (_ROW_WIDTH - 1) * radius
    return np.asarray(np.sqrt(1 + (outermost**2 + (y - camera.height / 2) ** 2) / camera.focal_length**2))


def _middles(radius: Floats) -> tuple[Floats, Floats]:
    """Where the middles of the lowest rows (h, 1) and of the columns (w,) of a picture lie."""
    rows, columns = radius.shape
    return np.arange(_ROWS - rows, _ROWS)[:, None] + 0.5, np.arange(columns) + 0.5


_Ends = tuple[NDArray[np.intp], NDArray[np.intp]]  # the first row or column (h, w), and the one after the last


@dataclass(frozen=True, eq=False, repr=False)
class _Boxes:
    """The pixels under and behind a ball that stands in each place."""

    columns: _Ends  # that it covers
    foot: _Ends  # rows where it meets the ground
    rows: _Ends  # as many as columns

    @classmethod
    def of_balls(cls, radius: Floats) -> "_Boxes":
        """Of balls of a radius (h, w) [pixels]."""
        y, x = _middles(radius)
        foot, rows = (_ends(y, reach, _ROWS) for reach in (_FOOT_HEIGHT * radius, radius))
        return cls(_ends(x, radius, radius.shape[1]), foot, rows)


def _ends(middle: Floats, reach: Floats, count: int) -> _Ends:
    """The ends (h, w) of boxes within `count` rows or columns that reach so far (h, w) from the middle of a pixel."""
    first, end = (np.clip(np.round(edge), 0, count).astype(np.intp) for edge in (middle - reach, middle + reach))
    end = np.minimum(np.maximum(end, first + 1), count)
    return np.minimum(first, end - 1), end


def _spot_scores(ground: NDArray[np.float32], radius: Floats, boxes: _Boxes) -> Floats:
    """How well (h, w) a row of balls would stand in each place, -inf where none can.

    `ground` (_ROWS, w) is the probability of ground, `radius` (h, w) that of a ball [pixels].
    """
    rows, columns = ground.shape
    y, x = _middles(radius)
    under_one = box_means(ground, boxes.foot, boxes.columns)
    under_all = np.minimum(under_one, np.minimum(*_beside(under_one, radius)))
    fits = (np.abs(x - columns / 2) + _ROW_WIDTH * radius <= columns / 2 + 0.5) & (y <= _MAX_FOOT_ROW * rows)
    stands = (under_one >= _MIN_SUPPORT) & (under_all >= _MIN_ROW_SUPPORT) & (radius >= _MIN_RADIUS * rows)
    away = _LATERAL_COST * np.abs(x / columns - 0.5) + _VERTICAL_COST * np.abs(y / rows - _BEST_ROW)
    size = np.log2(np.maximum(radius, 1e-6) / (OBJECT_RADIUS * rows))
    return np.where(fits & stands, (under_one + under_all) / 2 - away + _SIZE_COST * size, -np.inf)


def _beside(values: Floats, radius: Floats) -> tuple[Floats, Floats]:
    """The values (h, w) where the outer two of three balls in a row stand, by their radius (h, w)."""
    middle, shift = np.arange(values.shape[1]), np.round((_ROW_WIDTH - 1) * radius).astype(np.intp)
    left = np.take_along_axis(values, np.maximum(middle - shift, 0), axis=1)
    right = np.take_along_axis(values, np.minimum(middle + shift, values.shape[1] - 1), axis=1)
    return left, right


def _is_free(
    water: NDArray[np.float32], things: NDArray[np.float32], radius: Floats, boxes: _Boxes
) -> NDArray[np.bool_]:
    """Where (h, w) three balls of a radius (h, w) [pixels] stand on no water, and cover nothing that is nearer.

    What is nearer stands farther down in the picture. `water` and `things` (_ROWS, w) are probabilities.
    """
    rows = len(radius)
    in_front = box_means(things, boxes.rows, boxes.columns)
    below = np.minimum(np.arange(rows)[:, None] + np.round(radius).astype(np.intp), rows - 1)
    in_front = np.take_along_axis(in_front, below, axis=0)
    in_front = np.maximum(in_front, np.maximum(*_beside(in_front, radius)))
    wet = box_means(water, boxes.foot, boxes.columns)
    return np.asarray((in_front <= _MAX_IN_FRONT) & (wet <= _MAX_WATER))
