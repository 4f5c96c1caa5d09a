"""The days of measured skies: folders of environment maps in the layout of SkyDB, see `lighting.probe.probes_in`."""

from collections.abc import Mapping
from datetime import date, timedelta, timezone
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance
from lighting.errors import EnvironmentMapError, ErrorCode, ParameterError
from lighting.files import read_map
from lighting.geometry import Floats, latlong_directions
from lighting.prefilter import shrink
from lighting.probe import probes_in
from lighting.stereo.days import ONE_SKY, Day, in_grey
from lighting.stereo.mean_light import Skies, skies_of_maps
from lighting.stereo.skies import HEIGHT

LONGEST_GAP = 20.0  # min between two probes that photos may be planned in


def probe_days(folder: Path, utc_offset: float = 0.0) -> dict[date, dict[float, Path]]:
    """The maps of each day by minutes since midnight, both by a clock at `utc_offset` hours from UTC.

    Folders without a time in their maps are named by that clock. Raises ProbeError where there is no probe.
    """
    zone = timezone(timedelta(hours=utc_offset))
    days: dict[date, dict[float, Path]] = {}
    for probe in probes_in(folder, zone):
        local = probe.time.astimezone(zone)
        days.setdefault(local.date(), {})[60.0 * local.hour + local.minute + local.second / 60] = probe.path
    return days


def files_of(folder: Path, day: date, utc_offset: float = 0.0) -> dict[float, Path]:
    """The maps of one day, see `probe_days`; none where the folder has none of that day."""
    return probe_days(folder, utc_offset).get(day, {})


def read_day(day: date, files: Mapping[float, Path]) -> Day:
    """The probes of one day by minutes since midnight; ParameterError where there are fewer than two of it."""
    if len(files) < 2:
        raise ParameterError(
            f"There is one probe of {day}; a plan needs two or more of a day.", code=ErrorCode.INSUFFICIENT
        )
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
    image = read_map(file)
    skies = skies_of_maps(image[None], brightest(image)[None])
    return Skies(shrink(skies.radiance[0], HEIGHT)[None], skies.sun_direction, skies.sun_irradiance)


def brightest(image: NDArray[np.float32]) -> Floats:
    """The direction (3,) of the brightest spot of a map (H, 2H, 3): the mean of its brightest pixels by luminance."""
    light = luminance(image)
    top = light >= 0.5 * light.max()
    mean = (latlong_directions(len(image))[top] * light[top][:, None]).sum(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12))
