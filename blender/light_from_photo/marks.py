"""What is drawn along the shadows of a photo, as the command takes it by --shadow; nothing here needs Blender."""

from collections.abc import Sequence
from typing import NamedTuple

Point = tuple[float, float]


class Kind(NamedTuple):
    """A kind of mark: what it is called, the prefix of its text, and what each click is on."""

    label: str
    prefix: str
    clicks: tuple[str, ...]


KINDS = {
    "SHADOW": Kind("Shadow: Foot and Tip", "", ("the foot of what casts it", "the shadow's tip")),
    "TOP": Kind("The Same, with Its Top", "", ("the foot of what casts it", "the shadow's tip", "the thing's top")),
    "LINE": Kind("Edge of a Shadow", "line:", ("a point of the edge", "another point of it")),
    "OWN": Kind("Camera's Own Shadow", "own:", ("the middle of the camera's shadow",)),
    "HEAD": Kind("Shadow of My Head", "head:", ("the head's shadow",)),
    "LIT": Kind("Lit and Shaded Side", "lit:", ("the side in shade", "the side in sunlight")),
    "BORDER": Kind(
        "The Same, with Its Border", "lit:", ("the edge in shade", "the edge in sunlight", "where shade turns to light")
    ),
}
_GUESS = "doubt:"  # the prefix of a shadow whose foot or tip is one


def photo_pixel(click: Point, upper_left: Point, lower_right: Point, size: tuple[int, int]) -> Point | None:
    """The pixel of the upright photo that was clicked; None beside it.

    Args:
        click: in pixels of the window, y upwards.
        upper_left: of the photo in the window.
        lower_right: of the photo in the window.
        size: columns and rows of the photo.
    """
    width, height = lower_right[0] - upper_left[0], upper_left[1] - lower_right[1]
    if width <= 0 or height <= 0:
        return None
    x, y = (click[0] - upper_left[0]) / width, (upper_left[1] - click[1]) / height
    return (x * size[0], y * size[1]) if 0 <= x <= 1 and 0 <= y <= 1 else None


def is_guess(mark: str) -> bool | None:
    """Whether a mark is of a shadow whose foot or tip is a guess; None of what is no shadow with its foot.

    Args:
        mark: as the command takes it.
    """
    return mark.startswith(_GUESS) if ":" not in mark.removeprefix(_GUESS) else None


def turn_guess(mark: str) -> str:
    """A shadow with its foot that is a guess from now on, or no longer.

    Args:
        mark: as the command takes it.
    """
    return mark.removeprefix(_GUESS) if is_guess(mark) else _GUESS + mark


def mark_text(kind: str, points: Sequence[Point]) -> str:
    """A mark such as "310.0,820.0,455.0,790.0".

    Args:
        kind: of KINDS.
        points: pixels of the upright photo, as many as the kind has clicks.
    """
    return KINDS[kind].prefix + ",".join(f"{value:.1f}" for point in points for value in point)
