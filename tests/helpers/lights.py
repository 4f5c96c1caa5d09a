"""Lights for tests of maps."""

from typing import Any

import numpy as np

from lighting.records import Lighting

SUN_IRRADIANCE, SKY_IRRADIANCE, GROUND_COLOR = (1.9, 1.5, 0.9), (0.4, 0.5, 0.8), (0.12, 0.11, 0.1)

GROUND_ALBEDO = 0.15
SUN_ON_GROUND = np.sin(np.radians(40.0)) * np.array(SUN_IRRADIANCE)  # of stated_light(40.0)
SUNLIT_GROUND = GROUND_ALBEDO / np.pi * (np.array(SKY_IRRADIANCE) + SUN_ON_GROUND)
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
