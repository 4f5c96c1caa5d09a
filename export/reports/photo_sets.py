"""How well photos of one place are registered, and what that makes of the sun.

Photos are taken of panoramas through one lens that nobody noted, with overlapping views and changing gains.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from export import PHOTO_SET_PARTS
from export.crops.crops import Camera, auto_exposure_gain, crop_rng, pinhole_camera
from export.data.panoramas import DataError, Panorama, linearize, read_index, read_picture
from export.evaluation.metrics import figures_table
from lighting.color import tone_map
from lighting.estimator import Estimator
from lighting.fusion.multi_view import fuse_views
from lighting.fusion.single_view import Observations, Posterior
from lighting.geometry import Floats, angle_between, angles, camera_directions, direction, sample_latlong, wrap_azimuth
from lighting.model import Model
from lighting.photo.reader import photo_from_array
from lighting.prediction import Prediction
from lighting.registration.features import Features, detect_features, match_features
from lighting.registration.photo_set import RegisteredView, ViewFeatures, register_views
from lighting.registration.rotations import camera_from_world
from lighting.registration.two_view import RelativeRotation, estimate_rotation

PHOTO_WIDTH, PHOTO_HEIGHT = 640, 480  # pixels; the panoramas hold no more
PHOTO_FOVS = (40.0, 65.0)  # deg, vertical
PHOTO_OVERLAPS = (0.25, 0.7)  # of neighbours' width
PHOTO_GAINS = (0.7, 1.3)  # of each channel
SET_SIZES = (3, 4, 5)  # photos
MAX_SETS = 36  # places with a set
MAX_HEADING_ERROR = 2.0  # deg, from which a heading is wrong


@dataclass(frozen=True, eq=False)
class _Photo:
    """One photo of a panorama and its camera."""

    pixels: NDArray[np.uint8]  # (PHOTO_HEIGHT, PHOTO_WIDTH, 3) sRGB
    camera: Camera


def report_photo_sets(data: Path, model: Path | None, parts: Sequence[str] = (), count: int | None = None) -> str:
    """Tables in Markdown of pairs and sets of photos of `val` panoramas.

    Args:
        data: folder of panoramas.
        model: network to ask; None for the one in the package.
        parts: of PHOTO_SET_PARTS; none for all.
        count: at most so many places of each part; None for all pairs and MAX_SETS sets.

    Raises:
        DataError: if the folder has no panorama in `val`.
    """
    panoramas = [p for p in read_index(data) if p.split == "val"]
    if not panoramas:
        raise DataError(f"No panorama of {data} is left in `val`.")
    chosen = _one_per_place(panoramas)[:count]
    sections: dict[str, Callable[[], str]] = {
        "pairs": lambda: _pairs_section(chosen),
        "sets": lambda: _sets_section(Model.load(model, threads=1), chosen[:MAX_SETS]),
    }
    return "\n\n".join(sections[part]() for part in parts or PHOTO_SET_PARTS) + "\n"


def _one_per_place(panoramas: Sequence[Panorama]) -> list[Panorama]:
    """One panorama a place, chosen by the place's name."""
    places: dict[str, list[Panorama]] = {}
    for panorama in panoramas:
        places.setdefault(panorama.place, []).append(panorama)
    return [of[int(crop_rng(name, 0, "which").integers(len(of)))] for name, of in sorted(places.items())]


# Photos of panoramas.


def _photograph_sweep(panorama: Panorama, count: int, purpose: str) -> list[_Photo]:
    """Photos of which each overlaps the one before; decided by the panorama's name and the purpose alone."""
    rng = crop_rng(panorama.name, count, purpose)
    fov, azimuth = rng.uniform(*PHOTO_FOVS), rng.uniform(-180, 180)
    side = rng.choice([-1.0, 1.0])
    cameras = []
    for _ in range(count):
        cameras.append(Camera(float(azimuth), rng.uniform(-10, 15), rng.normal(0, 2), fov, PHOTO_WIDTH / PHOTO_HEIGHT))
        azimuth = azimuth + side * _horizontal_fov(fov) * (1 - rng.uniform(*PHOTO_OVERLAPS))
    linear = expose_panorama(panorama)
    return [_Photo(_photograph(linear, camera, rng.uniform(*PHOTO_GAINS, 3)), camera) for camera in cameras]


def _horizontal_fov(vertical_fov: float) -> float:
    return float(2 * np.degrees(np.arctan(np.tan(np.radians(vertical_fov / 2)) * PHOTO_WIDTH / PHOTO_HEIGHT)))


def expose_panorama(panorama: Panorama) -> NDArray[np.float32]:
    """Linear values (H, 2H, 3) of which the bright parts are near white.

    Args:
        panorama: HDR or 8-bit.
    """
    linear = linearize(panorama, read_picture(panorama))
    return linear if panorama.kind == "ldr" else np.asarray(linear * auto_exposure_gain(linear), dtype=np.float32)


def _photograph(linear: NDArray[np.float32], camera: Camera, gain: Floats) -> NDArray[np.uint8]:
    """What a camera takes of a panorama in linear values (H, 2H, 3)."""
    rays = camera_directions(pinhole_camera(camera, PHOTO_WIDTH, PHOTO_HEIGHT, camera.azimuth))
    return np.asarray(tone_map(sample_latlong(linear, rays.astype(np.float32)) * gain))


# Pairs: how well the relative rotation of two photos is estimated.


@dataclass(frozen=True)
class _Pair:
    """The cameras of two photos and the rotation between them that was estimated, None where there was none."""

    rotation: RelativeRotation | None
    first: Camera
    second: Camera

    @property
    def heading_error(self) -> float:
        """Deg, with the first camera's true vertical."""
        if self.rotation is None:
            return float("nan")
        first, second = self.first, self.second
        axes = camera_from_world(first.azimuth, first.elevation, first.roll)
        ahead = axes.T @ self.rotation.rotation.T @ np.array([0.0, 0.0, -1.0])
        return abs(float(wrap_azimuth(float(angles(ahead)[0]) - second.azimuth)))

    @property
    def fov_error(self) -> float:
        """Deg, of the first photo's vertical field of view."""
        return float("nan") if self.rotation is None else abs(self.rotation.vertical_fov[0] - self.first.vertical_fov)


def _pairs_section(panoramas: Sequence[Panorama]) -> str:
    pairs, strangers = _register_pairs(panoramas)
    false = sum(rotation is not None for rotation in strangers)
    sections = [
        f"## Two photos of one panorama ({len(pairs)} places), unknown lens, gains of 0.7 to 1.3 [deg]",
        figures_table({"all": _pair_figures(pairs)}, digits=2),
        f"Photos of two different places: {false} of {len(strangers)} pairs were given a rotation.",
    ]
    return "\n\n".join(sections)


def _register_pairs(panoramas: Sequence[Panorama]) -> tuple[list[_Pair], list[RelativeRotation | None]]:
    """Relative rotations of two overlapping photos of each panorama, and of one of each with one of the next."""
    pairs, features = [], []
    for panorama in tqdm(panoramas, unit="pair"):
        first, second = _photograph_sweep(panorama, 2, "pair")
        both = detect_features(first.pixels), detect_features(second.pixels)
        features.append(both)
        pairs.append(_Pair(_rotation(*both), first.camera, second.camera))
    following = [*features[1:], features[0]]
    return pairs, [_rotation(a[0], b[1]) for a, b in zip(features, following, strict=True)]


def _rotation(a: Features, b: Features) -> RelativeRotation | None:
    return estimate_rotation(match_features(a, b), a.size, b.size)


def _pair_figures(pairs: Sequence[_Pair]) -> dict[str, float]:
    """Quantiles of the errors [deg], and shares [%] of the pairs."""
    solved = [pair for pair in pairs if pair.rotation is not None]
    heading = np.array([pair.heading_error for pair in solved])
    fov = np.array([pair.fov_error for pair in solved])
    return {
        "solved [%]": 100 * len(solved) / len(pairs),
        **{f"heading, {q} %": float(np.quantile(heading, q / 100)) for q in (50, 90, 95)},
        "over 2° [% of all]": 100 * float(np.sum(heading > MAX_HEADING_ERROR)) / len(pairs),
        "field of view, 50 %": float(np.median(fov)),
        "field of view, 95 %": float(np.quantile(fov, 0.95)),
    }


# Sets of 3 to 5 overlapping photos: their headings, their lens, and the sun.

COMPARED = ("headings unknown", "headings by matches", "true headings")  # known of a set's cameras


@dataclass(frozen=True, eq=False)
class _PhotoSet:
    """One set with its registration and the light by what is known of its headings."""

    cameras: list[Camera]
    predictions: list[Prediction]
    views: tuple[RegisteredView, ...]
    posteriors: dict[str, tuple[Posterior, ...]]  # by COMPARED
    sun: Floats | None  # (3,) true, from azimuth 0 of the panorama

    @property
    def connected(self) -> bool:
        """Whether all photos are in one group."""
        return len({view.group for view in self.views}) == 1

    def heading_errors(self) -> Floats:
        """Deg (n - 1,) against the first photo, NaN for photos that are not connected with it."""
        true = np.array([camera.azimuth for camera in self.cameras])
        group = self.views[0].group
        headings = np.array([view.heading if view.group == group else np.nan for view in self.views])
        return np.abs(wrap_azimuth(headings - (true - true[0])))[1:]

    def fov_errors(self, estimates: Sequence[float | None]) -> Floats:
        """Deg (n,) of vertical fields of view, NaN where there is none."""
        true = np.array([camera.vertical_fov for camera in self.cameras])
        return np.asarray(np.abs(np.array([np.nan if fov is None else fov for fov in estimates]) - true))

    def suns(self, headings: str) -> Floats:
        """Directions (n, 3) from azimuth 0 of each photo's camera."""
        suns = [posterior.sun for posterior in self.posteriors[headings]]
        return direction([sun.azimuth for sun in suns], [sun.elevation for sun in suns])

    def sun_errors(self, headings: str) -> Floats:
        """Deg (n,) from the true sun, which there must be."""
        assert self.sun is not None
        suns = [posterior.sun for posterior in self.posteriors[headings]]
        azimuths = [sun.azimuth + camera.azimuth for sun, camera in zip(suns, self.cameras, strict=True)]
        return angle_between(direction(azimuths, [sun.elevation for sun in suns]), self.sun)


def _sets_section(model: Model, panoramas: Sequence[Panorama]) -> str:
    sets = _fuse_sets(model, panoramas)
    lit = [one for one in sets if one.sun is not None]
    tables = [figures_table({"all": _set_figures(sets)}, digits=2)]
    if lit:
        tables += [f"The sun of {len(lit)} sets", figures_table({h: _sun_figures(lit, h) for h in COMPARED}, digits=2)]
    return "\n\n".join([f"## Sets of 3 to 5 overlapping photos ({len(sets)} places)", *tables])


def _fuse_sets(model: Model, panoramas: Sequence[Panorama]) -> list[_PhotoSet]:
    """A set of each panorama, of 3, 4 and 5 photos in turn."""
    return [_fuse_set(model, p, SET_SIZES[i % len(SET_SIZES)]) for i, p in enumerate(tqdm(panoramas, unit="set"))]


def _fuse_set(model: Model, panorama: Panorama, size: int) -> _PhotoSet:
    photos = _photograph_sweep(panorama, size, "set")
    predictions = [Estimator(model).predict(photo_from_array(photo.pixels)) for photo in photos]
    views = register_views(
        [
            ViewFeatures(detect_features(photo.pixels), p.camera_elevation, p.camera_roll, p.vertical_fov)
            for photo, p in zip(photos, predictions, strict=True)
        ]
    )
    cameras = [photo.camera for photo in photos]
    nothing = [Observations()] * size
    sun = None
    if panorama.sun_azimuth is not None and panorama.sun_elevation is not None:
        sun = direction(panorama.sun_azimuth, max(panorama.sun_elevation, 0.0))
    posteriors = (
        fuse_views(predictions, nothing),
        fuse_views(predictions, nothing, None, views),
        fuse_views(predictions, nothing, [camera.azimuth for camera in cameras]),
    )
    return _PhotoSet(cameras, predictions, views, dict(zip(COMPARED, posteriors, strict=True)), sun)


def _set_figures(sets: Sequence[_PhotoSet]) -> dict[str, float]:
    """Figures of all photos of all sets: angles in deg, shares in %."""
    heading = np.concatenate([one.heading_errors() for one in sets])
    heading = heading[np.isfinite(heading)]
    matched = np.concatenate([one.fov_errors([view.vertical_fov for view in one.views]) for one in sets])
    predicted = np.concatenate([one.fov_errors([p.vertical_fov for p in one.predictions]) for one in sets])
    moved = np.concatenate([angle_between(one.suns(COMPARED[1]), one.suns(COMPARED[2])) for one in sets])
    connected = np.concatenate([np.full(len(one.cameras), one.connected) for one in sets])
    return {
        "connected [%]": 100 * float(np.mean([one.connected for one in sets])),
        "heading, 50 %": float(np.median(heading)),
        "95 %": float(np.quantile(heading, 0.95)),
        "over 2° [%]": 100 * float(np.mean(heading > MAX_HEADING_ERROR)),
        "field of view, 50 %": float(np.nanmedian(matched)),
        "of the network": float(np.median(predicted)),
        "sun moved by the matched headings, 50 %": float(np.median(moved)),
        "90 %": float(np.quantile(moved, 0.9)),
        "within 1° [%]": 100 * float(np.mean(moved <= 1.0)),
        "of connected sets [%]": 100 * float(np.mean(moved[connected] <= 1.0)),
    }


def _sun_figures(sets: Sequence[_PhotoSet], headings: str) -> dict[str, float]:
    """Errors of the sun over photos of sets: deg and shares in %."""
    error = np.concatenate([one.sun_errors(headings) for one in sets])
    suns = [posterior.sun for one in sets for posterior in one.posteriors[headings]]
    return {
        "sun, 50 %": float(np.median(error)),
        "under 45° [%]": 100 * float(np.mean(error < 45.0)),
        "in 50 % region [%]": 100 * float(np.mean(error <= [sun.radius_50 for sun in suns])),
        "in 90 % region [%]": 100 * float(np.mean(error <= [sun.radius_90 for sun in suns])),
    }
