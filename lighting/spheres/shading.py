"""Radiance along rays in a scene of three spheres, mirror, glossy and diffuse, on the ground.

Distances are in sphere radii. The sun's disc is not in the map; it lights everything analytically.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import SUN_RADIUS, Floats, ray_sphere, sample_latlong

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
class Stage:
    """The spheres, the environment map with its sun apart, and the light exchanged between spheres and ground."""

    centres: Floats  # (3, 3) of the spheres, which stand on level ground
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


def trace(
    origin: Floats,
    rays: Floats,
    stage: Stage,
    leaving: int | None = None,
    disc: float | None = SUN_RADIUS,
) -> Floats:
    """Radiance (N, 3) along rays (N, 3) from `origin` (3,) or (N, 3), on the sphere they are `leaving` if any.

    The sun's disc has a radius of `disc` [deg], or is left out.
    """
    radiance = _surroundings(origin, rays, stage, disc)
    nearest = np.full(len(rays), np.inf, dtype=rays.dtype)
    for kind, centre in enumerate(stage.centres):
        if kind == leaving:
            continue
        distance = ray_sphere(origin, rays, centre)
        seen = np.flatnonzero(distance < nearest)
        nearest[seen] = distance[seen]
        start = np.broadcast_to(origin, rays.shape)[seen]
        point = start + rays[seen] * distance[seen, None]
        radiance[seen] = shade(kind, point, rays[seen], stage, mirrored=leaving is not None)
    return radiance


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _surroundings(origin: Floats, rays: Floats, stage: Stage, disc: float | None) -> Floats:
    """Radiance (N, 3) of sky and ground along rays (N, 3), the spheres left out."""
    radiance = np.empty_like(rays)
    down = rays[:, 1] < _LEVEL
    radiance[~down] = _sky(rays[~down], stage, disc)
    radiance[down] = _ground_along(np.broadcast_to(origin, rays.shape)[down], rays[down], stage)
    return radiance


def _sky(rays: Floats, stage: Stage, disc: float | None) -> Floats:
    """The map along rays (N, 3), with a sharp disc that carries the sun's power."""
    radiance = sample_latlong(stage.sky, rays).astype(rays.dtype)
    if disc is not None:
        cosine = np.cos(np.radians(disc))
        radiance[rays @ stage.sun_direction.astype(rays.dtype) > cosine] += stage.sun_irradiance / (
            2 * np.pi * (1 - cosine)
        )
    return radiance


def _ground_along(origins: Floats, rays: Floats, stage: Stage) -> Floats:
    """Radiance (N, 3) of the ground that rays (N, 3) from origins (N, 3) go down to."""
    reach = (stage.centres[0, 1] - 1 - origins[:, 1]) / rays[:, 1]
    return ground(origins + rays * reach[:, None], stage)


def ground(points: Floats, stage: Stage) -> Floats:
    """Radiance (N, 3) of the ground at points (N, 3): the spheres hide the sun and part of the sky, and shine on it."""
    sky, albedo = stage.ground_sky.astype(points.dtype), stage.albedo.astype(points.dtype)
    radiance = (stage.ground.astype(points.dtype) - sky) * sunlit(points, stage)[:, None] + sky
    for centre, exchange in zip(stage.centres, stage.exchange, strict=True):
        towards = centre - points
        share = _dot(towards, towards)[:, None] ** -1.5  # of a cosine-weighted hemisphere; the centre is 1 up
        radiance += albedo * share * sample_latlong(exchange, towards).astype(points.dtype)
    return np.maximum(radiance, 0)


def sunlit(points: Floats, stage: Stage, leaving: int | None = None) -> Floats:
    """Visible share (N,) of the sun's disc from points (N, 3), with penumbra."""
    share = np.ones(len(points), dtype=points.dtype)
    sun = stage.sun_direction.astype(points.dtype)
    for kind, centre in enumerate(stage.centres):
        if kind == leaving:
            continue
        towards = centre - points
        along = towards @ sun
        aside = np.sqrt(np.maximum(_dot(towards, towards) - along**2, 0))
        penumbra = 2 * np.tan(np.radians(SUN_RADIUS)) * np.maximum(along, 1e-3)
        share *= np.where(along > 0, np.clip((aside - 1) / penumbra + 0.5, 0, 1), 1)
    return share


def shade(kind: int, points: Floats, rays: Floats, stage: Stage, *, mirrored: bool) -> Floats:
    """Radiance (N, 3) of a sphere at points (N, 3) seen along rays (N, 3); `mirrored`, it is seen in another sphere."""
    normals = points - stage.centres[kind]
    if kind == DIFFUSE:
        return _diffuse(points, normals, stage)
    reflected = rays - 2 * _dot(rays, normals)[:, None] * normals
    if mirrored:
        return _glossy(_around(kind, points, reflected, stage), points, reflected, stage, kind, _SECOND_HAND)
    if kind == GLOSSY:
        around = sample_latlong(stage.lobes, reflected) * _contact(normals)
        return _glossy(around, points, reflected, stage, kind, GLOSSINESS)
    return MIRROR_REFLECTANCE * trace(points, reflected, stage, kind, MIRROR_SUN_RADIUS)


def _around(kind: int, points: Floats, rays: Floats, stage: Stage) -> Floats:
    """Radiance (N, 3) of blurred sky, sharp ground and the diffuse sphere along rays (N, 3) from points (N, 3)."""
    radiance = sample_latlong(stage.lobes, rays).astype(rays.dtype)
    down = rays[:, 1] < _LEVEL
    radiance[down] = _ground_along(points[down], rays[down], stage)
    distance = ray_sphere(points, rays, stage.centres[DIFFUSE])
    ball = np.isfinite(distance) & (kind != DIFFUSE)
    hits = points[ball] + rays[ball] * distance[ball, None]
    radiance[ball] = _diffuse(hits, hits - stage.centres[DIFFUSE], stage)
    return radiance


def _diffuse(points: Floats, normals: Floats, stage: Stage) -> Floats:
    """Radiance (N, 3) of the diffuse sphere at points (N, 3) with these normals (N, 3)."""
    cosine = np.maximum(normals @ stage.sun_direction.astype(points.dtype), 0)
    direct = (cosine * sunlit(points, stage, DIFFUSE))[:, None] * stage.sun_irradiance.astype(points.dtype)
    return np.asarray(DIFFUSE_REFLECTANCE / np.pi * (direct + sample_latlong(stage.ball, normals).astype(points.dtype)))


def _glossy(around: Floats, points: Floats, reflected: Floats, stage: Stage, kind: int, glossiness: float) -> Floats:
    """Radiance (N, 3) of a sphere: what is `around` it (N, 3), and the sun in a lobe along `reflected` (N, 3)."""
    cosine = reflected @ stage.sun_direction.astype(points.dtype)
    lobe = glossiness / (2 * np.pi) * np.exp(glossiness * (cosine - 1)) * sunlit(points, stage, kind)
    sun = lobe[:, None] * stage.sun_irradiance.astype(points.dtype)
    return np.asarray(GLOSSY_REFLECTANCE * (around + sun))


def _contact(normals: Floats) -> Floats:
    """Share (N, 1) of the surrounding light that reaches a sphere, whose foot stands in its own shade."""
    downward = np.maximum(-normals[:, 1:2], 0)
    return np.asarray(1 - _FOOT_SHADE * downward**2)
