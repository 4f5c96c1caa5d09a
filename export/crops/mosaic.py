"""Crops that show two places under the same sun, so that the network learns from the light and not from the place.

The second panorama is turned until the same camera sees its sun where it sees the first one's. On one side of a
straight line through the picture, the crop then shows the second place.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from export.crops.cameras import Camera
from export.crops.crops import Crop
from export.crops.sources import Source
from lighting.geometry import Floats, wrap_azimuth

NEAR = 5.0  # deg, how far apart in elevation the suns of two places in one picture may stand


def companions(sources: Sequence[Source], chances: Floats) -> list[tuple[NDArray[np.intp], Floats]]:
    """For each source, the indices (M,) of sources that may share its picture, and their cumulative chances (M,).

    They are of other places, have about the same sun elevation and the same `direct`; sources without a sun go with
    each other. A source without companions gets itself. `chances` (N,) are those of drawing each source.
    """
    elevation = np.array([s.label.sun_elevation for s in sources])
    direct = np.array([s.label.direct for s in sources])
    place = np.array([s.panorama.place for s in sources])
    found = []
    for own, height in enumerate(elevation):
        near = np.abs(elevation - height) < NEAR if math.isfinite(height) else ~np.isfinite(elevation)
        numbers = np.flatnonzero(near & (direct == direct[own]) & (place != place[own]) & (chances > 0))
        if len(numbers):
            found.append((numbers, np.cumsum(chances[numbers]) / chances[numbers].sum()))
        else:
            found.append((np.array([own]), np.ones(1)))
    return found


def same_view(camera: Camera, source: Source, other: Source, rng: np.random.Generator) -> Camera:
    """The camera that sees the other's sun where `camera` sees the source's, mirrored at random.

    Without a sun it looks in a random direction.
    """
    mirrored = bool(rng.random() < 0.5)
    if not math.isfinite(source.label.sun_azimuth):
        return replace(camera, azimuth=rng.uniform(-180, 180))
    flip = 1.0 if mirrored == camera.mirrored else -1.0
    relative = flip * (source.label.sun_azimuth - camera.azimuth)
    azimuth = float(wrap_azimuth(other.label.sun_azimuth - relative))
    return replace(camera, azimuth=azimuth, roll=flip * camera.roll, mirrored=mirrored)


def joined(one: Crop, other: Crop, rng: np.random.Generator) -> Crop:
    """The first crop with the second one on one side of a straight line.

    The side with the sun's pixel shows the first crop; a sun that only the second crop holds is not shown. Turbidity
    and exposure are unknown. The sun's uncertainty combines those of both with the difference of their elevations.
    """
    height, width = one.linear.shape[:2]
    angle = rng.uniform(-math.pi, math.pi)
    x0, y0 = rng.uniform(0.25, 0.75) * width, rng.uniform(0.25, 0.75) * height

    def side(x: Floats, y: Floats) -> Floats:
        return np.asarray((x - x0) * math.cos(angle) + (y - y0) * math.sin(angle))

    beyond = side(np.arange(width)[None, :] + 0.5, np.arange(height)[:, None] + 0.5) > 0
    sun = one.sun_pixel or other.sun_pixel
    if sun is not None and side(*np.array(sun)) > 0:
        beyond = ~beyond
    apart = one.sun_elevation - other.sun_elevation
    return replace(
        one,
        linear=np.where(beyond[..., None], other.linear, one.linear).astype(np.float32),
        sun_uncertainty=float(np.sqrt((one.sun_uncertainty**2 + other.sun_uncertainty**2 + apart**2) / 2)),
        turbidity=math.nan,
        exposure=math.nan,
    )
