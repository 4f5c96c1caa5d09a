"""From a clip to its shots, each solved as soon as it is over."""

from collections.abc import Callable, Iterator
from typing import Any

from lighting.errors import VideoError
from lighting.evidence import NOTHING_GIVEN, Given
from lighting.model import Model
from lighting.video.clip import Clip
from lighting.video.shot import Shot, solve
from lighting.video.watch import EVERY, shots_watched
from lighting.video.watched import Circumstances


def around(clip: Clip, given: Given) -> Circumstances:
    """What is known of an open clip beside its pixels."""
    if not given.use_exif:
        return Circumstances(given=given)
    return Circumstances(clip.info.facts, clip.info.gimbal, given)


def shots_of(
    clip: Clip,
    model: Model,
    given: Given = NOTHING_GIVEN,
    every: float = EVERY,
    progress: Callable[[float], Any] | None = None,
) -> Iterator[Shot | VideoError]:
    """Each shot of an open clip, or, where there was no light to tell, the reason in its place.

    Raises MissingExtraError, ModelError, and ParameterError where the user's own time and place are of night at the
    clip's first frame.
    """
    circumstances = around(clip, given)
    for watched in shots_watched(clip.frames(), model, every, progress, circumstances.vertical_fov):
        try:
            yield solve(watched, circumstances)
        except VideoError as error:
            first, last = watched.steps[0].time, watched.steps[-1].time
            yield VideoError(f"From {first:.1f} to {last:.1f} s: {error}")
