"""The estimates of photos, each apart or all together, with the error of one that failed in its place."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from lighting.cli.files import open_photo
from lighting.errors import ParameterError, PhotoError

if TYPE_CHECKING:
    from lighting.evidence import Given
    from lighting.photo import Photo
    from lighting.pipeline import Estimator
    from lighting.records import Estimate


def answers(
    estimator: "Estimator",
    names: Iterable[str],
    given: "Given",
    together: bool = False,
    headings: Sequence[float] | None = None,
) -> Iterator[tuple[str, "Estimate | Exception"]]:
    """The estimate of each photo, or the error that it raised, in its place."""
    if together:
        yield from _together(estimator, names, given, headings)
        return
    for name in names:
        try:
            yield name, estimator(open_photo(name), given)
        except (PhotoError, ParameterError, OSError) as error:
            yield name, error


def _together(
    estimator: "Estimator", names: Iterable[str], given: "Given", headings: Sequence[float] | None
) -> Iterator[tuple[str, "Estimate | Exception"]]:
    """First the errors, then the estimates of the photos that could be read, taken together.

    Without headings they are matched with each other where OpenCV is installed.
    """
    from lighting.turns import MAX_SIDE, has_opencv

    match = headings is None and has_opencv()
    read: dict[int, tuple[str, Photo]] = {}
    for i, name in enumerate(names):
        try:
            read[i] = name, open_photo(name, MAX_SIDE if match else None)
        except (PhotoError, OSError) as error:
            yield name, error
    if not read:
        return
    turns = None if headings is None or len(read) == 1 else [headings[i] for i in read]
    found = estimator.together([photo for _, photo in read.values()], given, turns, match=match)
    yield from zip((name for name, _ in read.values()), found, strict=True)
