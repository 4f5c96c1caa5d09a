"""How two cameras are turned against each other, from what both see.

Far things obey the homography at infinity K R K^-1: a rotation and a focal length are sought that most matches obey
and refined. Where the lens was zoomed, each photo gets a focal length of its own (zoomed.py); where the camera moved
between near things the essential matrix takes over (parallax.py).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.turns.match import Features, Matches, match
from lighting.turns.parallax import LEAST_MOVED, clearly_more, motion, obeying_more
from lighting.turns.rays import focal_of, offsets, project, rays, rotation_about, vertical_fov_of
from lighting.turns.refine import Fit, minimise
from lighting.turns.search import TOLERANCE, search
from lighting.turns.zoomed import Zoomed, zoomed

DIAGONAL_FOVS = np.geomspace(25.0, 115.0, 14)  # deg, tried where the lens is unknown
LEAST_INLIERS = 12  # matches that agree, below which nothing is said
LEAST_SHARE = 0.15  # of the matches in the common part of both photos
LARGEST_SIGMA = 2.0  # deg, beyond which nothing is said
LEAST_STILL = 0.5  # of the matches that obey a motion must obey a rotation too, where the motion stays unknown
LEAST_ZOOMED = 0.95  # of the matches that obey an epipolar geometry must obey a zoom, which is then all there is to it
GUESSED = 0.1  # spread of a focal length's logarithm from which on it is a guess, which does not see a zoom
STILL_SPREAD, MOVED_SPREAD = 1.3, 3.0  # errors over what the scatter of the matches says (`export report photo-sets`)


@dataclass(frozen=True, eq=False)
class Turn:
    """How the second camera is turned against the first."""

    rotation: Floats  # (3, 3) a direction in the first camera's frame (x right, y up, -z ahead) to the second's
    covariance: Floats  # (3, 3) [deg^2] of the small rotation vector in the second's frame that corrects `rotation`
    vertical_fov: tuple[float, float]  # deg, of the first and of the second photo
    fov_sigma: float  # deg, one standard deviation of those; 0 where they were given as exact
    inliers: int  # matches that agree
    matches: int
    translates: bool = False  # whether the camera moved as well, among near things
    zoomed: bool = False  # whether the photos have a focal length each, other than was assumed of them

    @property
    def sigma(self) -> float:
        """Deg, one standard deviation of the turn about its least certain axis."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance)[-1]))


def relative_rotation(
    a: Features, b: Features, fov_a: float | None = None, fov_b: float | None = None, fov_sigma: float = 0.0
) -> Turn | None:
    """The turn from the camera of `a` to that of `b`, or None where they have too little in common to tell.

    `fov_a` and `fov_b` are vertical fields of view [deg]; one alone counts for both, none means one unknown lens.
    `fov_sigma` is how far they may be off [deg]: 0 takes them as exact.
    """
    return rotation_of(match(a, b), (a.width, a.height), (b.width, b.height), (fov_a, fov_b), fov_sigma)


def rotation_of(
    matches: Matches,
    size_a: tuple[int, int],
    size_b: tuple[int, int],
    fovs: tuple[float | None, float | None] = (None, None),
    fov_sigma: float = 0.0,
) -> Turn | None:
    """The same from matches of two photos of these sizes (width, height)."""
    if len(matches) < LEAST_INLIERS:
        return None
    lens = Lens.of(size_a, size_b, fovs, fov_sigma)
    return _turn(matches, lens)


@dataclass(frozen=True)
class Lens:
    """What is known of both focal lengths before a match is seen; as a rule both are off by one factor, the zoom."""

    sizes: tuple[tuple[int, int], tuple[int, int]]  # (width, height) of both photos
    focal: tuple[float, float]  # of both photos [half diagonals]
    spread: float  # one standard deviation of the zoom's logarithm; 0 exact, infinite unknown

    @classmethod
    def of(
        cls, a: tuple[int, int], b: tuple[int, int], fovs: tuple[float | None, float | None], fov_sigma: float
    ) -> "Lens":
        """The lens of two photos with given vertical fields of view [deg]."""
        said = [(focal_of(fov, *size), fov) for fov, size in zip(fovs, (a, b), strict=True) if fov is not None]
        if not said:
            return cls((a, b), (1.0, 1.0), np.inf)
        spread = np.radians(fov_sigma) / np.sin(np.radians(said[0][1]))  # d log f = d fov / sin fov
        return cls((a, b), (said[0][0], said[-1][0]), float(spread))

    def zooms(self) -> list[float]:
        """The zooms to try."""
        if np.isinf(self.spread):
            return [float(z) for z in 1.0 / np.tan(np.radians(DIAGONAL_FOVS) / 2.0)]
        return [1.0] if self.spread < 0.01 else [float(np.exp(k * self.spread)) for k in (-2, -1, 0, 1, 2)]

    def fovs(self, zoom: float) -> tuple[float, float]:
        """Vertical fields of view [deg] of both photos."""
        first, second = (vertical_fov_of(zoom * f, *s) for f, s in zip(self.focal, self.sizes, strict=True))
        return first, second

    def prior(self) -> float:
        """Inverse variance of the zoom's logarithm."""
        return 0.0 if np.isinf(self.spread) else 1.0 / max(self.spread, 1e-9) ** 2


def _turn(matches: Matches, lens: Lens) -> Turn | None:
    still = _rotated(matches, lens)
    obeying = obeying_more(matches, 0 if still is None else still.inliers)
    if obeying is None:
        return still
    believed = still if still is not None and still.inliers >= LEAST_STILL * len(obeying) else None
    found = _lenses_apart(obeying, lens)
    if found is None or clearly_more(len(obeying), int(np.sum(found.inliers))):
        return _moved(obeying, len(matches), lens) or believed
    return (_zoomed(found, len(matches), lens) if np.mean(found.inliers) >= LEAST_ZOOMED else None) or believed


def _rotated(matches: Matches, lens: Lens) -> Turn | None:
    """The turn of a camera that stayed where it was, or looks at far things only."""
    found = search(matches, lens.focal, lens.zooms())
    rotation, zoom = found.rotation, found.zoom
    scale = TOLERANCE * matches.pixel
    for _ in range(2):
        near = distances(matches, rotation, zoom, lens.focal) < 2.0 * scale
        if np.count_nonzero(near) < LEAST_INLIERS:
            return None
        fit = _refined(matches, near, rotation, zoom, lens)
        rotation, zoom = rotation_about(fit.parameters[:3]) @ rotation, zoom * float(np.exp(fit.parameters[3]))
    count = int(np.count_nonzero(distances(matches, rotation, zoom, lens.focal) < scale))
    common = int(np.count_nonzero(_in_common(matches, rotation, zoom, lens)))
    if count < max(LEAST_INLIERS, LEAST_SHARE * common):
        return None
    covariance = 2.0 * STILL_SPREAD**2 * fit.covariance  # each match counts in both photos
    return _sure_enough(Turn(rotation, *_uncertainty(covariance, zoom, lens), count, len(matches)))


def _lenses_apart(obeying: Matches, lens: Lens) -> Zoomed | None:
    """The best turn with a focal length for each photo, where none is known and one does not do for both."""
    if lens.spread < GUESSED:
        return None
    wide = replace(lens, spread=2.0 * lens.spread)  # what photos of several lenses look like is a poorer guess of one
    return zoomed(obeying, lens.focal, wide.zooms(), wide.prior())


def _zoomed(found: Zoomed, matches: int, lens: Lens) -> Turn | None:
    """The turn of a camera that stayed where it was and was zoomed."""
    covariance = 2.0 * STILL_SPREAD**2 * found.covariance  # each match counts in both photos
    uncertainty = _uncertainty(covariance, 1.0, replace(lens, focal=found.focal))
    return _sure_enough(Turn(found.rotation, *uncertainty, int(np.sum(found.inliers)), matches, zoomed=True))


def _moved(obeying: Matches, matches: int, lens: Lens) -> Turn | None:
    """The turn of a camera that walked, by those of so many matches that obey an epipolar geometry."""
    found = motion(obeying, lens.focal, lens.zooms(), lens.prior())
    if found is None or (count := int(np.count_nonzero(found.inliers))) < LEAST_MOVED:
        return None
    uncertainty = _uncertainty(MOVED_SPREAD**2 * found.covariance, found.zoom, lens)
    return _sure_enough(Turn(found.rotation, *uncertainty, count, matches, translates=True))


def _uncertainty(covariance: Floats, zoom: float, lens: Lens) -> tuple[Floats, tuple[float, float], float]:
    """Covariance [deg^2], fields of view [deg] and their standard deviation, by the covariance (4, 4) of a fit."""
    fovs = lens.fovs(zoom)
    sigma = float(np.sqrt(covariance[3, 3]) * np.degrees(np.sin(np.radians(fovs[0]))))
    return np.degrees(np.degrees(covariance[:3, :3])), fovs, sigma


def _sure_enough(turn: Turn) -> Turn | None:
    return turn if turn.sigma <= LARGEST_SIGMA else None


def distances(matches: Matches, rotation: Floats, zoom: float, focal: tuple[float, float]) -> Floats:
    """How far (M,) [half diagonals] each match is from obeying the rotation, in the worse of both photos."""
    own = (zoom * focal[0], zoom * focal[1])
    return np.asarray(np.max(np.linalg.norm(offsets(matches.a, matches.b, rotation, own), axis=-1), axis=0))


def _refined(matches: Matches, near: NDArray[np.bool_], rotation: Floats, zoom: float, lens: Lens) -> Fit:
    a, b = matches.a[near], matches.b[near]

    def residuals(at: Floats) -> Floats:
        scaled = zoom * float(np.exp(at[3]))
        own = (scaled * lens.focal[0], scaled * lens.focal[1])
        return offsets(a, b, rotation_about(at[:3]) @ rotation, own).ravel()

    scale = TOLERANCE * matches.pixel / 2.0
    prior = np.array([0.0, 0.0, 0.0, lens.prior()])
    expected = np.array([0.0, 0.0, 0.0, -np.log(zoom)])
    return minimise(residuals, np.zeros(4), scale, prior, expected)


def _in_common(matches: Matches, rotation: Floats, zoom: float, lens: Lens) -> NDArray[np.bool_]:
    """Which matches' first points the rotation puts inside the second photo."""
    width, height = lens.sizes[1]
    at = np.abs(project(rays(matches.a, zoom * lens.focal[0]) @ rotation.T, zoom * lens.focal[1]))
    half = np.array([width, height]) / np.hypot(width, height)
    return np.asarray(np.all(at <= half, axis=1))
