"""Keyframes of a stream that are remembered, to be recognised: a few for each direction, at most BANK of them.

Keyframes that are linked without a gap form a chain, and their orientations are against that chain's first camera.
Nothing is known of how two chains lie to each other until a keyframe of one is recognised in the other; then the later
chain is turned into the earlier one. That of the first frame is FIRST.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from lighting.geometry import Floats, angle_between
from lighting.video.follow import Key

BANK = 32  # keyframes that are remembered
APART = 12.0  # deg between two of a chain
RECENT = 3  # keyframes; those just before are no news
COMPARED = 3  # keyframes of its own chain, with a new one
STRANGERS = 3  # of other chains, those that seem nearest, and as many of the others, in turn
FIRST = 0  # the chain that headings are against


@dataclass(frozen=True, eq=False)
class Kept:
    """A keyframe of the bank."""

    key: Key
    orientation: Floats  # (3, 3) against the first camera of its chain
    chain: int


class Bank:
    """Keyframes with their orientations, not two of one direction in a chain."""

    def __init__(self) -> None:
        self.kept: list[Kept] = []

    def own(self, key: Key, orientation: Floats, chain: int, within: float) -> Sequence[Kept]:
        """The nearest COMPARED of a new keyframe's chain within an angle [deg], its neighbours in time left out."""
        apart = {i: angle for i, angle in self._apart(orientation).items() if self.kept[i].chain == chain}
        near = sorted((i for i in apart if apart[i] < within and _is_old(self.kept[i].key, key)), key=apart.__getitem__)
        return [self.kept[i] for i in near[:COMPARED]]

    def strangers(self, key: Key, orientation: Floats, chain: int) -> Sequence[Kept]:
        """Keyframes of other chains, whose directions are unknown: none is too far off, and each gets its turn."""
        apart = {i: angle for i, angle in self._apart(orientation).items() if self.kept[i].chain != chain}
        order = sorted(apart, key=apart.__getitem__)
        rest = order[STRANGERS:]
        start = key.number * STRANGERS % max(len(rest), 1)
        return [self.kept[i] for i in [*order[:STRANGERS], *(rest + rest)[start : start + min(STRANGERS, len(rest))]]]

    def add(self, new: Kept) -> None:
        """Remember a keyframe, unless its chain has one of nearly the same direction."""
        if any(angle < APART and self.kept[i].chain == new.chain for i, angle in self._apart(new.orientation).items()):
            return
        self.kept.append(new)
        if len(self.kept) > BANK:
            del self.kept[self._least_missed(new.chain)]

    def join(self, chain: int, other: int, correction: Floats) -> None:
        """Make a chain part of another one, its orientations being turned by a rotation (3, 3)."""
        self.kept = [
            replace(k, orientation=k.orientation @ correction, chain=other) if k.chain == chain else k
            for k in self.kept
        ]

    def _apart(self, orientation: Floats) -> dict[int, float]:
        """Angles [deg] between where each keyframe and a camera look."""
        return {i: float(angle_between(-k.orientation[2], -orientation[2])) for i, k in enumerate(self.kept)}

    def _least_missed(self, chain: int) -> int:
        """The oldest of chains that were left, or of the longer one of the first and the present `chain`.

        The first frame's stays: it is what all headings refer to.
        """
        left = [i for i, k in enumerate(self.kept) if k.chain not in (FIRST, chain)]
        first, present = ([i for i, k in enumerate(self.kept) if k.chain == c] for c in (FIRST, chain))
        return left[0] if left else (present if len(present) > len(first) else first[1:])[0]


def _is_old(kept: Key, new: Key) -> bool:
    return new.number - kept.number > RECENT or new.stretch != kept.stretch
