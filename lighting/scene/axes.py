"""Conversions to the frames and lamps of other tools; numpy alone is needed."""

import numpy as np

from lighting.geometry import Floats


def to_z_up(vector: Floats) -> Floats:
    """Vectors (..., 3) of our frame where +Z is up and the camera looks along +Y."""
    x, y, z = np.moveaxis(np.asarray(vector), -1, 0)
    return np.stack([x, -z, y], axis=-1)


def colour_and_strength(irradiance: Floats) -> tuple[Floats, float]:
    """An irradiance (3,) as a colour (3,) whose largest channel is 1, and its strength; white and 0 for no light."""
    strength = float(irradiance.max())
    return (irradiance / strength if strength > 0 else np.ones(3)), strength
