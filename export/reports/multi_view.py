"""What several photos of one place make of the sun: overlapping sets, and how the errors of views correlate.

The numbers in lighting/fusion/likelihood.py are those with the least negative log density at the true suns of one half
of the places that the network never saw, over groups of neighbours and groups dealt at random.
"""

import itertools
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from export.crops.cameras import PROTOCOLS, Camera
from export.crops.crops import generator
from export.data.panoramas import Panorama
from export.evaluation.metrics import clustered_error
from export.reports.registration import (
    PHOTO_FOVS,
    PHOTO_HEIGHT,
    PHOTO_WIDTH,
    PanoramaPhoto,
    expose_panorama,
    photograph_panorama,
    photograph_sweep,
)
from lighting.decoding import sun_of
from lighting.fusion.estimate import predict_photo
from lighting.fusion.likelihood import SUN, Correlation, axes, effective_weights, pool_log_likelihoods, rotate_density
from lighting.fusion.multi_view import fuse_views
from lighting.fusion.single_view import Observations, Posterior
from lighting.geometry import Floats, angle_between, direction, wrap_azimuth
from lighting.model import Model
from lighting.photo.reader import photo_from_array
from lighting.records import Prediction, SunEstimate
from lighting.registration.features import detect_features
from lighting.registration.photo_set import RegisteredView, ViewFeatures, register_views
from lighting.sun_grid import grid_directions, grid_solid_angle

# Sets of 3 to 5 overlapping photos: their headings, their lens, and what that makes of the sun.

SET_SIZES = (3, 4, 5)


@dataclass(frozen=True, eq=False)
class _PhotoSet:
    """One set and all that was said of it."""

    taken: list[PanoramaPhoto]
    said: list[Prediction]
    placed: tuple[RegisteredView, ...]
    matched: tuple[Posterior, ...]  # with the turns by matches
    true: tuple[Posterior, ...]  # with the true headings
    blind: tuple[Posterior, ...]  # with unknown headings
    sun: Floats | None  # (3,) true, from azimuth 0 of the panorama


def fuse_sets(model: Model, panoramas: Sequence[Panorama]) -> list[_PhotoSet]:
    """A set of each panorama, of 3, 4 and 5 photos in turn."""
    return [_fuse_set(model, p, SET_SIZES[i % len(SET_SIZES)]) for i, p in enumerate(tqdm(panoramas, unit="set"))]


def _fuse_set(model: Model, panorama: Panorama, size: int) -> _PhotoSet:
    taken = photograph_sweep(panorama, size, "set")
    said = _predict_sweep(model, taken)
    placed = register_views(
        [
            ViewFeatures(detect_features(t.pixels), p.camera_elevation, p.camera_roll, p.vertical_fov)
            for t, p in zip(taken, said, strict=True)
        ]
    )
    nothing, headings = [Observations()] * size, [t.camera.azimuth for t in taken]
    sun = None
    if panorama.sun_azimuth is not None and panorama.sun_elevation is not None:
        sun = direction(panorama.sun_azimuth, max(panorama.sun_elevation, 0.0))
    return _PhotoSet(
        taken,
        said,
        placed,
        fuse_views(said, nothing, None, placed),
        fuse_views(said, nothing, headings),
        fuse_views(said, nothing),
        sun,
    )


def _predict_sweep(model: Model, taken: Sequence[PanoramaPhoto]) -> list[Prediction]:
    """What the network says of each photo alone."""
    return [predict_photo(model, photo_from_array(t.pixels)) for t in taken]


def set_figures(found: Sequence[_PhotoSet]) -> dict[str, float]:
    """Of all photos of all sets; angles in deg, shares in %."""
    heading = np.concatenate([_heading_errors(g) for g in found])
    known = np.isfinite(heading)
    fov = np.concatenate([_fov_errors(g) for g in found])
    moved = np.concatenate([angle_between(_suns(g.matched), _suns(g.true)) for g in found])
    whole = np.concatenate([np.full(len(g.taken), _connected(g)) for g in found])
    return {
        "photos": float(sum(len(g.taken) for g in found)),
        "connected [%]": 100 * float(np.mean([_connected(g) for g in found])),
        "heading, 50 %": float(np.median(heading[known])),
        "95 %": float(np.quantile(heading[known], 0.95)),
        "over 2° [%]": 100 * float(np.mean(heading[known] > 2.0)),
        "field of view, 50 %": float(np.nanmedian(fov)),
        "of the network": float(np.median(np.concatenate([_network_fov_errors(g) for g in found]))),
        "sun moved by the matched headings, 50 %": float(np.median(moved)),
        "90 %": float(np.quantile(moved, 0.9)),
        "within 1° [%]": 100 * float(np.mean(moved <= 1.0)),
        "of connected sets [%]": 100 * float(np.mean(moved[whole] <= 1.0)),
    }


def set_sun_figures(found: Sequence[_PhotoSet]) -> dict[str, dict[str, float]]:
    """Errors of the sun over sets that have one, by what is known of the headings."""
    lit = [g for g in found if g.sun is not None]
    ways = {"headings unknown": "blind", "headings by matches": "matched", "true headings": "true"}
    return {name: _sun_row(lit, attribute) for name, attribute in ways.items()}


def _sun_row(lit: Sequence[_PhotoSet], attribute: str) -> dict[str, float]:
    error = np.concatenate([_sun_errors(g, getattr(g, attribute)) for g in lit])
    answers = [f for g in lit for f in getattr(g, attribute)]
    return {
        "photos": float(len(error)),
        "sun, 50 %": float(np.median(error)),
        "under 45° [%]": 100 * float(np.mean(error < 45.0)),
        "in 50 % region [%]": 100 * float(np.mean(error <= [f.sun.radius_50 for f in answers])),
        "in 90 % region [%]": 100 * float(np.mean(error <= [f.sun.radius_90 for f in answers])),
    }


def _suns(answers: Sequence[Posterior]) -> Floats:
    return direction([f.sun.azimuth for f in answers], [f.sun.elevation for f in answers])


def _sun_errors(group: _PhotoSet, answers: Sequence[Posterior]) -> Floats:
    turned = [f.sun.azimuth + t.camera.azimuth for f, t in zip(answers, group.taken, strict=True)]
    assert group.sun is not None
    return angle_between(direction(turned, [f.sun.elevation for f in answers]), group.sun)


def _connected(group: _PhotoSet) -> bool:
    return len({p.group for p in group.placed}) == 1


def _heading_errors(group: _PhotoSet) -> Floats:
    """Errors (n - 1,) against the first photo, NaN for photos that are not connected with it."""
    true = np.array([t.camera.azimuth for t in group.taken])
    found = np.array([p.heading if p.group == group.placed[0].group else np.nan for p in group.placed])
    return np.abs(wrap_azimuth(found - (true - true[0])))[1:]


def _fov_errors(group: _PhotoSet) -> Floats:
    return np.array(
        [
            np.nan if p.vertical_fov is None else abs(p.vertical_fov - t.camera.vertical_fov)
            for p, t in zip(group.placed, group.taken, strict=True)
        ]
    )


def _network_fov_errors(group: _PhotoSet) -> Floats:
    return np.array([abs(p.vertical_fov - t.camera.vertical_fov) for p, t in zip(group.said, group.taken, strict=True)])


# Views with true headings: how their errors correlate by their overlap, and whether regions hold what they say.

VIEWS_EACH = 30  # of each panorama, by cameras that are held nearly level
TILTED_EACH = 8  # of each panorama, by cameras of the protocol `paper`
VIEW_ROWS = 240  # of each photo, as the network takes
VIEW_COUNTS = (1, 2, 4, 8, 30)
GROUP_KINDS = ("in any direction", "neighbours")
CORRELATIONS_FAR, OUTLIER_RATES = (0.0, 0.05, 0.1, 0.2, 0.3), (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5)  # tried
CERTAIN_SUN = 12.0  # deg, the largest uncertainty of a sun that counts
GROUPS_EACH = 4

Indices = NDArray[np.intp]

_MIN_DENSITY = 1e-12


@dataclass(frozen=True, eq=False)
class _PanoramaViews:
    """What the views of one panorama say, in its frame."""

    log: Floats  # (n, N) log densities over the cells
    azimuth: Floats  # (n,) deg
    said: list[Prediction]
    sun: Floats  # (3,) true
    place: str


def predict_panoramas(model: Model, panoramas: Sequence[Panorama], *, tilted: bool = False) -> list[_PanoramaViews]:
    """The views of panoramas whose sun is known."""
    around = _tilted if tilted else _around
    return [_predict_panorama(model, panorama, around(panorama)) for panorama in tqdm(panoramas, unit="panorama")]


def has_certain_sun(panorama: Panorama) -> bool:
    """Whether the panorama's sun is known well enough."""
    return panorama.sun_azimuth is not None and (panorama.sun_uncertainty or np.inf) <= CERTAIN_SUN


def _predict_panorama(model: Model, panorama: Panorama, taken: Sequence[PanoramaPhoto]) -> _PanoramaViews:
    said = _predict_sweep(model, taken)
    azimuth = np.array([t.camera.azimuth for t in taken])
    layout = model.spec.sun_grid
    density = [rotate_density(p.sun_probability, -a, layout) for p, a in zip(said, azimuth, strict=True)]
    assert panorama.sun_azimuth is not None
    assert panorama.sun_elevation is not None
    sun = direction(panorama.sun_azimuth, max(panorama.sun_elevation, 0.0))
    return _PanoramaViews(np.log(np.maximum(density, _MIN_DENSITY)), azimuth, said, sun, panorama.place)


def _around(panorama: Panorama) -> list[PanoramaPhoto]:
    """VIEWS photos by one lens in any direction."""
    rng, linear = generator(panorama.name, VIEWS_EACH, "views"), expose_panorama(panorama)
    fov = rng.uniform(*PHOTO_FOVS)
    cameras = [
        Camera(rng.uniform(-180, 180), rng.normal(2, 6), rng.normal(0, 2), fov, PHOTO_WIDTH / PHOTO_HEIGHT)
        for _ in range(VIEWS_EACH)
    ]
    return [
        PanoramaPhoto(photograph_panorama(linear, camera, rng.uniform(0.85, 1.15, 3), VIEW_ROWS), camera)
        for camera in cameras
    ]


def _tilted(panorama: Panorama) -> list[PanoramaPhoto]:
    """TILTED photos by the cameras of the protocol `paper`, which look up and down by up to 20°."""
    rng, linear = generator(panorama.name, TILTED_EACH, "tilted"), expose_panorama(panorama)
    cameras = [PROTOCOLS["paper"](rng) for _ in range(TILTED_EACH)]
    return [PanoramaPhoto(photograph_panorama(linear, camera, np.ones(3), VIEW_ROWS), camera) for camera in cameras]


def _deal_groups(views: Sequence[_PanoramaViews], size: int, kind: str) -> list[tuple[_PanoramaViews, Indices]]:
    """Groups of views, several of each panorama."""
    rng = np.random.default_rng(size)
    return [(v, part) for v in views for part in _dealt(v, size, kind, rng)]


def _dealt(views: _PanoramaViews, size: int, kind: str, rng: np.random.Generator) -> list[Indices]:
    count = len(views.said)
    if size == count:
        return [np.arange(count)]
    if kind == "neighbours":
        order = np.argsort(views.azimuth)
        return [order[(first + np.arange(size)) % count] for first in rng.integers(0, count, GROUPS_EACH)]
    return list(rng.permutation(count)[: count // size * size].reshape(-1, size)[: GROUPS_EACH if size > 1 else None])


def group_kinds(size: int) -> tuple[str, ...]:
    """Ways to make groups of this size that differ."""
    return GROUP_KINDS if 1 < size < VIEWS_EACH else GROUP_KINDS[:1]


def fit_correlation(views: Sequence[_PanoramaViews]) -> dict[str, float]:
    """The numbers with the least mean negative log density [nat], that, and what those that ship give."""
    loss = {
        (far, misled): _mean_log_loss(views, Correlation(far, misled))
        for far, misled in itertools.product(CORRELATIONS_FAR, OUTLIER_RATES)
    }
    far, misled = min(loss, key=lambda pair: loss[pair])
    return {"far": far, "misled": misled, "NLL": loss[far, misled], "NLL, as shipped": _mean_log_loss(views, SUN)}


def cross_fit_correlation(views: Sequence[_PanoramaViews]) -> dict[str, dict[str, float]]:
    """What each half of the places teaches, and what that gives on the other one."""
    own = [[v for v in views if zlib.crc32(v.place.encode()) % 2 == half] for half in (0, 1)]
    if not all(own):
        return {}
    learnt = [fit_correlation(part) for part in own]
    return {
        f"half {half + 1} of the places": known
        | {"NLL of the other half": _mean_log_loss(own[1 - half], Correlation(known["far"], known["misled"]))}
        for half, known in enumerate(learnt)
    }


def _mean_log_loss(views: Sequence[_PanoramaViews], correlation: Correlation) -> float:
    """The mean negative log density [nat] at the true suns over all sizes and kinds of groups, which count alike."""
    dealt = [_deal_groups(views, size, kind) for size in VIEW_COUNTS[1:] for kind in group_kinds(size)]
    return float(np.mean([np.mean([_loss(v, part, correlation) for v, part in d]) for d in dealt]))


def _together(views: _PanoramaViews, part: Indices, correlation: Correlation) -> Floats:
    """Probabilities (N,) of the cells by some of the views."""
    share = effective_weights(*axes([views.said[i] for i in part], views.azimuth[part]), correlation)
    return pool_log_likelihoods(views.log[part], share, correlation, grid_solid_angle(views.said[0].spec.sun_grid))


def _loss(views: _PanoramaViews, part: Indices, correlation: Correlation) -> float:
    layout = views.said[0].spec.sun_grid
    cell = int(np.argmax(grid_directions(layout) @ views.sun))
    density = _together(views, part, correlation)[cell] / grid_solid_angle(layout)[cell]
    return float(-np.log(max(density, _MIN_DENSITY)))


def region_coverage(views: Sequence[_PanoramaViews], size: int, kind: str) -> dict[str, float]:
    """Error [deg] and shares [%] inside the regions of groups, as shipped; each group counts alike, as in `evaluate`.

    `+-` is the standard error of a share by which places were chosen.
    """
    dealt = _deal_groups(views, size, kind)
    suns = [_fused_sun(v, part) for v, part in dealt]
    error = np.array(
        [angle_between(v.sun, direction(s.azimuth, s.elevation)) for (v, _), s in zip(dealt, suns, strict=True)]
    )
    place = np.array([v.place for v, _ in dealt])
    within = {name: error <= [getattr(s, f"radius_{name}") for s in suns] for name in (50, 90)}
    off = {name: 100 * clustered_error(hit, place) for name, hit in within.items()}
    return {
        "groups": float(len(dealt)),
        "sun, 50 %": float(np.median(error)),
        "under 45° [%]": 100 * float(np.mean(error < 45.0)),
        "in 50 % region [%]": 100 * float(within[50].mean()),
        "+- of that": off[50],
        "in 90 % region [%]": 100 * float(within[90].mean()),
        "+- of this": off[90],
    }


def _fused_sun(views: _PanoramaViews, part: Indices) -> SunEstimate:
    return sun_of(replace(views.said[0], sun_probability=_together(views, part, SUN)))
