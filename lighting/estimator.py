"""From a photo to its light: the whole chain, and nothing else."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Union, Unpack

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ErrorCode, ParameterError, PhotoError, warn_of_old_name
from lighting.fusion.user_input import NO_USER_INPUT, UserInput, check_headings, check_user_input
from lighting.map_options import MapKeywords, MapOptions
from lighting.model import Model, model_or_packaged, preprocess
from lighting.photo.reader import Photo, Source, check_photo, photo_from_array, read_photo
from lighting.prediction import Prediction
from lighting.records import Lighting, check_lighting
from lighting.runtime import ONE_BLAS_THREAD, return_memory

if TYPE_CHECKING:
    from PIL import Image

    from lighting.fusion.estimate import PhotoPrediction
    from lighting.fusion.single_view import Observations
    from lighting.photo_estimate import Estimate
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

    def _predict(self, photo: Photo, user_input: UserInput) -> "PhotoPrediction":
        from lighting.fusion.estimate import refine_prediction

        _check_arguments([photo], user_input)
        return refine_prediction(self.model.predict_one(photo), photo, user_input)

    def __call__(self, photo: Photo, user_input: UserInput = NO_USER_INPUT) -> "Estimate":
        """Estimate the photo's light from its pixels, its metadata and what the user states.

        Args:
            photo: as `lighting.read_photo` returns it.
            user_input: what the user states of the photo.

        Raises:
            ModelError: the network fails.
            PhotoError: `photo` is no Photo.
            ParameterError: the user's time and place are of night.
        """
        return _join_photo(photo, self._predict(photo, user_input), user_input)

    def estimate_views(
        self,
        photos: Sequence[Photo],
        user_input: UserInput = NO_USER_INPUT,
        headings: Sequence[float] | None = None,
        *,
        register: bool | RegisterFn = False,
    ) -> "list[Estimate]":
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
        if len(photos) > 1 and user_input.drawn_fields:
            sentence = "Shadows, lines and things of known size are drawn in one photo; estimate it alone."
            raise ParameterError(sentence, user_input.drawn_fields[0], ErrorCode.CONTRADICTION)
        if len(photos) < 2:
            return [self(photo, user_input) for photo in photos]
        from lighting.fusion.estimate import apply_photo_colors, build_estimate
        from lighting.fusion.metadata_prior import observations_multi
        from lighting.fusion.multi_view import fuse_views
        from lighting.ground import describe_ground
        from lighting.photo_estimate import Estimate

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
    ) -> "list[Estimate]":
        """Call `estimate_views`, of which this is the old name.

        Args:
            photos: as there.
            given: `user_input` there.
            headings: as there.
            match: `register` there.
        """
        warn_of_old_name("lighting.Estimator.together")
        return self.estimate_views(photos, given, headings, register=match)


def estimate(source: PhotoInput, user_input: UserInput = NO_USER_INPUT) -> "Estimate":
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


def estimate_once(
    read: Callable[[], Photo],
    load: Callable[[], Model],
    user_input: UserInput = NO_USER_INPUT,
    *,
    thread: Executor,
    meanwhile: Callable[[], object] = lambda: None,
) -> "Estimate":
    """Estimate the light of one photo by a network that is loaded for it, and gone with its answer.

    Args:
        read: returns the photo.
        load: returns the network.
        user_input: what the user states of the photo.
        thread: loads the network while the photo is read, and runs it while this one imports what comes after.
        meanwhile: what else to do while the network runs.

    Raises:
        PhotoError: it is no photo that can be read.
        ModelError: the network cannot be read, or fails.
        ParameterError: the user's time and place are of night.
    """
    loading = thread.submit(load)
    photo = read()
    network = loading.result()
    return_memory()  # what opening it took, before it takes more
    predictions = thread.submit(network.predict, preprocess(photo, network.spec))
    del loading, network
    from lighting.fusion.estimate import refine_prediction

    meanwhile()
    (prediction,) = predictions.result()
    return _join_photo(photo, refine_prediction(prediction, photo, user_input), user_input)


def _join_photo(photo: Photo, predicted: "PhotoPrediction", user_input: UserInput) -> "Estimate":
    """The photo with its light."""
    from lighting.fusion.estimate import estimate_light
    from lighting.photo_estimate import Estimate

    return Estimate.of_photo(photo, estimate_light(photo, predicted, user_input))


def render_lighting(
    lighting: Lighting,
    height: int = 512,
    *,
    photo: PhotoInput | None = None,
    user_input: UserInput = NO_USER_INPUT,
    **options: Unpack[MapKeywords],
) -> NDArray[np.float32]:
    """Render the environment map (height, 2 height, 3) of a light, in linear Rec.709, in the photo's linear values.

    With its photo the map shows the place, as `Estimate.envmap` does; without, the sky alone and plain ground.

    Args:
        lighting: a record, such as `Lighting.from_dict` returns.
        height: rows, even, 16 to 8192.
        photo: of which the record is, as `estimate` takes it; the network sees it again. None: without.
        user_input: what was stated of the photo when the record was made.
        options: the other fields of `lighting.MapOptions`: sun, yaw, sky, around, disc, adjustments.

    Raises:
        ParameterError: a value is out of range.
        PhotoError: `photo` is no photo that can be read.
        OSError: the photo's file cannot be read.
    """
    from lighting.photo_estimate import render_map

    check_lighting(lighting)
    view = MapOptions.of_keywords(height, options)
    if photo is None:
        return render_map(lighting, view).image
    return estimate(photo, user_input).replace(lighting=lighting).render(view).image


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


def _check_arguments(photos: object, user_input: object) -> None:
    """Raise PhotoError for what is no list of Photos, ParameterError for what is no UserInput."""
    if not isinstance(photos, Sequence):
        raise PhotoError(
            f"Several photos are given as a list, not as {type(photos).__name__}.", code=ErrorCode.WRONG_TYPE
        )
    for photo in photos:
        check_photo(photo)
    check_user_input(user_input)


def _view(photo: Photo, prediction: Prediction, observations: "Observations") -> "View":
    """The photo as it is registered with the others."""
    from lighting.fusion.single_view import camera_elevation_std, fuse_gravity
    from lighting.registration.photo_set import UP_STD, View

    fused = fuse_gravity(prediction, observations)
    camera, gravity = fused.prediction, fused.observations.gravity
    tilt = (camera.camera_elevation, camera.camera_roll)
    std = UP_STD if gravity is None else min(UP_STD, camera_elevation_std(gravity))
    return View(*tilt, prediction.vertical_fov, observations.vertical_fov, std, pixels=photo.pixels)


def _register_here(views: "Sequence[View]") -> "Sequence[RegisteredView]":
    from lighting.registration.photo_set import register_views

    return register_views([view.with_features() for view in views])
