"""Folders in the layout of DiLiGenT (Shi et al., CVPR 2016): photos under single distant lights.

`filenames.txt`, one picture a line; `light_directions.txt`, a unit vector each (x right, y up, z to the camera);
`light_intensities.txt`, three numbers each; `mask.png`; `Normal_gt.mat` with the true normals, where known.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.errors import PhotoError
from lighting.stereo.mean_light import Skies
from lighting.stereo.normals.images import read_mask, read_shot

Pixels = NDArray[np.float32]

NAMES, DIRECTIONS, INTENSITIES = "filenames.txt", "light_directions.txt", "light_intensities.txt"

_MAP_HEIGHT = 4  # rows of the dark sky around a single light


@dataclass(frozen=True)
class Lit:
    """Photos under single lights, divided by the lights' intensities."""

    names: tuple[str, ...]
    images: Pixels  # (T, H, W, 3)
    mask: NDArray[np.bool_]  # (H, W)
    skies: Skies  # dark but for the light; the camera frame stands for the world
    truth: Pixels | None  # (H, W, 3), true normals


def is_diligent(folder: Path) -> bool:
    """Whether a folder has this layout."""
    return all((folder / name).is_file() for name in (NAMES, DIRECTIONS, INTENSITIES))


def read_diligent(folder: Path) -> Lit:
    """The photos of a folder; PhotoError where files are missing or do not fit together."""
    names = _names(folder / NAMES)
    directions, intensities = _numbers(folder / DIRECTIONS, len(names)), _numbers(folder / INTENSITIES, len(names))
    if len(names) < 3:
        raise PhotoError(f"{folder / NAMES} lists {len(names)} pictures; normals need at least 3.")
    pictures = [read_shot(folder / name, "linear").pixels for name in names]
    if len({picture.shape for picture in pictures}) > 1:
        raise PhotoError(f"The pictures of {folder} differ in size.")
    images = np.asarray(np.stack(pictures) / intensities[:, None, None, :], dtype=np.float32)
    return Lit(names, images, _mask(folder, images.shape[1:3]), _lights(directions), _truth(folder))


def _names(file: Path) -> tuple[str, ...]:
    try:
        return tuple(file.read_text(encoding="utf-8").split())
    except UnicodeDecodeError as error:
        raise PhotoError(f"{file} is not a text in UTF-8.") from error


def _numbers(file: Path, rows: int) -> NDArray[np.float64]:
    try:
        table = np.loadtxt(file, ndmin=2)
    except ValueError as error:
        raise PhotoError(f"{file} does not hold numbers alone.") from error
    if table.shape != (rows, 3) or not np.isfinite(table).all():
        raise PhotoError(f"{file} must hold three numbers for each of the {rows} pictures.")
    return table


def _lights(directions: NDArray[np.float64]) -> Skies:
    """Lights of which a white patch that faces them has brightness 1."""
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    if (length == 0).any():
        raise PhotoError("A light's direction is zero.")
    dark = np.zeros((len(directions), _MAP_HEIGHT, 2 * _MAP_HEIGHT, 3), dtype=np.float32)
    return Skies(dark, directions / length, np.full((len(directions), 3), np.pi))


def _mask(folder: Path, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    file = folder / "mask.png"
    if not file.exists():
        return np.ones(shape, dtype=bool)
    inside = np.asarray(read_mask(file)) > 127
    if inside.shape != shape:
        raise PhotoError(f"{file} does not have the pictures' size.")
    return np.asarray(inside)


def _truth(folder: Path) -> Pixels | None:
    file = folder / "Normal_gt.mat"
    if not file.exists():
        return None
    from scipy.io import loadmat

    try:
        content: dict[str, Any] = loadmat(file)
    except Exception as error:  # scipy raises nearly anything on hostile bytes
        raise PhotoError(f"{file} is not a MATLAB file that can be read.") from error
    normals = content.get("Normal_gt")
    if normals is None or normals.ndim != 3:
        raise PhotoError(f"{file} holds no Normal_gt (H, W, 3).")
    return np.asarray(normals, dtype=np.float32)
