"""The exposures of one bracket, as files and as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.errors import EnvironmentMapError, ErrorCode, PhotoError, ProbeError
from lighting.files import MAP_FORMATS
from lighting.photo import Curve, LinearPhoto, of_floats, read_linear

_FLOAT_SUFFIXES = tuple(f".{name}" for name, entry in MAP_FORMATS.items() if entry.read)
PICTURES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", *_FLOAT_SUFFIXES)


@dataclass(frozen=True, eq=False)
class Bracket:
    """Two exposures or more of one view, the shortest first."""

    photos: tuple[LinearPhoto, ...]
    names: tuple[str, ...]  # of the files, for messages

    @property
    def warnings(self) -> tuple[str, ...]:
        """Each warning about the files once."""
        return tuple(dict.fromkeys(warning for photo in self.photos for warning in photo.warnings))


def read_bracket(paths: Sequence[str | Path], curve: Curve | None = None) -> Bracket:
    """The exposures in files, in any order.

    Raises ProbeError for fewer than two, one given twice and sizes that differ, PhotoError and OSError for unreadable
    files.
    """
    if len(paths) < 2:
        raise ProbeError(f"A probe needs two exposures or more; there {'is only one' if paths else 'are none'}.")
    files: set[Path] = set()
    for path in paths:
        if (file := Path(path).resolve()) in files:
            raise ProbeError(f"{path} is given twice.", code=ErrorCode.DUPLICATE)
        files.add(file)
    photos = [_read(Path(path), curve) for path in paths]
    return bracket_of(photos, [Path(path).name for path in paths])


def bracket_of(photos: Sequence[LinearPhoto], names: Sequence[str] | None = None) -> Bracket:
    """The exposures in order: by EXIF where all have it, else by how bright they are.

    Raises ProbeError where there is none, and for sizes that differ.
    """
    if not photos:
        raise ProbeError("A bracket needs at least one exposure.")
    sizes = {photo.pixels.shape[:2] for photo in photos}
    if len(sizes) > 1:
        listed = ", ".join(f"{width} x {height}" for height, width in sorted(sizes))
        raise ProbeError(f"The exposures differ in size: {listed} pixels.")
    told = [photo.exposure for photo in photos]
    length = [value for value in told if value is not None]
    if len(length) < len(photos):
        length = [brightness(photo.pixels) for photo in photos]
    order = sorted(range(len(photos)), key=length.__getitem__)
    called = names or [f"exposure {number}" for number in range(1, len(photos) + 1)]
    return Bracket(tuple(photos[i] for i in order), tuple(called[i] for i in order))


def brightness(pixels: NDArray[np.float32]) -> float:
    """Mean of the values, each counted up to full scale."""
    return float(np.minimum(pixels[::4, ::4], 1.0).mean())


def _read(path: Path, curve: Curve | None) -> LinearPhoto:
    if path.suffix.lower() not in _FLOAT_SUFFIXES:
        return read_linear(path, curve)
    if curve == "srgb":
        raise PhotoError(f"{path.name} holds floats, which are linear; --curve srgb is for integers.")
    try:
        return of_floats(_floats(path))
    except (PhotoError, EnvironmentMapError) as error:
        raise PhotoError(f"{path}: {error}") from error


def _floats(path: Path) -> NDArray[np.float32]:
    read = MAP_FORMATS[path.suffix.lower().removeprefix(".")].read
    assert read is not None
    return read(path.read_bytes())
