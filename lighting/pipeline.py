"""The chain from a photo to its light, and nothing else."""

from collections.abc import Sequence
from functools import lru_cache

from lighting.evidence.fusion import Fused, fuse
from lighting.evidence.metadata import Given, Known, known, known_together, lighting_of
from lighting.evidence.together import together
from lighting.model import Model
from lighting.photo.read import Photo, Source, read_photo, to_tensor
from lighting.records import Lighting, Prediction

NOTHING_GIVEN = Given()


class Estimator:
    """A network ready for many photos; `Estimator()(read_photo("photo.jpg"))` is a Lighting."""

    def __init__(self, model: Model | None = None) -> None:
        """Uses the network in this package unless given another; raises ModelError."""
        self.model = model or Model.load()

    def predict(self, photo: Photo) -> Prediction:
        """What the network says about the photo: the sun's probability on its grid, and raw parameters."""
        return self.model.predict(to_tensor(photo, self.model.spec))[0]

    def fuse(self, photo: Photo, given: Given = NOTHING_GIVEN) -> tuple[Fused, Known]:
        """What pixels, metadata and user say together; ParameterError where the user's time and place are of night."""
        facts = known(photo.facts, given)
        return fuse(self.predict(photo), facts.evidence), facts

    def fuse_together(
        self, photos: Sequence[Photo], given: Given = NOTHING_GIVEN, headings: Sequence[float] | None = None
    ) -> list[tuple[Fused, Known]]:
        """The same for photos of one place and light; `headings` [deg] are theirs from any common direction."""
        facts = known_together([photo.facts for photo in photos], given)
        answers = together([self.predict(photo) for photo in photos], [fact.evidence for fact in facts], headings)
        return list(zip(answers, facts, strict=True))

    def __call__(self, photo: Photo, given: Given = NOTHING_GIVEN) -> Lighting:
        """The photo's light, by its pixels, its metadata and what is given; raises as `fuse` does."""
        return lighting_of(*self.fuse(photo, given))


def estimate(source: Source, given: Given = NOTHING_GIVEN) -> Lighting:
    """The light of the photo in a file, in bytes or in a binary stream, by the network in this package.

    Raises PhotoError, ModelError, ParameterError or OSError.
    """
    return _packaged()(read_photo(source), given)


@lru_cache(maxsize=1)
def _packaged() -> Estimator:
    return Estimator()
