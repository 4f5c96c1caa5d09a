"""The Estimate of one photo from all evidence."""

from dataclasses import replace

from lighting.decoding import lighting_from, said_elevation
from lighting.evidence.exposure import daylight_probability, too_dark
from lighting.evidence.fusion import Evidence, Fused
from lighting.evidence.metadata import Known
from lighting.records import SUITABLE, Estimate, EvidenceKind, Lighting, significant
from lighting.strength import tinted

_UNSUITABLE = (
    "This does not look like an ordinary {} of outdoors by daylight, upright and with an ordinary lens: "
    "the answer may mean nothing."
)
_IN_TWILIGHT = 0.1  # the most that `suitable` is where time and place have the sun below the horizon


def estimate_of(fused: Fused, known: Known) -> Estimate:
    """The Estimate of fused evidence, with the evidence used and the warnings."""
    lighting = lighting_from(fused.prediction, fused.sun)
    suitable, warnings = lighting.suitable, (*known.warnings, *fused.warnings)
    if suitable is not None:
        suitable = _suitable(suitable, known)
        warnings = (*warnings, *(reasons(known.evidence) if suitable < SUITABLE else ()))
    latitude, longitude = known.location or (None, None)
    lit = _with_headings(_with_sunlight(lighting, fused, known), fused)
    told = replace(
        lit, evidence=fused.used, warnings=warnings, suitable=suitable, latitude=latitude, longitude=longitude
    )
    light = fused.prediction.light
    return Estimate(told, fused.on_cells(), light.around if light else None)


def _with_headings(lighting: Lighting, fused: Fused) -> Lighting:
    """The same with where its camera points, as far as it is known."""
    if (relative := fused.relative_heading) is not None:
        lighting = replace(lighting, relative_heading=round(relative.best, 2) % 360.0)
    if (heading := fused.camera_heading) is None:
        return lighting
    return replace(
        lighting,
        camera_heading=round(heading.best, 2) % 360.0,
        camera_heading_radius_50=round(heading.radius_50, 2),
        camera_heading_radius_90=round(heading.radius_90, 2),
        camera_heading_probability=tuple(round(float(p), 6) for p in heading.probability),
    )


def _with_sunlight(lighting: Lighting, fused: Fused, known: Known) -> Lighting:
    """The same with a sun of the colour of its height, which does not shine from below the horizon."""
    irradiance = lighting.sun_irradiance
    if not known.sun_is_up:
        return replace(lighting, sun_visibility=0.0, sun_irradiance=None if irradiance is None else (0.0, 0.0, 0.0))
    if irradiance is None:
        return lighting
    said = said_elevation(fused.prediction) if fused.said_elevation is None else fused.said_elevation
    elevation = lighting.sun_elevation if EvidenceKind.TIME_AND_PLACE in fused.used else said
    return replace(lighting, sun_irradiance=tinted(irradiance, said, elevation))


def _suitable(by_pixels: float, known: Known) -> float:
    """The probability that this is an ordinary photo of outdoors by daylight, by the metadata too."""
    return significant(min(_by_exposure(by_pixels, known.evidence), 1.0 if known.sun_is_up else _IN_TWILIGHT))


def _by_exposure(suitable: float, evidence: Evidence) -> float:
    """What the pixels say of `suitable`, times the probability of daylight by the exposure that the camera noted."""
    exposure = evidence.exposure_value
    return suitable if exposure is None else suitable * daylight_probability(exposure)


def reasons(evidence: Evidence) -> tuple[str, ...]:
    """Sentences about a picture that does not suit."""
    dark = () if evidence.exposure_value is None else too_dark(evidence.exposure_value, evidence.subject)
    return (*dark, _UNSUITABLE.format(evidence.subject))
