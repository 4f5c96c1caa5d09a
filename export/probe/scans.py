"""Scans of the real sky over a roof at Cornell University: how a scanner's azimuth counts, and which model fits.

`sky_scans.csv` beside this file holds 20 scans in 81 directions of 27 May (clear) and 24 September 2013, as linear
Rec.709 of the CIE 1931 observer. They come from the spectral measurements of the project spectralskylight (repository
sky-measurements-2014, Apache License 2.0; Kider, Knowlton, Newlin, Li and Greenberg, SIGGRAPH Asia 2014), reduced by

python -m export.probe.scans RADIANCES.csv
"""

import csv
import sys
from collections.abc import Callable, Iterable
from datetime import datetime
from pathlib import Path

import numpy as np

from lighting.colour import luminance
from lighting.evidence import sun_position
from lighting.files import replacing
from lighting.geometry import Floats, angle_between, direction
from lighting.probe.orientation import SUN_CLEARANCE, Orientation, Scan, log_errors, orient
from lighting.records import GROUND_ALBEDO
from lighting.sky.cie import general_luminance, overcast_luminance
from lighting.sky.hosek_wilkie import sky_radiance
from lighting.sky.perez import perez_luminance

Model = Callable[[Floats, Floats], Iterable[Floats]]

SCANS = Path(__file__).with_name("sky_scans.csv")
PLACE = (42.443449, -76.481962)  # deg, the roof of Rhodes Hall
FORMER = {"2013-05-27": 13.0}  # deg, about, the offset that a former fit to that day found
COLUMNS = ("utc", "azimuth_as_filed", "elevation", "red", "green", "blue")

WAVELENGTHS = range(380, 781, 20)  # nm
# The CIE 1931 observer at these wavelengths.
_X = (0.0014, 0.0143, 0.1344, 0.3483, 0.2908, 0.0956, 0.0049, 0.0633, 0.2904, 0.5945, 0.9163, 1.0622, 0.8544, 0.4479,
      0.1649, 0.0468, 0.0114, 0.0029, 0.0007, 0.0002, 0.0)  # fmt: skip
_Y = (0.0, 0.0004, 0.0040, 0.0230, 0.0600, 0.1390, 0.3230, 0.7100, 0.9540, 0.9950, 0.8700, 0.6310, 0.3810, 0.1750,
      0.0610, 0.0170, 0.0041, 0.0010, 0.0002, 0.0001, 0.0)  # fmt: skip
_Z = (0.0065, 0.0679, 0.6456, 1.7471, 1.6692, 0.8130, 0.2720, 0.0782, 0.0203, 0.0039, 0.0017, 0.0008, 0.0002, 0.0,
      0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # fmt: skip
_REC709 = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def read_scans(path: Path = SCANS) -> dict[str, list[Scan]]:
    """The scans of each day, by date."""
    rows: dict[str, list[dict[str, str]]] = {}
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            rows.setdefault(row["utc"], []).append(row)
    days: dict[str, list[Scan]] = {}
    for time in sorted(rows):
        days.setdefault(time[:10], []).append(_scan(time, rows[time]))
    return days


def _scan(time: str, rows: list[dict[str, str]]) -> Scan:
    colour = np.array([[float(row[name]) for name in COLUMNS[3:]] for row in rows])
    azimuth, elevation = (np.array([float(row[name]) for row in rows]) for name in COLUMNS[1:3])
    sun = sun_position(datetime.fromisoformat(time), *PLACE)
    return Scan(azimuth, elevation, luminance(colour), (float(sun[0]), float(sun[1])))


MODELS: dict[str, Model] = {
    "Hosek-Wilkie, turbidity fitted": lambda towards, sun: (
        luminance(sky_radiance(towards, sun, float(turbidity), GROUND_ALBEDO)) for turbidity in np.arange(1, 10.1, 0.25)
    ),
    "Perez, clearness and brightness fitted": lambda towards, sun: (
        perez_luminance(towards, sun, clearness, brightness)
        for clearness in (1.03, 1.15, 1.35, 1.7, 2.3, 3.5, 5.3, 8.0)
        for brightness in np.arange(0.05, 0.5, 0.05)
    ),
    "CIE general sky, type fitted": lambda towards, sun: (general_luminance(towards, sun, k) for k in range(1, 16)),
    "CIE clear sky (type 12)": lambda towards, sun: [general_luminance(towards, sun, 12)],
    "CIE overcast sky": lambda towards, _: [overcast_luminance(towards)],
}


def residuals(scans: list[Scan], sense: int, offset: float, model: Model) -> Floats:
    """Relative error (S,) of a model at its best in each scan: root mean square of the logarithm, free of scale."""
    result = []
    for scan in scans:
        towards, sun = scan.directions(sense, offset), direction(*scan.sun)
        far = angle_between(towards, sun) > SUN_CLEARANCE
        result.append(min(_rms(log_errors(scan.luminance[far], values)) for values in model(towards[far], sun)))
    return np.array(result)


def _rms(error: Floats) -> float:
    return float(np.sqrt(np.mean(error**2)))


def report(path: Path = SCANS) -> str:
    """What the scans say, as tables in Markdown."""
    parts = []
    for day, scans in read_scans(path).items():
        found = orient(scans)
        parts.append(
            f"### {day}, {len(scans)} scans\n\nazimuths run {'clockwise' if found.sense > 0 else 'counter-clockwise'} "
            f"from {found.offset:.1f}° (error {found.error:.3f}, the other sense {found.other:.3f}); each scan alone "
            f"says {found.offsets.min():.0f} to {found.offsets.max():.0f}°, {found.offsets.mean():.1f} ± "
            f"{found.offsets.std():.1f}, along the sky at most {along(scans, found, found.offset):.1f}° from it"
            f"{_from_former(day, scans, found)}\n\n"
            "| model | median error | least | largest |\n|---|---:|---:|---:|"
        )
        for name, model in MODELS.items():
            error = 100 * residuals(scans, found.sense, found.offset, model)
            parts.append(f"| {name} | {np.median(error):.0f} % | {error.min():.0f} % | {error.max():.0f} % |")
        parts.append("")
    return "\n".join(parts)


def along(scans: list[Scan], found: Orientation, offset: float) -> float:
    """How far [deg] along the sky, at the sun's height, a single scan's azimuths are at most from those by `offset`."""
    height = np.radians([scan.sun[1] for scan in scans])
    return float(np.max(np.abs(found.offsets - offset) * np.cos(height)))


def _from_former(day: str, scans: list[Scan], found: Orientation) -> str:
    return f", {along(scans, found, FORMER[day]):.1f}° from {FORMER[day]:.0f}°" if day in FORMER else ""


def reduce(source: Path, target: Path = SCANS) -> None:
    """Write `sky_scans.csv` from spectral radiances, columns radiance_380 to radiance_780."""
    observer = _REC709 @ np.array([_X, _Y, _Z])
    with source.open(newline="", encoding="utf-8") as file:
        rows = [[*(row[name] for name in COLUMNS[:3]), *_colour(row, observer)] for row in csv.DictReader(file)]
    with replacing(target) as temporary, temporary.open("w", newline="", encoding="utf-8") as output:
        csv.writer(output).writerows([COLUMNS, *rows])


def _colour(row: dict[str, str], observer: Floats) -> list[str]:
    radiance = np.array([float(row[f"radiance_{wavelength}"]) for wavelength in WAVELENGTHS])
    return [f"{value:.5g}" for value in observer @ radiance]


if __name__ == "__main__":
    reduce(Path(sys.argv[1]))
