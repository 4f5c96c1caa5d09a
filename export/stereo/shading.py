"""Pictures of a surface on a day: skies' light by mean light vectors, the sun's with cast shadows and gloss.

Light that one part of the surface reflects onto another is left out, and the surface does not hide the sky from
itself; the ground below the horizon lights it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from export.stereo.surfaces import Surface
from lighting.geometry import Floats
from lighting.stereo.mean_light import Skies, sky_light, sun_light
from lighting.stereo.normals.frame import Pose, to_camera, to_world, visible_normals

Image = NDArray[np.float32]

_STEP_GROWTH = 1.08  # of the steps of a ray towards the sun, from one pixel on
_BIAS = 0.75  # pixels that a ray must be below a surface to be blocked
_GRID = 600  # normals at which the skies' light is integrated, where it is to be quick


@dataclass(frozen=True)
class Material:
    """What a surface is made of."""

    albedo: Image  # (P,), of its pixels
    gloss: float = 0.0  # reflectance of the lobe of Blinn and Phong beside the diffuse one
    exponent: float = 30.0  # of that lobe


def cast_shadows(surface: Surface, pixels: NDArray[np.intp], suns: Floats) -> NDArray[np.bool_]:
    """Whether each sun reaches each pixel (P, T); `pixels` (P, 2) holds rows and columns, suns (T, 3) camera frame.

    Rays are marched over the heights in steps that grow. What the camera sees is solid half a picture deep.
    """
    height = np.where(surface.mask, surface.height, -np.inf).astype(np.float32)
    reached = np.ones((len(pixels), len(suns)), dtype=bool)
    start = height[pixels[:, 0], pixels[:, 1]]
    facing = surface.normals[pixels[:, 0], pixels[:, 1]] @ suns.T > 0
    for moment, sun in enumerate(suns):
        rows = np.flatnonzero(facing[:, moment])
        blocked = _blocked(height, pixels[rows], start[rows], sun)
        reached[rows[blocked], moment] = False
    return reached


def _blocked(height: Image, pixels: NDArray[np.intp], start: Image, sun: Floats) -> NDArray[np.bool_]:
    """Which of the rays that leave pixels (P, 2) at heights (P,) towards a sun (3,) meet the surface."""
    size = max(height.shape)
    across = max(float(np.hypot(sun[0], sun[1])), 1e-6)
    blocked = np.zeros(len(pixels), dtype=bool)
    distance = 1.5
    while distance < size:
        row = np.round(pixels[:, 0] - sun[1] / across * distance).astype(np.intp)
        column = np.round(pixels[:, 1] + sun[0] / across * distance).astype(np.intp)
        inside = (row >= 0) & (row < height.shape[0]) & (column >= 0) & (column < height.shape[1])
        met = height[np.where(inside, row, 0), np.where(inside, column, 0)]
        above = met - (start + sun[2] / across * distance)
        blocked |= inside & (above > _BIAS) & (above < 0.5 * size)
        distance += max(1.0, (_STEP_GROWTH - 1) * distance)
    return blocked


def shade(
    normals: Image, skies: Skies, pose: Pose, material: Material, lit: NDArray[np.bool_] | None, *, quick: bool = False
) -> Image:
    """Brightnesses (P, T, C) of pixels with normals (P, 3) in the camera frame; `lit` (P, T) is from `cast_shadows`.

    A quick picture takes the skies' light from the nearest of _GRID normals, within half a per cent.
    """
    world = to_world(normals, pose).astype(np.float32)
    by_sky = _quick_sky(skies, normals, pose) if quick else _exact_sky(skies, world)
    sun = np.maximum(np.einsum("ptjc,pj->ptc", sun_light(skies.sun_direction, skies.sun_irradiance, world), world), 0)
    diffuse = material.albedo[:, None, None] * by_sky
    direct = material.albedo[:, None, None] * sun + _gloss(normals, skies, pose, material)
    return np.asarray(diffuse + (direct if lit is None else direct * lit[..., None]), dtype=np.float32)


def _exact_sky(skies: Skies, world: Image) -> Floats:
    return np.asarray(np.einsum("ptjc,pj->ptc", sky_light(skies.radiance, world), world))


def _quick_sky(skies: Skies, normals: Image, pose: Pose) -> Floats:
    grid = visible_normals(_GRID)
    light = sky_light(skies.radiance, to_world(grid, pose))
    nearest = (normals @ grid.T).argmax(axis=1)
    return np.asarray(np.einsum("ptjc,pj->ptc", light[nearest], to_world(normals, pose)))


def _gloss(normals: Image, skies: Skies, pose: Pose, material: Material) -> Floats:
    """The sun's reflection (P, T, C) towards the camera."""
    if not material.gloss:
        return np.zeros((1, 1, 1))
    suns = to_camera(skies.sun_direction, pose)
    half = suns + np.array([0.0, 0.0, 1.0])
    half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-6)
    lobe = np.maximum(normals @ half.T, 0) ** material.exponent * np.maximum(normals @ suns.T, 0)
    scale = material.gloss * (material.exponent + 8) / (8 * np.pi)
    return np.asarray(scale * lobe[..., None] * skies.sun_irradiance)
