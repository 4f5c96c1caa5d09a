"""From a photo to its light: the whole chain, and nothing else."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Union

import numpy as np
from numpy.typing import NDArray

from lighting.decoding import doubts_sun, with_dappled_sun, with_ground_color
from lighting.envmap.appearance import PhotoSamples, estimate_ground_albedo, share_sky_color, snow_gain
from lighting.envmap.render import check_height, render
from lighting.envmap.shadow_mask import dappled_sunlight
from lighting.errors import ErrorCode, ParameterError, PhotoError, warn_of_old_name
from lighting.fusion.estimate import PhotoPrediction, build_estimate, refine_prediction
from lighting.fusion.metadata_prior import observations_multi, observations_single
from lighting.fusion.single_view import Observations, camera_elevation_std, fuse_gravity, fuse_single_view
from lighting.fusion.user_input import NO_USER_INPUT, UserInput, check_headings, check_user_input
from lighting.ground import describe_ground
from lighting.model import Model, model_or_packaged
from lighting.photo.reader import Photo, Source, check_photo, photo_from_array, read_photo
from lighting.photo_estimate import Estimate
from lighting.records import EstimatedLight, Lighting, Prediction, check_lighting
from lighting.runtime import ONE_BLAS_THREAD

if TYPE_CHECKING:
    from PIL import Image

    from lighting.registration.photo_set import RegisteredView, View

# As `registration.photo_set.register_views_isolated`; it returns None where nothing says how the photos are rotated.
RegisterFn = Callable[[Sequence["View"]], "Sequence[RegisteredView] | None"]


# What is taken for a photo: what `read_photo` reads, its answer, or pixels (h, w, 3) of 8-bit sRGB.
PhotoInput = Union[Source, Photo, NDArray[np.uint8], "Image.Image"]


class Estimator:
    """A network ready for many photos; `Estimator()(read_photo("photo.jpg"))` is an Estimate.

    Threads may share one. It cannot be pickled: each process loads its own.
    """

    def __init__(self, model: Model | None = None) -> None:
        """Take a network.

        Args:
            model: the network; None is the one in this package.

        Raises:
            ModelError: the network cannot be read.
            ParameterError: `model` is no Model.
        """
        self.model = model_or_packaged(model)

    def predict(self, photo: Photo, user_input: UserInput = NO_USER_INPUT) -> Prediction:
        """Run the network: the sun's probability on its grid, and raw parameters.

        Of the metadata and of the user's input the lens alone enters, for the camera's tilt.

        Args:
            photo: as `lighting.read_photo` returns it.
            user_input: what the user states of the photo.

        Raises:
            ModelError: the network fails.
            PhotoError: `photo` is no Photo.
            ParameterError: `user_input` is no UserInput.
        """
        return self._predict(photo, user_input).prediction

    def _predict(self, photo: Photo, user_input: UserInput) -> PhotoPrediction:
        _check_arguments([photo], user_input)
        return refine_prediction(self.model.predict_one(photo), photo, user_input)

    def __call__(self, photo: Photo, user_input: UserInput = NO_USER_INPUT) -> Estimate:
        """Estimate the photo's light from its pixels, its metadata and what the user states.

        Args:
            photo: as `lighting.read_photo` returns it.
            user_input: what the user states of the photo.

        Raises:
            ModelError: the network fails.
            PhotoError: `photo` is no Photo.
            ParameterError: the user's time and place are of night.
        """
        return estimate_from_prediction(photo, self._predict(photo, user_input), user_input)

    def estimate_views(
        self,
        photos: Sequence[Photo],
        user_input: UserInput = NO_USER_INPUT,
        headings: Sequence[float] | None = None,
        *,
        register: bool | RegisterFn = False,
    ) -> list[Estimate]:
        """Estimate the light of photos of one place and time; one Estimate each, in its own camera's frame.

        Args:
            photos: one or more, as `lighting.read_photo` returns them.
            user_input: what the user states of all photos.
            headings: deg, clockwise from any common direction: where each camera points. None where unknown.
            register: True finds the headings from what the photos show in common, by OpenCV (extra `all`).
                A function does the same elsewhere, such as `registration.photo_set.register_views_isolated`.

        Raises:
            ModelError: the network fails.
            PhotoError: `photos` is no list of Photos.
            ParameterError: there is not one heading a photo, or the time and place are of night.
            MissingExtraError: `register` is True, and OpenCV is not installed.
        """
        _check_arguments(photos, user_input)
        if not callable(register) and not isinstance(register, bool):
            sentence = f"register must be True, False or a function, not {register!r}."
            raise ParameterError(sentence, "register", ErrorCode.WRONG_TYPE)
        check_headings(len(photos), headings, user_input.heading)
        if len(photos) < 2:
            return [self(photo, user_input) for photo in photos]
        predicted = [self._predict(photo, user_input) for photo in photos]
        predictions = [one.prediction for one in predicted]
        observed = observations_multi([one.metadata for one in predicted], user_input)
        observed = [
            replace(prior, warnings=(*photo.warnings, *one.warnings, *prior.warnings))
            for prior, photo, one in zip(observed, photos, predicted, strict=True)
        ]
        observations = [one.observations for one in observed]
        views = None
        if headings is None and register:
            register_views = register if callable(register) else _register_here
            views = register_views(list(map(_view, photos, predictions, observations)))
        from lighting.fusion.multi_view import fuse_views

        posteriors = fuse_views(predictions, observations, headings, views)
        estimates = list(map(build_estimate, posteriors, observed))
        aerial = [one.is_aerial for one in observed]
        lights = apply_photo_colors(photos, list(map(describe_ground, photos, estimates, predictions, aerial)))
        return list(map(Estimate.of_photo, photos, lights))

    def together(
        self,
        photos: Sequence[Photo],
        given: UserInput = NO_USER_INPUT,
        headings: Sequence[float] | None = None,
        *,
        match: bool | RegisterFn = False,
    ) -> list[Estimate]:
        """Call `estimate_views`, of which this is the old name.

        Args:
            photos: as there.
            given: `user_input` there.
            headings: as there.
            match: `register` there.
        """
        warn_of_old_name("lighting.Estimator.together")
        return self.estimate_views(photos, given, headings, register=match)


def estimate(source: PhotoInput, user_input: UserInput = NO_USER_INPUT) -> Estimate:
    """Estimate the light of a photo by the network in this package, as the commands for one photo do.

    An Estimator is quicker where there are many photos.

    Args:
        source: a path, bytes, a binary stream, a Photo, or pixels (h, w, 3) of 8-bit sRGB: an array, or a PIL image.
        user_input: what the user states of the photo.

    Raises:
        PhotoError: it is no photo that can be read; also a TypeError where it is of another type.
        ModelError: the network fails.
        ParameterError: the user's time and place are of night.
        OSError: the file cannot be read.
    """
    photo = _as_photo(source)
    with ONE_BLAS_THREAD:
        return _packaged_estimator()(photo, user_input)


def render_lighting(
    lighting: Lighting,
    height: int = 512,
    *,
    photo: PhotoInput | None = None,
    user_input: UserInput = NO_USER_INPUT,
    sun: bool | None = None,
    disc: bool = True,
) -> NDArray[np.float32]:
    """Render the environment map (height, 2 height, 3) of a light, in linear Rec.709, in the photo's linear values.

    With its photo the map shows the place, as `Estimate.envmap` does; without, the sky alone and plain ground.

    Args:
        lighting: a record, such as `Lighting.from_dict` returns.
        height: rows, even, 16 to 4096.
        photo: of which the record is, as `estimate` takes it; the network sees it again. None: without.
        user_input: what was stated of the photo when the record was made.
        sun: whether the sun is in the map; None: by `Lighting.sun_painted`.
        disc: False leaves the sun's disc for a light of its own; the sun still lights the ground.

    Raises:
        ParameterError: a value is out of range.
        PhotoError: `photo` is no photo that can be read.
        OSError: the photo's file cannot be read.
    """
    if photo is None:
        return render(lighting, height, sun=sun, disc=disc)
    check_lighting(lighting)
    check_height(height)
    return estimate(photo, user_input).replace(lighting=lighting).envmap(height, sun=sun, disc=disc)


def _as_photo(source: Any) -> Photo:
    """The Photo of what `estimate` takes."""
    if isinstance(source, Photo):
        return source
    if isinstance(source, str | os.PathLike | bytes | bytearray | memoryview) or hasattr(source, "read"):
        return read_photo(source)
    if hasattr(source, "__array__") or hasattr(source, "__array_interface__"):
        return photo_from_array(source)
    kind = type(source).__name__
    sentence = f"A photo must be a path, bytes, a binary stream, an array of pixels or a Photo, not {kind}."
    raise PhotoError(sentence, code=ErrorCode.WRONG_TYPE)


@lru_cache(maxsize=1)
def _packaged_estimator() -> Estimator:
    """An Estimator that is ready soonest."""
    return Estimator(Model.load(for_one_photo=True))


def estimate_from_prediction(
    photo: Photo, predicted: PhotoPrediction, user_input: UserInput = NO_USER_INPUT
) -> Estimate:
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
    posterior = fuse_single_view(predicted.prediction, observed.observations, photo.pixels)
    estimate = build_estimate(posterior, observed)
    estimate = describe_ground(photo, estimate, predicted.prediction, observed.is_aerial)
    return Estimate.of_photo(photo, apply_photo_colors([photo], [estimate])[0])


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
    lights = list(map(with_ground_color, lights, map(estimate_ground_albedo, samples, lights, around)))
    return [replace(estimate, lighting=light) for estimate, light in zip(estimates, lights, strict=True)]


def _with_ground_light(photo: Photo, samples: PhotoSamples, light: Lighting) -> Lighting:
    """The light of a photo whose ground may show patches of sun, or snow, which reflects no more than it can."""
    if doubts_sun(light) and (dapple := dappled_sunlight(photo.pixels, light)) is not None:
        light = with_dappled_sun(light, *dapple)
    if (gain := snow_gain(samples, light)) == 1:
        return light
    from lighting.envmap.relighting import scale_exposure

    return scale_exposure(light, np.full(3, gain))


def _check_arguments(photos: object, user_input: object) -> None:
    """Raise PhotoError for what is no list of Photos, ParameterError for what is no UserInput."""
    if not isinstance(photos, Sequence):
        raise PhotoError(
            f"Several photos are given as a list, not as {type(photos).__name__}.", code=ErrorCode.WRONG_TYPE
        )
    for photo in photos:
        check_photo(photo)
    check_user_input(user_input)


def _view(photo: Photo, prediction: Prediction, observations: Observations) -> "View":
    """The photo as it is registered with the others."""
    from lighting.registration.photo_set import UP_STD, View

    fused = fuse_gravity(prediction, observations)
    camera, gravity = fused.prediction, fused.observations.gravity
    tilt = (camera.camera_elevation, camera.camera_roll)
    std = UP_STD if gravity is None else min(UP_STD, camera_elevation_std(gravity))
    return View(photo.pixels, *tilt, prediction.vertical_fov, observations.vertical_fov, std)


def _register_here(views: "Sequence[View]") -> "Sequence[RegisteredView]":
    from lighting.registration.photo_set import register_views

    return register_views([view.with_features() for view in views])
