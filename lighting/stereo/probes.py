"""Measured skies: folders of environment maps in the layout of SkyDB, YYYYMMDD/HHMMSS/envmap.exr.

Maps are lat-long in world axes, the centre column true north. The names tell the day and the time by the clock that
the probes were filed with.
"""

import re
from datetime import date
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance
from lighting.errors import EnvironmentMapError
from lighting.files.exr import checked_map, read_exr
from lighting.geometry import Floats, latlong_directions
from lighting.prefilter import shrink
from lighting.stereo.days import ONE_SKY, Day, in_grey
from lighting.stereo.mean_light import Skies, skies_of_maps
from lighting.stereo.skies import HEIGHT

FILE = "envmap.exr"
LONGEST_GAP = 20.0  # min between two probes that photos may be planned in


def probe_days(folder: Path) -> list[date]:
    """The days that a folder has probes of, in order; EnvironmentMapError where it has none."""
    days = [day for path in folder.glob("*/") if (day := _day(path.name)) and files_of(folder, day)]
    if not days:
        raise EnvironmentMapError(f"{folder} holds no sky probes YYYYMMDD/HHMMSS/{FILE}.")
    return sorted(days)


def read_day(folder: Path, day: date) -> Day:
    """The probes of one day; EnvironmentMapError where there are fewer than two or one cannot be read."""
    files = files_of(folder, day)
    if len(files) < 2:
        raise EnvironmentMapError(f"{folder} holds {len(files)} probe of {day}; a plan needs two or more of a day.")
    minutes = np.array(sorted(files))
    skies = in_grey(read_skies([files[minute] for minute in minutes]))
    tolerance = min(float(np.diff(minutes).max()), LONGEST_GAP) / 2
    return Day(day, minutes, tolerance, skies, ONE_SKY)


def read_skies(files: list[Path]) -> Skies:
    """Skies of maps in EXR files, at most HEIGHT rows, the sun taken out of where a map is brightest."""
    parts = [_read(file) for file in files]
    if len({sky.radiance.shape for sky in parts}) > 1:
        raise EnvironmentMapError("The probes differ in size; all must have the same number of rows.")
    return Skies(
        np.concatenate([sky.radiance for sky in parts]),
        np.concatenate([sky.sun_direction for sky in parts]),
        np.concatenate([sky.sun_irradiance for sky in parts]),
    )


def _read(file: Path) -> Skies:
    try:
        image = checked_map(read_exr(file)[0])
    except EnvironmentMapError as error:
        raise EnvironmentMapError(f"{file}: {error}") from error
    if not np.isfinite(image).all():
        raise EnvironmentMapError(f"{file}: The map holds values that are not finite numbers.")
    skies = skies_of_maps(image[None], brightest(image)[None])
    return Skies(shrink(skies.radiance[0], HEIGHT)[None], skies.sun_direction, skies.sun_irradiance)


def brightest(image: NDArray[np.float32]) -> Floats:
    """The direction (3,) of the brightest spot of a map (H, 2H, 3): the mean of its brightest pixels by luminance."""
    light = luminance(image)
    top = light >= 0.5 * light.max()
    mean = (latlong_directions(len(image))[top] * light[top][:, None]).sum(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12))


def files_of(folder: Path, day: date) -> dict[float, Path]:
    """The maps of a day by minutes since midnight."""
    found = folder.joinpath(f"{day:%Y%m%d}").glob(f"*/{FILE}")
    return {minutes: path for path in found if (minutes := _minutes(path.parent.name)) is not None}


def _day(name: str) -> date | None:
    try:
        return date.fromisoformat(name) if re.fullmatch(r"\d{8}", name, re.ASCII) else None
    except ValueError:
        return None


def _minutes(name: str) -> float | None:
    parts = re.fullmatch(r"([01]\d|2[0-3])([0-5]\d)([0-5]\d)", name, re.ASCII)
    return None if not parts else 60.0 * int(parts[1]) + int(parts[2]) + int(parts[3]) / 60
