"""Models of the clear sky beside scans of the real one.

`sky_scans.csv` holds 20 scans of the sky over Cornell University in 81 directions. They are of 27 May (clear) and 24
September 2013, as linear Rec.709 of the CIE 1931 observer. They come from the spectral measurements of the project
spectralskylight (repository sky-measurements-2014, Apache License 2.0). Their authors are Kider, Knowlton, Newlin, Li
and Greenberg (SIGGRAPH Asia 2014). `python -m export.probe.scans` of commit 6df25d7 reduced them.

Azimuths are filed counter-clockwise from 11 degrees (docs/lab/accuracy.md).
"""

import csv
from collections.abc import Callable, Iterable
from datetime import datetime
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from lighting.color import luminance
from lighting.geometry import Floats, angle_between, direction
from lighting.records import GROUND_ALBEDO
from lighting.sky.clear_sky import sky_radiance
from lighting.sky.perez import general_luminance, overcast_luminance
from lighting.solar_position import sun_position

PLACE = (42.443449, -76.481962)  # deg, the roof of Rhodes Hall
SUN_CLEARANCE = 10.0  # deg around the sun left out

Model = Callable[[Floats, Floats], Iterable[Floats]]  # relative luminances that a model can have, by rays and sun

MODELS: dict[str, Model] = {
    "Hosek-Wilkie": lambda rays, sun: (
        luminance(sky_radiance(rays, sun, float(turbidity), GROUND_ALBEDO)) for turbidity in np.arange(1, 10.1, 0.25)
    ),
    "CIE general": lambda rays, sun: (general_luminance(rays, sun, kind) for kind in range(1, 16)),
    "CIE clear": lambda rays, sun: [general_luminance(rays, sun, 12)],
    "CIE overcast": lambda rays, _: [overcast_luminance(rays)],
}


@pytest.fixture(scope="module")
def scans() -> list[tuple[Floats, Floats, Floats]]:
    """Of the clear day, one in five: rays (N, 3), their luminance (N,), and the sun (3,)."""
    with Path(__file__).with_name("sky_scans.csv").open(newline="", encoding="utf-8") as file:
        rows = sorted((row for row in csv.DictReader(file) if row["utc"][:10] == "2013-05-27"), key=lambda r: r["utc"])
    found = []
    for time, scan in [(time, list(scan)) for time, scan in groupby(rows, lambda row: row["utc"])][::5]:
        azimuth, elevation, *color = (
            np.array([float(row[n]) for row in scan]) for n in ("azimuth_as_filed", "elevation", "red", "green", "blue")
        )
        sun = sun_position(datetime.fromisoformat(time), *PLACE)
        found.append((direction(11.0 - azimuth, elevation), luminance(np.stack(color, axis=1)), direction(*sun)))
    return found


def misfit(rays: Floats, measured: Floats, sun: Floats, model: Model) -> float:
    """Root mean square of the logarithm, free of scale, of a model at its best."""
    far = angle_between(rays, sun) > SUN_CLEARANCE
    errors = (np.log(measured[far] / values) for values in model(rays[far], sun))
    return min(float(np.sqrt(np.mean((error - np.median(error)) ** 2))) for error in errors)


def test_the_clear_sky_is_near_the_models_and_far_from_overcast(scans: list[tuple[Floats, Floats, Floats]]) -> None:
    errors = {name: float(np.median([misfit(*scan, model) for scan in scans])) for name, model in MODELS.items()}
    assert 0.08 < errors["Hosek-Wilkie"] < 0.2
    assert errors["CIE general"] <= errors["CIE clear"] < 0.2
    assert errors["CIE overcast"] > 0.5
