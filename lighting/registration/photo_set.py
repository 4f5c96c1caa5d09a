"""Registration of a set of photos: which way each camera looks, by matches between pairs of them.

One lens serves all photos, but for those that show things larger than others do from the same point: zoomed ones.

The vertical is the median of each camera's own, by its elevation and roll, carried into one frame. A photo whose
metadata have its tilt counts for more than one of which only the network tells it.

Features and matches take seconds and hundreds of megabytes, of some photos far more, and nothing in Python interrupts
OpenCV. The process is a new one for each set, so that all it took is given back.
"""

import pickle
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field, fields, replace
from itertools import combinations
from time import monotonic
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

import lighting.runtime as runtime
from lighting.errors import ErrorCode, LightingError, TurnsError
from lighting.geometry import Floats, wrap_azimuth
from lighting.registration.features import Features, Matches, detect_features, import_opencv, match_features
from lighting.registration.rotation_averaging import (
    OrientedGroup,
    PairRotations,
    average_rotations,
    connected_components,
)
from lighting.registration.rotations import (
    camera_up,
    consensus_up,
    focal_from_fov,
    fov_from_focal,
    heading_elevation_roll,
    leveling_rotation,
)
from lighting.registration.two_view import RelativeRotation, estimate_rotation
from lighting.sun_grid import weighted_median

if TYPE_CHECKING:
    from subprocess import Popen


_PREDICTED_FOV_STD = 7.0  # deg, of what the network says of a field of view
_METADATA_FOV_STD = 1.5  # deg, of what a photo's metadata say
UP_STD = 2.5  # deg, of the vertical by the network, about each horizontal axis
_MAX_EXHAUSTIVE = 8  # photos up to which every pair is matched in full
_MAX_PARTNERS = 6  # the likeliest of each photo that are matched in larger sets
_COARSE_FEATURES = 400  # the first, by which those partners are chosen

BASE_MEMORY = 400_000_000  # bytes that matching may take beside those that its process has when it starts
MEMORY_PER_PHOTO = 2_000_000  # bytes of MAX_FEATURES features, and of their matches
CODE = "from lighting.registration.photo_set import _serve_registration; _serve_registration()"
MATCHING_SECONDS = 10.0  # s, for a set; eight photos that overlap take half of it on a free CPU
_STEP = 0.1  # s after which whoever waits looks up

Lens = tuple[float, float]  # focal length [half diagonals] and the standard deviation of its logarithm


@dataclass(frozen=True, eq=False)
class _CameraGuess:
    """What is known of a photo's camera before the photo is compared with others."""

    camera_elevation: float
    """Deg, by the network and the photo's metadata: positive looks up."""
    camera_roll: float
    """Deg, -180 to 180: positive turns the camera clockwise."""
    predicted_fov: float
    """Deg, 1 to 170, vertical field of view by the network."""
    metadata_fov: float | None = None
    """Deg, 1 to 170, vertical field of view by the metadata or the user. None: unknown."""
    up_std: float = UP_STD
    """Deg, of the vertical that elevation and roll mean, about each horizontal axis."""


@dataclass(frozen=True, eq=False)
class ViewFeatures(_CameraGuess):
    """One photo of a set, before it is compared with others."""

    features: Features = field(kw_only=True)
    """What is recognized elsewhere."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels, of which the ratio counts."""
        return self.features.size

    def lens_prior(self) -> Lens:
        """Its lens by metadata or network alone."""
        fov = self.metadata_fov or self.predicted_fov
        std = _PREDICTED_FOV_STD if self.metadata_fov is None else _METADATA_FOV_STD
        return focal_from_fov(fov, *self.size), float(np.radians(std) / np.sin(np.radians(fov)))


@dataclass(frozen=True, eq=False)
class View(_CameraGuess):
    """One photo of a set before features are sought in it."""

    pixels: NDArray[np.uint8] = field(kw_only=True)
    """(H, W, 3) sRGB, upright."""

    def with_features(self) -> ViewFeatures:
        """The same with its features; MissingExtraError without OpenCV."""
        known = {known.name: getattr(self, known.name) for known in fields(_CameraGuess)}
        return ViewFeatures(**known, features=detect_features(self.pixels))


@dataclass(frozen=True)
class RegisteredView:
    """Where one photo of a set looks, by its matches with the others."""

    group: int
    """Photos of one number are connected by matches."""
    heading: float
    """Deg clockwise from the group's first photo."""
    heading_std: float
    """Deg, one standard deviation of that."""
    camera_elevation: float
    """Camera elevation, deg."""
    camera_roll: float
    """Deg, -180 to 180: positive turns the camera clockwise."""
    vertical_fov: float | None
    """Deg, as the matches reveal it; None for a photo without any."""


def register_views(views: Sequence[ViewFeatures]) -> tuple[RegisteredView, ...]:
    """Where each photo looks.

    Args:
        views: the photos with their features.
    """
    likely = _likely_pairs([view.features for view in views])
    matched = {(i, j): match_features(views[i].features, views[j].features) for i, j in likely}
    lenses = _initial_lenses(views)
    pairs = _relative_rotations(views, matched, lenses)
    lenses = _agree_on_lenses(views, pairs, lenses)
    zoomed = {pair: relative for pair, relative in pairs.items() if relative.zoomed}
    pairs = _relative_rotations(views, {pair: matched[pair] for pair in pairs if pair not in zoomed}, lenses) | zoomed
    registered: dict[int, RegisteredView] = {}
    for number, members in enumerate(connected_components(len(views), pairs)):
        registered |= _level_group(number, average_rotations(members, pairs), views, lenses)
    return tuple(registered[i] for i in range(len(views)))


def _likely_pairs(features: Sequence[Features]) -> list[tuple[int, int]]:
    """The pairs worth matching in full: all of a small set, else those of which a few features match."""
    every = list(combinations(range(len(features)), 2))
    if len(features) <= _MAX_EXHAUSTIVE:
        return every
    first = slice(_COARSE_FEATURES)
    coarse = [replace(f, points=f.points[first], descriptors=f.descriptors[first]) for f in features]
    match_counts = {(i, j): len(match_features(coarse[i], coarse[j])) for i, j in every}
    kept: set[tuple[int, int]] = set()
    for photo in range(len(features)):
        partners = sorted((pair for pair in every if photo in pair), key=lambda pair: -match_counts[pair])
        kept.update(partners[:_MAX_PARTNERS])
    return sorted(kept)


def _initial_lenses(views: Sequence[ViewFeatures]) -> list[Lens]:
    """Lenses before a match: photos whose metadata say nothing share the mean of what the network says."""
    priors = [view.lens_prior() for view in views]
    log_predicted = [np.log(focal) for view, (focal, _) in zip(views, priors, strict=True) if view.metadata_fov is None]
    common = float(np.exp(np.mean(log_predicted))) if log_predicted else 1.0
    pairs = zip(views, priors, strict=True)
    return [(common if view.metadata_fov is None else focal, log_std) for view, (focal, log_std) in pairs]


def _relative_rotations(
    views: Sequence[ViewFeatures], matched: dict[tuple[int, int], Matches], lenses: Sequence[Lens]
) -> dict[tuple[int, int], RelativeRotation]:
    """The pairs that have one."""
    result = {}
    for (i, j), matches in matched.items():
        fovs = (fov_from_focal(lenses[i][0], *views[i].size), fov_from_focal(lenses[j][0], *views[j].size))
        std = float(np.degrees(max(lenses[i][1], lenses[j][1]) * np.sin(np.radians(fovs[0]))))
        relative = estimate_rotation(matches, views[i].size, views[j].size, fovs, std)
        if relative is not None:
            result[i, j] = relative
    return result


def _agree_on_lenses(views: Sequence[ViewFeatures], pairs: PairRotations, lenses: Sequence[Lens]) -> list[Lens]:
    """The lenses that the pairs agree on: one for all photos, but in groups where some are zoomed."""
    groups = connected_components(len(views), pairs)
    zoomed = [group for group in groups if any(pairs[a, b].zoomed and a in group for a, b in pairs)]
    rest = tuple(i for group in groups if group not in zoomed for i in group)
    agreed = dict(enumerate(lenses))
    for family in (*zoomed, rest):
        inside = {pair: relative for pair, relative in pairs.items() if pair[0] in family}
        zooms = _zoom_ratios(views, inside, lenses, family)
        scaled = [(focal * zooms.get(i, 1.0), log_std) for i, (focal, log_std) in enumerate(lenses)]
        zoom, log_std = _common_zoom(views, inside, scaled)
        agreed |= {i: (scaled[i][0] * zoom, log_std) for i in family}
    return [agreed[i] for i in range(len(views))]


def _zoom_ratios(
    views: Sequence[ViewFeatures], pairs: PairRotations, lenses: Sequence[Lens], members: Sequence[int]
) -> dict[int, float]:
    """The factors on focal lengths by which members are zoomed, along the surest pairs from the first of them."""
    result = dict.fromkeys(members[:1], 1.0)
    order = sorted(pairs, key=lambda pair: pairs[pair].std)
    while edge := next(((i, j) for i, j in order if (i in result) != (j in result)), None):
        (i, j), fovs = edge, pairs[edge].vertical_fov
        first, second = (_scale(views[k], lenses[k], fov) for k, fov in zip(edge, fovs, strict=True))
        result |= {j: result[i] * second / first} if i in result else {i: result[j] * first / second}
    return result


def _common_zoom(views: Sequence[ViewFeatures], pairs: PairRotations, lenses: Sequence[Lens]) -> tuple[float, float]:
    """The weighted median of the factors on all focal lengths, and the standard deviation of its logarithm."""
    if not pairs:
        return 1.0, 0.0
    fovs = [(i, relative.vertical_fov[0], relative.fov_std) for (i, _), relative in pairs.items()]
    log = np.array([float(np.log(_scale(views[i], lenses[i], fov))) for i, fov, _ in fovs])
    log_std = np.array([float(np.radians(std) / np.sin(np.radians(fov))) for _, fov, std in fovs])
    weight = 1.0 / np.maximum(log_std, 1e-4) ** 2
    return float(np.exp(weighted_median(log, weight))), float(weight.sum() ** -0.5)


def _scale(view: ViewFeatures, lens: Lens, fov: float) -> float:
    """The focal length that a field of view [deg] means, over the one assumed."""
    return focal_from_fov(fov, *view.size) / lens[0]


def _level_group(
    number: int, group: OrientedGroup, views: Sequence[ViewFeatures], lenses: Sequence[Lens]
) -> dict[int, RegisteredView]:
    """The photos of one group about their common vertical, by their numbers."""
    members = [views[i] for i in group.members]
    ups = np.stack([camera_up(view.camera_elevation, view.camera_roll) for view in members])
    up_std = np.array([view.up_std for view in members])
    up = consensus_up(group.rotations, ups, up_std**-2.0)
    heading, elevation, roll = _angles_about(up, group.rotations)
    up_in_cameras = group.rotations @ up
    rotation_std = np.sqrt(np.einsum("ni,nij,nj->n", up_in_cameras, group.covariance, up_in_cameras))
    std = np.hypot(rotation_std, _tilt_heading_std(group.rotations, up, up_std))
    fovs = [None if len(members) == 1 else fov_from_focal(lenses[i][0], *views[i].size) for i in group.members]
    poses = np.stack([heading, std, elevation, roll], axis=1).tolist()
    found = zip(group.members, poses, fovs, strict=True)
    return {i: RegisteredView(number, h, s, e, r, fov) for i, (h, s, e, r), fov in found}


def _angles_about(up: Floats, rotations: Floats) -> tuple[Floats, Floats, Floats]:
    """Heading from the first camera's, elevation and roll [deg] (n,) of cameras (n, 3, 3) about a vertical (3,)."""
    heading, elevation, roll = heading_elevation_roll(rotations, leveling_rotation(up))
    return wrap_azimuth(heading - heading[0]), elevation, roll


def _tilt_heading_std(rotations: Floats, up: Floats, up_std: Floats) -> Floats:
    """Standard deviations (n,) [deg] of the headings by the vertical's uncertainty, with those of all cameras (n,)."""
    std = min(UP_STD / np.sqrt(min(len(up_std), 4)), up_std.min())  # cameras of one place err alike
    straight = _angles_about(up, rotations)[0]
    across = np.linalg.svd(up[None])[2][1:]
    tilted = [_angles_about(up + np.tan(np.radians(std)) * side, rotations)[0] for side in across]
    return np.asarray(np.linalg.norm([wrap_azimuth(t - straight) for t in tilted], axis=0))


# Where photos look, found in a process of its own, which ends with the answer or is killed.


def register_views_isolated(
    views: Sequence[View], seconds: float = MATCHING_SECONDS, check: Callable[[], None] = lambda: None
) -> tuple[RegisteredView, ...]:
    """Where each photo looks, as `register_views` finds it, in a process that may be killed.

    Args:
        views: the photos.
        seconds: after which the process is killed.
        check: called while the process works; what it raises ends it.

    Raises:
        TurnsError: the photos take longer or, on Linux, more than BASE_MEMORY and MEMORY_PER_PHOTO.
        MissingExtraError: OpenCV is not installed.
    """
    request = _request(views, seconds)
    try:
        process = runtime.start_python(CODE)
    except OSError as error:
        raise TurnsError("The process that matches photos with each other does not start.") from error
    with runtime.charge_helper(process.pid):
        reply = _read_reply(process, request, seconds, check)
    if reply is None:
        sentence = f"Matching the photos with each other takes longer than {seconds:g} seconds."
        raise TurnsError(sentence, code=ErrorCode.TIMEOUT)
    try:
        answer: tuple[RegisteredView, ...] | LightingError = pickle.loads(reply)
    except (EOFError, pickle.UnpicklingError) as error:
        raise TurnsError("Matching the photos with each other needs too much memory, or ended its process.") from error
    if isinstance(answer, LightingError):
        raise answer
    return answer


def _request(views: Sequence[View], seconds: float) -> bytes:
    """What the process reads: the seconds after which nobody waits any more, memory and number of views, and these."""
    limits = (seconds, BASE_MEMORY + MEMORY_PER_PHOTO * len(views), len(views))
    return b"".join(pickle.dumps(part, pickle.HIGHEST_PROTOCOL) for part in (limits, *views))


def _read_reply(process: "Popen[bytes]", request: bytes, seconds: float, check: Callable[[], None]) -> bytes | None:
    """What the process says to the request; None where it does not say it in time."""
    until = monotonic() + seconds
    with ThreadPoolExecutor(1) as pool:
        reply = pool.submit(process.communicate, request)
        try:
            while not reply.done() and monotonic() < until:
                check()
                wait([reply], _STEP)
            return reply.result()[0] if reply.done() else None
        finally:
            process.kill()  # which ends the talk, too


def _serve_registration() -> None:
    """Answer the one request on stdin; the process ends with it, or a second after nobody waits for it any more."""
    requests, answers = sys.stdin.buffer, runtime.begin_helper()
    pickle.dump(_answer(requests), answers)
    answers.flush()


def _answer(requests: BinaryIO) -> tuple[RegisteredView, ...] | LightingError:
    try:
        import_opencv().setNumThreads(1)
        seconds, memory, count = pickle.load(requests)
        with runtime.exit_after(seconds):
            runtime.limit_address_space(runtime.address_space_used() + memory)
            # One photo in memory at a time.
            return register_views([pickle.load(requests).with_features() for _ in range(count)])
    except LightingError as error:
        return error
