"""Ray-shaded mirror, glossy and diffuse balls.

Distances are in sphere radii. The sun's disc is not in the map; it lights everything analytically.

What a sphere hides from the ground and reflects to it, and what the diffuse sphere receives, are integrals over rays,
kept in small tables by direction.

The camera keeps the photo's heading and, as far as the ground stays in view, its pitch, so that light and shadow fall
as in the photo. The ground has the colour of the map's own ground, so it meets the horizon without a seam.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.envmap.latlong import blur_envmap, envmap_irradiance, remove_sun, shrink_envmap
from lighting.geometry import (
    SUN_RADIUS,
    Floats,
    Pinhole,
    angles,
    camera_axes,
    camera_directions,
    direction,
    focal_length,
    latlong_directions,
    latlong_solid_angle,
    ray_sphere,
    sample_latlong,
)
from lighting.records import Lighting

# Radiance along rays in a scene of three spheres, mirror, glossy and diffuse, on the ground.

MIRROR, GLOSSY, DIFFUSE = range(3)  # from left to right

MIRROR_SUN_RADIUS = 1.0  # deg, wide enough to be seen in the mirror, with the same power
MIRROR_REFLECTANCE = 0.92
GLOSSY_REFLECTANCE = 0.85
DIFFUSE_REFLECTANCE = 0.36  # twice a grey card's: white burns out in many photos of sunlight
GLOSSINESS = 60.0  # concentration of the glossy lobe, exp(GLOSSINESS (cos - 1))
_SECOND_HAND = 25.0  # the same for light that a sphere sends elsewhere; wide enough to be sampled with few rays
_LEVEL = -1e-4  # vertical part of a unit ray, below which it meets the ground
_FOOT_SHADE = 0.7  # share of the surrounding light that does not reach a sphere where it touches the ground


@dataclass(frozen=True)
class SphereScene:
    """The spheres, the environment map with its sun apart, and the light exchanged between spheres and ground."""

    centers: Floats  # (3, 3) of the spheres, which stand on level ground
    sky: NDArray[np.float32]  # the map (H, 2H, 3) without the sun's disc
    coarse: NDArray[np.float32]  # the same in few pixels
    lobes: NDArray[np.float32]  # the same, blurred by the glossy lobe
    sun_direction: Floats  # (3,)
    sun_irradiance: Floats  # (3,) on a surface that faces the sun; 0 where the map has no disc
    ground: Floats  # radiance (3,) of open ground
    ground_sky: Floats  # (3,) the part of it that the sky lights
    albedo: Floats  # (3,) of the ground
    ball: Floats  # irradiance (H, 2H, 3) of the diffuse sphere by all but the sun, by its normals
    exchange: tuple[Floats, ...]  # of each sphere with the ground, see bounces.py


def _trace(
    origin: Floats,
    rays: Floats,
    stage: SphereScene,
    leaving: int | None = None,
    disc: float | None = SUN_RADIUS,
) -> Floats:
    """Radiance (N, 3) along rays (N, 3) from `origin` (3,) or (N, 3), on the sphere they are `leaving` if any.

    The sun's disc has a radius of `disc` [deg], or is left out.
    """
    radiance = _surroundings(origin, rays, stage, disc)
    nearest = np.full(len(rays), np.inf, dtype=rays.dtype)
    for kind, center in enumerate(stage.centers):
        if kind == leaving:
            continue
        distance = ray_sphere(origin, rays, center)
        seen = np.flatnonzero(distance < nearest)
        nearest[seen] = distance[seen]
        start = np.broadcast_to(origin, rays.shape)[seen]
        point = start + rays[seen] * distance[seen, None]
        radiance[seen] = shade_sphere(kind, point, rays[seen], stage, mirrored=leaving is not None)
    return radiance


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _surroundings(origin: Floats, rays: Floats, stage: SphereScene, disc: float | None) -> Floats:
    """Radiance (N, 3) of sky and ground along rays (N, 3), the spheres left out."""
    radiance = np.empty_like(rays)
    down = rays[:, 1] < _LEVEL
    radiance[~down] = _sky(rays[~down], stage, disc)
    radiance[down] = _ground_along(np.broadcast_to(origin, rays.shape)[down], rays[down], stage)
    return radiance


def _sky(rays: Floats, stage: SphereScene, disc: float | None) -> Floats:
    """The map along rays (N, 3), with a sharp disc that carries the sun's power."""
    radiance = sample_latlong(stage.sky, rays).astype(rays.dtype)
    if disc is not None:
        cosine = np.cos(np.radians(disc))
        radiance[rays @ stage.sun_direction.astype(rays.dtype) > cosine] += stage.sun_irradiance / (
            2 * np.pi * (1 - cosine)
        )
    return radiance


def _ground_along(origins: Floats, rays: Floats, stage: SphereScene) -> Floats:
    """Radiance (N, 3) of the ground that rays (N, 3) from origins (N, 3) go down to."""
    reach = (stage.centers[0, 1] - 1 - origins[:, 1]) / rays[:, 1]
    return ground_radiance(origins + rays * reach[:, None], stage)


def ground_radiance(points: Floats, stage: SphereScene) -> Floats:
    """Radiance (N, 3) of the ground at points (N, 3): the spheres hide the sun and part of the sky, and shine on it."""
    sky, albedo = stage.ground_sky.astype(points.dtype), stage.albedo.astype(points.dtype)
    radiance = (stage.ground.astype(points.dtype) - sky) * visible_sun_share(points, stage)[:, None] + sky
    for center, exchange in zip(stage.centers, stage.exchange, strict=True):
        towards = center - points
        share = _dot(towards, towards)[:, None] ** -1.5  # of a cosine-weighted hemisphere; the centre is 1 up
        radiance += albedo * share * sample_latlong(exchange, towards).astype(points.dtype)
    return np.maximum(radiance, 0)


def visible_sun_share(points: Floats, stage: SphereScene, leaving: int | None = None) -> Floats:
    """Visible share (N,) of the sun's disc from points (N, 3), with penumbra."""
    share = np.ones(len(points), dtype=points.dtype)
    sun = stage.sun_direction.astype(points.dtype)
    for kind, center in enumerate(stage.centers):
        if kind == leaving:
            continue
        towards = center - points
        along = towards @ sun
        aside = np.sqrt(np.maximum(_dot(towards, towards) - along**2, 0))
        penumbra = 2 * np.tan(np.radians(SUN_RADIUS)) * np.maximum(along, 1e-3)
        share *= np.where(along > 0, np.clip((aside - 1) / penumbra + 0.5, 0, 1), 1)
    return share


def shade_sphere(kind: int, points: Floats, rays: Floats, stage: SphereScene, *, mirrored: bool) -> Floats:
    """Radiance (N, 3) of a sphere at points (N, 3) seen along rays (N, 3); `mirrored`, it is seen in another sphere."""
    normals = points - stage.centers[kind]
    if kind == DIFFUSE:
        return _diffuse(points, normals, stage)
    reflected = rays - 2 * _dot(rays, normals)[:, None] * normals
    if mirrored:
        return _glossy(_around(kind, points, reflected, stage), points, reflected, stage, kind, _SECOND_HAND)
    if kind == GLOSSY:
        around = sample_latlong(stage.lobes, reflected) * _contact(normals)
        return _glossy(around, points, reflected, stage, kind, GLOSSINESS)
    return MIRROR_REFLECTANCE * _trace(points, reflected, stage, kind, MIRROR_SUN_RADIUS)


def _around(kind: int, points: Floats, rays: Floats, stage: SphereScene) -> Floats:
    """Radiance (N, 3) of blurred sky, sharp ground and the diffuse sphere along rays (N, 3) from points (N, 3)."""
    radiance = sample_latlong(stage.lobes, rays).astype(rays.dtype)
    down = rays[:, 1] < _LEVEL
    radiance[down] = _ground_along(points[down], rays[down], stage)
    distance = ray_sphere(points, rays, stage.centers[DIFFUSE])
    ball = np.isfinite(distance) & (kind != DIFFUSE)
    hits = points[ball] + rays[ball] * distance[ball, None]
    radiance[ball] = _diffuse(hits, hits - stage.centers[DIFFUSE], stage)
    return radiance


def _diffuse(points: Floats, normals: Floats, stage: SphereScene) -> Floats:
    """Radiance (N, 3) of the diffuse sphere at points (N, 3) with these normals (N, 3)."""
    cosine = np.maximum(normals @ stage.sun_direction.astype(points.dtype), 0)
    direct = (cosine * visible_sun_share(points, stage, DIFFUSE))[:, None] * stage.sun_irradiance.astype(points.dtype)
    return np.asarray(DIFFUSE_REFLECTANCE / np.pi * (direct + sample_latlong(stage.ball, normals).astype(points.dtype)))


def _glossy(
    around: Floats, points: Floats, reflected: Floats, stage: SphereScene, kind: int, glossiness: float
) -> Floats:
    """Radiance (N, 3) of a sphere: what is `around` it (N, 3), and the sun in a lobe along `reflected` (N, 3)."""
    cosine = reflected @ stage.sun_direction.astype(points.dtype)
    lobe = glossiness / (2 * np.pi) * np.exp(glossiness * (cosine - 1)) * visible_sun_share(points, stage, kind)
    sun = lobe[:, None] * stage.sun_irradiance.astype(points.dtype)
    return np.asarray(GLOSSY_REFLECTANCE * (around + sun))


def _contact(normals: Floats) -> Floats:
    """Share (N, 1) of the surrounding light that reaches a sphere, whose foot stands in its own shade."""
    downward = np.maximum(-normals[:, 1:2], 0)
    return np.asarray(1 - _FOOT_SHADE * downward**2)


# The light exchanged between spheres and ground under an environment map.

_LOBE_ROWS = 32  # of the blurred map
_EXCHANGE_ROWS = 24  # of `Stage.exchange`, by the direction to a sphere
_RINGS, _SPOKES = 8, 20  # of rays from a point on the ground to a sphere
_BALL_ROWS = 12  # of `Stage.ball`, by the normal
_AROUND_ROWS = 16  # of the directions from which light comes to the diffuse sphere
_BOUNCES = 3  # of light between spheres and ground
_BOUNCES_MORE = 2  # where that light is nearly right already


def build_sphere_scene(envmap: NDArray[np.float32], sun: Floats, centers: Floats) -> SphereScene:
    """The spheres at `centres` (3, 3) under a map (H, 2H, 3) whose sun stands in the direction `sun` (3,)."""
    sky, sun_irradiance = remove_sun(envmap, sun)
    coarse = shrink_envmap(sky, _LOBE_ROWS)
    ground = sky[-len(sky) // 4 :].mean(axis=(0, 1), dtype=np.float64).reshape(3)
    overhead = np.maximum(envmap_irradiance(coarse, np.array([0.0, 1.0, 0.0])), 1e-9)
    direct = sun_irradiance * max(float(sun[1]), 0.0)
    albedo = np.pi * ground / (overhead + direct)
    ball = envmap_irradiance(_with_ground_times(coarse, 0.0), latlong_directions(_BALL_ROWS))
    lobes = blur_envmap(coarse, GLOSSINESS)
    none = tuple(np.zeros((2, 4, 3)) for _ in centers)
    stage = SphereScene(
        centers, sky, coarse, lobes, sun, sun_irradiance, ground, albedo * overhead / np.pi, albedo, ball, none
    )
    return _bounced(stage, _BOUNCES)


def dim_sun(stage: SphereScene, lit: float) -> SphereScene:
    """The same where the sun reaches a share `lit` of the spheres and of the ground around them."""
    ground = stage.ground_sky + lit * (stage.ground - stage.ground_sky)
    coarse = _with_ground_times(stage.coarse, ground / np.maximum(stage.ground, 1e-9))
    return _bounced(
        replace(
            stage,
            coarse=coarse,
            lobes=blur_envmap(coarse, GLOSSINESS),
            sun_irradiance=lit * stage.sun_irradiance,
            ground=ground,
        ),
        _BOUNCES_MORE,
    )


def _with_ground_times(image: NDArray[np.float32], gain: Floats | float) -> NDArray[np.float32]:
    """The map (H, 2H, 3) with its lower half multiplied by a gain, a number or (3,)."""
    result = image.copy()
    result[len(image) // 2 :] *= np.asarray(gain, dtype=np.float32)
    return result


def _bounced(stage: SphereScene, times: int) -> SphereScene:
    """The stage with the light that its spheres and its ground send to each other, so many times."""
    for _ in range(times):
        stage = replace(stage, exchange=tuple(_exchange(kind, stage) for kind in range(len(stage.centers))))
        stage = replace(stage, ball=_around_ball(stage))
    return stage


def _exchange(kind: int, stage: SphereScene) -> Floats:
    """Mean radiance (H, 2H, 3) that the ground receives from a sphere minus that of the sky behind it, by direction.

    A ground point sees the centre in that direction. The sphere then fills a cone that touches the horizon; the mean
    over it is weighted with the ground's cosine. Where another sphere stands before this one, it is left out.
    """
    towards = latlong_directions(_EXCHANGE_ROWS)[: _EXCHANGE_ROWS // 2].reshape(-1, 3)
    rays, weight = _cones(towards)
    shape, rays = rays.shape, rays.reshape(-1, 3)
    points = np.repeat(stage.centers[kind] - towards / towards[:, 1:2], shape[1], axis=0)
    distance = ray_sphere(points, rays, stage.centers[kind])
    first = np.all([distance <= ray_sphere(points, rays, center) for center in stage.centers], axis=0)
    radiance = shade_sphere(kind, points + rays * distance[:, None], rays, stage, mirrored=True)
    radiance = np.where(first[:, None], radiance - sample_latlong(stage.coarse, rays), 0.0).reshape(shape)
    upper = np.einsum("nr,nrc->nc", weight, radiance).reshape(_EXCHANGE_ROWS // 2, -1, 3)
    return np.concatenate([upper, upper[::-1]])


def _cones(axes: Floats) -> tuple[Floats, Floats]:
    """Rays (N, R, 3) in cones around axes (N, 3) down to the horizon; weights (N, R) of a mean over what they light."""
    node, part = np.polynomial.legendre.leggauss(_RINGS)
    rim = np.sqrt(1 - axes[:, 1] ** 2)
    cosine = (rim[:, None] + (1 - rim[:, None]) * (node + 1) / 2)[:, :, None, None]
    turn = (np.arange(_SPOKES) + 0.5)[:, None] * 2 * np.pi / _SPOKES
    right = direction(angles(axes)[0] + 90.0, 0.0)
    aside = np.cos(turn) * right[:, None] + np.sin(turn) * np.cross(right, axes)[:, None]
    rays = cosine * axes[:, None, None] + np.sqrt(1 - cosine**2) * aside[:, None]
    weight = (rays[..., 1] * part[:, None]).reshape(len(axes), -1)
    return rays.reshape(len(axes), -1, 3), weight / weight.sum(axis=1, keepdims=True)


def _around_ball(stage: SphereScene) -> Floats:
    """Irradiance (H, 2H, 3) of the diffuse sphere by sky, ground and the other spheres, by its normals."""
    soft = replace(stage, sky=shrink_envmap(stage.sky, _AROUND_ROWS))
    rays = latlong_directions(_AROUND_ROWS).reshape(-1, 3)
    normals = latlong_directions(_BALL_ROWS).reshape(-1, 3)
    weight = np.maximum(normals @ rays.T, 0) * np.repeat(latlong_solid_angle(_AROUND_ROWS), 2 * _AROUND_ROWS)
    normal, ray = np.nonzero(weight)
    radiance = np.zeros((*weight.shape, 3))
    radiance[normal, ray] = _trace(stage.centers[DIFFUSE] + normals[normal], rays[ray], soft, DIFFUSE, disc=None)
    total = np.einsum("nr,nrc->nc", weight, radiance) * np.pi / weight.sum(axis=1, keepdims=True)
    return np.asarray(total.reshape(_BALL_ROWS, -1, 3))


# A picture of three spheres, mirror, glossy and diffuse, on the ground under an environment map.

VERTICAL_FOV = 40.0  # deg
PITCH = (-20.0, -5.0)  # deg, range of the camera's elevation that keeps ground and sky in view
SPACING = 2.6  # between neighbouring centres, in radii
CENTER_HEIGHT = 0.60  # of the middle sphere in the picture, 0 = top, 1 = bottom
PICTURE_WIDTH = 8.6  # at the spheres' distance, in radii


def render_spheres(
    envmap: NDArray[np.float32],
    lighting: Lighting,
    width: int,
    height: int,
    supersampling: int = 2,
    centers: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Linear picture (supersampling x height, supersampling x width, 3) of the spheres under a map (H, 2H, 3).

    They stand where `sphere_centres` says, or at `centres` (3, 3) from the camera, on the same ground.
    """
    centers = sphere_centers(width / height, limit_pitch(lighting)) if centers is None else centers
    stage = build_sphere_scene(envmap, lighting.sun_direction, centers.astype(np.float64))
    return render_sphere_scene(stage, lighting, width, height, supersampling)


def render_sphere_scene(
    stage: SphereScene, lighting: Lighting, width: int, height: int, supersampling: int = 2
) -> NDArray[np.float32]:
    """The same picture of a stage that is lit already."""
    columns, rows = width * supersampling, height * supersampling
    camera = Pinhole(columns, rows, VERTICAL_FOV, elevation=limit_pitch(lighting))
    rays = camera_directions(camera).astype(np.float32).reshape(-1, 3)
    picture = _trace(np.zeros(3, np.float32), rays, replace(stage, centers=stage.centers.astype(np.float32)))
    return np.asarray(picture.reshape(rows, columns, 3), dtype=np.float32)


def limit_pitch(lighting: Lighting) -> float:
    """Elevation [deg] of the stage's camera: the photo's, as far as the ground stays in view."""
    return float(np.clip(lighting.camera_elevation, *PITCH))


def sphere_centers(aspect: float, pitch: float) -> NDArray[np.float32]:
    """The spheres' centres (3, 3) as seen from a camera at the origin whose elevation is `pitch` [deg]."""
    right, up, forward = camera_axes(0.0, pitch, 0.0)
    height = PICTURE_WIDTH / aspect
    middle = forward * focal_length(height, VERTICAL_FOV) + up * (0.5 - CENTER_HEIGHT) * height
    return np.asarray(middle + np.array([[-SPACING], [0.0], [SPACING]]) * right, dtype=np.float32)
