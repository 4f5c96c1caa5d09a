"""Where the ground that a photo shows lies in sunlight, and where in shade.

The page in the browser looks for it in the same way, but for the step that the light predicts
(`server/web/src/picture/ground.ts`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.colour import SRGB_LINEAR, luminance
from lighting.envmap.render import sky_irradiance, sun_irradiance
from lighting.geometry import Floats, Pinhole, camera_directions
from lighting.records import Lighting

_SIDE = 640  # pixels of the answer's longer side, at most
_GRAIN = 4  # pixels over which brightness is averaged, so that a dark stone is no shade
_BELOW = np.sin(np.radians(1.0))  # sine of the angle below the horizon from which a pixel counts as ground
_LEAST = 0.02  # share of the picture that must show ground
_STOPS = (-7.0, 0.0)  # range of the log2 of luminance
_BINS = 64
_LEAST_STEP = 1.0  # stops between shade and sunlight; a smaller difference is the ground's own
_OF_PREDICTED = 0.6  # share of the predicted step; in photos of examples/ shadows reach 0.78 to 1.1 of it, grass 0.5
_LEAST_PART = 0.03  # share of the ground that the rarer of both takes


def lit_ground(photo: NDArray[np.uint8], lighting: Lighting, *, sun: bool | None = None) -> NDArray[np.float32]:
    """How much of the sun reaches what each pixel of a photo (h, w, 3, sRGB) shows: (H, W), 0 in shade, 1 in sunlight.

    It has the photo's aspect and at most 640 pixels on its longer side. It is 1 above the horizon, where the light has
    no sun (`sun` as in `render`), and everywhere unless the ground falls into two kinds, a dark and a bright one
    (Otsu's threshold on log luminance), at least a stop apart and about as far as shade and sunlight are in this light.
    So ground that is all in shade counts as lit, and what is dark by itself may count as shade.
    """
    small = _reduced(photo)
    lit = np.ones(small.shape[:2], dtype=np.float32)
    shines = lighting.sun_painted if sun is None else sun
    predicted = _predicted_step(lighting) if shines else 0.0
    ground = _below_horizon(small, lighting)
    if predicted < _LEAST_STEP or ground.mean() < _LEAST:
        return lit
    stops = np.log2(np.clip(_smooth(luminance(SRGB_LINEAR[small])), *np.exp2(_STOPS)))[ground]
    kinds = _two_kinds(stops)
    if kinds is not None and kinds.step >= max(_LEAST_STEP, _OF_PREDICTED * predicted):
        lit[ground] = np.clip((stops - kinds.threshold) / (0.5 * kinds.step) + 0.5, 0, 1)
    return lit


@dataclass(frozen=True)
class _Kinds:
    """Dark and bright ground."""

    threshold: float  # stops, halfway between the two means
    step: float  # stops between the means


def _predicted_step(lighting: Lighting) -> float:
    """Stops between level ground in the sun and in shade."""
    sky = float(luminance(sky_irradiance(lighting)))
    direct = float(luminance(sun_irradiance(lighting))) * max(float(lighting.sun_direction[1]), 0.0)
    return float(np.log2(1 + direct / max(sky, 1e-9)))


def _reduced(photo: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = photo.shape[:2]
    scale = min(1.0, _SIDE / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(Image.fromarray(photo).resize(size, Image.Resampling.BOX, reducing_gap=2.0))


def _below_horizon(picture: NDArray[np.uint8], lighting: Lighting) -> NDArray[np.bool_]:
    """Which pixels of a picture (h, w, 3) show ground, if nothing stands on it."""
    height, width = picture.shape[:2]
    tilt = {"elevation": lighting.camera_elevation, "roll": lighting.camera_roll}
    rays = camera_directions(Pinhole(width, height, lighting.vertical_fov, **tilt))
    return np.asarray(rays[..., 1] < -_BELOW)


def _smooth(grey: Floats) -> NDArray[np.float32]:
    """A picture (h, w) without what is finer than _GRAIN."""
    height, width = grey.shape
    few = (max(1, width // _GRAIN), max(1, height // _GRAIN))
    mean = Image.fromarray(grey.astype(np.float32)).resize(few, Image.Resampling.BOX)
    return np.asarray(mean.resize((width, height), Image.Resampling.BILINEAR))


def _two_kinds(stops: Floats) -> _Kinds | None:
    """The two kinds into which values (N,) fall; None if one of them is rare."""
    counts, edges = np.histogram(stops, _BINS, _STOPS)
    middle = (edges[:-1] + edges[1:]) / 2
    below = np.cumsum(counts)[:-1]
    above = len(stops) - below
    sums = np.cumsum(counts * middle)
    dark = sums[:-1] / np.maximum(below, 1)
    bright = (sums[-1] - sums[:-1]) / np.maximum(above, 1)
    best = int(np.argmax(np.where((below > 0) & (above > 0), below * above * (bright - dark) ** 2, 0.0)))
    if min(below[best], above[best]) < _LEAST_PART * len(stops):
        return None
    return _Kinds(float(dark[best] + bright[best]) / 2, float(bright[best] - dark[best]))
