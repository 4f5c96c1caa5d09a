"""View graph, rotation averaging, common focal length; subprocess wrapper.

One lens serves all photos, but for those that show things larger than others do from the same point: zoomed ones.

The vertical is the median of what is known of each camera's elevation and roll, carried into one frame; a photo whose
metadata say how it was held counts for more than one of which only the network does.

Gauss-Newton on the rotation vectors, each turn weighted by its covariance. Sums of distances are minimised first, which
a turn that contradicts the others cannot hold; then Cauchy's weight takes from such a turn most of what it says.

Features and matches take seconds and hundreds of megabytes, of some photos far more, and nothing in Python interrupts
OpenCV. The process is a new one for each set, so that all it took is given back.
"""

import pickle
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from itertools import combinations
from time import monotonic
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from lighting.circular import weighted_median
from lighting.errors import ErrorCode, LightingError, TurnsError
from lighting.geometry import Floats, wrap_azimuth
from lighting.registration.features import Features, Matches, detect_features, import_opencv, match_features
from lighting.registration.rotations import (
    camera_up,
    consensus_up,
    focal_from_fov,
    fov_from_focal,
    heading_elevation_roll,
    leveling_rotation,
    nearest_rotation,
    rotation_about,
    rotation_vector,
)
from lighting.registration.two_view import RelativeRotation, estimate_rotation
from lighting.runtime import (
    address_space_used,
    claim_stdout,
    exit_after,
    ignore_signals,
    limit_address_space,
    start_python,
)

if TYPE_CHECKING:
    from subprocess import Popen

# Rotation averaging: the orientations of many cameras from the turns of some pairs (Hartley et al. 2013).

Pairs = Mapping[tuple[int, int], RelativeRotation]  # by the numbers of both photos, the lower first

CAUCHY_SCALE = 5.0  # standard deviations from which a turn counts for half
MIN_ROTATION_STD = 0.02  # deg, under which no turn is believed: lenses are not perfect pinholes
STEPS = 20  # under one weight, at most

Weight = Callable[[float], float]


@dataclass(frozen=True, eq=False)
class _Oriented:
    """Cameras that are connected by turns."""

    members: tuple[int, ...]  # numbers of the photos, ascending
    rotations: Floats  # (n, 3, 3) directions in the first member's frame to each member's
    covariance: Floats  # (n, 3, 3) [deg^2] of the small rotation in each member's frame; zero for the first


def _components(count: int, pairs: Pairs) -> list[tuple[int, ...]]:
    """The photos 0 to `count` - 1 in groups that turns connect, each ascending, by their first photo."""
    group = list(range(count))
    for a, b in pairs:
        low, high = sorted((group[a], group[b]))
        group = [low if g == high else g for g in group]
    return [tuple(i for i in range(count) if group[i] == g) for g in sorted(set(group))]


def _average(members: tuple[int, ...], pairs: Pairs) -> _Oriented:
    """The orientations of connected photos."""
    inside = {pair: turn for pair, turn in pairs.items() if pair[0] in members}
    place = {number: k for k, number in enumerate(members)}
    rotations = _along_the_surest(members, inside)
    for weight in (_by_distance, _by_cauchy) if len(members) > 1 else ():
        rotations = _settled(inside, place, rotations, weight)
    return _Oriented(members, nearest_rotation(rotations), _covariances(inside, place, rotations))


def _settled(pairs: Pairs, place: Mapping[int, int], rotations: Floats, weight: Weight) -> Floats:
    """The orientations after as many steps as change anything."""
    for _ in range(STEPS):
        normal, pull = _normal_equations(pairs, place, rotations, weight)
        step = np.linalg.solve(normal, pull).reshape(-1, 3)
        rotations = np.concatenate([rotations[:1], rotation_about(step) @ rotations[1:]])
        if np.abs(step).max() < 1e-9:
            break
    return rotations


def _along_the_surest(members: tuple[int, ...], pairs: Pairs) -> Floats:
    """Orientations (n, 3, 3) by the surest turns that connect all (Prim's spanning tree)."""
    known = {members[0]: np.eye(3)}
    order = sorted(pairs, key=lambda pair: pairs[pair].std)
    while len(known) < len(members):
        a, b = next(pair for pair in order if (pair[0] in known) != (pair[1] in known))
        turn = pairs[a, b].rotation
        known |= {b: turn @ known[a]} if a in known else {a: turn.T @ known[b]}
    return np.array([known[number] for number in members])


def _normal_equations(
    pairs: Pairs, place: Mapping[int, int], rotations: Floats, weigh: Weight
) -> tuple[Floats, Floats]:
    """Matrix (3(n-1), 3(n-1)) and right side of the corrections [rad] of all orientations but the first."""
    size = 3 * len(rotations)
    normal, pull = np.zeros((size, size)), np.zeros(size)
    for (a, b), turn in pairs.items():
        i, j = place[a], place[b]
        expected = rotations[j] @ rotations[i].T
        off = rotation_vector(turn.rotation @ expected.T)
        slope = np.zeros((3, size))
        slope[:, 3 * j : 3 * j + 3], slope[:, 3 * i : 3 * i + 3] = np.eye(3), -expected
        weight = _inverse(turn) * weigh(float(off @ _inverse(turn) @ off))
        normal += slope.T @ weight @ slope
        pull += slope.T @ weight @ off
    return normal[3:, 3:], pull[3:]


def _inverse(turn: RelativeRotation) -> Floats:
    """Inverse covariance (3, 3) [1/rad^2]."""
    return np.asarray(np.linalg.inv(np.radians(np.radians(turn.covariance + MIN_ROTATION_STD**2 * np.eye(3)))))


def _by_distance(square: float) -> float:
    """The weight of a turn this many squared standard deviations off, for the least sum of distances."""
    return 1.0 / max(float(np.sqrt(square)), 0.1)


def _by_cauchy(square: float) -> float:
    return 1.0 / (1.0 + square / CAUCHY_SCALE**2)


def _covariances(pairs: Pairs, place: Mapping[int, int], rotations: Floats) -> Floats:
    if len(rotations) == 1:
        return np.zeros((1, 3, 3))
    inverse = np.linalg.inv(_normal_equations(pairs, place, rotations, _by_cauchy)[0])
    own = [inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(len(rotations) - 1)]
    return np.concatenate([np.zeros((1, 3, 3)), np.degrees(np.degrees(np.array(own)))])


PREDICTED_FOV_STD = 7.0  # deg, of what the network says of a field of view
METADATA_FOV_STD = 1.5  # deg, of what a photo's metadata say
UP_STD = 2.5  # deg, of the vertical by the network, about each horizontal axis
ALL_PAIRS = 8  # photos up to which every pair is matched in full
PARTNERS = 6  # the likeliest of each photo that are matched in larger sets
COARSE = 400  # features, the first, by which they are found


Lens = tuple[float, float]  # focal length [half diagonals] and the standard deviation of its logarithm


@dataclass(frozen=True, eq=False)
class ViewFeatures:
    """One photo of a set as far as it is known alone."""

    features: Features
    camera_elevation: float  # deg, by the network and the photo's metadata
    camera_roll: float
    predicted_fov: float  # deg, vertical, by the network
    metadata_fov: float | None = None  # by its metadata or its user
    up_std: float = UP_STD  # deg, of the vertical that elevation and roll mean, about each horizontal axis

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) [pixels], of which the ratio counts."""
        return self.features.width, self.features.height

    def lens(self) -> Lens:
        """What is said of its lens alone."""
        fov = self.metadata_fov or self.predicted_fov
        sigma = PREDICTED_FOV_STD if self.metadata_fov is None else METADATA_FOV_STD
        return focal_from_fov(fov, *self.size), float(np.radians(sigma) / np.sin(np.radians(fov)))


@dataclass(frozen=True, eq=False)
class View:
    """One photo of a set before features are sought in it."""

    pixels: NDArray[np.uint8]  # (H, W, 3) sRGB, upright
    camera_elevation: float  # deg; this and what follows as in a Shot
    camera_roll: float
    predicted_fov: float
    metadata_fov: float | None = None
    up_std: float = UP_STD

    def shot(self) -> ViewFeatures:
        """The same with its features; MissingExtraError without OpenCV."""
        return ViewFeatures(
            detect_features(self.pixels),
            self.camera_elevation,
            self.camera_roll,
            self.predicted_fov,
            self.metadata_fov,
            self.up_std,
        )


@dataclass(frozen=True)
class RegisteredView:
    """Where one photo of a set looks, as far as matches with the others tell."""

    group: int  # photos of one number are connected by matches
    heading: float  # deg clockwise from the group's first photo
    heading_std: float  # deg, one standard deviation of that
    camera_elevation: float  # deg
    camera_roll: float
    vertical_fov: float | None  # deg, as the matches reveal it; None for a photo without any


def register_views(shots: Sequence[ViewFeatures]) -> tuple[RegisteredView, ...]:
    """Where each photo looks."""
    matched = _matched(shots)
    lenses = _lenses(shots)
    pairs = _turns(shots, matched, lenses)
    lenses = _agreed(shots, pairs, lenses)
    zoomed = {pair: turn for pair, turn in pairs.items() if turn.zoomed}
    pairs = _turns(shots, {pair: matched[pair] for pair in pairs if pair not in zoomed}, lenses) | zoomed
    groups = [_average(members, pairs) for members in _components(len(shots), pairs)]
    return _in_order([_levelled(number, group, shots, lenses) for number, group in enumerate(groups)], groups)


def _matched(shots: Sequence[ViewFeatures]) -> dict[tuple[int, int], Matches]:
    pairs = _likely_pairs([shot.features for shot in shots])
    return {(i, j): match_features(shots[i].features, shots[j].features) for i, j in pairs}


def _likely_pairs(features: Sequence[Features]) -> list[tuple[int, int]]:
    """The pairs worth matching in full: all of a small set, else those of which a few features match."""
    every = list(combinations(range(len(features)), 2))
    if len(features) <= ALL_PAIRS:
        return every
    coarse = [replace(f, points=f.points[:COARSE], descriptors=f.descriptors[:COARSE]) for f in features]
    alike = {(i, j): len(match_features(coarse[i], coarse[j])) for i, j in every}
    kept: set[tuple[int, int]] = set()
    for photo in range(len(features)):
        own = sorted((pair for pair in every if photo in pair), key=lambda pair: -alike[pair])
        kept.update(own[:PARTNERS])
    return sorted(kept)


def _lenses(shots: Sequence[ViewFeatures]) -> list[Lens]:
    """Focal lengths and spreads: photos whose metadata say nothing share the mean of what the network says."""
    said = [shot.lens() for shot in shots]
    guessed = [np.log(focal) for shot, (focal, _) in zip(shots, said, strict=True) if shot.metadata_fov is None]
    common = float(np.exp(np.mean(guessed))) if guessed else 1.0
    return [
        (common if s.metadata_fov is None else focal, spread) for s, (focal, spread) in zip(shots, said, strict=True)
    ]


def _turns(
    shots: Sequence[ViewFeatures], matched: dict[tuple[int, int], Matches], lenses: Sequence[Lens]
) -> dict[tuple[int, int], RelativeRotation]:
    """The pairs that have one."""
    found = {}
    for (i, j), matches in matched.items():
        fovs = (fov_from_focal(lenses[i][0], *shots[i].size), fov_from_focal(lenses[j][0], *shots[j].size))
        sigma = float(np.degrees(max(lenses[i][1], lenses[j][1]) * np.sin(np.radians(fovs[0]))))
        turn = estimate_rotation(matches, shots[i].size, shots[j].size, fovs, sigma)
        if turn is not None:
            found[i, j] = turn
    return found


def _agreed(shots: Sequence[ViewFeatures], pairs: Pairs, lenses: Sequence[Lens]) -> list[Lens]:
    """The lenses that the pairs agree on: one for all photos, but in groups where some are zoomed."""
    groups = _components(len(shots), pairs)
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


def _ratios(
    shots: Sequence[ViewFeatures], pairs: Pairs, lenses: Sequence[Lens], members: Sequence[int]
) -> dict[int, float]:
    """The factors on focal lengths by which members are zoomed, along the surest pairs from the first of them."""
    found = dict.fromkeys(members[:1], 1.0)
    order = sorted(pairs, key=lambda pair: pairs[pair].std)
    while edge := next(((i, j) for i, j in order if (i in found) != (j in found)), None):
        first, second = (
            _scale(shots[k], lenses[k], fov) for k, fov in zip(edge, pairs[edge].vertical_fov, strict=True)
        )
        i, j = edge
        found |= {j: found[i] * second / first} if i in found else {i: found[j] * first / second}
    return found


def _common_zoom(shots: Sequence[ViewFeatures], pairs: Pairs, lenses: Sequence[Lens]) -> tuple[float, float]:
    """The factor on all focal lengths that the pairs agree on (weighted median), and its logarithm's spread."""
    if not pairs:
        return 1.0, 0.0
    log, spread = np.array([_zoom(shots[i], lenses[i], turn) for (i, _), turn in pairs.items()]).T
    weight = 1.0 / np.maximum(spread, 1e-4) ** 2
    return float(np.exp(weighted_median(log, weight))), float(weight.sum() ** -0.5)


def _zoom(shot: ViewFeatures, lens: Lens, turn: RelativeRotation) -> tuple[float, float]:
    """The logarithm of a turn's focal length over the one assumed, and its standard deviation."""
    fov = turn.vertical_fov[0]
    return float(np.log(_scale(shot, lens, fov))), float(np.radians(turn.fov_std) / np.sin(np.radians(fov)))


def _scale(shot: ViewFeatures, lens: Lens, fov: float) -> float:
    """The focal length that a field of view [deg] means, over the one assumed."""
    return focal_from_fov(fov, *shot.size) / lens[0]


def _levelled(
    number: int, group: _Oriented, shots: Sequence[ViewFeatures], lenses: Sequence[Lens]
) -> list[RegisteredView]:
    """The photos of one group about their common vertical."""
    own = [shots[i] for i in group.members]
    ups = np.stack([camera_up(s.camera_elevation, s.camera_roll) for s in own])
    up_std = np.array([s.up_std for s in own])
    up = consensus_up(group.rotations, ups, up_std**-2.0)
    heading, elevation, roll = _about(up, group.rotations)
    sigma = np.hypot(_turn_sigma(group, up), _tilt_sigma(group.rotations, up, up_std))
    alone = len(own) == 1
    return [
        RegisteredView(
            number, float(h), float(s), float(e), float(r), None if alone else fov_from_focal(lenses[i][0], *shot.size)
        )
        for i, shot, h, s, e, r in zip(group.members, own, heading, sigma, elevation, roll, strict=True)
    ]


def _about(up: Floats, rotations: Floats) -> tuple[Floats, Floats, Floats]:
    """Heading from the first camera's, elevation and roll [deg] (n,) of cameras (n, 3, 3) about a vertical (3,)."""
    heading, elevation, roll = heading_elevation_roll(rotations, leveling_rotation(up))
    return wrap_azimuth(heading - heading[0]), elevation, roll


def _turn_sigma(group: _Oriented, up: Floats) -> Floats:
    """Standard deviations (n,) [deg] of the headings by the turns' own uncertainty."""
    own = group.rotations @ up  # the vertical in each camera's frame
    return np.asarray(np.sqrt(np.einsum("ni,nij,nj->n", own, group.covariance, own)))


def _tilt_sigma(rotations: Floats, up: Floats, up_std: Floats) -> Floats:
    """Standard deviations (n,) [deg] of the headings by the vertical's uncertainty, with those of all cameras (n,)."""
    spread = min(UP_STD / np.sqrt(min(len(up_std), 4)), up_std.min())  # cameras of one place err alike
    straight = _about(up, rotations)[0]
    across = np.linalg.svd(up[None])[2][1:]
    tilted = [_about(up + np.tan(np.radians(spread)) * side, rotations)[0] for side in across]
    return np.asarray(np.linalg.norm([wrap_azimuth(t - straight) for t in tilted], axis=0))


def _in_order(placed: Sequence[Sequence[RegisteredView]], groups: Sequence[_Oriented]) -> tuple[RegisteredView, ...]:
    """All photos' places in the order of the photos."""
    by_number = {
        i: p for group, own in zip(groups, placed, strict=True) for i, p in zip(group.members, own, strict=True)
    }
    return tuple(by_number[i] for i in sorted(by_number))


# Where photos look, found in a process of its own, which ends with the answer or is killed.

SECONDS = 10.0  # for a set; eight photos that overlap take half of it on a free CPU
MEMORY = 400_000_000  # bytes beside those that the process has when it starts
PER_PHOTO = 2_000_000  # bytes of MAX_FEATURES features, and of their matches

CODE = "from lighting.registration.photo_set import serve_registration; serve_registration()"

_STEP = 0.1  # seconds after which whoever waits looks up


def _nothing() -> None:
    """No reason to stop."""


def register_views_isolated(
    views: Sequence[View], seconds: float = SECONDS, check: Callable[[], None] = _nothing
) -> tuple[RegisteredView, ...]:
    """Where each photo looks, as `place` finds it.

    `check` is called while the process works, and what it raises ends it. Raises TurnsError where the photos take
    longer than `seconds` or, on Linux, more memory than MEMORY and PER_PHOTO; and MissingExtraError without OpenCV.
    """
    request = _request(views, seconds)
    try:
        process = start_python(CODE)
    except OSError as error:
        raise TurnsError("The process that matches photos with each other does not start.") from error
    said = _told(process, request, seconds, check)
    if said is None:
        raise TurnsError(
            f"Matching the photos with each other takes longer than {seconds:g} seconds.", code=ErrorCode.TIMEOUT
        )
    try:
        answer: tuple[RegisteredView, ...] | LightingError = pickle.loads(said)
    except (EOFError, pickle.UnpicklingError) as error:
        raise TurnsError("Matching the photos with each other needs too much memory, or ended its process.") from error
    if isinstance(answer, LightingError):
        raise answer
    return answer


def _request(views: Sequence[View], seconds: float) -> bytes:
    """What the process reads: the seconds after which nobody waits any more, the memory it may take, and the views."""
    request = BytesIO()
    for part in (seconds, MEMORY + PER_PHOTO * len(views), *views):
        pickle.dump(part, request, pickle.HIGHEST_PROTOCOL)
    return request.getvalue()


def _told(process: "Popen[bytes]", request: bytes, seconds: float, check: Callable[[], None]) -> bytes | None:
    """What the process says to the request; None where it does not say it in time."""
    until = monotonic() + seconds
    with ThreadPoolExecutor(1) as pool:
        said = pool.submit(process.communicate, request)
        try:
            while not said.done() and monotonic() < until:
                check()
                wait([said], _STEP)
            return said.result()[0] if said.done() else None
        finally:
            process.kill()  # which ends the talk, too


def serve_registration() -> None:
    """Answer the one request on stdin; the process ends with it, or a second after nobody waits for it any more."""
    ignore_signals()
    requests, answers = sys.stdin.buffer, claim_stdout()
    pickle.dump(_answer(requests), answers)
    answers.flush()


def _answer(requests: BinaryIO) -> tuple[RegisteredView, ...] | LightingError:
    try:
        import_opencv().setNumThreads(1)
        seconds, memory = pickle.load(requests), pickle.load(requests)
        with exit_after(seconds):
            limit_address_space(address_space_used() + memory)
            return register_views(list(_shots(requests)))
    except LightingError as error:
        return error


def _shots(requests: BinaryIO) -> Iterator[ViewFeatures]:
    """The photos' features, one photo in memory at a time."""
    with suppress(EOFError):
        while True:
            yield pickle.load(requests).shot()
