"""Three balls composited into the photo: on its ground, in its light, with their shadows and bounced light.

They stand on the spot that the photo's record states. A ball replaces the photo's pixels. The ground keeps them, times
the share of its light that the balls leave. Where the picture's ground already lies in shade, only the sky's light is
left to take. So no shadow darkens it twice. Balls that stand on such ground are in shade, too. What stands before the
ground, as people and plants do, keeps its light.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import lighting.geometry as geometry
from lighting.color import SRGB_LINEAR, srgb_bytes
from lighting.envmap.latlong import photo_camera
from lighting.envmap.shadow_mask import ground_shadow_mask, is_in_shade, shadow_receivers
from lighting.geometry import Floats, Pinhole
from lighting.ground import object_radius
from lighting.preview.spheres import SPACING, SphereScene, dim_sun, ground_radiance, shade_sphere, visible_sun_share
from lighting.records import Lighting
from lighting.segmentation import Segments

_FINE = 2  # rays per pixel and side on the balls and in their shadows
_COARSE = 2  # pixels per ray and side on the ground where light changes slowly
_FAR = 40.0  # radii from the balls to which they change the ground
_CONTACT_END = 1.5  # radii from a ball's foot; within one, a ball shades whatever the picture shows there


def insert_balls(
    picture: Image.Image, lighting: Lighting, scene: SphereScene, segments: Segments | None = None
) -> Image.Image:
    """The picture with balls on its ground; as it is where the record states no spot for them.

    Args:
        picture: the photo, sRGB.
        lighting: the photo's light, camera and spot.
        scene: balls in the light of the photo's own map; they are moved to the spot.
        segments: of the photo: what stands before the ground takes no shadow. None: nothing does.
    """
    if lighting.spot_direction is None:
        return picture
    camera = photo_camera(lighting, picture.width, picture.height)
    centers, radius = _ball_centers(camera, np.array(lighting.spot_direction), lighting.camera_height)
    moved = replace(scene, centers=centers.astype(np.float32))
    linear = SRGB_LINEAR[np.asarray(picture)]
    lit = ground_shadow_mask(np.asarray(picture), lighting, segments=segments)
    in_shade = is_in_shade(lit, camera, centers - [0.0, 1.0, 0.0], radius)
    standing = dim_sun(moved, 0.0) if in_shade else moved
    points, near = _coarse_ground_points(camera, moved)
    exchanging = replace(moved, exchange=standing.exchange)
    left = _remaining_light(lit, camera, exchanging, points, near, casts_shadow=not in_shade)
    left = _on_ground(left, segments, _enlarge(_contact_share(points, near, moved)[..., None], camera))
    return Image.fromarray(srgb_bytes(_composite_balls(linear * left, camera, standing, centers)))


def _on_ground(
    left: NDArray[np.float32], segments: Segments | None, contact: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The share (h, w, 3) of light that balls leave; 1 on what stands before the ground, but at `contact` (h, w, 1)."""
    free = shadow_receivers(np.ones(left.shape[:2], dtype=np.float32), segments)
    return 1 + np.maximum(free[..., None], contact) * (left - 1)


def _contact_share(points: Floats, near: NDArray[np.bool_], scene: SphereScene) -> NDArray[np.float32]:
    """1 (H, W) beside the balls' feet, where they stand before all that the picture shows, to 0 at _CONTACT_END."""
    feet = scene.centers - [0.0, 1.0, 0.0]
    distance = np.min([np.linalg.norm(points - foot, axis=-1) for foot in feet], axis=0)
    share = np.zeros(near.shape, dtype=np.float32)
    share[near] = np.clip((_CONTACT_END - distance) / (_CONTACT_END - 1), 0, 1)
    return share


def _ball_centers(camera: Pinhole, spot: Floats, camera_height: float) -> tuple[Floats, float]:
    """The balls' centers (3, 3) from the camera, in radii, and their radius [pixels]; the middle one is on the spot.

    `spot` (3,) is the unit vector to it, `camera_height` in m.
    """
    ahead = float(spot @ camera.axes[2])
    radius = float(object_radius(camera, np.array(-spot[1] / ahead), camera_height))
    middle = spot / ahead * camera.focal_length / radius + [0.0, 1.0, 0.0]
    return np.asarray(middle + np.array([[-SPACING], [0.0], [SPACING]]) * [1.0, 0.0, 0.0]), radius


def _remaining_light(
    lit: NDArray[np.float32],
    camera: Pinhole,
    scene: SphereScene,
    points: Floats,
    near: NDArray[np.bool_],
    *,
    casts_shadow: bool,
) -> NDArray[np.float32]:
    """The share (h, w, 3) of each pixel's light that the balls leave or add; 1 above the ground.

    `lit` (H, W) says how far the picture's ground lies in sunlight; `points`, `near` are its `_coarse_ground_points`.
    """
    sun = _enlarge(lit[..., None], camera) * (scene.ground - scene.ground_sky).astype(np.float32)
    open_ground = scene.ground_sky.astype(np.float32) + np.float32(1e-6)
    added = np.zeros((*near.shape, 3), dtype=np.float32)  # by the balls and all but the sun, less than 0 under them
    added[near] = ground_radiance(points, replace(scene, ground=scene.ground_sky)) - scene.ground_sky
    dark = _shadow_cells(points, near, scene) if casts_shadow else np.zeros_like(near)
    shadow = _shadow_factors(camera, scene, dark)
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
    return points[near].astype(np.float32), near


def _enlarge(small: NDArray[np.float32], camera: Pinhole) -> NDArray[np.float32]:
    """Values (H, W, C) at the picture's size (h, w, C), linear between them."""
    channels, size = (Image.fromarray(small[..., c]) for c in range(small.shape[2])), (camera.width, camera.height)
    planes = [channel.resize(size, Image.Resampling.BILINEAR) for channel in channels]
    return np.stack([np.asarray(plane) for plane in planes], axis=-1)


def _composite_balls(
    linear: NDArray[np.float32], camera: Pinhole, scene: SphereScene, centers: Floats
) -> NDArray[np.float32]:
    """The picture (h, w, 3) with each ball, at centers (3, 3) of 64 bits, drawn into its own window."""
    result = linear.copy()
    for kind, center in enumerate(centers):
        depth = float(center @ camera.axes[2])
        if depth <= 0:  # behind a camera that looks straight down through a very wide lens
            continue
        x, y = geometry.camera_pixel(center, camera)
        reach = 1.2 * camera.focal_length / depth
        rows, columns = geometry.clip_slice(y, reach, camera.height), geometry.clip_slice(x, reach, camera.width)
        window = result[rows, columns]
        if window.size:
            _draw_ball(window, kind, _window_rays(camera, rows, columns), scene, center)
    return result


def _window_rays(camera: Pinhole, rows: slice, columns: slice) -> Floats:
    """Unit vectors (_FINE h, _FINE w, 3) through a window of the picture."""
    step = (np.arange(_FINE) + 0.5) / _FINE
    x = (np.arange(columns.start, columns.stop)[:, None] + step).ravel() - camera.width / 2
    y = camera.height / 2 - (np.arange(rows.start, rows.stop)[:, None] + step).ravel()
    right, up, forward = camera.axes
    rays = x[None, :, None] * right + y[:, None, None] * up + camera.focal_length * forward
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def _draw_ball(window: NDArray[np.float32], kind: int, rays: Floats, scene: SphereScene, center: Floats) -> None:
    """Lay a ball over a window (h, w, 3), mixed with it where it covers a pixel in part."""
    flat = rays.reshape(-1, 3)
    distance = geometry.ray_sphere(np.zeros(3), flat, center)
    hit = np.isfinite(distance)
    color = np.zeros(flat.shape, dtype=np.float32)
    points = (flat[hit] * distance[hit, None]).astype(np.float32)
    color[hit] = shade_sphere(kind, points, flat[hit].astype(np.float32), scene, mirrored=False)
    height, width = window.shape[:2]
    blocks = (height, _FINE, width, _FINE)
    cover = hit.reshape(blocks).mean(axis=(1, 3))[..., None]
    window *= 1 - cover
    window += np.minimum(color, 1.0).reshape(*blocks, 3).mean(axis=(1, 3))
