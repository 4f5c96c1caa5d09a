"""What a person draws in a photo, as records, texts and checks: lines, a thing of known size, a spot, shadows.

Points are (x, y) in pixels of the upright photo. `drawn_camera` and `shadows` say what follows from them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from numbers import Real
from typing import Any, TypeVar, cast

from lighting.errors import ErrorCode, ParameterError
from lighting.fields import is_finite

_Drawn = TypeVar("_Drawn")
Point = tuple[float, float]
Line = tuple[float, float, float, float]

_MIN_LINE_LENGTH = 10.0  # pixels
_MIN_SHADOW_LENGTH = 3.0  # pixels
_LINES = {"horizon": "The horizon", "verticals": "A wall's edge", "reference": "The thing of known size"}  # by field


@dataclass(frozen=True)
class Reference:
    """A thing of known size that stands on the ground, or lies on it; points are (x, y) pixels of the upright photo."""

    start: Point
    """Its foot; of one that lies, an end of it."""
    end: Point
    """Its upper end; of one that lies, the other end."""
    meters: float
    """How long it is, 0.01 to 1000."""
    lies: bool = False
    """Whether it lies on the ground, where any two points of the ground do."""

    def __post_init__(self) -> None:
        for name in ("start", "end"):  # also of a list or an array
            object.__setattr__(self, name, tuple(getattr(self, name)))


@dataclass(frozen=True)
class LevelLines:
    """Edges that are level in the world and parallel to each other, two or more; x, y, x, y in pixels."""

    lines: tuple[Line, ...]
    """One of each edge."""


@dataclass(frozen=True)
class KnownCamera:
    """A camera that another program has found."""

    elevation: float
    """Deg, -90 to 90: positive looks up."""
    roll: float
    """Deg, -180 to 180: positive turns the camera clockwise."""
    vertical_fov: float
    """Deg, 1 to 170, of the whole upright picture."""


@dataclass(frozen=True)
class DrawnCamera:
    """What a person states of the camera in one photo; lines are x, y, x, y in pixels."""

    horizon: Line | None = None
    """Two points of the horizon. None: not drawn."""
    verticals: tuple[Line, ...] = ()
    """Edges that stand upright in the world."""
    levels: tuple[LevelLines, ...] = ()
    """Level edges, one for each direction."""
    known: KnownCamera | None = None
    """In place of lines. None: not known."""


def read_line(text: str, field: str) -> Line:
    """Read a line such as "0,410,1200,395".

    Args:
        text: x and y of its ends in pixels of the upright photo.
        field: that it is for, in the error.

    Raises:
        ParameterError: for any other text.
    """
    match _numbers(text):
        case [a, b, c, d]:
            return a, b, c, d
    sentence = f"{text!r} is no line in pixels such as 0,410,1200,395."
    raise ParameterError(sentence, field, ErrorCode.MALFORMED)


def read_edge(text: str) -> Line | LevelLines:
    """Read an upright line such as "80,700,95,150", or level ones such as "level:80,300,500,340,80,600,500,560".

    Args:
        text: x and y of a line's ends in pixels of the upright photo; after "level:" those of two or more lines.

    Raises:
        ParameterError: for any other text.
    """
    kind, _, numbers = text.strip().rpartition(":")
    match kind, _numbers(numbers):
        case "", [a, b, c, d]:
            return a, b, c, d
        case "level", [_, _, _, _, _, _, _, _, *_] as found if len(found) % 4 == 0:
            return LevelLines(tuple((a, b, c, d) for a, b, c, d in zip(*(found[i::4] for i in range(4)), strict=True)))
    sentence = f"{text!r} is no edge in pixels such as 80,700,95,150 or level:80,300,500,340,80,600,500,560."
    raise ParameterError(sentence, "verticals", ErrorCode.MALFORMED)


def read_spot(text: str) -> Point:
    """Read a spot such as "640,820".

    Args:
        text: x and y in pixels of the upright photo.

    Raises:
        ParameterError: for any other text.
    """
    match _numbers(text):
        case [x, y]:
            return x, y
    raise ParameterError(f"{text!r} is no spot in pixels such as 640,820.", "spot", ErrorCode.MALFORMED)


def read_reference(text: str) -> Reference:
    """Read a thing of known size such as "310,820,305,400,1.8" or "ground:300,900,700,880,5".

    Args:
        text: its foot and its upper end in pixels of the upright photo, and meters; after "ground:" the two ends of
            what lies on the ground.

    Raises:
        ParameterError: for any other text.
    """
    kind, _, numbers = text.strip().rpartition(":")
    match kind, _numbers(numbers):
        case (("" | "ground"), [a, b, c, d, meters]):
            return Reference((a, b), (c, d), meters, kind == "ground")
    sentence = f"{text!r} is no thing of known size such as 310,820,305,400,1.8 or ground:300,900,700,880,5."
    raise ParameterError(sentence, "reference", ErrorCode.MALFORMED)


def _numbers(text: str) -> list[float]:
    try:
        return [float(number) for number in text.split(",")]
    except ValueError:
        return []


def check_line(line: object, field: str) -> None:
    """Raise ParameterError for what is no line of a photo.

    Args:
        line: what a caller passed as one.
        field: that it is for.
    """
    if not isinstance(line, tuple) or len(line) != 4 or not all(map(is_finite, line)):
        sentence = "A line is four numbers: x and y of its two ends, in pixels."
        raise ParameterError(sentence, field, ErrorCode.WRONG_TYPE)
    if math.dist(line[:2], line[2:]) < _MIN_LINE_LENGTH:
        sentence = f"{_LINES.get(field, 'A line')} is shorter than {_MIN_LINE_LENGTH:.0f} pixels; draw a longer one."
        raise ParameterError(sentence, field, ErrorCode.OUT_OF_RANGE)
    if field == "horizon" and abs(line[3] - line[1]) > abs(line[2] - line[0]):
        sentence = "The horizon is steeper than 45°; draw it from side to side of the upright photo."
        raise ParameterError(sentence, field, ErrorCode.OUT_OF_RANGE)


def check_edge(edge: object) -> None:
    """Raise ParameterError for what is neither an upright line nor level ones.

    Args:
        edge: what a caller passed as one.
    """
    if not isinstance(edge, LevelLines):
        check_line(edge, "verticals")
        return
    if not isinstance(edge.lines, tuple) or len(edge.lines) < 2:
        sentence = "Level lines are two or more that are parallel in the world."
        raise ParameterError(sentence, "verticals", ErrorCode.WRONG_TYPE)
    for line in edge.lines:
        check_line(line, "verticals")


def check_spot(spot: object) -> None:
    """Raise ParameterError for what is no point of a photo.

    Args:
        spot: what a caller passed as one.
    """
    if not isinstance(spot, tuple) or len(spot) != 2 or not all(map(is_finite, spot)):
        raise ParameterError("A spot is two numbers: x and y, in pixels.", "spot", ErrorCode.WRONG_TYPE)


def check_reference(reference: object) -> None:
    """Raise ParameterError for what is no thing of known size.

    Args:
        reference: what a caller passed as one.
    """
    if not isinstance(reference, Reference):
        sentence = "A reference is a Reference, or a text such as 310,820,305,400,1.8."
        raise ParameterError(sentence, "reference", ErrorCode.WRONG_TYPE)
    check_line((*reference.start, *reference.end), "reference")
    if not (is_finite(reference.meters) and 0.01 <= reference.meters <= 1000):
        sentence = f"A reference is 0.01 to 1000 meters long, not {reference.meters!r}."
        raise ParameterError(sentence, "reference", ErrorCode.OUT_OF_RANGE)


@dataclass(frozen=True)
class Shadow:
    """The shadow of an upright thing on level ground; points are (x, y) pixels of the upright photo."""

    foot: Point
    """Where the thing stands, at whose foot its shadow begins."""
    tip: Point
    """Where its shadow ends, or the photo."""
    top: Point | None = None
    """The thing's upper end, whose shadow the tip is. None: not in the picture, or the tip is not."""
    is_doubted: bool = False
    """Whether who marks it doubts it: foot or tip is guessed, the thing leans, or the ground slopes."""


@dataclass(frozen=True)
class OwnShadow:
    """The shadow of the camera, or of the head of who holds it; the point is (x, y) pixels of the upright photo."""

    point: Point
    """Its middle."""
    is_head: bool = False
    """Whether it is the head's, which tells the azimuth alone."""


@dataclass(frozen=True)
class ShadowLine:
    """A straight edge of a shadow on level ground, cast by something upright; points as in `Shadow`, in any order."""

    start: Point
    """One point on it."""
    end: Point
    """Another one."""


@dataclass(frozen=True)
class LitSide:
    """The two sides of a wall's corner, a post or a trunk; points as in `Shadow`."""

    shaded: Point
    """On the side in shade."""
    lit: Point
    """On the side that the sun lights."""
    border: Point | None = None
    """Where shade turns into light; the other two points are then the thing's edges. None: not told."""


ShadowMark = Shadow | OwnShadow | ShadowLine | LitSide


def marked_points(mark: ShadowMark) -> list[Point]:
    """Return the points of a mark, (x, y) in its own order.

    Args:
        mark: of any kind.
    """
    points = [getattr(mark, name) for name in mark.__dataclass_fields__]
    return [point for point in points if isinstance(point, tuple)]


def move_drawn(drawn: _Drawn, right: float, down: float) -> _Drawn:
    """Return what a person drew with all its points moved.

    Args:
        drawn: a point, a line, a record of this module, or a tuple of such; what else it holds stays.
        right: pixels.
        down: pixels.
    """
    moved: Any = drawn
    match moved:
        case (Real(), *_):
            moved = tuple(value + (down if number % 2 else right) for number, value in enumerate(moved))
        case tuple():
            moved = tuple(move_drawn(part, right, down) for part in moved)
        case _ if names := getattr(moved, "__dataclass_fields__", ()):
            moved = replace(moved, **{name: move_drawn(getattr(moved, name), right, down) for name in names})
    return cast(_Drawn, moved)


def read_shadow(text: str) -> ShadowMark:
    """Read a mark as the command line and HTTP write it.

    Args:
        text: pixels of the upright photo. A shadow is "FOOT_X,FOOT_Y,TIP_X,TIP_Y", with ",TOP_X,TOP_Y" where the
            thing's top is seen, and "doubt:" before it where foot or tip is a guess. Others are "own:X,Y", "head:X,Y",
            "line:X,Y,X,Y" and "lit:X,Y,X,Y". The last goes from shade to light; ",X,Y" may add their border.

    Raises:
        ParameterError: for any other text.
    """
    kind, colon, numbers = text.strip().rpartition(":")
    values = _numbers(numbers)
    points = list(zip(values[::2], values[1::2], strict=False)) if len(values) % 2 == 0 else []
    make = _KINDS.get(kind) if kind or not colon else None
    if make is None or len(points) not in make[0]:
        sentence = f"{text!r} is no shadow such as 310,820,455,790 (foot and tip), own:300,900 or lit:500,400,560,400."
        raise ParameterError(sentence, "shadows", ErrorCode.MALFORMED)
    return make[1](*points)


_KINDS: dict[str, tuple[tuple[int, ...], Callable[..., ShadowMark]]] = {  # by prefix: how many points, and the mark
    "": ((2, 3), Shadow),
    "doubt": ((2, 3), partial(Shadow, is_doubted=True)),
    "own": ((1,), OwnShadow),
    "head": ((1,), partial(OwnShadow, is_head=True)),
    "line": ((2,), ShadowLine),
    "lit": ((2, 3), LitSide),
}


def check_marks(marks: object) -> None:
    """Raise ParameterError for what are no marks, or marks that say nothing.

    Args:
        marks: what a caller passed as a tuple of marks.
    """
    if not isinstance(marks, tuple) or not all(isinstance(mark, ShadowMark) for mark in marks):
        sentence = "Shadows are a tuple of Shadow, OwnShadow, ShadowLine and LitSide."
        raise ParameterError(sentence, "shadows", ErrorCode.WRONG_TYPE)
    for mark in marks:
        points = marked_points(mark)
        for point in points:
            if len(point) != 2 or not all(isinstance(v, int | float) and math.isfinite(v) for v in point):
                sentence = "A point of a shadow is two numbers, x and y in pixels."
                raise ParameterError(sentence, "shadows", ErrorCode.WRONG_TYPE)
        if len(points) > 1 and math.dist(points[0], points[1]) < _MIN_SHADOW_LENGTH:
            sentence = "The two ends of a shadow are the same point; mark where it begins and where it ends."
            raise ParameterError(sentence, "shadows", ErrorCode.CONTRADICTION)
