"""Skies for tests, and photos of things under them."""

from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags
from PIL import Image as Picture

from export.data.rendered_panoramas import RenderedPanorama
from lighting.geometry import direction
from lighting.stereo.light_vectors import Skies, illumination_matrices, sun_directions
from lighting.stereo.normal_search import Pose, camera_to_world


def sun_of(scene: RenderedPanorama) -> np.ndarray:
    return np.asarray(direction(scene.sun_azimuth or 0.0, scene.sun_elevation or 0.0))


Image = NDArray[np.float32]

LATITUDE = 47.0
JUNE = np.datetime64("2024-06-21T00:00:00") + np.arange(9, 17) * np.timedelta64(1, "h")


def june_suns() -> NDArray[Any]:
    return sun_directions(JUNE, LATITUDE, 0.0)


def ball(side: int = 48) -> tuple[Image, NDArray[np.bool_], NDArray[Any]]:
    """Normals (H, W, 3), mask and height [pixels] of a ball that nearly fills the picture."""
    radius = 0.48 * side
    y, x = np.mgrid[:side, :side] - (side - 1) / 2
    inside = x * x + y * y < (0.97 * radius) ** 2
    z = np.sqrt(np.maximum(radius**2 - x * x - y * y, 0))
    normals = np.stack([x, -y, z], axis=-1) / radius
    return (normals * inside[..., None]).astype(np.float32), inside, z


def photos(normals: Image, mask: NDArray[np.bool_], skies: Skies, pose: Pose, noise: float = 0.01) -> Image:
    """Images (T, H, W, C) of a white thing, their brightest value 0.8."""
    world = camera_to_world(normals[mask], pose)
    values = np.maximum(np.einsum("ptjc,pj->ptc", illumination_matrices(skies, world), world), 0)
    values *= 0.8 / values.max()
    values += np.random.default_rng(3).normal(0, noise * 0.8, values.shape)
    images = np.zeros((values.shape[1], *mask.shape, values.shape[2]), dtype=np.float32)
    images[:, mask] = np.moveaxis(np.maximum(values, 0), 1, 0)
    return images


def angles(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Angles [deg] between unit vectors."""
    return np.asarray(np.degrees(2 * np.arcsin(np.minimum(np.linalg.norm(a - b, axis=-1) / 2, 1))))


def gray_blocks(seed: int = 0, side: int = 64) -> NDArray[Any]:
    """Blocks of several grays, which have edges whatever the light."""
    return np.asarray(np.kron(np.random.default_rng(seed).uniform(0.1, 0.7, (side // 8, side // 8)), np.ones((8, 8))))


def write_photo(path: Path, picture: NDArray[Any], time: datetime | None, seconds: float = 0.01, **tags: Any) -> None:
    """A JPEG of gray values (H, W) from 0 to 1 with EXIF of its time and exposure."""
    exif = Picture.Exif()
    camera = exif.get_ifd(ExifTags.IFD.Exif)
    if time is not None:
        camera[ExifTags.Base.DateTimeOriginal] = f"{time:%Y:%m:%d %H:%M:%S}"
    camera[ExifTags.Base.ExposureTime] = seconds
    camera[ExifTags.Base.FocalLengthIn35mmFilm] = 50
    for name, value in tags.items():
        camera[ExifTags.Base[name]] = value
    pixels = np.repeat((picture * 255).astype(np.uint8)[..., None], 3, axis=-1)
    Picture.fromarray(pixels).save(path, exif=exif, quality=95)
