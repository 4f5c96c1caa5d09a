"""What the network says of one photo's pixels, and what the pixels say of that."""

from dataclasses import replace

from lighting.model import Model
from lighting.photo import Photo, is_empty, is_panorama, to_tensor
from lighting.records import Prediction

_NO_PHOTO = 0.01  # the most that `suitable` is for pictures that are no photo of one view


def said_of(model: Model, photo: Photo) -> Prediction:
    """The network's answer for a photo; it does not suit where it is an empty frame or a whole panorama."""
    said = model.predict(to_tensor(photo, model.spec))[0]
    if said.light is None or not (is_empty(photo.pixels) or is_panorama(photo.pixels)):
        return said
    return replace(said, light=replace(said.light, suitable=min(said.light.suitable, _NO_PHOTO)))
