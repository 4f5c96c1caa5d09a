"""Shaded pictures of surfaces on a day: skies by mean light vectors, the sun with cast shadows and gloss.

Light that one part of the surface reflects onto another is left out, and the surface does not hide the sky from
itself; the ground below the horizon lights it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.stereo.surfaces import Surface, is_held_out, project_mesh, random_rotation, read_mesh
from lighting.geometry import Floats
from lighting.stereo.light_vectors import (
    CLEAR_TURBIDITY,
    Skies,
    clear_skies,
    sky_light_vectors,
    sun_directions,
    sun_light_vectors,
)
from lighting.stereo.normal_search import Pose, camera_to_world, sample_visible_normals, world_to_camera

FloatImage = NDArray[np.float32]

_STEP_GROWTH = 1.08  # of the steps of a ray towards the sun, from one pixel on
_BIAS = 0.75  # pixels that a ray must be below a surface to be blocked
_GRID = 600  # normals at which the skies' light is integrated, where it is to be quick


Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class CaptureDay:
    """When, where and under what a thing is photographed."""

    times: NDArray[np.datetime64]  # (T,), UTC
    latitude: float  # deg
    longitude: float = 0.0  # deg
    turbidity: float = CLEAR_TURBIDITY
    ground_albedo: float = 0.3
    pose: Pose = field(default_factory=Pose)

    def suns(self) -> Floats:
        """Unit vectors (T, 3) to the sun in world axes."""
        return sun_directions(self.times, self.latitude, self.longitude)

    def skies(self, height: int = 64) -> Skies:
        """Its clear skies."""
        return clear_skies(self.suns(), self.turbidity, self.ground_albedo, height)


def utc_times(date: str, hours: Floats) -> NDArray[np.datetime64]:
    """UTC times (T,) of a date.

    Args:
        date: such as 2024-03-21.
        hours: (T,) h of that day, 0 to 24.
    """
    seconds = np.round(np.asarray(hours, dtype=np.float64) * 3600).astype("timedelta64[s]")
    return np.datetime64(date, "s") + seconds


@dataclass(frozen=True)
class Material:
    """What a surface is made of."""

    albedo: FloatImage  # (P,), of its pixels
    gloss: float = 0.0  # reflectance of the lobe of Blinn and Phong beside the diffuse one
    exponent: float = 30.0  # of that lobe


def cast_shadows(surface: Surface, pixels: NDArray[np.intp], suns: Floats) -> Bools:
    """Whether each sun reaches each pixel (P, T).

    Rays are marched over the heights in steps that grow. What the camera sees is solid half a picture deep.

    Args:
        surface: the shape.
        pixels: (P, 2) rows and columns.
        suns: (T, 3) unit vectors in the camera frame.
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


def _blocked(height: FloatImage, pixels: NDArray[np.intp], start: FloatImage, sun: Floats) -> Bools:
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


def shade_surface(
    normals: FloatImage, skies: Skies, pose: Pose, material: Material, lit: Bools | None, *, quick: bool = False
) -> FloatImage:
    """Brightnesses (P, T, C) of pixels.

    Args:
        normals: (P, 3) unit vectors in the camera frame.
        skies: T skies of C channels.
        pose: of the camera.
        material: of the pixels.
        lit: (P, T) of `cast_shadows`; None where the sun reaches all.
        quick: take the skies' light from the nearest of _GRID normals, within half a per cent.
    """
    world = camera_to_world(normals, pose).astype(np.float32)
    if quick:
        grid = sample_visible_normals(_GRID)
        light = sky_light_vectors(skies.radiance, camera_to_world(grid, pose))[(normals @ grid.T).argmax(axis=1)]
        by_sky = np.einsum("ptjc,pj->ptc", light, camera_to_world(normals, pose))
    else:
        by_sky = np.einsum("ptjc,pj->ptc", sky_light_vectors(skies.radiance, world), world)
    vectors = sun_light_vectors(skies.sun_direction, skies.sun_irradiance, world)
    sun = np.maximum(np.einsum("ptjc,pj->ptc", vectors, world), 0)
    diffuse = material.albedo[:, None, None] * by_sky
    direct = material.albedo[:, None, None] * sun + _gloss(normals, skies, pose, material)
    return np.asarray(diffuse + (direct if lit is None else direct * lit[..., None]), dtype=np.float32)


def _gloss(normals: FloatImage, skies: Skies, pose: Pose, material: Material) -> Floats:
    """The sun's reflection (P, T, C) towards the camera."""
    if not material.gloss:
        return np.zeros((1, 1, 1))
    suns = world_to_camera(skies.sun_direction, pose)
    half = suns + np.array([0.0, 0.0, 1.0])
    half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-6)
    lobe = np.maximum(normals @ half.T, 0) ** material.exponent * np.maximum(normals @ suns.T, 0)
    scale = material.gloss * (material.exponent + 8) / (8 * np.pi)
    return np.asarray(scale * lobe[..., None] * skies.sun_irradiance)


# Shapes to photograph: scanned objects and meshes, which lie beside the project and never in it.

_SCANNED_OBJECTS = ("bear", "buddha", "cat", "cow", "goblet", "harvest", "pot1", "pot2", "reading")

_MARGIN = 8  # pixels around an object
_VIEW_SIDE = 224  # pixels each way of a mesh's view


@dataclass(frozen=True)
class Subject:
    """A shape to photograph."""

    name: str
    group: str  # "scanned objects" or "held-out meshes"
    surface: Surface
    scale: float = 0.0  # mm in a pixel; 0 is unknown


def read_subjects(data: Path, step: int = 1) -> Iterator[Subject]:
    """The shapes of a folder with `scanned_objects` and `meshes`; none where it lacks both.

    Args:
        data: the folder.
        step: every so many pixels of each, both ways.
    """
    for name in _SCANNED_OBJECTS:
        if (data / "scanned_objects" / name).is_dir():
            yield _thinned(_scanned(data / "scanned_objects" / name), step)
    for file in sorted((data / "meshes").glob("*.obj")):
        if is_held_out(file):
            rng, mesh = np.random.default_rng(0), read_mesh(file)  # two views of it, the same every time
            for number in (1, 2):
                view = project_mesh(mesh, random_rotation(rng), _VIEW_SIDE, rng)
                yield _thinned(Subject(f"{file.stem} {number}", "held-out meshes", view), step)


def _scanned(folder: Path) -> Subject:
    coded = np.asarray(Image.open(folder / "normal_map.png"), dtype=np.float32)
    mask = np.asarray(Image.open(folder / "mask.png").convert("L")) > 127
    depth = np.load(folder / "depth_gt.npz")["depth_gt"]
    mask &= np.isfinite(depth)
    normals = np.asarray(coded / 127.5 - 1)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    scale = float(np.median(depth[mask]) / np.loadtxt(folder / "K.txt")[0, 0])
    height = np.where(mask, -depth / scale, np.nan).astype(np.float32)
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    window = tuple(slice(max(0, inside[0] - _MARGIN), inside[-1] + 1 + _MARGIN) for inside in (rows, columns))
    inside = Surface(np.asarray(normals * mask[..., None], dtype=np.float32)[window], height[window], mask[window])
    return Subject(folder.name, "scanned objects", inside, scale)


def _thinned(subject: Subject, step: int) -> Subject:
    """Every `step`th pixel each way; heights stay in pixels."""
    if step == 1:
        return subject
    part, surface = np.s_[::step, ::step], subject.surface
    height = np.asarray(surface.height[part] / step, dtype=np.float32)
    smaller = Surface(surface.normals[part], height, surface.mask[part])
    return replace(subject, surface=smaller, scale=subject.scale * step)
