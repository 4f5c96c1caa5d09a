"""The answers about photos, each apart or all together, with what failed in their place."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from lighting.cli.files import open_photo
from lighting.errors import ParameterError, PhotoError

if TYPE_CHECKING:
    from lighting.evidence.metadata import Given
    from lighting.photo.read import Photo
    from lighting.pipeline import Estimator
    from lighting.records import Lighting

Answer = tuple[str, "Lighting | Exception"]


def answers(estimator: "Estimator", names: Iterable[str], given: "Given") -> Iterator[Answer]:
    """The light of each photo or the error that it made."""
    for name in names:
        try:
            yield name, estimator(open_photo(name), given)
        except (PhotoError, ParameterError, OSError) as error:
            yield name, error


def answers_together(
    estimator: "Estimator", names: Iterable[str], given: "Given", headings: Sequence[float] | None
) -> Iterator[Answer]:
    """First the errors, then the light of the photos that could be read, taken together."""
    from lighting.evidence.metadata import lighting_of

    read: dict[int, tuple[str, Photo]] = {}
    for i, name in enumerate(names):
        try:
            read[i] = name, open_photo(name)
        except (PhotoError, OSError) as error:
            yield name, error
    if not read:
        return
    turns = None if headings is None else [headings[i] for i in read]
    fused = estimator.fuse_together([photo for _, photo in read.values()], given, turns)
    for (name, _), answer in zip(read.values(), fused, strict=True):
        yield name, lighting_of(*answer)
