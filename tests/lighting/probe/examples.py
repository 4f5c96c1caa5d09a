"""What rendered panoramas say of their suns."""

import numpy as np

from export.data.synthetic import SyntheticPanorama
from lighting.geometry import direction


def sun_of(scene: SyntheticPanorama) -> np.ndarray:
    return np.asarray(direction(scene.sun_azimuth or 0.0, scene.sun_elevation or 0.0))
