"""Three spheres, mirror, glossy and diffuse, on the ground under an environment map: a small renderer in numpy.

The camera keeps the photo's heading and, as far as the ground stays in view, its pitch, so that light and shadow fall
as in the photo. The ground has the colour of the map's own ground, so it meets the horizon without a seam.
The sun's disc is taken out of the map and lights everything analytically; what remains lights the diffuse sphere
by its second-order spherical harmonics (Ramamoorthi and Hanrahan 2001) and the glossy one by a blurred copy.
Distances are in sphere radii.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import (
    angle_between,
    camera_axes,
    camera_directions,
    focal_length,
    latlong_directions,
    latlong_solid_angle,
    sample_latlong,
)
from lighting.parameters import Lighting

Floats = NDArray[np.floating[Any]]

MIRROR, GLOSSY, DIFFUSE = range(3)  # from left to right

VERTICAL_FOV = 40.0  # deg
PITCH = (-20.0, -5.0)  # deg, range of the camera's elevation that keeps ground and sky in view
SPACING = 2.6  # between neighbouring centres
CENTRE_HEIGHT = 0.60  # of the middle sphere in the picture, 0 = top, 1 = bottom
PICTURE_WIDTH = 8.6  # at the spheres' distance

SUN_RADIUS = 0.2665  # deg, mean over the year
MIRROR_SUN_RADIUS = 1.0  # deg, wide enough to be seen in the mirror, with the same power
MIRROR_REFLECTANCE = 0.92
GLOSSY_REFLECTANCE = 0.85
DIFFUSE_REFLECTANCE = 0.6
GLOSSINESS = 60.0  # concentration of the glossy lobe, exp(GLOSSINESS (cos - 1))
_LOBE_ROWS = 32  # of the blurred maps
_VEIL = 15.0  # concentration of the lobe through which the ground sees a sphere in the sky's place
_BAND = np.repeat([np.pi, 2 * np.pi / 3, np.pi / 4], [1, 3, 5])  # clamped cosine in spherical harmonics


@dataclass(frozen=True)
class _Light:
    """An environment map taken apart."""

    sky: NDArray[np.float32]  # the map (H, 2H, 3) without the sun's disc
    lobes: NDArray[np.float32]  # the same, blurred by the glossy lobe
    harmonics: Floats  # irradiance (9, 3)
    sun_direction: Floats  # (3,)
    sun_irradiance: Floats  # (3,) on a surface that faces the sun; 0 where the map has no disc
    ground: Floats  # radiance (3,) of open ground
    ground_sky: Floats  # (3,) the part of it that the sky lights
    veil: NDArray[np.float32]  # the map, blurred by the size that a sphere has in the sky
    albedo: Floats  # (3,) of the ground


def render_spheres(
    envmap: NDArray[np.float32], lighting: Lighting, width: int, height: int, supersampling: int = 2
) -> NDArray[np.float32]:
    """Linear picture (supersampling x height, supersampling x width, 3) of the spheres under a map (H, 2H, 3)."""
    light = _take_apart(envmap, lighting.sun_direction)
    pitch = float(np.clip(lighting.camera_elevation, *PITCH))
    columns, rows = width * supersampling, height * supersampling
    rays = camera_directions(columns, rows, VERTICAL_FOV, elevation=pitch).astype(np.float32).reshape(-1, 3)
    picture = _trace(np.zeros(3, np.float32), rays, sphere_centres(width / height, pitch), light)
    return np.asarray(picture.reshape(rows, columns, 3), dtype=np.float32)


def sphere_centres(aspect: float, pitch: float) -> NDArray[np.float32]:
    """The spheres' centres (3, 3) as seen from a camera at the origin whose elevation is `pitch` [deg]."""
    right, up, forward = camera_axes(0.0, pitch, 0.0)
    height = PICTURE_WIDTH / aspect
    middle = forward * focal_length(height, VERTICAL_FOV) + up * (0.5 - CENTRE_HEIGHT) * height
    return np.asarray(middle + np.array([[-SPACING], [0.0], [SPACING]]) * right, dtype=np.float32)


# --- light


def _take_apart(envmap: NDArray[np.float32], sun: Floats) -> _Light:
    sky, sun_irradiance = _without_sun(envmap, sun)
    small = shrink(sky, 2 * _LOBE_ROWS)
    harmonics = irradiance_harmonics(small)
    ground = sky[-len(sky) // 4 :].mean(axis=(0, 1), dtype=np.float64).reshape(3)
    overhead = np.maximum(_irradiance(np.array([0.0, 1.0, 0.0]), harmonics), 1e-9)
    direct = sun_irradiance * max(float(sun[1]), 0.0)
    coarse = shrink(sky, _LOBE_ROWS)
    albedo = np.pi * ground / (overhead + direct)
    return _Light(
        sky,
        _blur(coarse, GLOSSINESS),
        harmonics,
        sun,
        sun_irradiance,
        ground,
        albedo * overhead / np.pi,
        _blur(coarse, _VEIL),
        albedo,
    )


def _without_sun(envmap: NDArray[np.float32], sun: Floats) -> tuple[NDArray[np.float32], Floats]:
    """The map with its disc replaced by the sky around it, and the irradiance (3,) that the disc gave."""
    height = len(envmap)
    row = int((0.5 - np.degrees(np.arcsin(sun[1])) / 180.0) * height)
    reach = SUN_RADIUS + 3 * 180.0 / height
    rows = slice(max(0, row - int(reach / 180 * height) - 2), row + int(reach / 180 * height) + 3)
    above = latlong_directions(height)[rows]
    distance = np.where(above[..., 1] > 0, angle_between(above, sun), 180.0)
    disc, around = distance < reach - 180.0 / height, (distance >= reach - 180.0 / height) & (distance < 2 * reach)
    if not (disc.any() and around.any()):
        return envmap, np.zeros(3)
    sky = envmap.copy()
    background = np.median(sky[rows][around], axis=0)
    weight = np.broadcast_to(latlong_solid_angle(height)[rows, None], distance.shape)[disc]
    power = weight @ np.maximum(sky[rows][disc] - background, 0.0)
    sky[rows][disc] = background
    return sky, np.asarray(power, dtype=np.float64)


def shrink(image: NDArray[np.float32], rows: int) -> NDArray[np.float32]:
    """Box average to at most `rows` rows."""
    factor = max(1, len(image) // rows)
    rows = len(image) // factor
    trimmed = image[: rows * factor, : 2 * rows * factor]
    return np.asarray(trimmed.reshape(rows, factor, 2 * rows, factor, 3).mean(axis=(1, 3)))


def _basis(d: Floats) -> Floats:
    """Real spherical harmonics (..., 9) up to order 2 of unit vectors (..., 3)."""
    x, y, z = np.moveaxis(d, -1, 0)
    terms = [
        np.full_like(x, 0.282095), 0.488603 * y, 0.488603 * z, 0.488603 * x,
        1.092548 * x * y, 1.092548 * y * z, 0.315392 * (3 * z * z - 1), 1.092548 * x * z, 0.546274 * (x * x - y * y),
    ]  # fmt: skip
    return np.stack(terms, axis=-1)


def irradiance_harmonics(image: NDArray[np.float32]) -> Floats:
    """Harmonics (9, 3) of the irradiance under a map."""
    height = len(image)
    weighted = image * latlong_solid_angle(height)[:, None, None]
    radiance = _basis(latlong_directions(height)).reshape(-1, 9).T @ weighted.reshape(-1, 3)
    return np.asarray(radiance * _BAND[:, None])


def _irradiance(normal: Floats, harmonics: Floats) -> Floats:
    return np.maximum(_basis(normal) @ harmonics.astype(normal.dtype), 0.0)


def _blur(image: NDArray[np.float32], concentration: float) -> NDArray[np.float32]:
    """The map seen through a lobe exp(concentration (cos - 1)) around each direction."""
    height = len(image)
    d = latlong_directions(height).reshape(-1, 3).astype(np.float32)
    weight = np.exp(np.float32(concentration) * (d @ d.T - 1)) * np.repeat(latlong_solid_angle(height), 2 * height)
    blurred = weight.astype(np.float32) @ image.reshape(-1, 3) / weight.sum(axis=1, keepdims=True)
    return np.asarray(blurred.reshape(image.shape), dtype=np.float32)


# --- shading


def _trace(origin: Floats, rays: Floats, centres: Floats, light: _Light, leaving: int | None = None) -> Floats:
    """Radiance (N, 3) along rays (N, 3) from `origin` (3,) or (N, 3), on the sphere they are `leaving` if any."""
    radiance = _surroundings(origin, rays, centres, light, SUN_RADIUS if leaving is None else MIRROR_SUN_RADIUS)
    nearest = np.full(len(rays), np.inf, dtype=rays.dtype)
    for kind, centre in enumerate(centres):
        if kind == leaving:
            continue
        distance = _hit(centre - origin, rays)
        seen = np.flatnonzero(distance < nearest)
        nearest[seen] = distance[seen]
        start = np.broadcast_to(origin, rays.shape)[seen]
        point = start + rays[seen] * distance[seen, None]
        radiance[seen] = _shade(kind, point, rays[seen], centres, light, mirrored=leaving is not None)
    return radiance


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _hit(towards: Floats, rays: Floats) -> Floats:
    """Distance (N,) along the rays to a unit sphere whose centre lies `towards` (3,) or (N, 3); inf for a miss."""
    along = _dot(towards, rays) if towards.ndim > 1 else rays @ towards
    inside = along**2 - _dot(towards, towards) + 1
    return np.where((inside > 0) & (along > 0), along - np.sqrt(np.maximum(inside, 0)), np.inf)


def _surroundings(origin: Floats, rays: Floats, centres: Floats, light: _Light, sun_radius: float) -> Floats:
    radiance = np.empty_like(rays)
    down = rays[:, 1] < -1e-4
    radiance[~down] = _sky(rays[~down], light, sun_radius)
    start = np.broadcast_to(origin, rays.shape)[down]
    reach = (centres[0, 1] - 1 - start[:, 1]) / rays[down, 1]
    radiance[down] = _ground(start + rays[down] * reach[:, None], centres, light)
    return radiance


def _sky(rays: Floats, light: _Light, sun_radius: float) -> Floats:
    """The map along rays (N, 3), with a sharp disc that carries the sun's power."""
    radiance = sample_latlong(light.sky, rays).astype(rays.dtype)
    cosine = np.cos(np.radians(sun_radius))
    disc = rays @ light.sun_direction.astype(rays.dtype) > cosine
    radiance[disc] += light.sun_irradiance / (2 * np.pi * (1 - cosine))
    return radiance


def _ground(points: Floats, centres: Floats, light: _Light) -> Floats:
    """Radiance (N, 3) of the ground at points (N, 3): the spheres hide the sun and part of the sky."""
    sky = light.ground_sky.astype(points.dtype)
    direct = light.ground.astype(points.dtype) - sky
    return np.maximum(direct * _sunlit(points, centres, light)[:, None] + sky - _hidden(points, centres, light), 0)


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


def _hidden(points: Floats, centres: Floats, light: _Light) -> Floats:
    """Radiance (N, 3) that ground points (N, 3) lack because the spheres stand before the sky, most before the sun.

    A distant sphere hides the sky right behind it, one overhead the mean of all.
    """
    radiance = np.zeros_like(points)
    albedo, mean = light.albedo.astype(points.dtype), light.ground_sky.astype(points.dtype)
    for centre in centres:
        towards = centre - points
        share = _dot(towards, towards) ** np.float32(-1.5)  # of a cosine-weighted hemisphere; the centre is 1 up
        veil = sample_latlong(light.veil, towards).astype(points.dtype)
        radiance += share[:, None] * (albedo * veil + np.sqrt(share)[:, None] * (mean - albedo * veil))
    return radiance


def _shade(kind: int, points: Floats, rays: Floats, centres: Floats, light: _Light, *, mirrored: bool) -> Floats:
    normals = points - centres[kind]
    if kind == DIFFUSE:
        return _diffuse(points, normals, centres, light)
    reflected = rays - 2 * _dot(rays, normals)[:, None] * normals
    if kind == GLOSSY or mirrored:
        return _glossy(points, normals, reflected, centres, light, kind)
    return MIRROR_REFLECTANCE * _trace(points, reflected, centres, light, leaving=kind)


def _diffuse(points: Floats, normals: Floats, centres: Floats, light: _Light) -> Floats:
    cosine = np.maximum(normals @ light.sun_direction.astype(points.dtype), 0)
    direct = (cosine * _sunlit(points, centres, light, DIFFUSE))[:, None] * light.sun_irradiance.astype(points.dtype)
    return DIFFUSE_REFLECTANCE / np.pi * (direct + _irradiance(normals, light.harmonics) * _contact(normals))


def _glossy(points: Floats, normals: Floats, reflected: Floats, centres: Floats, light: _Light, kind: int) -> Floats:
    cosine = reflected @ light.sun_direction.astype(points.dtype)
    lobe = GLOSSINESS / (2 * np.pi) * np.exp(GLOSSINESS * (cosine - 1)) * _sunlit(points, centres, light, kind)
    sun = lobe[:, None] * light.sun_irradiance.astype(points.dtype)
    return np.asarray(GLOSSY_REFLECTANCE * (sample_latlong(light.lobes, reflected) * _contact(normals) + sun))


def _contact(normals: Floats) -> Floats:
    """Share (N, 1) of the surrounding light that reaches a sphere, whose foot stands in its own shade."""
    downward = np.maximum(-normals[:, 1:2], 0)
    return np.asarray(1 - 0.7 * downward**2)
