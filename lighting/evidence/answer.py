"""The Estimate of one photo from all evidence."""

from dataclasses import replace
from typing import Any

from lighting.decoding import lighting_from, said_elevation, significant, tinted
from lighting.evidence.exposure import daylight, too_dark
from lighting.evidence.fusion import Evidence, Fused
from lighting.evidence.metadata import Known
from lighting.records import SUITABLE, Estimate

_UNSUITABLE = (
    "This does not look like an ordinary {} of outdoors by daylight, upright and with an ordinary lens: "
    "the answer may mean nothing."
)
UNSUITABLE = _UNSUITABLE.format("photo")
_IN_TWILIGHT = 0.1  # the most that `suitable` is where time and place have the sun below the horizon


def estimate_of(fused: Fused, known: Known) -> Estimate:
    """The Estimate of fused evidence, with the evidence used and the warnings."""
    lighting = lighting_from(fused.prediction, fused.sun)
    heading = fused.camera_heading
    told: dict[str, Any] = {"evidence": fused.used, "warnings": (*known.warnings, *fused.warnings)}
    if heading is not None:
        told["camera_heading"] = round(heading.best, 2) % 360.0
        told["camera_heading_radius_50"] = round(heading.radius_50, 2)
        told["camera_heading_radius_90"] = round(heading.radius_90, 2)
        told["camera_heading_probability"] = tuple(round(float(p), 6) for p in heading.probability)
    if fused.relative_heading is not None:
        told["relative_heading"] = round(fused.relative_heading.best, 2) % 360.0
    if lighting.sun_irradiance is not None:
        said = said_elevation(fused.prediction) if fused.elevation_said is None else fused.elevation_said
        elevation = lighting.sun_elevation if "time+place" in fused.used else said
        told["sun_irradiance"] = tinted(lighting.sun_irradiance, said, elevation)
    if not known.sun_is_up:
        told["sun_visibility"] = 0.0
        told["sun_irradiance"] = None if lighting.sun_irradiance is None else (0.0, 0.0, 0.0)
    if lighting.suitable is not None:
        told["suitable"] = suitable = _suitable(lighting.suitable, known)
        if suitable < SUITABLE:
            told["warnings"] = (*told["warnings"], *_reasons(known.evidence))
    if known.location is not None:
        told["latitude"], told["longitude"] = known.location
    light = fused.prediction.light
    return Estimate(replace(lighting, **told), fused.on_cells(), light.around if light else None)


def _suitable(by_pixels: float, known: Known) -> float:
    """The probability that this is an ordinary photo of outdoors by daylight, by the metadata too."""
    exposure = known.evidence.exposure_value
    by_exposure = 1.0 if exposure is None else daylight(exposure)
    return significant(min(by_pixels * by_exposure, 1.0 if known.sun_is_up else _IN_TWILIGHT))


def _reasons(evidence: Evidence) -> tuple[str, ...]:
    """Sentences about a picture that does not suit."""
    dark = () if evidence.exposure_value is None else too_dark(evidence.exposure_value, evidence.subject)
    return (*dark, _UNSUITABLE.format(evidence.subject))
