"""The sun in a measured sky: where it is, whether it is clipped, and the light it gives."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance
from lighting.geometry import Floats, angle_between, angles, direction, latlong_directions
from lighting.probe.regions import Mask, connected, solid_angle

LEAST_CONTRAST = 200.0  # the sun's pixel / the median above the horizon; sunlit clouds stay under 50
LARGEST_CLIPPED = 12.0  # deg, radius of a clipped region that can still be called the sun
MARGIN = 1.5  # pixels of the map around the bright region whose light counts as the sun's


@dataclass(frozen=True, eq=False)
class SunSpot:
    """The sun as a map shows it."""

    azimuth: float  # deg, 0 = centre column, positive to the right
    elevation: float  # deg
    radius: float  # deg, of a cap as large as the bright region
    clipped: bool  # brighter than the shortest exposure could measure
    irradiance: Floats  # (3,), on a surface that faces it, above the sky beside it; the least that it can be if clipped

    @property
    def direction(self) -> Floats:
        return direction(self.azimuth, self.elevation)


def find_spot(image: NDArray[np.float32], clipped: Mask) -> SunSpot | None:
    """The sun in a map (H, 2H, 3) whose clipped pixels (H, 2H) are marked; None where none is above the horizon."""
    towards = latlong_directions(len(image))
    value = np.where(towards[..., 1] > 0, luminance(image), 0.0)
    region = _bright_region(value, clipped & (towards[..., 1] > 0))
    if region is None:
        return None
    area = solid_angle(len(image))
    size = float(area[region].sum())
    radius = float(np.degrees(np.arccos(1 - size / (2 * np.pi))))
    centre = (area * value)[region] @ towards[region]
    from_centre = angle_between(towards, centre)
    reach = radius + MARGIN * 180.0 / len(image)
    background = _background(image, from_centre, reach)
    near = from_centre < reach
    light = np.maximum(image[near] - background, 0) * area[near][:, None]
    azimuth, elevation = angles(luminance(light) @ towards[near])
    return SunSpot(float(azimuth), float(elevation), radius, bool(clipped[region].any()), light.sum(axis=0))


def _bright_region(value: Floats, clipped: Mask) -> Mask | None:
    """The largest of the clipped regions, or what is brighter than a tenth of the peak around the peak."""
    area = solid_angle(len(value))
    if clipped.any():
        regions = connected(clipped)
        light = np.bincount(regions.ravel(), (area * value).ravel())
        best = regions == int(np.argmax(light[1:])) + 1
        cap = 2 * np.pi * (1 - np.cos(np.radians(LARGEST_CLIPPED)))
        return best if area[best].sum() < cap else None
    peak = float(value.max())
    if peak <= LEAST_CONTRAST * float(np.median(value[value > 0])):
        return None
    regions = connected(value > 0.1 * peak)
    return np.asarray(regions == regions[np.unravel_index(int(value.argmax()), value.shape)])


def _background(image: NDArray[np.float32], from_centre: Floats, reach: float) -> Floats:
    """Median colour (3,) of the sky right beside the sun, which is much brighter than that a few degrees away."""
    ring = (from_centre > reach) & (from_centre < reach + MARGIN * 180.0 / len(image))
    return np.median(image[ring], axis=0) if ring.any() else np.zeros(3)
