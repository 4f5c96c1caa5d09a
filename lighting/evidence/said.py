"""What the pixels of one photo say: the network's answer, and what the picture shows beside it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.evidence.calibration import with_lines
from lighting.evidence.given import NOTHING_GIVEN, Given
from lighting.evidence.metadata import camera_evidence
from lighting.evidence.seen import shown_sun, through_camera
from lighting.model import Model
from lighting.photo import Photo, is_empty, is_panorama, to_tensor
from lighting.records import Prediction

_NO_PHOTO = 0.01  # the most that `suitable` is for pictures that are no photo of one view


def said_of(model: Model, photo: Photo, given: Given = NOTHING_GIVEN) -> Prediction:
    """The network's answer for a photo, with the camera by its straight lines too.

    Where the photo or its user says which lens it has, elevation and roll are those of a camera with it.
    """
    said = model.predict(to_tensor(photo, model.spec))[0]
    return as_shown(said, photo.pixels, camera_evidence(photo.facts, given).vertical_fov)


def as_shown(said: Prediction, pixels: NDArray[np.uint8], vertical_fov: float | None = None) -> Prediction:
    """As `upright`; an empty frame or a whole panorama keeps the network's camera, and does not suit."""
    if not (is_empty(pixels) or is_panorama(pixels)):
        return upright(said, pixels, vertical_fov)
    if said.light is None:
        return said
    return replace(said, light=replace(said.light, suitable=min(said.light.suitable, _NO_PHOTO)))


def upright(said: Prediction, pixels: NDArray[np.uint8], vertical_fov: float | None = None) -> Prediction:
    """The same with the camera by the straight lines of the pixels (h, w, 3) too, and by the lens [deg] if known.

    A sun that the photo shows stays on its pixel.
    """
    known = with_lines(said, pixels, vertical_fov)
    sun = None if known is said else shown_sun(said, pixels)
    return known if sun is None else replace(known, sun_probability=through_camera(said, known, sun))
