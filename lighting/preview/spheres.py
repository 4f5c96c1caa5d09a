"""Three spheres, mirror, glossy and diffuse, ray-shaded on the ground under an environment map.

Distances are in sphere radii. The sun's disc is not in the map; it lights everything analytically. What a sphere hides
from the ground and reflects to it, and what the diffuse sphere receives, are integrals over rays, kept in small tables
by direction.

The camera keeps the photo's heading and, as far as the ground stays in view, its elevation, so that light and shadow
fall as in the photo. The ground has the color of the map's own ground, so it meets the horizon without a seam.

`insert_balls` puts them into the photo, on the spot that its record states. A ball replaces the photo's pixels. The
ground keeps them, times the share of its light that the balls leave. Where the picture's ground already lies in shade,
only the sky's light is left to take. So no shadow darkens it twice. Balls that stand on such ground are in shade, too.
Where the picture shows lit ground and shade, the balls' shadows become as dark as that.
What stands before the ground, as people and plants do, keeps its light.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import lighting.geometry as geometry
from lighting.color import SRGB_LINEAR, luminance, srgb_bytes
from lighting.envmap.latlong import blur_envmap, envmap_irradiance, remove_sun, shrink_envmap
from lighting.envmap.projection import photo_camera
from lighting.envmap.shadow_mask import is_in_shade, read_ground_shade, shadow_receivers
from lighting.geometry import Floats, LatlongSampler, Pinhole, angles, camera_axes, direction, dot_product, ray_sphere
from lighting.ground import object_radius
from lighting.prediction import Segments
from lighting.preview.drawing import display_srgb
from lighting.records import Lighting

MIRROR, GLOSSY, DIFFUSE = range(3)  # from left to right

_MIRROR_SUN_RADIUS = 1.0  # deg, wide enough to be seen in the mirror, with the same power
MIRROR_REFLECTANCE = 0.92
GLOSSY_REFLECTANCE = 0.85
DIFFUSE_REFLECTANCE = 0.36  # twice a gray card's: white burns out in many photos of sunlight
GLOSSINESS = 60.0  # concentration of the glossy lobe, exp(GLOSSINESS (cos - 1))
_MIRRORED_GLOSSINESS = 25.0  # the same for light that a sphere sends elsewhere; wide enough for few rays
_LEVEL = -1e-4  # vertical part of a unit ray, below which it meets the ground
_FOOT_SHADE = 0.7  # share of the surrounding light that does not reach a sphere where it touches the ground

VERTICAL_FOV = 40.0  # deg
_ELEVATION_RANGE = (-20.0, -5.0)  # deg, range of the camera's elevation that keeps ground and sky in view
_SPACING = 2.6  # between neighboring centers, in radii
_CENTER_HEIGHT = 0.60  # of the middle sphere in the picture, 0 = top, 1 = bottom
_PICTURE_WIDTH = 8.6  # at the spheres' distance, in radii

_LOBE_ROWS = 32  # of the blurred map
_EXCHANGE_ROWS = 24  # of `SphereScene.exchange`, by the direction to a sphere
_RINGS, _SPOKES = 5, 12  # of rays from a point on the ground to a sphere
_NORMAL_ROWS = 12  # of `SphereScene.diffuse_irradiance`, by the normal
_INCOMING_ROWS = 16  # of the directions from which light comes to the diffuse sphere
_BOUNCES = (2, 1)  # of light between spheres and ground: how much coarser its tables and rays are in each
_BOUNCES_DIMMED = (1,)  # where that light is nearly right already
_EVEN = 0.01  # of square roots of linear values, 2 of 255 levels off the neighbors, up to which one ray will do
_EPSILON = 1e-9  # stands for no light

_RAYS_AT_ONCE = 1 << 15  # of the camera, few enough for the processor's cache
_FINE = 2  # rays per pixel and side on the balls and in their shadows
_COARSE = 2  # pixels per ray and side on the ground where light changes slowly
_FAR = 40.0  # radii from the balls to which they change the ground
_OWN_SHADE = 2.0  # factor by which a photo's own shade may differ from the map's
_CONTACT_END = 1.5  # radii from a ball's foot; within one, a ball shades whatever the picture shows there


@dataclass(frozen=True)
class SphereScene:
    """The spheres, the environment map without its sun, and the light exchanged between spheres and ground."""

    centers: Floats
    """(3, 3) of the spheres, which stand on level ground."""
    sky: NDArray[np.float32]
    """The map (H, 2H, 3) without the sun's disc."""
    coarse_sky: NDArray[np.float32]
    """The same in few pixels."""
    glossy_sky: LatlongSampler
    """Of the same, blurred by the glossy lobe."""
    sun_direction: Floats
    """Sun direction, (3,)."""
    sun_irradiance: Floats
    """(3,) on a surface that faces the sun; 0 where the map has no disc."""
    ground: Floats
    """Radiance (3,) of open ground."""
    ground_sky: Floats
    """(3,) the part of it that the sky lights."""
    albedo: Floats
    """(3,) of the ground."""
    diffuse_irradiance: LatlongSampler
    """Of irradiance (h, 2h, 3) of the diffuse sphere by all but the sun, by its normals."""
    exchange: tuple[Floats, ...]
    """(h, 2h, 3) of each sphere with the ground, by direction; empty before a bounce."""

    @cached_property
    def sample_sky(self) -> LatlongSampler:
        """Of `sky`."""
        return LatlongSampler(self.sky)

    @cached_property
    def sample_exchange(self) -> list[LatlongSampler]:
        """Of `exchange`."""
        return list(map(LatlongSampler, self.exchange))


# A picture of the scene.


def render_spheres(
    envmap: NDArray[np.float32],
    lighting: Lighting,
    width: int,
    height: int,
    supersampling: int = 2,
    centers: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """The linear picture (supersampling x height, supersampling x width, 3) of the spheres under a map.

    Args:
        envmap: (H, 2H, 3) linear Rec.709, row 0 is the zenith.
        lighting: where the sun is, and the camera's elevation.
        width: pixels.
        height: pixels.
        supersampling: rays per pixel and side, where neighboring pixels differ; else one.
        centers: (3, 3) of the spheres from the camera, on one level; None for those of `sphere_centers`.
    """
    centers = sphere_centers(width / height, limit_elevation(lighting)) if centers is None else centers
    scene = build_sphere_scene(envmap, lighting.sun_direction, centers)
    even, uneven, fine = _sample_scene(scene, lighting, width, height, supersampling)
    blocks = np.empty((height, width, supersampling, supersampling, 3), dtype=np.float32)
    blocks[:] = even[:, :, None, None]
    blocks[uneven] = fine
    return np.ascontiguousarray(blocks.transpose(0, 2, 1, 3, 4)).reshape(supersampling * height, -1, 3)


def draw_sphere_scene(scene: SphereScene, lighting: Lighting, width: int, height: int) -> NDArray[np.uint8]:
    """The sRGB picture (height, width, 3) of a scene; where neighboring pixels differ, of four rays a pixel.

    Args:
        scene: the spheres and their light.
        lighting: the camera's elevation.
        width: pixels.
        height: pixels.
    """
    even, uneven, fine = _sample_scene(scene, lighting, width, height, _FINE)
    picture = display_srgb(even)
    picture[uneven] = display_srgb(fine).mean(axis=(1, 2)) + 0.5  # rounded
    return picture


def _sample_scene(
    scene: SphereScene, lighting: Lighting, width: int, height: int, parts: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.float32]]:
    """Radiance (height, width, 3) of a ray a pixel, where neighbors differ, and that of parts (N, parts, parts, 3)."""
    camera = Pinhole(width, height, VERTICAL_FOV, elevation=limit_elevation(lighting))
    even = _trace_rays(geometry.camera_directions(camera).astype(np.float32), scene)
    uneven = _is_uneven(even) if parts > 1 else np.zeros((height, width), dtype=bool)
    step, (row, column) = (np.arange(parts) + 0.5) / parts, np.nonzero(uneven)
    x, y = column[:, None, None] + step, row[:, None, None] + step[:, None]
    return even, uneven, _trace_rays(geometry.pixel_directions(camera, x, y).astype(np.float32), scene)


def _trace_rays(rays: NDArray[np.float32], scene: SphereScene) -> NDArray[np.float32]:
    """Radiance (..., 3) along rays (..., 3) from the origin."""
    radiance, flat = np.empty(rays.shape, np.float32), rays.reshape(-1, 3)
    for start in range(0, len(flat), _RAYS_AT_ONCE):
        part = slice(start, start + _RAYS_AT_ONCE)
        radiance.reshape(-1, 3)[part] = _trace(np.zeros(3, np.float32), flat[part], scene)
    return radiance


def _is_uneven(picture: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Which pixels (H, W) of a picture (H, W, 3) are off their neighbors' mean by over _EVEN, or lie beside one.

    Where it changes evenly, a pixel's middle has its mean. Edges that fall between the rays show beside them; what is
    smaller than a pixel lies on such edges.
    """
    shown = np.sqrt(np.clip(picture, 0.0, 1.0))
    uneven = np.zeros(shown.shape[:2], dtype=bool)
    uneven[1:-1] |= _is_bent(shown[:-2], shown[1:-1], shown[2:])
    uneven[:, 1:-1] |= _is_bent(shown[:, :-2], shown[:, 1:-1], shown[:, 2:])
    near = np.pad(uneven, 1)
    rows = near[:-2] | near[1:-1] | near[2:]
    return np.asarray(rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:])


def _is_bent(before: Floats, middle: Floats, after: Floats) -> NDArray[np.bool_]:
    """Where (...) any channel of values (..., 3) is off the mean of its two neighbors by more than _EVEN."""
    off = before + after
    off *= 0.5
    off -= middle
    red, green, blue = np.moveaxis(np.abs(off, out=off) > _EVEN, -1, 0)
    return np.asarray(red | green | blue)


def limit_elevation(lighting: Lighting) -> float:
    """The elevation of the scene's camera in deg: the photo's, as far as the ground stays in view.

    Args:
        lighting: the camera's elevation.
    """
    return float(np.clip(lighting.camera_elevation, *_ELEVATION_RANGE))


def sphere_centers(aspect: float, elevation: float) -> NDArray[np.float32]:
    """The spheres' centers (3, 3) from the camera.

    Args:
        aspect: the picture's width / height.
        elevation: the camera's elevation in deg.
    """
    right, up, forward = camera_axes(0.0, elevation, 0.0)
    height = _PICTURE_WIDTH / aspect
    middle = forward * geometry.focal_length(height, VERTICAL_FOV) + up * (0.5 - _CENTER_HEIGHT) * height
    return np.asarray(middle + np.array([[-_SPACING], [0.0], [_SPACING]]) * right, dtype=np.float32)


# The light of a scene.


def build_sphere_scene(envmap: NDArray[np.float32], sun: Floats, centers: Floats) -> SphereScene:
    """The spheres under a map, with the light that they and the ground send to each other.

    Args:
        envmap: (H, 2H, 3) linear Rec.709, row 0 is the zenith.
        sun: (3,) the sun's direction, a unit vector.
        centers: (3, 3) of the spheres from the camera, on one level.
    """
    sky, sun_irradiance = remove_sun(envmap, sun)
    coarse = shrink_envmap(sky, _LOBE_ROWS)
    ground = sky[-len(sky) // 4 :].mean(axis=(0, 1), dtype=np.float64).reshape(3)
    overhead = np.maximum(envmap_irradiance(coarse, np.array([0.0, 1.0, 0.0])), _EPSILON)
    direct = sun_irradiance * max(float(sun[1]), 0.0)
    albedo = np.pi * ground / (overhead + direct)
    scene = SphereScene(
        centers=centers.astype(np.float32),
        sky=sky,
        coarse_sky=coarse,
        glossy_sky=LatlongSampler(blur_envmap(coarse, GLOSSINESS)),
        sun_direction=sun,
        sun_irradiance=sun_irradiance,
        ground=ground,
        ground_sky=albedo * overhead / np.pi,
        albedo=albedo,
        diffuse_irradiance=LatlongSampler(
            envmap_irradiance(_scale_ground(coarse, 0.0), geometry.latlong_directions(_NORMAL_ROWS))
        ),
        exchange=(),
    )
    return _add_bounces(scene, _BOUNCES)


def _without_sun(scene: SphereScene) -> SphereScene:
    """The same scene where the sun reaches neither the spheres nor the ground."""
    coarse = _scale_ground(scene.coarse_sky, scene.ground_sky / np.maximum(scene.ground, _EPSILON))
    glossy = LatlongSampler(blur_envmap(coarse, GLOSSINESS))
    dimmed = replace(scene, coarse_sky=coarse, glossy_sky=glossy, sun_irradiance=np.zeros(3), ground=scene.ground_sky)
    return _add_bounces(dimmed, _BOUNCES_DIMMED)


def _scale_ground(image: NDArray[np.float32], gain: Floats | float) -> NDArray[np.float32]:
    """The map (H, 2H, 3) with its lower half multiplied by a gain, a number or (3,)."""
    result = image.copy()
    result[len(image) // 2 :] *= np.asarray(gain, dtype=np.float32)
    return result


def _add_bounces(scene: SphereScene, bounces: Sequence[int]) -> SphereScene:
    """The scene with the light that its spheres and its ground send to each other, of one coarseness for each time."""
    for coarseness in bounces:
        exchange = tuple(_exchange(kind, scene, coarseness) for kind in range(len(scene.centers)))
        scene = replace(scene, exchange=exchange)
        scene = replace(scene, diffuse_irradiance=_diffuse_irradiance(scene, coarseness))
    return scene


def _exchange(kind: int, scene: SphereScene, coarseness: int) -> Floats:
    """Mean radiance (h, 2h, 3) that the ground receives from a sphere minus that of the sky behind it, by direction.

    The mean is weighted with the ground's cosine. Where another sphere lies before this one, it is left out. A ground
    point sees the center in one direction; the sphere then fills a cone that touches the horizon.
    """
    rows = _EXCHANGE_ROWS // coarseness
    to_center = geometry.latlong_directions(rows)[: rows // 2].reshape(-1, 3)
    cones, weight = (part.astype(np.float32) for part in _cones(to_center, _RINGS // coarseness, _SPOKES // coarseness))
    rays = cones.reshape(-1, 3)
    feet = (scene.centers[kind] - to_center / to_center[:, 1:2]).astype(np.float32)
    points = np.repeat(feet, cones.shape[1], axis=0)
    distances = [ray_sphere(points, rays, center) for center in scene.centers]
    unobstructed = np.all([distances[kind] <= distance for distance in distances], axis=0)
    radiance = _shade_sphere(kind, points + rays * distances[kind][:, None], rays, scene, mirrored=True)
    radiance = np.where(unobstructed[:, None], radiance - geometry.sample_latlong(scene.coarse_sky, rays), 0.0)
    upper = (weight[:, None] @ radiance.reshape(*weight.shape, 3))[:, 0].reshape(rows // 2, -1, 3)
    return np.concatenate([upper, upper[::-1]])


def _cones(axes: Floats, rings: int, spokes: int) -> tuple[Floats, Floats]:
    """Rays (N, R, 3) in cones around axes (N, 3) down to the horizon; weights (N, R) of a mean over what they light."""
    node, part = np.polynomial.legendre.leggauss(rings)
    rim = np.sqrt(1 - axes[:, 1] ** 2)
    cosine = (rim[:, None] + (1 - rim[:, None]) * (node + 1) / 2)[:, :, None, None]
    spoke = (np.arange(spokes) + 0.5)[:, None] * 2 * np.pi / spokes
    right = direction(angles(axes)[0] + 90.0, 0.0)
    sideways = np.cos(spoke) * right[:, None] + np.sin(spoke) * np.cross(right, axes)[:, None]
    rays = cosine * axes[:, None, None] + np.sqrt(1 - cosine**2) * sideways[:, None]
    weight = (rays[..., 1] * part[:, None]).reshape(len(axes), -1)
    return rays.reshape(len(axes), -1, 3), weight / weight.sum(axis=1, keepdims=True)


def _diffuse_irradiance(scene: SphereScene, coarseness: int) -> LatlongSampler:
    """Of irradiance (h, 2h, 3) of the diffuse sphere by a coarse sky, ground and other spheres, by its normals."""
    rows = _NORMAL_ROWS // coarseness
    scene = replace(scene, sky=shrink_envmap(scene.sky, _INCOMING_ROWS))
    rays = geometry.latlong_directions(_INCOMING_ROWS).reshape(-1, 3)
    normals = geometry.latlong_directions(rows).reshape(-1, 3)
    solid_angle = np.repeat(geometry.latlong_solid_angle(_INCOMING_ROWS), 2 * _INCOMING_ROWS)
    weight = np.maximum(normals @ rays.T, 0) * solid_angle
    normal, ray = np.nonzero(weight)
    radiance = np.zeros((*weight.shape, 3), dtype=np.float32)
    points = (scene.centers[DIFFUSE] + normals).astype(np.float32)
    radiance[normal, ray] = _trace(points[normal], rays.astype(np.float32)[ray], scene, DIFFUSE, disc_radius=None)
    total = (weight[:, None] @ radiance)[:, 0] * np.pi / weight.sum(axis=1, keepdims=True)
    return LatlongSampler(total.reshape(rows, -1, 3))


# Radiance along rays.


def _trace(
    origin: Floats,
    rays: Floats,
    scene: SphereScene,
    leaving: int | None = None,
    disc_radius: float | None = geometry.SUN_RADIUS,
) -> Floats:
    """Radiance (N, 3) along rays (N, 3) from `origin` (3,) or (N, 3), on the sphere they are `leaving` if any.

    The sun's disc has that radius [deg], or is left out.
    """
    radiance = np.empty_like(rays)
    nearest, first = np.full(len(rays), np.inf, dtype=rays.dtype), np.full(len(rays), len(scene.centers))
    for kind, center in enumerate(scene.centers):
        if kind != leaving:
            distance = ray_sphere(origin, rays, center)
            first[distance < nearest] = kind
            np.minimum(nearest, distance, out=nearest)
    free, down = first == len(scene.centers), rays[:, 1] < _LEVEL
    up, ground = np.flatnonzero(free & ~down), np.flatnonzero(free & down)
    radiance[up] = _sky_radiance(rays.take(up, axis=0), scene, disc_radius)
    radiance[ground] = _ground_along(_rows(origin, ground), rays.take(ground, axis=0), scene)
    for kind in range(len(scene.centers)):
        if len(hit := np.flatnonzero(first == kind)):
            along = rays.take(hit, axis=0)
            point = _rows(origin, hit) + along * nearest.take(hit)[:, None]
            radiance[hit] = _shade_sphere(kind, point, along, scene, mirrored=leaving is not None)
    return radiance


def _rows(origin: Floats, chosen: NDArray[np.intp]) -> Floats:
    """The origins (M, 3) of chosen rays (M,): `origin` (3,) of all, or (N, 3)."""
    return np.broadcast_to(origin, (len(chosen), 3)) if origin.ndim == 1 else origin.take(chosen, axis=0)


def _sky_radiance(rays: Floats, scene: SphereScene, disc_radius: float | None) -> Floats:
    """The map along rays (N, 3), with a sharp disc that carries the sun's power."""
    radiance = scene.sample_sky(rays).astype(rays.dtype)
    if disc_radius is not None:
        cosine = np.cos(np.radians(disc_radius))
        hit = rays @ scene.sun_direction.astype(rays.dtype) > cosine
        radiance[hit] += scene.sun_irradiance / (2 * np.pi * (1 - cosine))
    return radiance


def _ground_along(origins: Floats, rays: Floats, scene: SphereScene) -> Floats:
    """Radiance (N, 3) of the ground that rays (N, 3) from origins (N, 3) go down to."""
    if not len(rays):
        return rays
    reach = (scene.centers[0, 1] - 1 - origins[:, 1]) / rays[:, 1]
    return _ground_radiance(origins + rays * reach[:, None], scene)


def _ground_radiance(points: Floats, scene: SphereScene) -> Floats:
    """Radiance (N, 3) of the ground: the spheres hide the sun and part of the sky, and shine on it.

    Args:
        points: (N, 3) on the ground.
        scene: the spheres and their light.
    """
    sky, albedo = scene.ground_sky.astype(points.dtype), scene.albedo.astype(points.dtype)
    radiance = (scene.ground.astype(points.dtype) - sky) * _visible_sun_share(points, scene)[:, None] + sky
    for center, sample_exchange in zip(
        scene.centers, scene.sample_exchange, strict=False
    ):  # without an exchange before a bounce
        to_center = center - points
        distance2 = dot_product(to_center, to_center)
        share = 1 / (distance2 * np.sqrt(distance2))  # of a cosine-weighted hemisphere; the center is 1 up
        radiance += albedo * share[:, None] * sample_exchange(to_center).astype(points.dtype)
    return np.maximum(radiance, 0)


def _visible_sun_share(points: Floats, scene: SphereScene, leaving: int | None = None) -> Floats:
    """The share (N,) of the sun's disc that the spheres leave visible, 0 to 1, with penumbra.

    Args:
        points: (N, 3) on the ground or on a sphere.
        scene: the spheres and the sun.
        leaving: the sphere that the points lie on, which hides nothing from them; None for the ground.
    """
    share = np.ones(len(points), dtype=points.dtype)
    sun = scene.sun_direction.astype(points.dtype)
    width = 2 * np.tan(np.radians(geometry.SUN_RADIUS))  # of the penumbra, by the distance
    for kind, center in enumerate(scene.centers):
        if kind == leaving:
            continue
        to_center = center - points
        along = to_center @ sun
        lateral2 = dot_product(to_center, to_center) - along**2
        dim = np.flatnonzero((along > 0) & (lateral2 < (1 + width * along) ** 2))
        penumbra = width * np.maximum(along[dim], 1e-3)
        lateral = np.sqrt(np.maximum(lateral2[dim], 0))
        share[dim] *= np.clip((lateral - 1) / penumbra + 0.5, 0, 1)
    return share


def _shade_sphere(kind: int, points: Floats, rays: Floats, scene: SphereScene, *, mirrored: bool) -> Floats:
    """Radiance (N, 3) of a sphere along the rays that reach it.

    Args:
        kind: MIRROR, GLOSSY or DIFFUSE.
        points: (N, 3) on the sphere.
        rays: (N, 3) unit vectors that end at the points.
        scene: the spheres and their light.
        mirrored: whether it is seen in another sphere, where a wider lobe does.
    """
    normals = points - scene.centers[kind]
    if kind == DIFFUSE:
        return _shade_diffuse(points, normals, scene)
    reflected = rays - 2 * dot_product(rays, normals)[:, None] * normals
    if mirrored:
        incoming = _blurred_surroundings(points, reflected, scene)
        return _shade_glossy(incoming, points, reflected, scene, kind, _MIRRORED_GLOSSINESS)
    if kind == GLOSSY:
        shade = _FOOT_SHADE * np.maximum(-normals[:, 1:2], 0) ** 2  # of a sphere's foot, by itself
        incoming = scene.glossy_sky(reflected) * (1 - shade)
        return _shade_glossy(incoming, points, reflected, scene, kind, GLOSSINESS)
    return MIRROR_REFLECTANCE * _trace(points, reflected, scene, kind, _MIRROR_SUN_RADIUS)


def _blurred_surroundings(points: Floats, rays: Floats, scene: SphereScene) -> Floats:
    """Radiance (N, 3) of blurred sky, sharp ground and the diffuse sphere along rays (N, 3) from points (N, 3)."""
    radiance = scene.glossy_sky(rays).astype(rays.dtype)
    down = rays[:, 1] < _LEVEL
    radiance[down] = _ground_along(points[down], rays[down], scene)
    distance = ray_sphere(points, rays, scene.centers[DIFFUSE])
    if len(hit := np.flatnonzero(np.isfinite(distance))):
        hits = points[hit] + rays[hit] * distance[hit, None]
        radiance[hit] = _shade_diffuse(hits, hits - scene.centers[DIFFUSE], scene)
    return radiance


def _shade_diffuse(points: Floats, normals: Floats, scene: SphereScene) -> Floats:
    """Radiance (N, 3) of the diffuse sphere at points (N, 3) with these normals (N, 3)."""
    cosine = np.maximum(normals @ scene.sun_direction.astype(points.dtype), 0)
    lit = cosine * _visible_sun_share(points, scene, DIFFUSE)
    direct = lit[:, None] * scene.sun_irradiance.astype(points.dtype)
    indirect = scene.diffuse_irradiance(normals).astype(points.dtype)
    return np.asarray(DIFFUSE_REFLECTANCE / np.pi * (direct + indirect))


def _shade_glossy(
    incoming: Floats, points: Floats, reflected: Floats, scene: SphereScene, kind: int, glossiness: float
) -> Floats:
    """Radiance (N, 3) of a sphere: `incoming` light (N, 3), and the sun in a lobe along `reflected`."""
    cosine = reflected @ scene.sun_direction.astype(points.dtype)
    lobe = glossiness / (2 * np.pi) * np.exp(glossiness * (cosine - 1)) * _visible_sun_share(points, scene, kind)
    sun = lobe[:, None] * scene.sun_irradiance.astype(points.dtype)
    return np.asarray(GLOSSY_REFLECTANCE * (incoming + sun))


# The spheres in the photo.


def insert_balls(
    picture: Image.Image,
    lighting: Lighting,
    scene: SphereScene,
    segments: Segments | None = None,
    photo_sun: bool | None = None,
) -> Image.Image:
    """The picture with balls on its ground; as it is where the record states no spot for them.

    Args:
        picture: the photo, sRGB.
        lighting: the photo's light, camera and spot.
        scene: balls in the light of the photo's own map; they are moved to the spot.
        segments: of the photo: what stands before the ground takes no shadow. None: nothing does.
        photo_sun: whether the sun shines in the photo itself: else it has no shade. None: as in `lighting`.
    """
    if lighting.spot_direction is None:
        return picture
    camera = photo_camera(lighting, picture.width, picture.height)
    centers, radius = _ball_centers(camera, np.array(lighting.spot_direction), lighting.camera_height)
    moved = replace(scene, centers=centers.astype(np.float32))
    pixels = np.array(picture)
    shade = read_ground_shade(pixels, lighting, sun=photo_sun, segments=segments)
    lit, own = shade.lit, shade.shaded_light
    in_shade = is_in_shade(lit, camera, centers - [0.0, 1.0, 0.0], radius)
    standing = _without_sun(moved) if in_shade else moved
    points, near = _coarse_ground_points(camera, moved)
    exchanging = replace(moved, exchange=standing.exchange)
    exchanging = exchanging if own is None else _shade_as(exchanging, own)
    lit = np.zeros_like(lit) if in_shade else lit  # as the ground at their feet
    windows = _ball_windows(camera, centers)
    ground = geometry.pixel_window(near, camera.height, near.shape[1])
    changed = [window[0] for window in (*windows.values(), ground) if window is not None]
    rows = slice(min((part.start for part in changed), default=0), max((part.stop for part in changed), default=0))
    linear = SRGB_LINEAR.take(pixels[rows])
    left = _remaining_light(lit, camera, exchanging, points, near, rows, casts_shadow=not in_shade)
    linear *= _on_ground(left, segments, _contact_share(points, near, moved), camera, rows)
    for kind, window in windows.items():
        part = linear[window[0].start - rows.start : window[0].stop - rows.start, window[1]]
        _draw_ball(part, kind, _window_rays(camera, *window), standing, centers[kind])
    pixels[rows] = srgb_bytes(linear)
    return Image.fromarray(pixels)


def _ball_windows(camera: Pinhole, centers: Floats) -> dict[int, tuple[slice, slice]]:
    """The rows and columns of the picture that each ball, at centers (3, 3) of 64 bits, may cover."""
    windows = {}
    for kind, center in enumerate(centers):
        depth = float(center @ camera.axes[2])
        if depth > 0:  # not behind a camera that looks straight down through a very wide lens
            x, y = geometry.camera_pixel(center, camera)
            reach = 1.2 * camera.focal_length / depth
            window = geometry.clip_slice(y, reach, camera.height), geometry.clip_slice(x, reach, camera.width)
            if all(part.start < part.stop for part in window):
                windows[kind] = window
    return windows


def _shade_as(scene: SphereScene, share: float) -> SphereScene:
    """The scene with ground that is in shade as dark as the photo's own, within _OWN_SHADE of what the map says.

    Args:
        scene: the spheres and their light.
        share: of the light of lit ground that is left in the photo's shade.
    """
    said = float(luminance(scene.ground_sky) / max(float(luminance(scene.ground)), _EPSILON))
    gain = float(np.clip(share / max(said, _EPSILON), 1 / _OWN_SHADE, _OWN_SHADE))
    sky = np.minimum(gain * scene.ground_sky, scene.ground)
    return replace(scene, ground_sky=sky, exchange=tuple(gain * one for one in scene.exchange))


def _on_ground(
    left: NDArray[np.float32],
    segments: Segments | None,
    contact: NDArray[np.float32],
    camera: Pinhole,
    rows: slice,
) -> NDArray[np.float32]:
    """The share (R, w, 3) of light that balls leave; 1 on what stands before the ground, but at `contact` (H, W)."""
    free = shadow_receivers(np.ones((camera.height, camera.width), dtype=np.float32), segments)[rows]
    strength = np.maximum(free, _enlarge(contact[..., None], camera, rows)[..., 0])
    left -= 1
    left *= strength[..., None].repeat(3, axis=2)
    left += 1
    return left


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
    return np.asarray(middle + np.array([[-_SPACING], [0.0], [_SPACING]]) * [1.0, 0.0, 0.0]), radius


def _remaining_light(
    lit: NDArray[np.float32],
    camera: Pinhole,
    scene: SphereScene,
    points: Floats,
    near: NDArray[np.bool_],
    rows: slice,
    *,
    casts_shadow: bool,
) -> NDArray[np.float32]:
    """The share (R, w, 3) of the light in some rows of pixels that the balls leave or add; 1 above the ground.

    `lit` (H, W) says how far the picture's ground lies in sunlight; `points`, `near` are its `_coarse_ground_points`.
    """
    sun = _enlarge(lit[..., None], camera, rows).repeat(3, axis=2)
    sun *= np.tile((scene.ground - scene.ground_sky).astype(np.float32), (camera.width, 1))
    open_ground = scene.ground_sky.astype(np.float32) + np.float32(1e-6)
    added = np.zeros((*near.shape, 3), dtype=np.float32)  # by the balls and all but the sun, less than 0 under them
    added[near] = _ground_radiance(points, replace(scene, ground=scene.ground_sky)) - scene.ground_sky
    dark = _shadow_cells(points, near, scene) if casts_shadow else np.zeros_like(near)
    shadow = _shadow_factors(camera, scene, dark)
    open_row = np.tile(open_ground, (camera.width, 1))  # numpy takes ten times as long with an innermost axis of 3
    left = _enlarge(added, camera, rows)
    left += open_row
    left += shadow[rows, :, None].repeat(3, axis=2) * sun
    sun += open_row
    left /= sun
    return left


def _coarse_ground_points(camera: Pinhole, scene: SphereScene) -> tuple[Floats, NDArray[np.bool_]]:
    """Points (N, 3) of the ground that the balls change, in a picture of fewer pixels, and which (H, W) they are."""
    size = max(1, camera.width // _COARSE), max(1, camera.height // _COARSE)
    return _ground_points(geometry.camera_directions(replace(camera, width=size[0], height=size[1])), scene)


def _shadow_cells(points: Floats, near: NDArray[np.bool_], scene: SphereScene) -> NDArray[np.bool_]:
    """Which pixels (H, W) the balls' shadows reach, of those `near` at points (N, 3)."""
    dark = near.copy()
    dark[near] = _visible_sun_share(points, scene) < 1
    return dark


def _shadow_factors(camera: Pinhole, scene: SphereScene, dark: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The share (h, w) of the sun that the balls leave each pixel; shadows lie in and around `dark` cells (H, W)."""
    share = np.ones((camera.height, camera.width), dtype=np.float32)
    window = geometry.pixel_window(dark, camera.height, camera.width)
    if window is not None:
        points, near = _ground_points(_window_rays(camera, *window), scene)
        fine = np.ones(near.shape)
        fine[near] = _visible_sun_share(points, scene)
        share[window] = fine.reshape(len(near) // _FINE, _FINE, -1, _FINE).mean(axis=(1, 3))
    return share


def _ground_points(rays: Floats, scene: SphereScene) -> tuple[Floats, NDArray[np.bool_]]:
    """Points (N, 3) where rays (h, w, 3) from the camera meet the ground that the balls change, and which (h, w) do."""
    reach = (scene.centers[0, 1] - 1) / np.minimum(rays[..., 1], -1e-6)
    points = rays * reach[..., None]
    near = (rays[..., 1] < 0) & (np.linalg.norm(points - scene.centers[1], axis=-1) < _FAR)
    return points[near].astype(np.float32), near


def _enlarge(small: NDArray[np.float32], camera: Pinhole, rows: slice) -> NDArray[np.float32]:
    """Values (H, W, C) in some rows of the picture (R, w, C), linear between them."""
    height, width, channels = small.shape
    box = (0, rows.start * height / camera.height, width, rows.stop * height / camera.height)
    result = np.empty((rows.stop - rows.start, camera.width, channels), np.float32)
    for channel in range(channels if len(result) else 0):
        plane = Image.fromarray(small[..., channel])
        result[..., channel] = plane.resize(result.shape[1::-1], Image.Resampling.BILINEAR, box)
    return result


def _window_rays(camera: Pinhole, rows: slice, columns: slice) -> Floats:
    """Unit vectors (_FINE h, _FINE w, 3) through a window of the picture."""
    step = (np.arange(_FINE) + 0.5) / _FINE
    x = (np.arange(columns.start, columns.stop)[:, None] + step).ravel()
    y = (np.arange(rows.start, rows.stop)[:, None] + step).ravel()
    return geometry.pixel_directions(camera, x[None], y[:, None])


def _draw_ball(window: NDArray[np.float32], kind: int, rays: Floats, scene: SphereScene, center: Floats) -> None:
    """Lay a ball over a window (h, w, 3), mixed with it where it covers a pixel in part."""
    flat = rays.reshape(-1, 3)
    distance = geometry.ray_sphere(np.zeros(3), flat, center)
    hit = np.isfinite(distance)
    color = np.zeros(flat.shape, dtype=np.float32)
    points = (flat[hit] * distance[hit, None]).astype(np.float32)
    color[hit] = _shade_sphere(kind, points, flat[hit].astype(np.float32), scene, mirrored=False)
    height, width = window.shape[:2]
    blocks = (height, _FINE, width, _FINE)
    cover = hit.reshape(blocks).mean(axis=(1, 3))[..., None]
    window *= 1 - cover
    window += np.minimum(color, 1.0).reshape(*blocks, 3).mean(axis=(1, 3))
