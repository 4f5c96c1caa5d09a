"""How far the errors of views correlate by their overlap, and whether regions of several views hold what they say.

The correlations in lighting/evidence/overlap.py are those with the least negative log density at the true suns of
places that the network never saw, over groups of neighbours and groups dealt at random.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from export.crops import Camera, generator
from export.data import Panorama
from export.turns.groups import predictions
from export.turns.sets import FOVS, HEIGHT, WIDTH, Taken, exposed, photo
from lighting.decoding import sun_of
from lighting.evidence import seen_from
from lighting.evidence.overlap import SUN, Correlation, axes, counts
from lighting.geometry import Floats, angle_between, direction
from lighting.model import Model
from lighting.records import Prediction, SunEstimate
from lighting.sun_grid import grid_directions, grid_solid_angle

VIEWS = 30  # of each panorama
ROWS = 240  # of each photo, as the network takes
SIZES = (1, 2, 4, 8, 30)
KINDS = ("dealt at random", "neighbours")
FARS, NEARS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3), (0.5, 0.8, 1.0)  # tried
CERTAIN = 12.0  # deg, the largest uncertainty of a sun that counts
GROUPS_EACH = 4

Indices = NDArray[np.intp]

_LOWEST = 1e-12


@dataclass(frozen=True, eq=False)
class Views:
    """What the views of one panorama say, in its frame."""

    log: Floats  # (VIEWS, N) log densities over the cells
    azimuth: Floats  # (VIEWS,) deg
    said: list[Prediction]
    sun: Floats  # (3,) true
    place: str


def views_of(model: Model, panoramas: Sequence[Panorama]) -> list[Views]:
    """The views of panoramas whose sun is known."""
    return [_views(model, panorama) for panorama in tqdm(panoramas, unit="panorama")]


def is_certain(panorama: Panorama) -> bool:
    """Whether the panorama's sun is known well enough."""
    return panorama.sun_azimuth is not None and (panorama.sun_uncertainty or np.inf) <= CERTAIN


def _views(model: Model, panorama: Panorama) -> Views:
    taken = _around(panorama)
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


def parts(views: Sequence[Views], size: int, kind: str) -> list[tuple[Views, Indices]]:
    """Groups of views, several of each panorama."""
    rng = np.random.default_rng(size)
    return [(v, part) for v in views for part in _dealt(v, size, kind, rng)]


def _dealt(views: Views, size: int, kind: str, rng: np.random.Generator) -> list[Indices]:
    if size == VIEWS:
        return [np.arange(VIEWS)]
    if kind == "neighbours":
        order = np.argsort(views.azimuth)
        return [order[(first + np.arange(size)) % VIEWS] for first in rng.integers(0, VIEWS, GROUPS_EACH)]
    return list(rng.permutation(VIEWS)[: VIEWS // size * size].reshape(-1, size)[:GROUPS_EACH])


def kinds(size: int) -> tuple[str, ...]:
    """Ways to make groups of this size that differ."""
    return KINDS if 1 < size < VIEWS else KINDS[:1]


def learn(views: Sequence[Views]) -> dict[str, float]:
    """The correlations with the least mean negative log density, and that."""
    dealt = [parts(views, size, kind) for size in SIZES[1:] for kind in kinds(size)]
    loss = {
        (far, near): float(np.mean([np.mean([_loss(v, part, Correlation(far, near)) for v, part in d]) for d in dealt]))
        for far, near in product(FARS, NEARS)
    }
    far, near = min(loss, key=lambda pair: loss[pair])
    return {"far": far, "near": near, "NLL": loss[far, near], "NLL, as shipped": loss.get((SUN.far, SUN.near), np.nan)}


def _product(views: Views, part: Indices, correlation: Correlation) -> Floats:
    shares = counts(*axes([views.said[i] for i in part], views.azimuth[part]), correlation)
    return np.asarray(shares @ views.log[part])


def _loss(views: Views, part: Indices, correlation: Correlation) -> float:
    layout = views.said[0].spec.sun_grid
    log = _product(views, part, correlation)
    total = np.log(np.sum(np.exp(log - log.max()) * grid_solid_angle(layout))) + log.max()
    return float(total - log[int(np.argmax(grid_directions(layout) @ views.sun))])


def coverage(views: Sequence[Views], size: int, kind: str) -> dict[str, float]:
    """Error [deg] and shares [%] inside the regions of groups, as shipped; each place counts alike."""
    dealt = parts(views, size, kind)
    suns = [_sun(v, part) for v, part in dealt]
    error = np.array(
        [angle_between(v.sun, direction(s.azimuth, s.elevation)) for (v, _), s in zip(dealt, suns, strict=True)]
    )
    places = [v.place for v, _ in dealt]
    weight = np.array([1.0 / places.count(place) for place in places])
    weight /= weight.sum()
    return {
        "groups": float(len(dealt)),
        "sun, 50 %": float(np.median(error)),
        "under 45° [%]": 100 * float(weight @ (error < 45.0)),
        "in 50 % region [%]": 100 * float(weight @ (error <= [s.radius_50 for s in suns])),
        "in 90 % region [%]": 100 * float(weight @ (error <= [s.radius_90 for s in suns])),
    }


def _sun(views: Views, part: Indices) -> SunEstimate:
    log = _product(views, part, SUN)
    weight = np.exp(log - log.max()) * grid_solid_angle(views.said[0].spec.sun_grid)
    return sun_of(replace(views.said[0], sun_probability=weight / weight.sum()))
