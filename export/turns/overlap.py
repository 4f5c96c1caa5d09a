"""How far the errors of views correlate by their overlap, and whether regions of several views hold what they say.

The numbers in lighting/evidence/overlap.py are those with the least negative log density at the true suns of one half
of the places that the network never saw, over groups of neighbours and groups dealt at random.
"""

import itertools
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from export.crops import PROTOCOLS, Camera, generator
from export.data import Panorama
from export.turns.groups import predictions
from export.turns.sets import FOVS, HEIGHT, WIDTH, Taken, exposed, photo
from lighting.decoding import sun_of
from lighting.evidence import seen_from
from lighting.evidence.overlap import SUN, Correlation, axes, counts, multiplied
from lighting.geometry import Floats, angle_between, direction
from lighting.model import Model
from lighting.records import Prediction, SunEstimate
from lighting.sun_grid import grid_directions, grid_solid_angle

VIEWS = 30  # of each panorama, by cameras that are held nearly level
TILTED = 8  # of each panorama, by cameras of the protocol `paper`
ROWS = 240  # of each photo, as the network takes
SIZES = (1, 2, 4, 8, 30)
KINDS = ("in any direction", "neighbours")
FARS, MISLED = (0.0, 0.05, 0.1, 0.2, 0.3), (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5)  # tried
CERTAIN = 12.0  # deg, the largest uncertainty of a sun that counts
GROUPS_EACH = 4

Indices = NDArray[np.intp]

_LOWEST = 1e-12


@dataclass(frozen=True, eq=False)
class Views:
    """What the views of one panorama say, in its frame."""

    log: Floats  # (n, N) log densities over the cells
    azimuth: Floats  # (n,) deg
    said: list[Prediction]
    sun: Floats  # (3,) true
    place: str


def views_of(model: Model, panoramas: Sequence[Panorama], *, tilted: bool = False) -> list[Views]:
    """The views of panoramas whose sun is known."""
    around = _tilted if tilted else _around
    return [_views(model, panorama, around(panorama)) for panorama in tqdm(panoramas, unit="panorama")]


def is_certain(panorama: Panorama) -> bool:
    """Whether the panorama's sun is known well enough."""
    return panorama.sun_azimuth is not None and (panorama.sun_uncertainty or np.inf) <= CERTAIN


def _views(model: Model, panorama: Panorama, taken: Sequence[Taken]) -> Views:
    said = predictions(model, taken)
    azimuth = np.array([t.camera.azimuth for t in taken])
    layout = model.spec.sun_grid
    density = [seen_from(p.sun_probability, -a, layout) for p, a in zip(said, azimuth, strict=True)]
    assert panorama.sun_azimuth is not None
    assert panorama.sun_elevation is not None
    sun = direction(panorama.sun_azimuth, max(panorama.sun_elevation, 0.0))
    return Views(np.log(np.maximum(density, _LOWEST)), azimuth, said, sun, panorama.place)


def _around(panorama: Panorama) -> list[Taken]:
    """VIEWS photos by one lens in any direction."""
    rng, linear = generator(panorama.name, VIEWS, "views"), exposed(panorama)
    fov = rng.uniform(*FOVS)
    cameras = [
        Camera(rng.uniform(-180, 180), rng.normal(2, 6), rng.normal(0, 2), fov, WIDTH / HEIGHT) for _ in range(VIEWS)
    ]
    return [Taken(photo(linear, camera, rng.uniform(0.85, 1.15, 3), ROWS), camera) for camera in cameras]


def _tilted(panorama: Panorama) -> list[Taken]:
    """TILTED photos by the cameras of the protocol `paper`, which look up and down by up to 20°."""
    rng, linear = generator(panorama.name, TILTED, "tilted"), exposed(panorama)
    cameras = [PROTOCOLS["paper"](rng) for _ in range(TILTED)]
    return [Taken(photo(linear, camera, np.ones(3), ROWS), camera) for camera in cameras]


def parts(views: Sequence[Views], size: int, kind: str) -> list[tuple[Views, Indices]]:
    """Groups of views, several of each panorama."""
    rng = np.random.default_rng(size)
    return [(v, part) for v in views for part in _dealt(v, size, kind, rng)]


def _dealt(views: Views, size: int, kind: str, rng: np.random.Generator) -> list[Indices]:
    count = len(views.said)
    if size == count:
        return [np.arange(count)]
    if kind == "neighbours":
        order = np.argsort(views.azimuth)
        return [order[(first + np.arange(size)) % count] for first in rng.integers(0, count, GROUPS_EACH)]
    return list(rng.permutation(count)[: count // size * size].reshape(-1, size)[: GROUPS_EACH if size > 1 else None])


def kinds(size: int) -> tuple[str, ...]:
    """Ways to make groups of this size that differ."""
    return KINDS if 1 < size < VIEWS else KINDS[:1]


def learn(views: Sequence[Views]) -> dict[str, float]:
    """The numbers with the least mean negative log density [nat], that, and what those that ship give."""
    loss = {
        (far, misled): mean_loss(views, Correlation(far, misled)) for far, misled in itertools.product(FARS, MISLED)
    }
    far, misled = min(loss, key=lambda pair: loss[pair])
    return {"far": far, "misled": misled, "NLL": loss[far, misled], "NLL, as shipped": mean_loss(views, SUN)}


def halves(views: Sequence[Views]) -> dict[str, dict[str, float]]:
    """What each half of the places teaches, and what that gives on the other one."""
    own = [[v for v in views if zlib.crc32(v.place.encode()) % 2 == half] for half in (0, 1)]
    if not all(own):
        return {}
    learnt = [learn(part) for part in own]
    return {
        f"half {half + 1} of the places": known
        | {"NLL of the other half": mean_loss(own[1 - half], Correlation(known["far"], known["misled"]))}
        for half, known in enumerate(learnt)
    }


def mean_loss(views: Sequence[Views], correlation: Correlation) -> float:
    """The mean negative log density [nat] at the true suns over all sizes and kinds of groups, which count alike."""
    dealt = [parts(views, size, kind) for size in SIZES[1:] for kind in kinds(size)]
    return float(np.mean([np.mean([_loss(v, part, correlation) for v, part in d]) for d in dealt]))


def _together(views: Views, part: Indices, correlation: Correlation) -> Floats:
    """Probabilities (N,) of the cells by some of the views."""
    share = counts(*axes([views.said[i] for i in part], views.azimuth[part]), correlation)
    return multiplied(views.log[part], share, correlation, grid_solid_angle(views.said[0].spec.sun_grid))


def _loss(views: Views, part: Indices, correlation: Correlation) -> float:
    layout = views.said[0].spec.sun_grid
    cell = int(np.argmax(grid_directions(layout) @ views.sun))
    density = _together(views, part, correlation)[cell] / grid_solid_angle(layout)[cell]
    return float(-np.log(max(density, _LOWEST)))


def coverage(views: Sequence[Views], size: int, kind: str) -> dict[str, float]:
    """Error [deg] and shares [%] inside the regions of groups, as shipped; each group counts alike, as in `evaluate`.

    `+-` is the standard error of a share by which places were chosen.
    """
    dealt = parts(views, size, kind)
    suns = [_sun(v, part) for v, part in dealt]
    error = np.array(
        [angle_between(v.sun, direction(s.azimuth, s.elevation)) for (v, _), s in zip(dealt, suns, strict=True)]
    )
    place = np.array([v.place for v, _ in dealt])
    within = {name: error <= [getattr(s, f"radius_{name}") for s in suns] for name in (50, 90)}
    off = {name: 100 * spread_over(hit, place) for name, hit in within.items()}
    return {
        "groups": float(len(dealt)),
        "sun, 50 %": float(np.median(error)),
        "under 45° [%]": 100 * float(np.mean(error < 45.0)),
        "in 50 % region [%]": 100 * float(within[50].mean()),
        "+- of that": off[50],
        "in 90 % region [%]": 100 * float(within[90].mean()),
        "+- of this": off[90],
    }


def spread_over(hit: NDArray[np.bool_], place: NDArray[np.str_]) -> float:
    """The standard error of the mean of `hit` (N,) where values of one of the places (N,) belong together."""
    rest = hit - hit.mean()
    return float(np.sqrt(sum(rest[place == p].sum() ** 2 for p in np.unique(place))) / len(hit))


def _sun(views: Views, part: Indices) -> SunEstimate:
    return sun_of(replace(views.said[0], sun_probability=_together(views, part, SUN)))
