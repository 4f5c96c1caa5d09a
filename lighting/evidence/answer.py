"""The Estimate of one photo from all evidence."""

from dataclasses import replace
from typing import Any

from lighting.decoding import lighting_from, said_elevation, tinted
from lighting.evidence.fusion import Fused
from lighting.evidence.metadata import Known
from lighting.records import SUITABLE, Estimate

_UNSUITABLE = (
    "This does not look like an ordinary {} of outdoors by daylight, upright and with an ordinary lens: "
    "the answer may mean nothing."
)
UNSUITABLE = _UNSUITABLE.format("photo")


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
    if lighting.suitable is not None and lighting.suitable < SUITABLE:
        told["warnings"] = (*told["warnings"], _UNSUITABLE.format(known.evidence.subject))
    if known.location is not None:
        told["latitude"], told["longitude"] = known.location
    light = fused.prediction.light
    return Estimate(replace(lighting, **told), fused.on_cells(), light.around if light else None)
