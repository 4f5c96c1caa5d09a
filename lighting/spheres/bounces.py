"""The light exchanged between spheres and ground under an environment map.

What a sphere hides from the ground and reflects to it, and what the diffuse sphere receives, are integrals over rays,
kept in small tables by direction.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import (
    Floats,
    angles,
    direction,
    latlong_directions,
    latlong_solid_angle,
    ray_sphere,
    sample_latlong,
)
from lighting.prefilter import blur, irradiance, shrink, without_sun
from lighting.spheres.shading import DIFFUSE, GLOSSINESS, Stage, shade, trace

_LOBE_ROWS = 32  # of the blurred map
_EXCHANGE_ROWS = 24  # of `Stage.exchange`, by the direction to a sphere
_RINGS, _SPOKES = 8, 20  # of rays from a point on the ground to a sphere
_BALL_ROWS = 12  # of `Stage.ball`, by the normal
_AROUND_ROWS = 16  # of the directions from which light comes to the diffuse sphere
_BOUNCES = 3  # of light between spheres and ground
_BOUNCES_MORE = 2  # where that light is nearly right already


def lit_stage(envmap: NDArray[np.float32], sun: Floats, centres: Floats) -> Stage:
    """The spheres at `centres` (3, 3) under a map (H, 2H, 3) whose sun stands in the direction `sun` (3,)."""
    sky, sun_irradiance = without_sun(envmap, sun)
    coarse = shrink(sky, _LOBE_ROWS)
    ground = sky[-len(sky) // 4 :].mean(axis=(0, 1), dtype=np.float64).reshape(3)
    overhead = np.maximum(irradiance(coarse, np.array([0.0, 1.0, 0.0])), 1e-9)
    direct = sun_irradiance * max(float(sun[1]), 0.0)
    albedo = np.pi * ground / (overhead + direct)
    ball = irradiance(_with_ground_times(coarse, 0.0), latlong_directions(_BALL_ROWS))
    lobes = blur(coarse, GLOSSINESS)
    none = tuple(np.zeros((2, 4, 3)) for _ in centres)
    stage = Stage(
        centres, sky, coarse, lobes, sun, sun_irradiance, ground, albedo * overhead / np.pi, albedo, ball, none
    )
    return _bounced(stage, _BOUNCES)


def in_shade(stage: Stage, lit: float) -> Stage:
    """The same where the sun reaches a share `lit` of the spheres and of the ground around them."""
    ground = stage.ground_sky + lit * (stage.ground - stage.ground_sky)
    coarse = _with_ground_times(stage.coarse, ground / np.maximum(stage.ground, 1e-9))
    return _bounced(
        replace(
            stage,
            coarse=coarse,
            lobes=blur(coarse, GLOSSINESS),
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


def _bounced(stage: Stage, times: int) -> Stage:
    """The stage with the light that its spheres and its ground send to each other, so many times."""
    for _ in range(times):
        stage = replace(stage, exchange=tuple(_exchange(kind, stage) for kind in range(len(stage.centres))))
        stage = replace(stage, ball=_around_ball(stage))
    return stage


def _exchange(kind: int, stage: Stage) -> Floats:
    """Mean radiance (H, 2H, 3) that the ground receives from a sphere minus that of the sky behind it, by direction.

    A ground point sees the centre in that direction. The sphere then fills a cone that touches the horizon; the mean
    over it is weighted with the ground's cosine. Where another sphere stands before this one, it is left out.
    """
    towards = latlong_directions(_EXCHANGE_ROWS)[: _EXCHANGE_ROWS // 2].reshape(-1, 3)
    rays, weight = _cones(towards)
    shape, rays = rays.shape, rays.reshape(-1, 3)
    points = np.repeat(stage.centres[kind] - towards / towards[:, 1:2], shape[1], axis=0)
    distance = ray_sphere(points, rays, stage.centres[kind])
    first = np.all([distance <= ray_sphere(points, rays, centre) for centre in stage.centres], axis=0)
    radiance = shade(kind, points + rays * distance[:, None], rays, stage, mirrored=True)
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


def _around_ball(stage: Stage) -> Floats:
    """Irradiance (H, 2H, 3) of the diffuse sphere by sky, ground and the other spheres, by its normals."""
    soft = replace(stage, sky=shrink(stage.sky, _AROUND_ROWS))
    rays = latlong_directions(_AROUND_ROWS).reshape(-1, 3)
    normals = latlong_directions(_BALL_ROWS).reshape(-1, 3)
    weight = np.maximum(normals @ rays.T, 0) * np.repeat(latlong_solid_angle(_AROUND_ROWS), 2 * _AROUND_ROWS)
    normal, ray = np.nonzero(weight)
    radiance = np.zeros((*weight.shape, 3))
    radiance[normal, ray] = trace(stage.centres[DIFFUSE] + normals[normal], rays[ray], soft, DIFFUSE, disc=None)
    total = np.einsum("nr,nrc->nc", weight, radiance) * np.pi / weight.sum(axis=1, keepdims=True)
    return np.asarray(total.reshape(_BALL_ROWS, -1, 3))
