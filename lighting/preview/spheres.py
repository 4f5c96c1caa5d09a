"""Three spheres, mirror, glossy and diffuse, on the ground under an environment map: a small renderer in numpy.

The camera keeps the photo's heading and, as far as the ground stays in view, its pitch, so that light and shadow fall
as in the photo. The ground has the colour of the map's own ground, so it meets the horizon without a seam.
The sun's disc is taken out of the map and lights everything analytically. What the spheres hide from the ground and
send to it, and what the diffuse sphere gets from all around, are integrals over rays, kept in small tables; the glossy
sphere reflects a blurred map, as do all in what they send to others.
Distances are in sphere radii.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import (
    SUN_RADIUS,
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
from lighting.prefilter import blur, irradiance, shrink, without_sun
from lighting.records import Lighting

Floats = NDArray[np.floating[Any]]

MIRROR, GLOSSY, DIFFUSE = range(3)  # from left to right

VERTICAL_FOV = 40.0  # deg
PITCH = (-20.0, -5.0)  # deg, range of the camera's elevation that keeps ground and sky in view
SPACING = 2.6  # between neighbouring centres
CENTRE_HEIGHT = 0.60  # of the middle sphere in the picture, 0 = top, 1 = bottom
PICTURE_WIDTH = 8.6  # at the spheres' distance

MIRROR_SUN_RADIUS = 1.0  # deg, wide enough to be seen in the mirror, with the same power
MIRROR_REFLECTANCE = 0.92
GLOSSY_REFLECTANCE = 0.85
DIFFUSE_REFLECTANCE = 0.6
GLOSSINESS = 60.0  # concentration of the glossy lobe, exp(GLOSSINESS (cos - 1))
_LOBE_ROWS = 32  # of the blurred map
_SECOND_HAND = 25.0  # the same where a sphere lights something else, wide enough for few rays to find the sun
_EXCHANGE_ROWS = 24
_RINGS, _SPOKES = 8, 20  # of rays from a point on the ground to a sphere
_BALL_ROWS = 12
_AROUND_ROWS = 16  # of the directions from which light comes to the diffuse sphere
_BOUNCES = 3


@dataclass(frozen=True)
class _Light:
    """An environment map taken apart, and what becomes of its light between the spheres and the ground."""

    sky: NDArray[np.float32]  # the map (H, 2H, 3) without the sun's disc
    coarse: NDArray[np.float32]  # the same in few pixels
    lobes: NDArray[np.float32]  # the same, blurred by the glossy lobe
    sun_direction: Floats  # (3,)
    sun_irradiance: Floats  # (3,) on a surface that faces the sun; 0 where the map has no disc
    ground: Floats  # radiance (3,) of open ground
    ground_sky: Floats  # (3,) the part of it that the sky lights
    albedo: Floats  # (3,) of the ground
    ball: Floats  # irradiance (H, 2H, 3) of the diffuse sphere by all but the sun, by its normals
    exchange: tuple[Floats, ...]  # of each sphere with the ground, see _exchange


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
    pitch = float(np.clip(lighting.camera_elevation, *PITCH))
    columns, rows = width * supersampling, height * supersampling
    rays = camera_directions(columns, rows, VERTICAL_FOV, elevation=pitch).astype(np.float32).reshape(-1, 3)
    centres = sphere_centres(width / height, pitch) if centres is None else centres
    light = _take_apart(envmap, lighting.sun_direction, centres.astype(np.float64))
    picture = _trace(np.zeros(3, np.float32), rays, centres, light)
    return np.asarray(picture.reshape(rows, columns, 3), dtype=np.float32)


def sphere_centres(aspect: float, pitch: float) -> NDArray[np.float32]:
    """The spheres' centres (3, 3) as seen from a camera at the origin whose elevation is `pitch` [deg]."""
    right, up, forward = camera_axes(0.0, pitch, 0.0)
    height = PICTURE_WIDTH / aspect
    middle = forward * focal_length(height, VERTICAL_FOV) + up * (0.5 - CENTRE_HEIGHT) * height
    return np.asarray(middle + np.array([[-SPACING], [0.0], [SPACING]]) * right, dtype=np.float32)


# --- light


def _take_apart(envmap: NDArray[np.float32], sun: Floats, centres: Floats) -> _Light:
    sky, sun_irradiance = without_sun(envmap, sun)
    coarse = shrink(sky, _LOBE_ROWS)
    ground = sky[-len(sky) // 4 :].mean(axis=(0, 1), dtype=np.float64).reshape(3)
    overhead = np.maximum(irradiance(coarse, np.array([0.0, 1.0, 0.0])), 1e-9)
    direct = sun_irradiance * max(float(sun[1]), 0.0)
    albedo = np.pi * ground / (overhead + direct)
    above = np.where(np.arange(len(coarse))[:, None, None] < len(coarse) // 2, coarse, 0)
    ball = irradiance(above, latlong_directions(_BALL_ROWS))
    lobes = blur(coarse, GLOSSINESS)
    none = tuple(np.zeros((2, 4, 3)) for _ in centres)
    light = _Light(sky, coarse, lobes, sun, sun_irradiance, ground, albedo * overhead / np.pi, albedo, ball, none)
    for _ in range(_BOUNCES):
        light = replace(light, exchange=tuple(_exchange(kind, centres, light) for kind in range(len(centres))))
        light = replace(light, ball=_around_ball(centres, light))
    return light


def _exchange(kind: int, centres: Floats, light: _Light) -> Floats:
    """Mean radiance that the ground gets from a sphere less that of the sky behind it, (H, 2H, 3) by direction.

    A ground point sees the centre in that direction. The sphere then fills a cone that touches the horizon; the mean
    over it is weighted with the ground's cosine. Where another sphere stands before this one, it is left out.
    """
    towards = latlong_directions(_EXCHANGE_ROWS)[: _EXCHANGE_ROWS // 2].reshape(-1, 3)
    rays, weight = _cones(towards)
    shape, rays = rays.shape, rays.reshape(-1, 3)
    points = np.repeat(centres[kind] - towards / towards[:, 1:2], shape[1], axis=0)
    distance = ray_sphere(points, rays, centres[kind])
    first = np.all([distance <= ray_sphere(points, rays, centre) for centre in centres], axis=0)
    radiance = _shade(kind, points + rays * distance[:, None], rays, centres, light, mirrored=True)
    radiance = np.where(first[:, None], radiance - sample_latlong(light.coarse, rays), 0.0).reshape(shape)
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


def _around_ball(centres: Floats, light: _Light) -> Floats:
    """Irradiance (H, 2H, 3) of the diffuse sphere by sky, ground and the other spheres, by its normals."""
    soft = replace(light, sky=shrink(light.sky, _AROUND_ROWS))
    rays = latlong_directions(_AROUND_ROWS).reshape(-1, 3)
    normals = latlong_directions(_BALL_ROWS).reshape(-1, 3)
    weight = np.maximum(normals @ rays.T, 0) * np.repeat(latlong_solid_angle(_AROUND_ROWS), 2 * _AROUND_ROWS)
    normal, ray = np.nonzero(weight)
    radiance = np.zeros((*weight.shape, 3))
    radiance[normal, ray] = _trace(centres[DIFFUSE] + normals[normal], rays[ray], centres, soft, DIFFUSE, disc=None)
    total = np.einsum("nr,nrc->nc", weight, radiance) * np.pi / weight.sum(axis=1, keepdims=True)
    return np.asarray(total.reshape(_BALL_ROWS, -1, 3))


# --- shading


def _trace(
    origin: Floats,
    rays: Floats,
    centres: Floats,
    light: _Light,
    leaving: int | None = None,
    disc: float | None = SUN_RADIUS,
) -> Floats:
    """Radiance (N, 3) along rays (N, 3) from `origin` (3,) or (N, 3), on the sphere they are `leaving` if any.

    The sun's disc has a radius of `disc` [deg], or is left out.
    """
    radiance = _surroundings(origin, rays, centres, light, disc)
    nearest = np.full(len(rays), np.inf, dtype=rays.dtype)
    for kind, centre in enumerate(centres):
        if kind == leaving:
            continue
        distance = ray_sphere(origin, rays, centre)
        seen = np.flatnonzero(distance < nearest)
        nearest[seen] = distance[seen]
        start = np.broadcast_to(origin, rays.shape)[seen]
        point = start + rays[seen] * distance[seen, None]
        radiance[seen] = _shade(kind, point, rays[seen], centres, light, mirrored=leaving is not None)
    return radiance


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _surroundings(origin: Floats, rays: Floats, centres: Floats, light: _Light, disc: float | None) -> Floats:
    radiance = np.empty_like(rays)
    down = rays[:, 1] < -1e-4
    radiance[~down] = _sky(rays[~down], light, disc)
    start = np.broadcast_to(origin, rays.shape)[down]
    reach = (centres[0, 1] - 1 - start[:, 1]) / rays[down, 1]
    radiance[down] = _ground(start + rays[down] * reach[:, None], centres, light)
    return radiance


def _sky(rays: Floats, light: _Light, disc: float | None) -> Floats:
    """The map along rays (N, 3), with a sharp disc that carries the sun's power."""
    radiance = sample_latlong(light.sky, rays).astype(rays.dtype)
    if disc is not None:
        cosine = np.cos(np.radians(disc))
        radiance[rays @ light.sun_direction.astype(rays.dtype) > cosine] += light.sun_irradiance / (
            2 * np.pi * (1 - cosine)
        )
    return radiance


def _ground(points: Floats, centres: Floats, light: _Light) -> Floats:
    """Radiance (N, 3) of the ground at points (N, 3): the spheres hide the sun and part of the sky, and shine on it."""
    sky, albedo = light.ground_sky.astype(points.dtype), light.albedo.astype(points.dtype)
    radiance = (light.ground.astype(points.dtype) - sky) * _sunlit(points, centres, light)[:, None] + sky
    for centre, exchange in zip(centres, light.exchange, strict=True):
        towards = centre - points
        share = _dot(towards, towards)[:, None] ** -1.5  # of a cosine-weighted hemisphere; the centre is 1 up
        radiance += albedo * share * sample_latlong(exchange, towards).astype(points.dtype)
    return np.maximum(radiance, 0)


def _sunlit(points: Floats, centres: Floats, light: _Light, leaving: int | None = None) -> Floats:
    """Visible share (N,) of the sun's disc from points (N, 3), with penumbra."""
    share = np.ones(len(points), dtype=points.dtype)
    sun = light.sun_direction.astype(points.dtype)
    for kind, centre in enumerate(centres):
        if kind == leaving:
            continue
        towards = centre - points
        along = towards @ sun
        aside = np.sqrt(np.maximum(_dot(towards, towards) - along**2, 0))
        penumbra = 2 * np.tan(np.radians(SUN_RADIUS)) * np.maximum(along, 1e-3)
        share *= np.where(along > 0, np.clip((aside - 1) / penumbra + 0.5, 0, 1), 1)
    return share


def _shade(kind: int, points: Floats, rays: Floats, centres: Floats, light: _Light, *, mirrored: bool) -> Floats:
    normals = points - centres[kind]
    if kind == DIFFUSE:
        return _diffuse(points, normals, centres, light)
    reflected = rays - 2 * _dot(rays, normals)[:, None] * normals
    if mirrored:
        return _glossy(
            _around(kind, points, reflected, centres, light), points, reflected, centres, light, kind, _SECOND_HAND
        )
    if kind == GLOSSY:
        around = sample_latlong(light.lobes, reflected) * _contact(normals)
        return _glossy(around, points, reflected, centres, light, kind, GLOSSINESS)
    return MIRROR_REFLECTANCE * _trace(points, reflected, centres, light, kind, MIRROR_SUN_RADIUS)


def _around(kind: int, points: Floats, rays: Floats, centres: Floats, light: _Light) -> Floats:
    """Radiance (N, 3) of blurred sky, sharp ground and the diffuse sphere along rays (N, 3) from points (N, 3)."""
    radiance = sample_latlong(light.lobes, rays).astype(rays.dtype)
    down = rays[:, 1] < -1e-4
    reach = (centres[0, 1] - 1 - points[down, 1]) / rays[down, 1]
    radiance[down] = _ground(points[down] + rays[down] * reach[:, None], centres, light)
    distance = ray_sphere(points, rays, centres[DIFFUSE])
    ball = np.isfinite(distance) & (kind != DIFFUSE)
    hits = points[ball] + rays[ball] * distance[ball, None]
    radiance[ball] = _diffuse(hits, hits - centres[DIFFUSE], centres, light)
    return radiance


def _diffuse(points: Floats, normals: Floats, centres: Floats, light: _Light) -> Floats:
    cosine = np.maximum(normals @ light.sun_direction.astype(points.dtype), 0)
    direct = (cosine * _sunlit(points, centres, light, DIFFUSE))[:, None] * light.sun_irradiance.astype(points.dtype)
    return np.asarray(DIFFUSE_REFLECTANCE / np.pi * (direct + sample_latlong(light.ball, normals).astype(points.dtype)))


def _glossy(
    around: Floats, points: Floats, reflected: Floats, centres: Floats, light: _Light, kind: int, glossiness: float
) -> Floats:
    cosine = reflected @ light.sun_direction.astype(points.dtype)
    lobe = glossiness / (2 * np.pi) * np.exp(glossiness * (cosine - 1)) * _sunlit(points, centres, light, kind)
    sun = lobe[:, None] * light.sun_irradiance.astype(points.dtype)
    return np.asarray(GLOSSY_REFLECTANCE * (around + sun))


def _contact(normals: Floats) -> Floats:
    """Share (N, 1) of the surrounding light that reaches a sphere, whose foot stands in its own shade."""
    downward = np.maximum(-normals[:, 1:2], 0)
    return np.asarray(1 - 0.7 * downward**2)
