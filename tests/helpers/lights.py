"""Lights for tests of maps."""

from itertools import product
from typing import Any

import numpy as np

from lighting.records import Lighting

SUN_IRRADIANCE, SKY_IRRADIANCE, GROUND_COLOR = (1.9, 1.5, 0.9), (0.4, 0.5, 0.8), (0.12, 0.11, 0.1)

GROUND_ALBEDO = 0.15
SUN_ON_GROUND = np.sin(np.radians(40.0)) * np.array(SUN_IRRADIANCE)  # of stated_light(40.0)
SUNLIT_GROUND = GROUND_ALBEDO / np.pi * (np.array(SKY_IRRADIANCE) + SUN_ON_GROUND)
NORMALS = np.array([n for n in product((-1, 0, 1), repeat=3) if np.abs(n).sum() in (1, 3)])
UNIT_NORMALS = NORMALS / np.linalg.norm(NORMALS, axis=-1, keepdims=True)  # (14, 3), of a cube's faces and corners
SHADED_GROUND = GROUND_ALBEDO / np.pi * np.array(SKY_IRRADIANCE)


def model_light(azimuth: float = -41.2, elevation: float = 33.0, **fields: float) -> Lighting:
    """A light whose irradiances follow from the sky model."""
    values: dict[str, Any] = {"turbidity": 2.6, "exposure": 1.0, **fields}
    return Lighting(sun_azimuth=azimuth, sun_elevation=elevation, **values)


def stated_light(elevation: float = 33.0, **fields: Any) -> Lighting:
    """A light with irradiances of its own."""
    stated = {"sun_irradiance": SUN_IRRADIANCE, "sky_irradiance": SKY_IRRADIANCE, "ground_color": GROUND_COLOR}
    values: dict[str, Any] = {**stated, **fields}
    return Lighting(-41.2, elevation, 2.6, 5.0, **values)


def without_probe(record: dict[str, Any]) -> dict[str, Any]:
    """A JSON record, which must have a light probe, without it."""
    assert len(record["light_probe"]["coefficients"]) == 9
    return {name: value for name, value in record.items() if name != "light_probe"}
