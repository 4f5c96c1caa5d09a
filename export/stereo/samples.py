"""What the network of normals learns from: crops of surfaces on random days, as planes and true normals."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from export.data.panoramas import DataError
from export.stereo.renders import CaptureDay, Material, cast_shadows, shade_surface, utc_times
from export.stereo.surfaces import (
    Surface,
    TriangleMesh,
    is_held_out,
    project_mesh,
    random_relief,
    random_rotation,
    read_mesh,
    rotate_surface,
)
from lighting.geometry import Floats
from lighting.stereo.normal_network import BY_IMAGE, SHARED, NormalFeatures, normal_features
from lighting.stereo.normal_search import Pose, make_candidates, search_normals, world_to_camera

HELD_OUT_LATITUDES = ((33.0, 37.0), (45.0, 49.0))  # deg; training days are elsewhere
IMAGES = 8

_MIN_SUN_ELEVATION = 5.0  # deg, of the images that training draws
_LATITUDES = (-60.0, 62.0)  # deg


def random_day(rng: np.random.Generator) -> CaptureDay:
    """A training day of 3 to 8 images over some hours, all with the sun well above the horizon.

    Args:
        rng: draws the day.
    """
    while True:
        count = IMAGES if rng.random() < 0.7 else int(rng.integers(3, IMAGES + 1))
        hours = np.linspace(rng.uniform(7.5, 10.5), rng.uniform(13.5, 16.5), count) + rng.normal(0, 0.1, count)
        date = np.datetime64("2024-01-01") + rng.integers(366).astype("timedelta64[D]")
        latitude = rng.uniform(*_LATITUDES)
        while any(low <= abs(latitude) <= high for low, high in HELD_OUT_LATITUDES):
            latitude = rng.uniform(*_LATITUDES)
        sunny = 0.0 if latitude > 0 else 180.0  # the camera that sees the lit side looks to the pole
        heading = sunny + rng.normal(0, 40) if rng.random() < 0.6 else rng.uniform(0, 360)
        pose = Pose(heading, rng.normal(0, 10) if rng.random() < 0.5 else 0.0)
        haze, ground = rng.uniform(2, 7), rng.uniform(0.1, 0.4)
        day = CaptureDay(utc_times(str(date), hours), latitude, turbidity=haze, ground_albedo=ground, pose=pose)
        if np.degrees(np.arcsin(day.suns()[:, 1])).min() > _MIN_SUN_ELEVATION:
            return day


def believed_day(day: CaptureDay, rng: np.random.Generator) -> CaptureDay:
    """What who photographs knows of a day: at times all of it, at times a wrong heading, clock, haze or ground.

    Args:
        day: as it is.
        rng: draws what is wrong.
    """
    if rng.random() < 0.4:
        return day
    heading = day.pose.heading + rng.normal(0, 1.5)
    late = np.round(rng.normal(0, 120)).astype("timedelta64[s]")
    turbidity = float(np.clip(day.turbidity + rng.normal(0, 0.8), 1.5, 9))
    pose = replace(day.pose, heading=heading)
    return replace(day, times=day.times + late, turbidity=turbidity, ground_albedo=0.3, pose=pose)


Image = NDArray[np.float32]
Batch = tuple[Tensor, Tensor, Tensor, Tensor]

CROP = 64  # pixels
_CROPS = 3  # of each surface and day

_SIZES = (160, 320)  # pixels, of the whole picture
_SEARCHED = 1200  # normals that the search tries here
_SKY_HEIGHT = 24  # rows of the skies' maps
_MESH_SHARE = 0.5
_MAX_VIEWS = 240  # of meshes that are kept
_NEW_VIEW_SHARE = 0.25  # share of mesh samples for which one more is made
_MIN_COVERAGE = 0.3  # least share of a crop that the surface covers


@dataclass(frozen=True)
class NormalsSample:
    """One crop; images that it lacks are 0."""

    count: int  # of images
    by_image: NDArray[np.float16]  # (IMAGES, BY_IMAGE - 3, CROP, CROP), without the planes of the suns
    suns: NDArray[np.float32]  # (IMAGES, 3)
    shared: NDArray[np.float16]  # (SHARED, CROP, CROP)
    truth: NDArray[np.float16]  # (3, CROP, CROP), true normals


def read_meshes(folder: Path) -> list[TriangleMesh]:
    """The meshes of a folder that training may see.

    Args:
        folder: of OBJ files.

    Raises:
        DataError: if it holds none.
    """
    files = [file for file in sorted(folder.glob("*.obj")) if not is_held_out(file)]
    if not files:
        raise DataError(f"{folder} holds no OBJ files to learn from.")
    return [read_mesh(file) for file in files]


def generate_samples(meshes: list[TriangleMesh], seed: int) -> Iterator[NormalsSample]:
    """Samples without end; the same seed gives the same ones.

    Args:
        meshes: to learn from beside reliefs; may be empty.
        seed: of all that is random.
    """
    rng = np.random.default_rng(seed)
    views: list[Surface] = []
    while True:
        of_mesh = meshes and rng.random() < _MESH_SHARE
        surface = _view_mesh(meshes, views, rng) if of_mesh else random_relief(_size(rng), rng)
        yield from _crop_samples(surface, random_day(rng), rng)


def _view_mesh(meshes: list[TriangleMesh], views: list[Surface], rng: np.random.Generator) -> Surface:
    """A new view of a mesh or, since they take long to make, mostly an earlier one turned or mirrored."""
    if len(views) < _MAX_VIEWS and (not views or rng.random() < _NEW_VIEW_SHARE):
        views.append(project_mesh(meshes[rng.integers(len(meshes))], random_rotation(rng), _size(rng), rng))
        return views[-1]
    return rotate_surface(views[rng.integers(len(views))], int(rng.integers(4)), mirrored=bool(rng.integers(2)))


def _size(rng: np.random.Generator) -> int:
    return int(rng.integers(*_SIZES))


def _crop_samples(surface: Surface, day: CaptureDay, rng: np.random.Generator) -> Iterator[NormalsSample]:
    skies, believed = day.skies(_SKY_HEIGHT), believed_day(day, rng)
    table = make_candidates(believed.skies(_SKY_HEIGHT), believed.pose, _SEARCHED)
    shadows, glossy, color = rng.random() < 0.6, rng.random() < 0.4, rng.random() < 0.3
    if not color:  # pictures of one channel, the mean of the three
        light, brightness = table.light.mean(axis=-1, keepdims=True), table.brightness.mean(axis=0, keepdims=True)
        table = replace(table, light=light, brightness=brightness)
    suns = world_to_camera(believed.suns(), believed.pose)
    noise = float(np.exp(rng.normal(np.log(0.01), 0.5)))
    for window in _windows(surface, rng):
        mask = surface.mask[window]
        pixels = np.argwhere(mask) + np.array([window[0].start, window[1].start])
        normals = surface.normals[window][mask]
        lit = cast_shadows(surface, pixels, world_to_camera(skies.sun_direction, day.pose)) if shadows else None
        gloss = rng.uniform(0.02, 0.15) if glossy else 0.0
        material = Material(_albedo(surface.mask.shape, rng)[window][mask], gloss, rng.uniform(8, 60))
        images = shade_surface(normals, skies, day.pose, material, lit, quick=True)
        images = images if color else images.mean(axis=2, keepdims=True)
        pixel_std = noise * float(images.max())
        noisy = np.maximum(images + rng.normal(0, pixel_std, images.shape), 0).astype(np.float32)
        planes = normal_features(noisy, mask, suns, search_normals(noisy, table, pixel_std), pixel_std)
        yield _sample(planes, mask, normals, suns)


def _windows(surface: Surface, rng: np.random.Generator) -> Iterator[tuple[slice, slice]]:
    """Places of crops that hold enough of the surface."""
    height, width = surface.mask.shape
    count = 0
    for _ in range(8 * _CROPS):
        top, left = rng.integers(0, [height - CROP + 1, width - CROP + 1])
        window = slice(top, top + CROP), slice(left, left + CROP)
        if surface.mask[window].mean() > _MIN_COVERAGE and count < _CROPS:
            count += 1
            yield window


def _albedo(shape: tuple[int, ...], rng: np.random.Generator) -> Image:
    """Albedos (H, W): one, or patches with soft changes inside them."""
    if rng.random() < 0.6:
        return np.full(shape, rng.uniform(0.3, 0.8), dtype=np.float32)
    y, x = np.mgrid[: shape[0], : shape[1]] / shape[0]
    wave = sum(np.sin(rng.uniform(2, 25) * (x * np.cos(t) + y * np.sin(t)) + rng.uniform(0, 6)) for t in range(4))
    levels = rng.uniform(0.25, 0.9, 4)
    patches = levels[np.digitize(wave, [-1.0, 0.0, 1.0])] if rng.random() < 0.5 else 0.5 + 0.1 * wave
    return np.asarray(np.clip(patches, 0.1, 0.95), dtype=np.float32)


def _sample(planes: NormalFeatures, mask: NDArray[np.bool_], normals: Image, suns: Floats) -> NormalsSample:
    truth = np.zeros((3, *mask.shape), dtype=np.float16)
    truth[:, mask] = normals.T
    count = len(planes.by_image)
    by_image = np.zeros((IMAGES, BY_IMAGE - 3, CROP, CROP), dtype=np.float16)
    by_image[:count] = planes.by_image[:, :-3]
    directions = np.zeros((IMAGES, 3), dtype=np.float32)
    directions[:count] = suns
    return NormalsSample(count, by_image, directions, planes.shared.astype(np.float16), truth)


def batch_samples(chosen: list[NormalsSample], *, mirrored: bool = False) -> Batch:
    """Planes of images (N, T, BY_IMAGE, H, W), which are present (N, T), shared planes and true normals.

    Args:
        chosen: N samples.
        mirrored: left and right change places, in the pictures and in all directions.
    """
    stacked = (np.stack([getattr(s, name) for s in chosen]) for name in ("by_image", "suns", "shared", "truth"))
    by_image, suns, shared, truth = (torch.from_numpy(values).float() for values in stacked)
    present = torch.tensor([[1.0] * s.count + [0.0] * (len(s.suns) - s.count) for s in chosen])
    planes = suns[..., None, None] * shared[:, None, -1:]
    by_image = torch.cat([by_image, planes], dim=2)
    if not mirrored:
        return by_image, present, shared, truth
    by_image, shared, truth = (planes.flip(-1) for planes in (by_image, shared, truth))
    by_image[:, :, 3] *= -1
    signs = torch.ones(SHARED)
    signs[[0, 3, 6]] = -1
    return by_image, present, shared * signs[:, None, None], truth * torch.tensor([-1.0, 1, 1])[:, None, None]
