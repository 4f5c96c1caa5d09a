"""The estimates of photos, each apart or all together, with the error of one that failed in its place."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from lighting.cli.files import estimated, load_estimator, open_photo, photo_bytes
from lighting.errors import ParameterError, PhotoError

if TYPE_CHECKING:
    from lighting.evidence import Given
    from lighting.photo import Photo
    from lighting.pipeline import Estimator
    from lighting.records import Estimate

Answers = Iterator[tuple[str, "Estimate | Exception"]]


def answers(
    model: str | None,
    names: Sequence[str],
    given: "Given",
    together: bool = False,
    headings: Sequence[float] | None = None,
) -> Callable[[Iterable[str]], Answers]:
    """A function of the names that gives the estimate of each photo, or the error that it raised, in its place.

    The network is loaded now for several photos, and beside the decoding of one alone. Raises ModelError.
    """
    if len(names) == 1:
        return lambda shown: _each(shown, lambda name: estimated(photo_bytes(name), given, model)[1])
    estimator = load_estimator(model)
    if together:
        return lambda shown: _together(estimator, shown, given, headings)
    return lambda shown: _each(shown, lambda name: estimator(open_photo(name), given))


def _each(names: Iterable[str], find: "Callable[[str], Estimate]") -> Answers:
    for name in names:
        try:
            yield name, find(name)
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
