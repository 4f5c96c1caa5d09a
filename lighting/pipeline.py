"""The chain from a photo to its light, and nothing else."""

from functools import lru_cache

from lighting.model import Model
from lighting.parameters import Lighting, Prediction, lighting_from
from lighting.photo import Photo, Source, read_photo, to_tensor


class Estimator:
    """A network ready for many photos; `Estimator()(read_photo("photo.jpg"))` is a Lighting."""

    def __init__(self, model: Model | None = None) -> None:
        """Uses the network in this package unless given another; raises ModelError."""
        self.model = model or Model.load()

    def predict(self, photo: Photo) -> Prediction:
        """What the network says about the photo: the sun's probability on its grid, and raw parameters."""
        return self.model.predict(to_tensor(photo, self.model.spec))[0]

    def __call__(self, photo: Photo) -> Lighting:
        """The photo's light."""
        return lighting_from(self.predict(photo))


def estimate(source: Source) -> Lighting:
    """The light of the photo in a file, in bytes or in a binary stream, by the network in this package.

    Raises PhotoError, ModelError or OSError.
    """
    return _packaged()(read_photo(source))


@lru_cache(maxsize=1)
def _packaged() -> Estimator:
    return Estimator()
