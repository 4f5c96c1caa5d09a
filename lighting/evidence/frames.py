"""Which photos taken together share a frame, and how they are turned in it."""

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lighting.circular import mean_angle
from lighting.errors import ErrorCode, ParameterError
from lighting.evidence.fusion import GROSS_ERRORS, Evidence
from lighting.geometry import Floats, angle_between, up_in_camera, wrap_azimuth
from lighting.ranges import check_range, is_finite
from lighting.records import EvidenceKind, Prediction

if TYPE_CHECKING:
    from lighting.turns import Placed

MISMATCHES = 0.01  # share of the turns by matches that are useless; `export report photo-sets` found none in 75 pairs
CONTRARY = 25.0  # deg between two verticals, five times what nine of ten photos err in their camera's elevation
TURN_NOISE = 10.0  # deg, spread of the turn between two compass headings of one phone, whose larger error is shared


@dataclass(frozen=True, eq=False)
class Frames:
    """How photos are turned: those of one group against each other, and nothing between the groups."""

    group: NDArray[np.intp]  # (n,) number of each photo's group
    turn: Floats  # (n,) deg clockwise from the group's zero
    noise: Floats  # (n,) deg, one standard deviation of that
    useless: float = 0.0  # share of the turns that say nothing, whatever their standard deviation
    source: EvidenceKind | None = None  # HEADING by compass, TURNS by matches

    def members(self) -> list[NDArray[np.intp]]:
        """The photos (m,) of each group."""
        return [np.flatnonzero(self.group == number) for number in np.unique(self.group)]

    def part(self, own: NDArray[np.intp]) -> "Frames":
        """The same of some photos alone."""
        return replace(self, group=self.group[own], turn=self.turn[own], noise=self.noise[own])

    def has_company(self, photo: int) -> bool:
        """Whether something connects this photo with another one."""
        return bool(np.count_nonzero(self.group == self.group[photo]) > 1)

    def heading_of_first(self, photo: int) -> float | None:
        """Deg clockwise from the first photo to this one; None where they are of two groups."""
        same = self.group[photo] == self.group[0]
        return float(self.turn[photo] - self.turn[0]) if same else None


def contrary_up(prediction: Prediction, placed: "Placed") -> tuple[str, ...]:
    """A warning where the photo alone has up elsewhere than what it has in common with the others."""
    angles = ((p.camera_elevation, p.camera_roll) for p in (prediction, placed))
    apart = float(angle_between(*(up_in_camera(*tilt) for tilt in angles)))
    if apart < CONTRARY:
        return ()
    return (
        f"Alone it has up {apart:.0f}° from where the photos have it together: one of them may lie on its side, "
        "and the turns may be wrong.",
    )


def check_headings(photos: int, headings: Sequence[float] | None) -> None:
    """Raise ParameterError unless there is one heading, a finite number, for each of several photos, or none at all."""
    if not isinstance(headings, Sequence | np.ndarray | None):
        sentence = f"headings are a list of degrees, not {reprlib.repr(headings)}."
        raise ParameterError(sentence, "headings", ErrorCode.WRONG_TYPE)
    if headings is not None and photos == 1:
        sentence = "headings are those of several photos; one photo has a heading."
        raise ParameterError(sentence, "headings", ErrorCode.CONTRADICTION)
    if headings is not None and len(headings) != photos:
        sentence = f"{photos} photos need {photos} headings, not {len(headings)}."
        raise ParameterError(sentence, "headings", ErrorCode.CONTRADICTION)
    for heading in () if headings is None else headings:
        if not is_finite(heading.item() if isinstance(heading, np.generic) else heading):
            sentence = f"A heading must be a finite number, not {reprlib.repr(heading)}."
            raise ParameterError(sentence, "headings", ErrorCode.WRONG_TYPE)


def check_heading(photos: int, heading: float | None) -> None:
    """Raise ParameterError where the one heading is given for several photos."""
    if heading is not None and photos > 1:
        sentence = "heading is that of one photo; photos taken together have headings."
        raise ParameterError(sentence, "heading", ErrorCode.CONTRADICTION)


def read_headings(text: str) -> list[float]:
    """Degrees in "0,45,90", as `together` takes them; ParameterError otherwise."""
    try:
        headings = [float(part) for part in text.split(",")]
    except ValueError as error:
        sentence = f"{text!r} is not a list of degrees such as 0,45,90."
        raise ParameterError(sentence, "headings", ErrorCode.MALFORMED) from error
    for angle in headings:
        check_range("headings", angle, -360.0, 360.0, "A heading")
    return headings


def frames(
    evidence: Sequence[Evidence], headings: Sequence[float] | None, placed: "Sequence[Placed] | None" = None
) -> Frames:
    """By exact headings [deg] if given; else by matches, by compass headings where all have one, or unknown.

    Compass headings bring groups that matches left apart into one frame.
    """
    count = len(evidence)
    together = np.zeros(count, dtype=np.intp)
    compass = [e.heading for e in evidence if e.heading is not None]
    if headings is not None:
        check_headings(count, headings)
        return Frames(together, np.array(headings, dtype=np.float64), np.zeros(count))
    if placed is not None and len({p.group for p in placed}) < count:
        matched = _by_matches(placed)
        return _joined(matched, np.array(compass)) if len(compass) == count and matched.group.any() else matched
    if len(compass) == count:
        return Frames(together, np.array(compass), np.full(count, TURN_NOISE), GROSS_ERRORS, EvidenceKind.HEADING)
    return Frames(np.arange(count), np.zeros(count), np.zeros(count))


def _by_matches(placed: "Sequence[Placed]") -> Frames:
    group, turn, noise = ([getattr(p, name) for p in placed] for name in ("group", "heading", "heading_sigma"))
    return Frames(np.array(group, dtype=np.intp), np.array(turn), np.array(noise), MISMATCHES, EvidenceKind.TURNS)


def _joined(matched: Frames, compass: Floats) -> Frames:
    """One frame of all groups: each is turned as its compasses say in the mean."""
    turn, noise = matched.turn.copy(), matched.noise.copy()
    for own in matched.members():
        turn[own] += mean_angle(wrap_azimuth(compass[own] - matched.turn[own]))
        noise[own] = np.hypot(noise[own], TURN_NOISE / np.sqrt(len(own)))
    return Frames(np.zeros_like(matched.group), turn, noise, GROSS_ERRORS, EvidenceKind.TURNS)
