"""How well the turn of two photos is found: panoramas seen twice or zoomed, walks through rendered places, strangers.

Photos of a panorama have one lens that nobody noted, overlapping views and changing gains. Photos of a rendered place
have exact turns with parallax: one ray a sample finds what is seen; sunlight with its shadows and skylight from above,
both of Hosek and Wilkie's model, and a grain fixed to the things shade it. It is no light transport.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from export.crops.cameras import Camera, pinhole
from export.crops.crops import automatic_gain, generator
from export.data.panoramas import Panorama, linear_of, read_picture
from export.data.path_tracing import find_llvm
from export.data.procedural_towns import EYE, Mesh, place
from lighting.color import tone_map
from lighting.envmap.render import render
from lighting.geometry import (
    Floats,
    Pinhole,
    angles,
    camera_directions,
    latlong_directions,
    latlong_solid_angle,
    sample_latlong,
    wrap_azimuth,
)
from lighting.records import Lighting
from lighting.registration.features import Features, detect_features
from lighting.registration.photo_set import GUESSED_FOV_SIGMA
from lighting.registration.rotations import own_axes
from lighting.registration.two_view import Turn, relative_rotation
from lighting.sky.hosek_wilkie import SUN_SOLID_ANGLE, sun_radiance

# Photos of panoramas.

PHOTO_WIDTH, PHOTO_HEIGHT = 640, 480  # pixels; the panoramas hold no more
PHOTO_FOVS = (40.0, 65.0)  # deg, vertical
SWEEP_OVERLAPS = (0.25, 0.7)  # of neighbours' width
PHOTO_GAINS = (0.7, 1.3)  # of each channel


@dataclass(frozen=True, eq=False)
class PanoramaPhoto:
    """One photo and how it was taken."""

    pixels: NDArray[np.uint8]  # (HEIGHT, WIDTH, 3) sRGB
    camera: Camera


def photograph_sweep(panorama: Panorama, count: int, purpose: str) -> list[PanoramaPhoto]:
    """`count` photos, each overlapping the one before; decided by the panorama's name and the purpose alone."""
    rng = generator(panorama.name, count, purpose)
    fov, azimuth = rng.uniform(*PHOTO_FOVS), rng.uniform(-180, 180)
    side = rng.choice([-1.0, 1.0])
    cameras = []
    for _ in range(count):
        cameras.append(Camera(float(azimuth), rng.uniform(-10, 15), rng.normal(0, 2), fov, PHOTO_WIDTH / PHOTO_HEIGHT))
        azimuth = azimuth + side * _sweep_width(fov) * (1 - rng.uniform(*SWEEP_OVERLAPS))
    picture = expose_panorama(panorama)
    return [
        PanoramaPhoto(photograph_panorama(picture, camera, rng.uniform(*PHOTO_GAINS, 3)), camera) for camera in cameras
    ]


def _sweep_width(vertical_fov: float) -> float:
    """Horizontal field of view [deg] of a photo of the set."""
    return float(2 * np.degrees(np.arctan(np.tan(np.radians(vertical_fov / 2)) * PHOTO_WIDTH / PHOTO_HEIGHT)))


def expose_panorama(panorama: Panorama) -> NDArray[np.float32]:
    """Linear values (H, 2H, 3) of which the bright parts are near white."""
    linear = linear_of(panorama, read_picture(panorama))
    return linear if panorama.kind == "ldr" else _scale_to_white(linear)


def _scale_to_white(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Scene-referred values (H, W, 3) times a number that brings their bright parts near white."""
    return np.asarray(linear * automatic_gain(linear), dtype=np.float32)


def photograph_panorama(
    linear: NDArray[np.float32], camera: Camera, gain: Floats, rows: int = PHOTO_HEIGHT
) -> NDArray[np.uint8]:
    """What a camera takes of a panorama in linear values (H, 2H, 3): `rows` of pixels."""
    columns = round(rows * camera.aspect)
    rays = camera_directions(pinhole(camera, columns, rows, camera.azimuth))
    return np.asarray(tone_map(sample_latlong(linear, rays.astype(np.float32)) * gain))


def one_panorama_per_place(panoramas: Sequence[Panorama]) -> list[Panorama]:
    """One panorama a place, chosen by its name."""
    places: dict[str, list[Panorama]] = {}
    for panorama in panoramas:
        places.setdefault(panorama.place, []).append(panorama)
    return [own[int(generator(place, 0, "which").integers(len(own)))] for place, own in sorted(places.items())]


# Photos of a rendered place from several standpoints.

SKY_ROWS = 128  # rows of the map of the sky
GRAIN = ((0.05, 0.25), (0.25, 0.35), (1.2, 0.3), (6.0, 0.3))  # m and contrast of the layers
REPEATS = 64  # cells after which a layer of grain repeats


@dataclass(frozen=True)
class Standpoint:
    """Where a photo is taken from and how the camera is held; angles in deg."""

    position: tuple[float, float]  # m, x and z over the ground
    azimuth: float
    elevation: float
    roll: float
    vertical_fov: float

    def camera(self, aspect: float) -> Camera:
        """The camera alone, of a photo of this width over height."""
        return Camera(self.azimuth, self.elevation, self.roll, self.vertical_fov, aspect)


@dataclass(frozen=True, eq=False)
class _Daylight:
    """The light of a clear sky."""

    sun: Floats  # (3,) direction
    beam: Floats  # (3,) irradiance of a plane that faces the sun
    ambient: Floats  # (3,) irradiance of a horizontal plane by the sky
    dome: NDArray[np.float32]  # (DOME, 2 DOME, 3) radiance

    @classmethod
    def of(cls, light: Lighting) -> "_Daylight":
        """That of a record."""
        dome = render(light, SKY_ROWS, sun=False)
        upwards = latlong_directions(SKY_ROWS)[..., 1:2]
        share = np.maximum(upwards, 0.0) * latlong_solid_angle(SKY_ROWS)[:, None, None]
        beam = sun_radiance(light.sun_direction, light.turbidity) * (SUN_SOLID_ANGLE * light.exposure)
        return cls(light.sun_direction, np.asarray(beam), np.sum(dome * share, axis=(0, 1)), dome)


class WalkableTown:
    """A rendered place to walk through, the same for one number, under a light of its own."""

    def __init__(self, number: int) -> None:
        find_llvm()
        import mitsuba as mi

        mi.set_variant("llvm_ad_rgb")
        rng = np.random.default_rng([21, number])
        meshes = place(rng)
        own = Lighting(float(rng.uniform(-180, 180)), float(rng.uniform(15, 60)), turbidity=3.0, exposure=0.02)
        self.light = _Daylight.of(own)
        self.lattice = rng.random((REPEATS, REPEATS, REPEATS)).astype(np.float32)
        self.colours = np.concatenate([mesh.albedo for mesh in meshes])
        self.scene = mi.load_dict({"type": "scene", "things": _quad_mesh(mi, meshes)})

    def photo(self, at: Standpoint, width: int, height: int) -> NDArray[np.uint8]:
        """What is seen from there: (height, width, 3) sRGB."""
        towards = camera_directions(Pinhole(2 * width, 2 * height, at.vertical_fov, at.azimuth, at.elevation, at.roll))
        linear = self._radiance(towards.reshape(-1, 3), (at.position[0], EYE, at.position[1]))
        mean = linear.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
        return np.asarray(tone_map(_scale_to_white(mean)))

    def is_clear(self, at: Standpoint, arm: float = 1.5) -> bool:
        """Whether nothing in view is nearer than an arm [m], but for a tenth of the picture."""
        towards = camera_directions(Pinhole(32, 24, at.vertical_fov, at.azimuth, at.elevation, at.roll)).reshape(-1, 3)
        hit, *_ = self._meet(towards, (at.position[0], EYE, at.position[1]))
        return float(np.mean(hit < arm)) < 0.1

    def _radiance(self, towards: Floats, origin: tuple[float, float, float]) -> NDArray[np.float32]:
        distance, face, normal = self._meet(towards, origin)
        seen = np.isfinite(distance)
        colour = sample_latlong(self.light.dome, towards).astype(np.float64)
        point = np.array(origin) + towards[seen] * distance[seen, None]
        facing = normal[seen] * -np.sign(np.sum(normal[seen] * towards[seen], axis=1, keepdims=True))
        lit = np.maximum(facing @ self.light.sun, 0.0) * self._sunlit(point + 0.01 * facing)
        light = self.light.beam * lit[:, None] + self.light.ambient * (0.6 + 0.4 * facing[:, 1:2])
        colour[seen] = self.colours[face[seen]] / np.pi * light * self._grain(point)[:, None]
        return np.asarray(colour, dtype=np.float32)

    def _meet(self, towards: Floats, origin: tuple[float, float, float]) -> tuple[Floats, NDArray[np.intp], Floats]:
        """Distances (N,) [m], infinite for the sky, quads (N,) and normals (N, 3)."""
        import mitsuba as mi

        ray = mi.Ray3f(mi.Point3f(*(float(v) for v in origin)), mi.Vector3f(*towards.T.astype(np.float32)))
        found = self.scene.ray_intersect(ray)
        distance = np.where(np.array(found.is_valid()), np.array(found.t), np.inf)
        return distance, np.array(found.prim_index).astype(np.intp) // 2 % len(self.colours), np.array(found.n).T

    def _sunlit(self, point: Floats) -> Floats:
        import mitsuba as mi

        ray = mi.Ray3f(mi.Point3f(*point.T.astype(np.float32)), mi.Vector3f(*(float(v) for v in self.light.sun)))
        return 1.0 - np.array(self.scene.ray_test(ray)).astype(np.float64)

    def _grain(self, point: Floats) -> Floats:
        """A factor (N,) around 1 that belongs to a place in space (N, 3)."""
        layers = [1.0 + contrast * (2.0 * _smooth(self.lattice, point / size) - 1.0) for size, contrast in GRAIN]
        return np.asarray(np.prod(layers, axis=0))


def _smooth(lattice: NDArray[np.float32], point: Floats) -> Floats:
    """Values (N,) between those of a lattice (R, R, R) that repeats, at points (N, 3)."""
    from scipy import ndimage

    return np.asarray(ndimage.map_coordinates(lattice, point.T, np.float64, order=1, mode="grid-wrap"))


def _quad_mesh(mi: Any, meshes: tuple[Mesh, ...]) -> Any:
    corners = np.concatenate([mesh.corners for mesh in meshes])
    count = len(corners)
    first = 4 * np.arange(count)[:, None]
    halves = np.stack([first + np.array(half) for half in ((0, 1, 2), (0, 2, 3))], axis=1)  # quad after quad
    made = mi.Mesh("quads", 4 * count, 2 * count)
    values = mi.traverse(made)
    values["vertex_positions"] = corners.ravel().astype(np.float32)
    values["faces"] = halves.ravel().astype(np.uint32)
    values.update()
    return made


# Pairs.

ZOOMS, ZOOM_OFFSETS = (1.2, 3.0), (3.0, 15.0)  # times, and deg between two photos of which one is zoomed
WALK_STEPS = (0.3, 3.0)  # m between two standpoints
WALKED_OVERLAPS = (0.4, 0.9)
WALK_ELEVATIONS = 8.0  # deg, of a walker's camera, up or down
WRONG_TURN = 2.0  # deg of heading from which a turn is wrong
LENS_GUESS_STD = 5.0  # deg, standard deviation of the field of view that a network would guess


@dataclass(frozen=True)
class _PairAnswer:
    """What was found of one pair; None where nothing was said."""

    turn: Turn | None
    first: Camera
    second: Camera

    @property
    def heading_error(self) -> float:
        """Deg, with the first camera's true vertical."""
        if self.turn is None:
            return float("nan")
        a, b = self.first, self.second
        ahead = own_axes(a.azimuth, a.elevation, a.roll).T @ self.turn.rotation.T @ np.array([0.0, 0.0, -1.0])
        return abs(float(wrap_azimuth(float(angles(ahead)[0]) - b.azimuth)))

    @property
    def rotation_error(self) -> float:
        """Deg, of the whole rotation."""
        if self.turn is None:
            return float("nan")
        a, b = (own_axes(c.azimuth, c.elevation, c.roll) for c in (self.first, self.second))
        off = self.turn.rotation @ (b @ a.T).T
        return float(np.degrees(np.arccos(np.clip((np.trace(off) - 1) / 2, -1, 1))))

    @property
    def fov_error(self) -> float:
        """Deg, of the first photo's vertical field of view."""
        return float("nan") if self.turn is None else abs(self.turn.vertical_fov[0] - self.first.vertical_fov)


def match_sweeps(panoramas: Sequence[Panorama]) -> tuple[list[_PairAnswer], list[Turn | None]]:
    """The answers about two overlapping photos of each panorama, and about one of each with one of the next."""
    answers, shown = [], []
    for panorama in tqdm(panoramas, unit="pair"):
        a, b = photograph_sweep(panorama, 2, "pair")
        seen = detect_features(a.pixels), detect_features(b.pixels)
        shown.append(seen)
        answers.append(_PairAnswer(relative_rotation(*seen), a.camera, b.camera))
    strangers = [relative_rotation(a[0], b[1]) for a, b in zip(shown, [*shown[1:], shown[0]], strict=True)]
    return answers, strangers


def match_zooms(panoramas: Sequence[Panorama]) -> Iterator[_PairAnswer]:
    """The answers about two photos of each panorama, the second through a longer lens."""
    for panorama in tqdm(panoramas, unit="zoom"):
        rng = generator(panorama.name, 2, "zoom")
        a, b = (
            Camera(0.0, rng.uniform(-10, 15), rng.normal(0, 2), fov, PHOTO_WIDTH / PHOTO_HEIGHT)
            for fov in _two_lenses(rng)
        )
        b = replace(b, azimuth=rng.uniform(*ZOOM_OFFSETS) * rng.choice([-1, 1]))
        picture, fov = (
            expose_panorama(panorama),
            0.5 * (a.vertical_fov + b.vertical_fov) + rng.normal(0, LENS_GUESS_STD),
        )
        first, second = (
            detect_features(photograph_panorama(picture, camera, rng.uniform(*PHOTO_GAINS, 3))) for camera in (a, b)
        )
        yield _PairAnswer(relative_rotation(first, second, fov, fov, GUESSED_FOV_SIGMA), a, b)


def _two_lenses(rng: np.random.Generator) -> tuple[float, float]:
    fov = rng.uniform(*PHOTO_FOVS)
    return fov, float(2 * np.degrees(np.arctan(np.tan(np.radians(fov / 2)) / rng.uniform(*ZOOMS))))


def match_walks(count: int) -> Iterator[_PairAnswer]:
    """The answers about two photos of each of `count` rendered places, from standpoints some steps apart."""
    for number in tqdm(range(count), unit="walk"):
        (a, first), (b, second) = _photograph_walk(number)
        rng = np.random.default_rng([6, number])
        fov = first.vertical_fov + rng.normal(0, LENS_GUESS_STD)
        yield _PairAnswer(relative_rotation(a, b, fov, fov, GUESSED_FOV_SIGMA), first, second)


def _photograph_walk(number: int) -> list[tuple[Features, Camera]]:
    """Two photos of a walk, neither with something just before the lens."""
    walk, rng = WalkableTown(number), np.random.default_rng([5, number])
    for _ in range(60):
        pair = _standpoints(rng)
        if all(walk.is_clear(at) for at in pair):
            break
    return [
        (detect_features(walk.photo(at, PHOTO_WIDTH, PHOTO_HEIGHT)), at.camera(PHOTO_WIDTH / PHOTO_HEIGHT))
        for at in pair
    ]


def _standpoints(rng: np.random.Generator) -> tuple[Standpoint, Standpoint]:
    fov = rng.uniform(40, 65)
    turn = _sweep_width(fov) * (1 - rng.uniform(*WALKED_OVERLAPS)) * rng.choice([-1, 1])
    azimuth, step, way = rng.uniform(-180, 180), rng.uniform(*WALK_STEPS), rng.uniform(0, 2 * np.pi)
    there = (float(step * np.sin(way)), float(step * np.cos(way)))
    tilts = [(rng.uniform(-WALK_ELEVATIONS, WALK_ELEVATIONS), rng.normal(0, 2)) for _ in range(2)]
    return Standpoint((0.0, 0.0), azimuth, *tilts[0], fov), Standpoint(there, azimuth + turn, *tilts[1], fov)


def pair_figures(answers: Sequence[_PairAnswer]) -> dict[str, float]:
    """Quantiles of the errors [deg], and shares [%] of the pairs."""
    said = [a for a in answers if a.turn is not None]
    heading = np.array([a.heading_error for a in said])
    fov = np.array([a.fov_error for a in said])
    sigma = np.array([a.turn.sigma for a in said if a.turn is not None])
    off = np.array([a.rotation_error for a in said])
    return {
        "pairs": float(len(answers)),
        "solved [%]": 100 * len(said) / len(answers),
        **{f"heading, {q} %": float(np.quantile(heading, q / 100)) for q in (50, 90, 95)},
        "over 2° [% of all]": 100 * float(np.sum(heading > WRONG_TURN)) / len(answers),
        "field of view, 50 %": float(np.median(fov)),
        "field of view, 95 %": float(np.quantile(fov, 0.95)),
        "rotation over its sigma, 50 %": float(np.median(off / sigma)),
        "95 %": float(np.quantile(off / sigma, 0.95)),
    }


def split_by_overlap(answers: Sequence[_PairAnswer]) -> dict[str, list[_PairAnswer]]:
    """The answers in thirds of the overlap."""
    share = np.array([1 - _heading_between(a) / _sweep_width(a.first.vertical_fov) for a in answers])
    edges = (0.25, 0.4, 0.55, 0.71)
    return {
        f"overlap {100 * low:.0f} to {100 * high:.0f} %": [
            a for a, s in zip(answers, share, strict=True) if low <= s < high
        ]
        for low, high in pairwise(edges)
    }


def _heading_between(answer: _PairAnswer) -> float:
    return abs(float(wrap_azimuth(answer.second.azimuth - answer.first.azimuth)))
