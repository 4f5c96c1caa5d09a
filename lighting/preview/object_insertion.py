"""Three balls composited into the photo: on its ground, in its light, with their shadows and bounced light.

A ball replaces the photo's pixels. The ground keeps them, times the share of its light that the balls leave: where the
picture's ground already lies in shade, only the sky's light is left to take, so no shadow darkens it twice. Balls that
stand on such ground are in shade, too.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import lighting.geometry as geometry
from lighting.color import srgb_decode, tone_map
from lighting.envmap.projection import photo_camera
from lighting.envmap.shadow_mask import ground_shadow_mask, mean_sunlit
from lighting.geometry import Floats, Pinhole
from lighting.preview.spheres import SPACING, SphereScene, dim_sun, ground_radiance, shade_sphere, visible_sun_share
from lighting.records import Lighting

MAX_BALL_RADIUS = 0.055  # of a ball in the picture, in picture heights

_HALF_WIDTH = SPACING + 1.0  # of the balls side by side, in radii
_MAX_WIDTH_SHARE = 0.95  # of a narrow picture's width, which they fill at most
_FINE = 2  # rays per pixel and side on the balls and in their shadows
_COARSE = 2  # pixels per ray and side on the ground where light changes slowly
_FAR = 40.0  # radii from the balls to which they change the ground

_PLAIN_ROWS = 150  # in which differences count: paving and grass are plain in them, people and bollards are not
_MAX_FOOT_ROW = 0.95  # of the picture's height, where a foot may stand
_ABOVE, _BELOW = 2.0, 0.5  # ball radii that must be free over the feet and under them
_DISTANCE_PENALTY = 100.0  # gray levels of difference that one is ready to bear to stay in the lower middle


def insert_balls(picture: Image.Image, lighting: Lighting, scene: SphereScene) -> Image.Image:
    """The picture with balls on its ground; as it is where it shows too little ground.

    Args:
        picture: the photo, sRGB.
        lighting: the photo's light and camera.
        scene: balls in the light of the photo's own map; they are moved to where the picture shows ground.
    """
    camera = photo_camera(lighting, picture.width, picture.height)
    spot = _find_plain_spot(picture, camera, _ball_radius(camera), _HALF_WIDTH)
    if spot is None:
        return picture
    centers = _ball_centers(camera, spot)
    moved = replace(scene, centers=centers)
    linear = srgb_decode(np.asarray(picture) / np.float32(255)).astype(np.float32)
    lit = ground_shadow_mask(np.asarray(picture), lighting)
    share = mean_sunlit(lit, camera, centers - [0.0, 1.0, 0.0], _ball_radius(camera))
    standing = dim_sun(moved, share) if share < 1.0 else moved
    shaded = linear * _remaining_light(lit, camera, replace(moved, exchange=standing.exchange))
    return Image.fromarray(tone_map(_composite_balls(shaded, camera, standing)))


def shows_ground(camera: Pinhole) -> bool:
    """Whether `insert_balls` puts balls into a picture.

    Args:
        camera: the photo's.
    """
    return _has_room(camera, _ball_radius(camera), _HALF_WIDTH)


def _ball_radius(camera: Pinhole) -> float:
    """Radius [pixels] of the balls in a picture, so small that three side by side fit."""
    return min(MAX_BALL_RADIUS * camera.height, _MAX_WIDTH_SHARE * camera.width / (2 * _HALF_WIDTH))


def _ball_centers(camera: Pinhole, spot: tuple[float, float]) -> Floats:
    """The balls' centers (3, 3) as the camera at the origin has them, in radii; the middle one stands on a pixel."""
    right, up, forward = camera.axes
    x, y = (np.array(spot) - [camera.width / 2, camera.height / 2]) / camera.focal_length
    sight = forward + x * right - y * up
    depth = geometry.EYE_HEIGHT / -sight[1]
    radius = _ball_radius(camera) / camera.focal_length * depth
    middle = sight * depth / radius + [0.0, 1.0, 0.0]
    return np.asarray(middle + np.array([[-SPACING], [0.0], [SPACING]]) * [1.0, 0.0, 0.0])


def _remaining_light(lit: NDArray[np.float32], camera: Pinhole, scene: SphereScene) -> NDArray[np.float32]:
    """The share (h, w, 3) of each pixel's light that the balls leave or add; 1 above the ground.

    `lit` (H, W) says how far the picture's ground lies in sunlight.
    """
    sun = _enlarge(lit[..., None], camera) * (scene.ground - scene.ground_sky).astype(np.float32)
    open_ground = scene.ground_sky.astype(np.float32) + np.float32(1e-6)
    points, near = _coarse_ground_points(camera, scene)
    added = np.zeros((*near.shape, 3), dtype=np.float32)  # by the balls and all but the sun, less than 0 under them
    added[near] = ground_radiance(points, replace(scene, ground=scene.ground_sky)) - scene.ground_sky
    shadow = _shadow_factors(camera, scene, _shadow_cells(points, near, scene))
    left = open_ground + _enlarge(added, camera) + shadow[..., None] * sun
    return np.asarray(left / (open_ground + sun))


def _coarse_ground_points(camera: Pinhole, scene: SphereScene) -> tuple[Floats, NDArray[np.bool_]]:
    """Points (N, 3) of the ground that the balls change, in a picture of fewer pixels, and which (H, W) they are."""
    size = max(1, camera.width // _COARSE), max(1, camera.height // _COARSE)
    return _ground_points(geometry.camera_directions(replace(camera, width=size[0], height=size[1])), scene)


def _shadow_cells(points: Floats, near: NDArray[np.bool_], scene: SphereScene) -> NDArray[np.bool_]:
    """Which pixels (H, W) the balls' shadows reach, of those `near` at points (N, 3)."""
    dark = near.copy()
    dark[near] = visible_sun_share(points, scene) < 1
    return dark


def _shadow_factors(camera: Pinhole, scene: SphereScene, dark: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The share (h, w) of the sun that the balls leave each pixel; shadows lie in and around `dark` cells (H, W)."""
    share = np.ones((camera.height, camera.width), dtype=np.float32)
    window = geometry.pixel_window(dark, camera.height, camera.width)
    if window is not None:
        points, near = _ground_points(_window_rays(camera, *window), scene)
        fine = np.ones(near.shape)
        fine[near] = visible_sun_share(points, scene)
        share[window] = fine.reshape(len(near) // _FINE, _FINE, -1, _FINE).mean(axis=(1, 3))
    return share


def _ground_points(rays: Floats, scene: SphereScene) -> tuple[Floats, NDArray[np.bool_]]:
    """Points (N, 3) where rays (h, w, 3) from the camera meet the ground that the balls change, and which (h, w) do."""
    reach = (scene.centers[0, 1] - 1) / np.minimum(rays[..., 1], -1e-6)
    points = rays * reach[..., None]
    near = (rays[..., 1] < 0) & (np.linalg.norm(points - scene.centers[1], axis=-1) < _FAR)
    return points[near], near


def _enlarge(small: NDArray[np.float32], camera: Pinhole) -> NDArray[np.float32]:
    """Values (H, W, C) at the picture's size (h, w, C), linear between them."""
    channels, size = (Image.fromarray(small[..., c]) for c in range(small.shape[2])), (camera.width, camera.height)
    planes = [channel.resize(size, Image.Resampling.BILINEAR) for channel in channels]
    return np.stack([np.asarray(plane) for plane in planes], axis=-1)


def _composite_balls(linear: NDArray[np.float32], camera: Pinhole, scene: SphereScene) -> NDArray[np.float32]:
    """The picture (h, w, 3) with each ball drawn into its own window."""
    result = linear.copy()
    for kind, center in enumerate(scene.centers):
        depth = float(center @ camera.axes[2])
        if depth <= 0:  # behind a camera that looks straight down through a very wide lens
            continue
        x, y = geometry.camera_pixel(center, camera)
        reach = 1.2 * camera.focal_length / depth
        rows, columns = geometry.clip_slice(y, reach, camera.height), geometry.clip_slice(x, reach, camera.width)
        window = result[rows, columns]
        if window.size:
            _draw_ball(window, kind, _window_rays(camera, rows, columns), scene)
    return result


def _window_rays(camera: Pinhole, rows: slice, columns: slice) -> Floats:
    """Unit vectors (_FINE h, _FINE w, 3) through a window of the picture."""
    step = (np.arange(_FINE) + 0.5) / _FINE
    x = (np.arange(columns.start, columns.stop)[:, None] + step).ravel() - camera.width / 2
    y = camera.height / 2 - (np.arange(rows.start, rows.stop)[:, None] + step).ravel()
    right, up, forward = camera.axes
    rays = x[None, :, None] * right + y[:, None, None] * up + camera.focal_length * forward
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def _draw_ball(window: NDArray[np.float32], kind: int, rays: Floats, scene: SphereScene) -> None:
    """Lay a ball over a window (h, w, 3), mixed with it where it covers a pixel in part."""
    flat = rays.reshape(-1, 3)
    distance = geometry.ray_sphere(np.zeros(3), flat, scene.centers[kind])
    hit = np.isfinite(distance)
    color = np.zeros_like(flat)
    color[hit] = shade_sphere(kind, flat[hit] * distance[hit, None], flat[hit], scene, mirrored=False)
    height, width = window.shape[:2]
    blocks = (height, _FINE, width, _FINE)
    cover = hit.reshape(blocks).mean(axis=(1, 3))[..., None]
    window *= 1 - cover
    window += np.minimum(color, 1.0).reshape(*blocks, 3).mean(axis=(1, 3))


# Where a photo has room for the balls: on plain ground, off people and things.


def _has_room(camera: Pinhole, radius: float, half_width: float) -> bool:
    """Whether the picture of a camera shows ground for balls as _find_plain_spot has them."""
    half = half_width * radius / camera.height
    return bool(_foot_mask(_coarse_camera(camera), half, radius / camera.focal_length).any())


def _find_plain_spot(
    picture: Image.Image, camera: Pinhole, radius: float, half_width: float
) -> tuple[float, float] | None:
    """The pixel (x, y) where balls side by side disturb a picture least; None where it shows no ground for them.

    `radius` [pixels] is a ball's, and they are `half_width` radii wide to either side; none is as high as the camera.
    The box around them holds the least mean difference between neighbours; the nearer to the lower middle, the better.
    """
    small = _coarse_camera(camera)
    tall = radius / camera.height
    feet = _foot_mask(small, half_width * tall, radius / camera.focal_length)
    if not feet.any():
        return None
    gray = picture.convert("L").resize((small.width, small.height), Image.Resampling.BOX)
    y, x = np.mgrid[: small.height, : small.width] + 0.5
    away = np.abs(x / small.width - 0.5) + np.abs(y / small.height - (1 + geometry.OBJECT_POSITION) / 2)
    lateral, above, below = (radii * tall * small.height for radii in (half_width, _ABOVE, _BELOW))
    differences = _box_means(_pixel_differences(np.asarray(gray, dtype=np.float32)), lateral, above, below)
    cost = np.where(feet, differences + _DISTANCE_PENALTY * away, np.inf)
    down, across = np.unravel_index(np.argmin(cost), feet.shape)
    return (float(across) + 0.5) * camera.width / small.width, (float(down) + 0.5) * camera.height / small.height


def _coarse_camera(camera: Pinhole) -> Pinhole:
    """The camera with a picture of at most _PLAIN_ROWS rows."""
    rows = min(camera.height, _PLAIN_ROWS)
    return replace(camera, width=max(1, round(camera.width * rows / camera.height)), height=rows)


def _foot_mask(camera: Pinhole, half: float, radius: float) -> NDArray[np.bool_]:
    """Which pixels (h, w) show ground where balls stand wholly in the picture and lower than the camera.

    `half` is the half width of all [picture heights], `radius` a ball's [focal lengths].
    """
    rays = geometry.camera_directions(camera)
    below = rays[..., 1] < -2 * radius * (rays @ camera.axes[2])
    below[int(_MAX_FOOT_ROW * camera.height) :] = False
    lateral = np.abs(np.arange(camera.width) + 0.5 - camera.width / 2) / camera.height
    return np.asarray(below & (lateral <= max(camera.width / 2 / camera.height - half, 0.5 / camera.height)))


def _pixel_differences(gray: NDArray[np.float32]) -> NDArray[np.float32]:
    """Differences (h, w) of a picture's pixels from their neighbours to the right and below."""
    across, down = (np.abs(np.diff(gray, axis=axis)) for axis in (1, 0))
    return np.asarray(np.pad(across, ((0, 0), (0, 1))) + np.pad(down, ((0, 1), (0, 0))))


def _box_means(values: NDArray[np.float32], lateral: float, above: float, below: float) -> Floats:
    """The mean (h, w) of values (h, w) within the boxes around each pixel that reach so far [pixels]."""
    rows, columns = values.shape
    sums = np.pad(values.astype(np.float64).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    y, x = np.arange(rows) + 0.5, np.arange(columns) + 0.5
    top, bottom = (np.clip(np.round(edge), 0, rows).astype(int) for edge in (y - above, y + below))
    left, right = (np.clip(np.round(edge), 0, columns).astype(int) for edge in (x - lateral, x + lateral))
    sums_of_rows = sums[bottom] - sums[top]
    area = np.maximum(np.outer(bottom - top, right - left), 1)
    return np.asarray((sums_of_rows[:, right] - sums_of_rows[:, left]) / area)
