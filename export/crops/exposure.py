"""The exposure that a camera sets by itself."""

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance

WHITE, BRIGHT = 0.7, 80  # linear value that this percentile of the luminance has in a photo
LEAST = 1e-6  # luminance


def automatic_gain(linear: NDArray[np.floating]) -> float:
    """The factor that brings a scene-referred view (H, W, 3) to a photo's exposure, its brighter parts near white."""
    return float(WHITE / max(float(np.percentile(luminance(linear), BRIGHT)), LEAST))
