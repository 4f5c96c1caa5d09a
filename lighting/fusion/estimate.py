"""From pixels to Prediction, and from Posterior to EstimatedLight.

At ISO 100 sunlight takes EV 15, open shade and a heavy sky 12, a landscape just after sunset 9. Streets and shop
windows in bright lamplight take 8, rooms 5 to 7 [1]. Exposures tell indoors from outdoors better than pixels do [2].

References:
    [1] ANSI PH2.7, Photographic Exposure Guide.
    [2] Boutell and Luo, CVPR 2004.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lighting.decoding as decoding
from lighting.calibration import MAX_LENS_RATIO, calibrate_from_lines, lens_ratio, shrink_to_gray
from lighting.envmap.appearance import PhotoSamples, estimate_ground_albedo, share_sky_color, snow_gain
from lighting.envmap.relighting import scale_exposure
from lighting.envmap.shadow_mask import dappled_sunlight
from lighting.errors import CodedWarning, WarningCode
from lighting.fields import clip_to_range, round_significant
from lighting.fusion.drawn_camera import height_by_reference
from lighting.fusion.marks import move_drawn
from lighting.fusion.metadata_prior import MetadataPrior, merge_user_input, observations_single
from lighting.fusion.single_view import Observations, Posterior, fuse_single_view
from lighting.fusion.time_zones import resolve_hemisphere
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.fusion.visible_sun import reproject_sun, visible_sun
from lighting.geometry import Pinhole, angles
from lighting.ground import describe_ground
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.picture_checks import is_blank, is_false_color, is_panorama
from lighting.photo.reader import Photo
from lighting.prediction import EstimatedLight, Prediction, photo_segments
from lighting.records import MIN_SUITABLE, Color, EvidenceKind, Lighting
from lighting.sea_horizon import level_by_sea, may_show_sea
from lighting.sun_grid import temper

_UNSUITABLE = "Probably not an outdoor daylight {}: do not trust this result."
_THERMAL = "Probably a picture of a thermal camera, which shows temperatures: do not trust this result."
_PANORAMA = "The file says that this is a panorama: do not trust this result."
_MAX_SUITABLE_IN_TWILIGHT = 0.1  # where time and place have the sun below the horizon
_EVEN_ODDS_EXPOSURE = 8.0  # EV at ISO 100 that is as often lamplight as daylight: about 30 cd/m2
_ODDS_EXPONENT = 2.5  # doublings of the odds of daylight for each EV: scenes and meters vary by a stop
_MAX_SUITABLE_NO_PHOTO = 0.01  # of pictures that are no photo of one view

_CROPPED = "The focal length in the file was not used, because the photo was cropped."

# Of 344 photos with a true lens the pixels find one that is 1.9 times shorter for 1.7 %, and 4 times for 0.3 %. Each of
# these has a field of view under 15 deg, which is rare where the network learned; of wider ones none is over 1.82. A
# file with a 35 mm value alone, as no camera writes it, is doubted sooner.
_MAX_WIDER_RATIO = 1.5
_MAX_LONGER_RATIO = 4.0  # of long lenses
_LONG_LENS = 16.0  # deg, vertical field of view under which a lens is long
_LENS_BIAS = 0.1  # logarithm of a true lens by the pixels', in the mean
_UNDECIDED = 0.15  # difference of such logarithms, under which the pixels do not choose


# Photos in shade and under clouds show less of the sun than the network's panoramas do: `export fit photo-radii`.
_HIDDEN_TEMPERATURE = 2.0  # of the sun's distribution where no direct sun shows
_CLEAR_VISIBILITY = 0.9  # from which on the distribution stays


@dataclass(frozen=True, eq=False)
class PhotoPrediction:
    """The network's prediction for a photo, and the photo's metadata as far as the pixels let them be true."""

    prediction: Prediction
    """With the camera by the photo's straight lines too."""
    metadata: PhotoMetadata
    """Whose place has a hemisphere and whose lens the pixels do not exclude."""
    warnings: tuple[CodedWarning, ...]
    """Of the metadata."""


def refine_prediction(prediction: Prediction, photo: Photo, user_input: UserInput = NO_USER_INPUT) -> PhotoPrediction:
    """The network's prediction for a photo, with the camera by its straight lines too, and what metadata count.

    Where the photo or its user tells the lens, elevation and roll are those of a camera with it.

    Args:
        prediction: of the network alone.
        photo: as `read_photo` returns it.
        user_input: what the user states of the photo.
    """
    metadata, warnings = _check_metadata(photo.metadata, prediction, user_input)
    if (user_input.metadata and metadata.is_thermal) or is_false_color(photo.pixels):
        thermal = CodedWarning(_THERMAL, WarningCode.THERMAL)
        return PhotoPrediction(_as_unsuitable(prediction), metadata, (thermal, *warnings))
    if photo.is_collage or (user_input.metadata and photo.metadata.is_panorama):
        return PhotoPrediction(_as_unsuitable(prediction), metadata, warnings)
    lens = merge_user_input(metadata, user_input).vertical_fov
    return PhotoPrediction(_refine_view(prediction, photo.pixels, lens), metadata, warnings)


def _check_metadata(
    metadata: PhotoMetadata, prediction: Prediction, user_input: UserInput
) -> tuple[PhotoMetadata, tuple[CodedWarning, ...]]:
    """The metadata of a PhotoPrediction, and its warnings, none of what the user replaces."""
    if not user_input.metadata:
        return metadata, ()
    about_kind = (CodedWarning(_PANORAMA, WarningCode.PANORAMA),) if metadata.is_panorama else ()
    about_lens, about_place = tuple[CodedWarning, ...](), tuple[CodedWarning, ...]()
    if user_input.vertical_fov is None and user_input.camera is None:
        metadata, about_lens = _choose_lens(metadata, prediction.vertical_fov)
    if user_input.latitude is None:
        metadata, about_place = resolve_hemisphere(metadata)
    return metadata, (*about_kind, *about_place, *about_lens)


def screen_prediction(
    prediction: Prediction, pixels: NDArray[np.uint8], vertical_fov: float | None = None
) -> Prediction:
    """As `refine_camera`, with the sun's distribution of photos.

    Blank frames, false colors and panoramas keep the network's camera and are not suitable.

    Args:
        prediction: of the network.
        pixels: (h, w, 3) sRGB.
        vertical_fov: deg, of the known lens; None where it is unknown.
    """
    if is_false_color(pixels):
        return _as_unsuitable(prediction)
    return _refine_view(prediction, pixels, vertical_fov)


def _refine_view(prediction: Prediction, pixels: NDArray[np.uint8], vertical_fov: float | None) -> Prediction:
    """As `screen_prediction`, of pixels (h, w, 3) that are no false colors."""
    if is_blank(pixels) or is_panorama(pixels):
        return _as_unsuitable(prediction)
    refined = refine_camera(prediction, pixels, vertical_fov)
    temperature = photo_temperature(refined.sun_visibility)
    if temperature == 1.0:
        return refined
    return replace(refined, sun_probability=temper(refined.sun_probability, temperature))


def photo_temperature(visibility: float, hidden: float = _HIDDEN_TEMPERATURE) -> float:
    """Return by which temperature, at least 1, a photo's distribution of the sun is wider than the network's.

    Args:
        visibility: of the sun, 0 to 1.
        hidden: temperature at visibility 0.
    """
    return 1.0 + (hidden - 1.0) * max(0.0, 1.0 - visibility / _CLEAR_VISIBILITY)


def _as_unsuitable(prediction: Prediction) -> Prediction:
    """The same of a picture that is no photo of one view."""
    if prediction.light is None:
        return prediction
    suitable = min(prediction.light.suitable, _MAX_SUITABLE_NO_PHOTO)
    return replace(prediction, light=replace(prediction.light, suitable=suitable))


def refine_camera(prediction: Prediction, pixels: NDArray[np.uint8], vertical_fov: float | None = None) -> Prediction:
    """The same with the camera by straight lines and the sea's horizon; a sun that the photo shows stays on its pixel.

    Args:
        prediction: of the network.
        pixels: (h, w, 3) sRGB.
        vertical_fov: deg, of the known lens; None where it is unknown.
    """
    gray, sun = shrink_to_gray(pixels), visible_sun(prediction, pixels)
    refined = calibrate_from_lines(prediction, gray, vertical_fov)
    lens = refined.vertical_fov
    if vertical_fov is not None and lens_ratio(prediction.vertical_fov, vertical_fov) <= MAX_LENS_RATIO:
        lens = vertical_fov
    if prediction.segments is not None and may_show_sea(prediction.segments):
        height, width = pixels.shape[:2]
        segments = photo_segments(prediction.segments, width, height)
        refined = level_by_sea(refined, gray, segments, lens, (width, height))
    if sun is None or refined is prediction:
        return refined
    return replace(refined, sun_probability=reproject_sun(prediction, refined, sun))


def build_estimate(posterior: Posterior, prior: MetadataPrior) -> EstimatedLight:
    """The EstimatedLight of a posterior, with the evidence used and the warnings.

    Args:
        posterior: of the photo.
        prior: the photo's observations, with their warnings.
    """
    headings: Any = _heading_fields(posterior)
    each = zip(prior.observations.candidates, prior.instants.instants, strict=False)
    matching = [instant for sun, instant in each if sun == posterior.candidate]  # the likeliest sun
    instant = max(matching, key=lambda instant: instant.weight, default=prior.instants.likeliest)
    conflict = prior.instants.conflict_warnings(instant, posterior.candidate_probability)
    lighting = decoding.lighting_from_prediction(posterior.prediction, posterior.sun)
    suitable, warnings = lighting.suitable, (*prior.warnings, *conflict, *posterior.warnings)
    if suitable is not None:
        if (exposure_value := prior.observations.exposure_value) is not None:
            suitable = round_significant(suitable * _daylight_probability(exposure_value))
        suitable = suitable if prior.twilight_sun is None else min(suitable, _MAX_SUITABLE_IN_TWILIGHT)
        warnings = (*warnings, *(_unsuitable_warnings(prior.observations) if suitable < MIN_SUITABLE else ()))
    elevation, visibility, irradiance = _sunlight(lighting, posterior, prior)
    latitude, longitude = prior.location or (None, None)
    time, offset, source = (None,) * 3 if instant is None else (instant.utc_time, instant.utc_offset, instant.source)
    answer = replace(
        lighting,
        sun_elevation=elevation,
        sun_visibility=visibility,
        sun_irradiance=irradiance,
        evidence=posterior.used,
        warnings=warnings,
        suitable=suitable,
        latitude=latitude,
        longitude=longitude,
        camera_height=round_significant(prior.camera_height),
        utc_time=time,
        utc_offset=offset,
        time_source=source,
        **headings,
    )
    light, distribution = posterior.prediction.light, posterior.on_cells()
    around = light.surroundings if light else None
    answer = replace(answer, sun_candidates=decoding.candidate_suns(answer, posterior.directions, distribution))
    return EstimatedLight(answer, distribution, around)


def _heading_fields(posterior: Posterior) -> dict[str, float | tuple[float, ...]]:
    """The fields of a Lighting about the camera's heading, as far as it is known."""
    fields: dict[str, float | tuple[float, ...]] = {}
    if (relative := posterior.relative_heading) is not None:
        fields["relative_heading"] = round(relative.best, 2) % 360.0
    if (heading := posterior.camera_heading) is not None:
        fields["camera_heading"] = round(heading.best, 2) % 360.0
        fields["camera_heading_radius_50"] = round(heading.radius_50, 2)
        fields["camera_heading_radius_90"] = round(heading.radius_90, 2)
        fields["camera_heading_probability"] = tuple(round(float(p), 6) for p in heading.probability)
    return fields


def _sunlight(lighting: Lighting, posterior: Posterior, prior: MetadataPrior) -> tuple[float, float, Color | None]:
    """Elevation [deg], visibility and irradiance of the sun, in the color of its height; below the horizon it is dark.

    The irradiance is None where the lighting states none.
    """
    irradiance = lighting.sun_irradiance
    if prior.twilight_sun is not None:
        return clip_to_range("sun_elevation", prior.twilight_sun), 0.0, None if irradiance is None else (0.0, 0.0, 0.0)
    if irradiance is not None:
        predicted = posterior.predicted_sun_elevation
        if predicted is None:
            predicted = float(angles(posterior.prediction.sun_direction)[1])
        known = lighting.sun_elevation if EvidenceKind.TIME_AND_PLACE in posterior.used else predicted
        irradiance = decoding.correct_sun_color(irradiance, predicted, known)
    return lighting.sun_elevation, lighting.sun_visibility, irradiance


def _daylight_probability(exposure_value: float) -> float:
    """Probability (0 to 1) that daylight lit a scene that took an exposure value [EV at ISO 100]."""
    return float(1.0 / (1.0 + 2.0 ** (_ODDS_EXPONENT * (_EVEN_ODDS_EXPOSURE - exposure_value))))


def _unsuitable_warnings(observations: Observations) -> tuple[str, ...]:
    """Sentences about a picture that is not suitable: a dark exposure first, where daylight is the less likely."""
    exposure_value, subject = observations.exposure_value, observations.subject
    unsuitable = _UNSUITABLE.format(subject)
    if exposure_value is None or _daylight_probability(exposure_value) >= 0.5:
        return (unsuitable,)
    dark = f"The {subject} was exposed for the dark (EV {exposure_value:.1f}): probably night or indoors."
    return (dark, unsuitable)


def _choose_lens(metadata: PhotoMetadata, pixel_fov: float) -> tuple[PhotoMetadata, tuple[CodedWarning, ...]]:
    """The metadata with the lens that the pixels choose, and what is to be said of it.

    Args:
        metadata: of the photo's file; a lens that the pixels contradict is dropped.
        pixel_fov: deg, the vertical field of view by the pixels.
    """
    if metadata.vertical_fov is None:
        if metadata.focal_length is None or metadata.is_panorama:
            return metadata, ()
        return metadata, (CodedWarning(_CROPPED, WarningCode.LENS_OPEN),)
    fovs = (metadata.vertical_fov, *metadata.other_vertical_fovs)
    tangent, *tangents = (math.tan(math.radians(fov) / 2) for fov in (pixel_fov, *fovs))
    longer = [math.log(tangent / other) for other in tangents]
    errors = [abs(ratio - _LENS_BIAS) for ratio in longer]
    best = min(range(len(fovs)), key=errors.__getitem__)
    is_long = metadata.is_lens_consistent and fovs[best] < _LONG_LENS
    limit = _MAX_LONGER_RATIO if is_long else MAX_LENS_RATIO
    if not -math.log(_MAX_WIDER_RATIO) <= longer[best] <= math.log(limit):
        cause = "check the focal length" if longer[best] > 0 else "it may be cropped"
        sentence = (
            f"The photo shows {pixel_fov:.0f}°, not the file's {fovs[best]:.0f}° vertical field of view: {cause}."
        )
        chosen = replace(metadata, vertical_fov=None, other_vertical_fovs=())
        return chosen, (CodedWarning(sentence, WarningCode.LENS_CONTRADICTED),)
    chosen = replace(metadata, vertical_fov=fovs[best], other_vertical_fovs=())
    if len(fovs) == 1 or (best == 0 and min(errors[1:]) - errors[0] > _UNDECIDED):
        return chosen, ()
    values = " or ".join(f"{fov:.0f}°" for fov in fovs)
    sentence = f"The file allows vertical fields of view of {values}; used: {fovs[best]:.0f}°."
    return chosen, (CodedWarning(sentence, WarningCode.LENS_OPEN),)


# From a prediction to the answer.


def estimate_light(photo: Photo, predicted: PhotoPrediction, user_input: UserInput = NO_USER_INPUT) -> EstimatedLight:
    """Estimate a photo's light from what the network says of it, its metadata and what the user states.

    Args:
        photo: as `lighting.read_photo` returns it.
        predicted: by `refine_prediction`, of this photo and this input.
        user_input: what the user states of the photo.

    Raises:
        ParameterError: the user's time and place are of night.
    """
    prior = observations_single(predicted.metadata, user_input)
    observed = replace(prior, warnings=(*photo.warnings, *predicted.warnings, *prior.warnings))
    observations = _with_drawn(observed.observations, photo, user_input)
    posterior, (left, top) = fuse_single_view(predicted.prediction, observations, photo.pixels), _border(photo)
    if user_input.reference is not None:
        fused, moved = posterior.prediction, move_drawn(user_input.reference, -left, -top)
        size = photo.width, photo.height, fused.vertical_fov
        camera = Pinhole(*size, elevation=fused.camera_elevation, roll=fused.camera_roll)
        observed = replace(observed, camera_height=height_by_reference(moved, camera))
    estimate = build_estimate(posterior, observed)
    spot = move_drawn(user_input.spot, -left, -top)
    estimate = describe_ground(photo, estimate, predicted.prediction, observed.is_aerial, spot)
    return apply_photo_colors([photo], [estimate])[0]


def _with_drawn(observations: Observations, photo: Photo, user_input: UserInput) -> Observations:
    """The same with what the user drew, in pixels of the photo without its border."""
    drawn = user_input.drawn_camera
    if not user_input.shadows and drawn is None:
        return observations
    left, top = _border(photo)
    return replace(
        observations,
        shadows=move_drawn(user_input.shadows, -left, -top),
        camera=move_drawn(drawn, -left, -top),
        picture_size=(photo.width, photo.height),
    )


def _border(photo: Photo) -> tuple[int, int]:
    """Columns and rows of the border on the photo's left and above it."""
    return (0, 0) if photo.crop is None else (photo.crop.left, photo.crop.top)


def apply_photo_colors(photos: Sequence[Photo], estimates: Sequence[EstimatedLight]) -> list[EstimatedLight]:
    """Give estimates of photos under one sky the colors that the photos show, where irradiances are known.

    The sky has one color in all of them, the geometric mean; each photo shows its own ground. The
    ground of a single photo also says how strong its light is.

    Args:
        photos: one or more.
        estimates: one a photo.
    """
    lights = [estimate.lighting for estimate in estimates]
    around = [estimate.surroundings for estimate in estimates]
    each = zip(photos, estimates, strict=True)
    samples = [PhotoSamples.of_photo(p.pixels, e.lighting, e.segments) for p, e in each]
    if len(photos) == 1:
        lights = [_with_ground_light(photos[0], samples[0], lights[0])]
    lights = share_sky_color(samples, lights)
    lights = list(map(decoding.with_ground_color, lights, map(estimate_ground_albedo, samples, lights, around)))
    return [replace(estimate, lighting=light) for estimate, light in zip(estimates, lights, strict=True)]


def _with_ground_light(photo: Photo, samples: PhotoSamples, light: Lighting) -> Lighting:
    """The light of a photo whose ground may show patches of sun, or snow, which reflects no more than it can."""
    if decoding.doubts_sun(light) and (dapple := dappled_sunlight(photo.pixels, light)) is not None:
        light = decoding.with_dappled_sun(light, *dapple)
    if (gain := snow_gain(samples, light)) == 1:
        return light
    return scale_exposure(light, np.full(3, gain))
