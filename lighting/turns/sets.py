"""Where the photos of a set look: turns between the pairs that overlap, their lenses, headings about the vertical.

One lens serves all photos, but for those that show things larger than others do from the same point: zoomed ones.

The vertical is the median of what is known of each camera's elevation and roll, carried into one frame; a photo whose
metadata say how it was held counts for more than one of which only the network does.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, wrap_azimuth
from lighting.medians import weighted_median
from lighting.turns.averaging import Oriented, Pairs, average, components
from lighting.turns.match import Features, Matches, features, match
from lighting.turns.rays import focal_of, vertical_fov_of
from lighting.turns.rotation import Turn, rotation_of
from lighting.turns.upright import angles_of, common_up, level, own_up

GUESSED_FOV_SIGMA = 7.0  # deg, of what the network says of a field of view
NOTED_FOV_SIGMA = 1.5  # deg, of what a photo's metadata say
UP_SIGMA = 2.5  # deg, of the vertical by the network, about each horizontal axis
ALL_PAIRS = 8  # photos up to which every pair is matched in full
PARTNERS = 6  # the likeliest of each photo that are matched in larger sets
COARSE = 400  # features, the first, by which they are found


Lens = tuple[float, float]  # focal length [half diagonals] and the standard deviation of its logarithm


@dataclass(frozen=True, eq=False)
class Shot:
    """One photo of a set as far as it is known alone."""

    features: Features
    camera_elevation: float  # deg, by the network and the photo's metadata
    camera_roll: float
    guessed_fov: float  # deg, vertical, by the network
    noted_fov: float | None = None  # by its metadata or its user
    up_sigma: float = UP_SIGMA  # deg, of the vertical that elevation and roll mean, about each horizontal axis

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) [pixels], of which the ratio counts."""
        return self.features.width, self.features.height

    def lens(self) -> Lens:
        """What is said of its lens alone."""
        fov = self.noted_fov or self.guessed_fov
        sigma = GUESSED_FOV_SIGMA if self.noted_fov is None else NOTED_FOV_SIGMA
        return focal_of(fov, *self.size), float(np.radians(sigma) / np.sin(np.radians(fov)))


@dataclass(frozen=True, eq=False)
class View:
    """One photo of a set before features are sought in it."""

    pixels: NDArray[np.uint8]  # (H, W, 3) sRGB, upright
    camera_elevation: float  # deg; this and what follows as in a Shot
    camera_roll: float
    guessed_fov: float
    noted_fov: float | None = None
    up_sigma: float = UP_SIGMA

    def shot(self) -> Shot:
        """The same with its features; MissingExtraError without OpenCV."""
        return Shot(
            features(self.pixels),
            self.camera_elevation,
            self.camera_roll,
            self.guessed_fov,
            self.noted_fov,
            self.up_sigma,
        )


@dataclass(frozen=True)
class Placed:
    """Where one photo of a set looks, as far as matches with the others tell."""

    group: int  # photos of one number are connected by matches
    heading: float  # deg clockwise from the group's first photo
    heading_sigma: float  # deg, one standard deviation of that
    camera_elevation: float  # deg
    camera_roll: float
    vertical_fov: float | None  # deg, as the matches reveal it; None for a photo without any


def place(shots: Sequence[Shot]) -> tuple[Placed, ...]:
    """Where each photo looks."""
    matched = _matched(shots)
    lenses = _lenses(shots)
    pairs = _turns(shots, matched, lenses)
    lenses = _agreed(shots, pairs, lenses)
    zoomed = {pair: turn for pair, turn in pairs.items() if turn.zoomed}
    pairs = _turns(shots, {pair: matched[pair] for pair in pairs if pair not in zoomed}, lenses) | zoomed
    groups = [average(members, pairs) for members in components(len(shots), pairs)]
    return _in_order([_levelled(number, group, shots, lenses) for number, group in enumerate(groups)], groups)


def _matched(shots: Sequence[Shot]) -> dict[tuple[int, int], Matches]:
    pairs = _likely_pairs([shot.features for shot in shots])
    return {(i, j): match(shots[i].features, shots[j].features) for i, j in pairs}


def _likely_pairs(features: Sequence[Features]) -> list[tuple[int, int]]:
    """The pairs worth matching in full: all of a small set, else those of which a few features match."""
    every = list(combinations(range(len(features)), 2))
    if len(features) <= ALL_PAIRS:
        return every
    coarse = [replace(f, points=f.points[:COARSE], descriptors=f.descriptors[:COARSE]) for f in features]
    alike = {(i, j): len(match(coarse[i], coarse[j])) for i, j in every}
    kept: set[tuple[int, int]] = set()
    for photo in range(len(features)):
        own = sorted((pair for pair in every if photo in pair), key=lambda pair: -alike[pair])
        kept.update(own[:PARTNERS])
    return sorted(kept)


def _lenses(shots: Sequence[Shot]) -> list[Lens]:
    """Focal lengths and spreads: photos whose metadata say nothing share the mean of what the network says."""
    said = [shot.lens() for shot in shots]
    guessed = [np.log(focal) for shot, (focal, _) in zip(shots, said, strict=True) if shot.noted_fov is None]
    common = float(np.exp(np.mean(guessed))) if guessed else 1.0
    return [(common if s.noted_fov is None else focal, spread) for s, (focal, spread) in zip(shots, said, strict=True)]


def _turns(
    shots: Sequence[Shot], matched: dict[tuple[int, int], Matches], lenses: Sequence[Lens]
) -> dict[tuple[int, int], Turn]:
    """The pairs that have one."""
    found = {}
    for (i, j), matches in matched.items():
        fovs = (vertical_fov_of(lenses[i][0], *shots[i].size), vertical_fov_of(lenses[j][0], *shots[j].size))
        sigma = float(np.degrees(max(lenses[i][1], lenses[j][1]) * np.sin(np.radians(fovs[0]))))
        turn = rotation_of(matches, shots[i].size, shots[j].size, fovs, sigma)
        if turn is not None:
            found[i, j] = turn
    return found


def _agreed(shots: Sequence[Shot], pairs: Pairs, lenses: Sequence[Lens]) -> list[Lens]:
    """The lenses that the pairs agree on: one for all photos, but in groups where some are zoomed."""
    groups = components(len(shots), pairs)
    own = [group for group in groups if any(turn.zoomed and pair[0] in group for pair, turn in pairs.items())]
    rest = tuple(i for group in groups if group not in own for i in group)
    agreed = dict(enumerate(lenses))
    for family in (*own, rest):
        inside = {pair: turn for pair, turn in pairs.items() if pair[0] in family}
        apart = _ratios(shots, inside, lenses, family)
        scaled = [(focal * apart.get(i, 1.0), spread) for i, (focal, spread) in enumerate(lenses)]
        zoom, spread = _common_zoom(shots, inside, scaled)
        agreed |= {i: (scaled[i][0] * zoom, spread) for i in family}
    return [agreed[i] for i in range(len(shots))]


def _ratios(shots: Sequence[Shot], pairs: Pairs, lenses: Sequence[Lens], members: Sequence[int]) -> dict[int, float]:
    """The factors on focal lengths by which members are zoomed, along the surest pairs from the first of them."""
    found = dict.fromkeys(members[:1], 1.0)
    order = sorted(pairs, key=lambda pair: pairs[pair].sigma)
    while edge := next(((i, j) for i, j in order if (i in found) != (j in found)), None):
        first, second = (
            _scale(shots[k], lenses[k], fov) for k, fov in zip(edge, pairs[edge].vertical_fov, strict=True)
        )
        i, j = edge
        found |= {j: found[i] * second / first} if i in found else {i: found[j] * first / second}
    return found


def _common_zoom(shots: Sequence[Shot], pairs: Pairs, lenses: Sequence[Lens]) -> tuple[float, float]:
    """The factor on all focal lengths that the pairs agree on (weighted median), and its logarithm's spread."""
    if not pairs:
        return 1.0, 0.0
    log, spread = np.array([_zoom(shots[i], lenses[i], turn) for (i, _), turn in pairs.items()]).T
    weight = 1.0 / np.maximum(spread, 1e-4) ** 2
    return float(np.exp(weighted_median(log, weight))), float(weight.sum() ** -0.5)


def _zoom(shot: Shot, lens: Lens, turn: Turn) -> tuple[float, float]:
    """The logarithm of a turn's focal length over the one assumed, and its standard deviation."""
    fov = turn.vertical_fov[0]
    return float(np.log(_scale(shot, lens, fov))), float(np.radians(turn.fov_sigma) / np.sin(np.radians(fov)))


def _scale(shot: Shot, lens: Lens, fov: float) -> float:
    """The focal length that a field of view [deg] means, over the one assumed."""
    return focal_of(fov, *shot.size) / lens[0]


def _levelled(number: int, group: Oriented, shots: Sequence[Shot], lenses: Sequence[Lens]) -> list[Placed]:
    """The photos of one group about their common vertical."""
    own = [shots[i] for i in group.members]
    ups = np.stack([own_up(s.camera_elevation, s.camera_roll) for s in own])
    up_sigma = np.array([s.up_sigma for s in own])
    up = common_up(group.rotations, ups, up_sigma**-2.0)
    heading, elevation, roll = about(up, group.rotations)
    sigma = np.hypot(_turn_sigma(group, up), _tilt_sigma(group.rotations, up, up_sigma))
    alone = len(own) == 1
    return [
        Placed(
            number, float(h), float(s), float(e), float(r), None if alone else vertical_fov_of(lenses[i][0], *shot.size)
        )
        for i, shot, h, s, e, r in zip(group.members, own, heading, sigma, elevation, roll, strict=True)
    ]


def about(up: Floats, rotations: Floats) -> tuple[Floats, Floats, Floats]:
    """Heading from the first camera's, elevation and roll [deg] (n,) of cameras (n, 3, 3) about a vertical (3,)."""
    heading, elevation, roll = angles_of(rotations, level(up))
    return wrap_azimuth(heading - heading[0]), elevation, roll


def _turn_sigma(group: Oriented, up: Floats) -> Floats:
    """Standard deviations (n,) [deg] of the headings by the turns' own uncertainty."""
    own = group.rotations @ up  # the vertical in each camera's frame
    return np.asarray(np.sqrt(np.einsum("ni,nij,nj->n", own, group.covariance, own)))


def _tilt_sigma(rotations: Floats, up: Floats, up_sigma: Floats) -> Floats:
    """Standard deviations (n,) [deg] of the headings by the vertical's uncertainty, with those of all cameras (n,)."""
    spread = min(UP_SIGMA / np.sqrt(min(len(up_sigma), 4)), up_sigma.min())  # cameras of one place err alike
    straight = about(up, rotations)[0]
    across = np.linalg.svd(up[None])[2][1:]
    tilted = [about(up + np.tan(np.radians(spread)) * side, rotations)[0] for side in across]
    return np.asarray(np.linalg.norm([wrap_azimuth(t - straight) for t in tilted], axis=0))


def _in_order(placed: Sequence[Sequence[Placed]], groups: Sequence[Oriented]) -> tuple[Placed, ...]:
    """All photos' places in the order of the photos."""
    by_number = {
        i: p for group, own in zip(groups, placed, strict=True) for i, p in zip(group.members, own, strict=True)
    }
    return tuple(by_number[i] for i in sorted(by_number))
