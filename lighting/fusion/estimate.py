"""Posterior -> Estimate."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.calibration import calibrate_from_lines
from lighting.decoding import correct_sun_color, lighting_from_prediction, predicted_sun_elevation
from lighting.fusion.metadata_prior import (
    MetadataPrior,
    camera_observations,
    dark_exposure_warnings,
    daylight_probability,
)
from lighting.fusion.single_view import Observations, Posterior, reproject_sun, visible_sun
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.model import Model
from lighting.photo.preprocess import is_blank, is_panorama, preprocess
from lighting.photo.reader import Photo
from lighting.records import SUITABLE, Estimate, EvidenceKind, Lighting, Prediction, significant

# The Estimate of one photo from all evidence.

_UNSUITABLE = (
    "This does not look like an ordinary {} of outdoors by daylight, upright and with an ordinary lens: "
    "the answer may mean nothing."
)
_IN_TWILIGHT = 0.1  # the most that `suitable` is where time and place have the sun below the horizon


def build_estimate(fused: Posterior, known: MetadataPrior) -> Estimate:
    """The Estimate of fused evidence, with the evidence used and the warnings."""
    lighting = lighting_from_prediction(fused.prediction, fused.sun)
    suitable, warnings = lighting.suitable, (*known.warnings, *fused.warnings)
    if suitable is not None:
        suitable = _suitable(suitable, known)
        warnings = (*warnings, *(_unsuitable_warnings(known.observations) if suitable < SUITABLE else ()))
    latitude, longitude = known.location or (None, None)
    lit = _with_headings(_with_sunlight(lighting, fused, known), fused)
    told = replace(
        lit, evidence=fused.used, warnings=warnings, suitable=suitable, latitude=latitude, longitude=longitude
    )
    light = fused.prediction.light
    return Estimate(told, fused.on_cells(), light.around if light else None)


def _with_headings(lighting: Lighting, fused: Posterior) -> Lighting:
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


def _with_sunlight(lighting: Lighting, fused: Posterior, known: MetadataPrior) -> Lighting:
    """The same with a sun of the colour of its height, which does not shine from below the horizon."""
    irradiance = lighting.sun_irradiance
    if not known.sun_is_up:
        return replace(lighting, sun_visibility=0.0, sun_irradiance=None if irradiance is None else (0.0, 0.0, 0.0))
    if irradiance is None:
        return lighting
    said = fused.predicted_sun_elevation
    if said is None:
        said = predicted_sun_elevation(fused.prediction)
    elevation = lighting.sun_elevation if EvidenceKind.TIME_AND_PLACE in fused.used else said
    return replace(lighting, sun_irradiance=correct_sun_color(irradiance, said, elevation))


def _suitable(by_pixels: float, known: MetadataPrior) -> float:
    """The probability that this is an ordinary photo of outdoors by daylight, by the metadata too."""
    return significant(min(_by_exposure(by_pixels, known.observations), 1.0 if known.sun_is_up else _IN_TWILIGHT))


def _by_exposure(suitable: float, evidence: Observations) -> float:
    """What the pixels say of `suitable`, times the probability of daylight by the exposure that the camera noted."""
    exposure = evidence.exposure_value
    return suitable if exposure is None else suitable * daylight_probability(exposure)


def _unsuitable_warnings(evidence: Observations) -> tuple[str, ...]:
    """Sentences about a picture that does not suit."""
    dark = () if evidence.exposure_value is None else dark_exposure_warnings(evidence.exposure_value, evidence.subject)
    return (*dark, _UNSUITABLE.format(evidence.subject))


# What the pixels of one photo say: the network's answer, and what the picture shows beside it.

_NO_PHOTO = 0.01  # the most that `suitable` is for pictures that are no photo of one view


def predict_photo(model: Model, photo: Photo, given: UserInput = NO_USER_INPUT) -> Prediction:
    """The network's answer for a photo, with the camera by its straight lines too.

    Where the photo or its user says which lens it has, elevation and roll are those of a camera with it.
    """
    said = model.predict(preprocess(photo, model.spec))[0]
    return screen_prediction(said, photo.pixels, camera_observations(photo.metadata, given).vertical_fov)


def screen_prediction(said: Prediction, pixels: NDArray[np.uint8], vertical_fov: float | None = None) -> Prediction:
    """As `upright`; an empty frame or a whole panorama keeps the network's camera, and does not suit."""
    if not (is_blank(pixels) or is_panorama(pixels)):
        return refine_camera(said, pixels, vertical_fov)
    if said.light is None:
        return said
    return replace(said, light=replace(said.light, suitable=min(said.light.suitable, _NO_PHOTO)))


def refine_camera(said: Prediction, pixels: NDArray[np.uint8], vertical_fov: float | None = None) -> Prediction:
    """The same with the camera by the straight lines of the pixels (h, w, 3) too, and by the lens [deg] if known.

    A sun that the photo shows stays on its pixel.
    """
    known = calibrate_from_lines(said, pixels, vertical_fov)
    sun = None if known is said else visible_sun(said, pixels)
    return known if sun is None else replace(known, sun_probability=reproject_sun(said, known, sun))
