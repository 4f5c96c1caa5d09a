"""How strongly the sun and the rest of a panorama light its camera: training targets in the panorama's own values.

An HDR panorama with an unclipped sun tells both powers. An 8-bit one tells the sky's as far as it is not clipped. How
much a sun that shines adds to it then follows from a clear sky of the same sun, which is a weaker truth.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from export.crops.sources import Source
from export.data import linear_of
from lighting.envmap import sky_irradiance, sun_irradiance
from lighting.geometry import Floats, direction, latlong_directions, latlong_solid_angle
from lighting.records import Lighting

SUN_REACH = 4.0  # deg around an unclipped sun that belong to it
GLARE = (6.0, 10.0)  # deg around it, whose mean is taken for the sky behind the sun
CLIPPED = 0.98  # linear values of an 8-bit picture from here on may stand for anything brighter
CLIPPED_SHARE = 0.12  # of the sky's cosine-weighted solid angle; with more, the sky's power is unknown
CLEAR_TURBIDITY = 3.0  # of the sky whose sun stands in for a clipped one
SEEN_RATIO = (1.2, 1.55, 2.1)  # median of the unclipped panoramas' ratio over that sky's: trees and walls hide sky
COVERED_SUN = 0.01  # power of a sun that does not shine, as a share of the sky's
COVER = {"yes": 0.0, "partly": 0.4, "no": 0.8}


@dataclass(frozen=True)
class Irradiance:
    """Targets of one panorama; NaN where it does not tell."""

    sun: Floats  # (3,) on a plane that faces the sun
    sky: Floats  # (3,) on a level plane, all that lies above the horizon but the sun
    cover: float  # 0 clear, 1 overcast


def irradiance_of(source: Source) -> Irradiance:
    """The powers of a panorama's sun and sky, as far as it tells them."""
    linear = np.asarray(linear_of(source.panorama, source.levels[-1]), dtype=np.float64)
    sun, sky = _measured(linear, source)
    label, direct = source.label, source.panorama.direct
    if direct == "no":
        sun = COVERED_SUN * sky
    elif direct == "yes" and not np.isfinite(sun).all() and math.isfinite(label.sun_elevation):
        sun = sky * clear_ratio(round(max(label.sun_elevation, 0.0)))
    covered = 1.0 if source.panorama.sun == "none" else COVER.get(direct, math.nan)
    return Irradiance(sun, sky, covered)


@lru_cache(maxsize=128)
def clear_ratio(elevation: int) -> Floats:
    """Power of the sun over that of what lies above the horizon (3,), the sun at an elevation [deg], no cloud."""
    clear = Lighting(0.0, float(elevation), CLEAR_TURBIDITY, 1.0)
    return np.asarray(sun_irradiance(clear) / sky_irradiance(clear)) * SEEN_RATIO


def _measured(linear: Floats, source: Source) -> tuple[Floats, Floats]:
    """Powers (3,) of sun and sky in the picture; NaN where they are clipped."""
    height = len(linear)
    rays = latlong_directions(height)[: height // 2]
    solid = latlong_solid_angle(height)[: height // 2, None]
    above = linear[: height // 2].copy()
    unknown = np.full(3, math.nan)
    sun, label = unknown, source.label
    if source.panorama.kind == "hdr" and source.panorama.sun_is_unclipped:
        apart = np.degrees(np.arccos(np.clip(rays @ direction(label.sun_azimuth, label.sun_elevation), -1, 1)))
        behind = above[(apart > GLARE[0]) & (apart < GLARE[1])].mean(axis=0)
        disc = apart < SUN_REACH
        sun = ((above - behind) * solid[..., None])[disc].sum(axis=0)
        above[disc] = behind
    weight = solid * rays[..., 1]
    clipped = (above.max(axis=-1) > CLIPPED) & (source.panorama.kind == "ldr")
    if (weight * clipped).sum() > CLIPPED_SHARE * weight.sum():
        return sun, unknown
    return np.maximum(sun, 1e-6), np.asarray((above * weight[..., None]).sum(axis=(0, 1)))
