"""From a photo to its light: the whole chain, and nothing else."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from lighting.decoding import with_ground
from lighting.envmap.appearance import estimate_ground_albedo, sky_white_balance
from lighting.envmap.render import sky_irradiance
from lighting.errors import ErrorCode, ParameterError, PhotoError
from lighting.fusion.estimate import build_estimate, predict_photo
from lighting.fusion.metadata_prior import observations_multi, observations_single
from lighting.fusion.multi_view import check_heading, check_headings, fuse_views
from lighting.fusion.single_view import Observations, fuse_gravity, fuse_single_view, tilt_spread
from lighting.fusion.user_input import NO_USER_INPUT, UserInput, check_given
from lighting.model import Model, model_or_packaged
from lighting.photo.reader import Photo, Source, check_photo, read_photo
from lighting.records import Estimate, Prediction, clipped_colour

if TYPE_CHECKING:
    from lighting.registration.photo_set import RegisteredView, View

# As `registration.photo_set.register_views_isolated`; None is no answer.
RegisterFn = Callable[[Sequence["View"]], "Sequence[RegisteredView] | None"]


class Estimator:
    """A network ready for many photos; `Estimator()(read_photo("photo.jpg"))` is an Estimate.

    Threads may share one. It cannot be pickled: each process loads its own.
    """

    def __init__(self, model: Model | None = None) -> None:
        """Uses the network in this package unless given another.

        Raises ModelError, and ParameterError for what is no Model.
        """
        self.model = model_or_packaged(model)

    def predict(self, photo: Photo, given: UserInput = NO_USER_INPUT) -> Prediction:
        """What the pixels say: the sun's probability on the network's grid, and raw parameters.

        Of the metadata and of what the user says, the lens alone enters, for how the camera was held.
        Raises ModelError, PhotoError for what is no Photo, and ParameterError for what is no Given.
        """
        _check_asked([photo], given)
        return predict_photo(self.model, photo, given)

    def __call__(self, photo: Photo, given: UserInput = NO_USER_INPUT) -> Estimate:
        """The photo's light by its pixels, its metadata and what the user says of it.

        Raises ModelError, PhotoError for what is no Photo, and ParameterError where the user's own time and place are
        of night.
        """
        return estimate_from_prediction(photo, self.predict(photo, given), given)

    def together(
        self,
        photos: Sequence[Photo],
        given: UserInput = NO_USER_INPUT,
        headings: Sequence[float] | None = None,
        *,
        match: bool | RegisterFn = False,
    ) -> list[Estimate]:
        """The light of photos of one place and time; one Estimate each, in its own camera's frame.

        `headings` [deg, clockwise from any common direction] say where each camera points; without them `match` finds
        it from what the photos show in common, by OpenCV of the extra `turns`: here, or by a function that does it
        elsewhere, such as `registration.photo_set.register_views_isolated`. Raises as a call does, ParameterError
        unless there is one heading for each of several photos, and MissingExtraError without OpenCV.
        """
        _check_asked(photos, given)
        if not callable(match) and not isinstance(match, bool):
            raise ParameterError(
                f"match must be True, False or a function, not {match!r}.", "match", ErrorCode.WRONG_TYPE
            )
        check_headings(len(photos), headings)
        check_heading(len(photos), given.heading)
        if len(photos) < 2:
            return [self(photo, given) for photo in photos]
        facts = observations_multi([photo.metadata for photo in photos], given)
        evidence, said = [fact.evidence for fact in facts], [self.predict(photo, given) for photo in photos]
        placing = None if headings is not None else _placing(match)
        placed = placing and placing(_views(photos, said, evidence))
        fused = fuse_views(said, evidence, headings, placed)
        return apply_photo_colors(
            photos, [build_estimate(answer, fact) for answer, fact in zip(fused, facts, strict=True)]
        )


def estimate_from_prediction(photo: Photo, said: Prediction, given: UserInput = NO_USER_INPUT) -> Estimate:
    """A photo's light by what a network says of its pixels, by its metadata and by what the user says of it.

    Raises ParameterError where the user's own time and place are of night.
    """
    facts = observations_single(photo.metadata, given)
    fused = fuse_single_view(said, facts.evidence, photo.pixels)
    return apply_photo_colors([photo], [build_estimate(fused, facts)])[0]


def _check_asked(photos: object, given: object) -> None:
    """Raise PhotoError for what is no Photo or no list of them, ParameterError for what is no Given."""
    if not isinstance(photos, Sequence):
        raise PhotoError(f"Several photos are given as a list, not as {type(photos).__name__}.")
    for photo in photos:
        check_photo(photo)
    check_given(given)


def apply_photo_colors(photos: Sequence[Photo], estimates: Sequence[Estimate]) -> list[Estimate]:
    """The estimates of photos under one sky, with the colours that they show where irradiances are known.

    The sky has one colour in all of them, the geometric mean of those that are seen; each photo shows its own ground.
    """
    lights = [estimate.lighting for estimate in estimates]
    found = [sky_white_balance(photo.pixels, light) for photo, light in zip(photos, lights, strict=True)]
    if tints := [tint for tint in found if tint is not None]:
        tint = np.exp(np.mean(np.log(tints), axis=0))
        skies = (clipped_colour(sky_irradiance(light) * tint, "sky_irradiance") for light in lights)
        lights = [replace(light, sky_irradiance=sky) for light, sky in zip(lights, skies, strict=True)]
    return [
        replace(estimate, lighting=with_ground(light, estimate_ground_albedo(photo.pixels, light, estimate.around)))
        for photo, estimate, light in zip(photos, estimates, lights, strict=True)
    ]


def _placing(match: bool | RegisterFn) -> RegisterFn | None:
    """What finds where photos look, if anything is to."""
    if isinstance(match, bool):
        return _place if match else None
    return match


def _views(photos: Sequence[Photo], said: Sequence[Prediction], evidence: Sequence[Observations]) -> "list[View]":
    """The photos as they are matched with each other."""
    return [_view(*photo) for photo in zip(photos, said, evidence, strict=True)]


def _view(photo: Photo, said: Prediction, evidence: Observations) -> "View":
    from lighting.registration.photo_set import UP_SIGMA, View

    stood = fuse_gravity(said, evidence)
    camera, gravity = stood.prediction, stood.evidence.gravity
    sigma = UP_SIGMA if gravity is None else min(UP_SIGMA, tilt_spread(gravity))
    return View(
        photo.pixels,
        camera.camera_elevation,
        camera.camera_roll,
        said.vertical_fov,
        evidence.vertical_fov,
        sigma,
    )


def _place(views: "Sequence[View]") -> "tuple[RegisteredView, ...]":
    """Where the photos look, by what they show in common."""
    from lighting.registration.photo_set import register_views

    return register_views([view.shot() for view in views])


def estimate(source: Source, given: UserInput = NO_USER_INPUT) -> Estimate:
    """The light of the photo in a file, in bytes or in a binary stream, by the network in this package.

    Raises PhotoError, ModelError, ParameterError or OSError.
    """
    return _packaged()(read_photo(source), given)


@lru_cache(maxsize=1)
def _packaged() -> Estimator:
    return Estimator()
