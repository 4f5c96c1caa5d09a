"""How a panorama gets its label: the sun that is given or found, and the sky fitted around it."""

import math

from export.data.labels import Label
from export.data.panoramas import Panorama
from export.data.pictures import read_linear
from lighting.geometry import direction
from lighting.probe.regions import HEIGHT
from lighting.probe.sky_fit import fit_sky
from lighting.probe.sun_finder import FoundSun, find_sun

LARGEST_UNCERTAINTY = 12.0  # deg, of a sun around which a fitted sky is trusted
GIVEN_UNCERTAINTY = 5.0  # deg, of a given sun whose uncertainty is not given


def label_panorama(panorama: Panorama) -> Label:
    """The panorama's label; a sun given in the index wins over the one found in the picture."""
    linear = read_linear(panorama, HEIGHT)
    found = find_sun(linear)
    azimuth, elevation, uncertainty, source = _sun_of(panorama, found)
    fit = None if source == "none" else fit_sky(linear, direction(azimuth, max(elevation, 0.0)))
    return Label(
        name=panorama.name,
        sun_azimuth=azimuth,
        sun_elevation=elevation,
        sun_uncertainty=uncertainty,
        sun_source=source,
        found_azimuth=found.azimuth if found else math.nan,
        found_elevation=found.elevation if found else math.nan,
        turbidity=fit.turbidity if fit else math.nan,
        exposure=fit.exposure if fit else math.nan,
        fit_residual=fit.residual if fit else math.nan,
        fit_ok=bool(fit and fit.ok and uncertainty <= LARGEST_UNCERTAINTY and not panorama.sky_is_altered),
        direct=panorama.direct,
    )


def _sun_of(panorama: Panorama, found: FoundSun | None) -> tuple[float, float, float, str]:
    """Azimuth, elevation, uncertainty [deg] and source."""
    if panorama.sun_azimuth is not None and panorama.sun_elevation is not None:
        given = panorama.sun_uncertainty
        return panorama.sun_azimuth, panorama.sun_elevation, GIVEN_UNCERTAINTY if given is None else given, "given"
    judged = panorama.sun == "none" or panorama.label  # someone looked and could not tell
    if found is None or judged:
        return math.nan, math.nan, math.nan, "none"
    return found.azimuth, found.elevation, max(2.0, found.radius / 2), "found"
