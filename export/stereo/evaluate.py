"""Errors of normals on shapes and latitudes that training never saw.

Every figure is of simulated photos under Hosek-Wilkie skies, median / mean angle in degrees over all pixels; none is of
real photographs. In some sessions Mitsuba traces paths (`pip install 'outdoor-lighting[train]'`), with light between a
mesh's parts and the sky that they hide. That camera is orthographic and level.
"""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from export.stereo.renders import CaptureDay, Material, Subject, cast_shadows, read_subjects, shade_surface, utc_times
from export.stereo.surfaces import Surface, TriangleMesh, is_held_out, random_rotation, read_mesh
from lighting.errors import LightingError, require_extra
from lighting.geometry import Floats
from lighting.stereo.light_vectors import Skies, gray_skies, illumination_matrices
from lighting.stereo.normal_network import Network
from lighting.stereo.output import depth_error, integrate_normals
from lighting.stereo.pose import camera_to_world, world_to_camera
from lighting.stereo.solver import (
    Session,
    add_model_error,
    apply_network,
    fit_turbidity,
    solve_normals,
    solve_with_planes,
)

# Simulated sessions: a shape photographed over a day, solved from what the photographer knows of it.

Image = NDArray[np.float32]

_HOURS = np.arange(9.0, 17.0)  # local solar time, about, of the eight photos
SEASONS = {
    "47° N, March": CaptureDay(utc_times("2024-03-21", _HOURS), 47.0),
    "47° N, June": CaptureDay(utc_times("2024-06-21", _HOURS), 47.0),
    "35° N, December": CaptureDay(utc_times("2024-12-21", _HOURS), 35.0),
}

_ALBEDO = 0.6
_GAP = 8  # pixels between shapes


@dataclass(frozen=True)
class Trial:
    """How a session goes, and what its photographer gets wrong."""

    day: CaptureDay
    shadows: bool = False  # whether the surface shades itself from the sun
    gloss: float = 0.0
    color: bool = False  # three channels in place of one
    noise: float = 0.01  # standard deviation, of the brightest pixel
    heading_error: float = 0.0  # deg
    clock_error: float = 0.0  # min
    turbidity_error: float = 0.0
    fitted: bool = False  # whether the turbidity is fitted to the photos
    drift: float = 0.0  # share by which the last photo is darker than its EXIF says, the others in proportion

    def believed(self) -> CaptureDay:
        """The day as its photographer believes it to be."""
        day = self.day
        late = np.timedelta64(round(60 * self.clock_error), "s")
        pose = replace(day.pose, heading=day.pose.heading + self.heading_error)
        return replace(day, times=day.times + late, turbidity=day.turbidity + self.turbidity_error, pose=pose)


@dataclass(frozen=True)
class _Result:
    """The normals of one shape."""

    subject: Subject
    search: Image  # (H, W, 3), normals
    network: Image  # (H, W, 3), those of search and network together
    expected: Image  # (H, W), expected error of the latter [deg]

    def errors(self) -> tuple[Image, Image]:
        """Angles [deg] to the truth (P,), of the search and of both."""
        surface = self.subject.surface
        truth = surface.normals[surface.mask]
        search, network = (normal_angles(normals[surface.mask], truth) for normals in (self.search, self.network))
        return search, network


def photograph_subject(subject: Subject, trial: Trial, skies: Skies) -> Image:
    """Images (T, H, W, C) without noise.

    Args:
        subject: the shape.
        trial: its day, shadows and gloss.
        skies: T skies of one channel or three.
    """
    surface, pose = subject.surface, trial.day.pose
    lit = None
    if trial.shadows:
        lit = cast_shadows(surface, np.argwhere(surface.mask), world_to_camera(skies.sun_direction, pose))
    normals = surface.normals[surface.mask]
    material = Material(np.full(len(normals), _ALBEDO, dtype=np.float32), trial.gloss)
    values = shade_surface(normals, skies, pose, material, lit)
    images = np.zeros((values.shape[1], *surface.mask.shape, values.shape[2]), dtype=np.float32)
    images[:, surface.mask] = np.moveaxis(values, 1, 0)
    return images


def run_session(subjects: Sequence[Subject], trial: Trial, network: Network | None) -> list[_Result]:
    """Shapes side by side in the photos of one day, solved together.

    Args:
        subjects: the shapes.
        trial: how the session goes.
        network: that improves the search; None for the search alone.
    """
    believed, skies = trial.believed(), trial.day.skies()
    skies = skies if trial.color else gray_skies(skies)
    sheet, windows = _side_by_side([photograph_subject(subject, trial, skies) for subject in subjects])
    mask = np.zeros(sheet.shape[1:3], dtype=bool)
    for subject, window in zip(subjects, windows, strict=True):
        mask[window] = subject.surface.mask
    noise = np.random.default_rng(7).normal(0, trial.noise * sheet.max(), sheet.shape).astype(np.float32)
    images = np.maximum(sheet + noise, 0) * _exposure_drift(trial, len(sheet))

    def solver_input(turbidity: float, height: int = 32) -> Session:
        skies = replace(believed, turbidity=turbidity).skies(height)
        return Session(images, mask, skies if trial.color else gray_skies(skies), believed.pose)

    turbidity = fit_turbidity(solver_input) if trial.fitted else believed.turbidity
    alone, planes = solve_with_planes(solver_input(turbidity, 64))
    both = add_model_error(alone if network is None else apply_network(alone, network, planes))
    placed = zip(subjects, windows, strict=True)
    return [_Result(s, alone.normal[at], both.normal[at], both.error[at]) for s, at in placed]


def _exposure_drift(trial: Trial, count: int) -> Image:
    return np.linspace(1, 1 - trial.drift, count, dtype=np.float32)[:, None, None, None]


def _side_by_side(pictures: list[Image]) -> tuple[Image, list[tuple[slice, slice]]]:
    """Pictures (T, H, W, C) of any sizes in one, and where each is."""
    height = max(picture.shape[1] for picture in pictures)
    padded = [np.pad(p, [(0, 0), (0, height - p.shape[1]), (0, _GAP), (0, 0)]) for p in pictures]
    starts = np.cumsum([0, *(picture.shape[2] for picture in padded)]).tolist()
    placed = zip(pictures, starts[:-1], strict=True)
    windows = [(slice(0, p.shape[1]), slice(start, start + p.shape[2])) for p, start in placed]
    return np.concatenate(padded, axis=2), windows


def normal_angles(a: Floats, b: Floats) -> Image:
    """Angles (P,) [deg] between unit vectors.

    Args:
        a: (P, 3).
        b: (P, 3).
    """
    half = np.linalg.norm(a - b, axis=-1) / 2
    return np.asarray(np.degrees(2 * np.arcsin(np.minimum(half, 1))), dtype=np.float32)


Say = Callable[[str], None]

FINE, COARSE = 2, 4  # every so many pixels of the shapes, in the first tables and in the others

_DATES = ("2024-03-21", "2024-06-21", "2024-12-21")
_WRONG: dict[str, dict[str, Any]] = {
    "nothing wrong": {},
    "heading off by 2°": {"heading_error": 2.0},
    "clock off by 5 min": {"clock_error": 5.0},
    "turbidity off by 2": {"turbidity_error": 2.0},
    "turbidity found from the photos": {"fitted": True},
    "cast shadows": {"shadows": True},
    "all four": {"heading_error": 2.0, "clock_error": 5.0, "turbidity_error": 2.0, "shadows": True},
    "the same, turbidity found": {"heading_error": 2.0, "clock_error": 5.0, "fitted": True, "shadows": True},
}


Table = Literal["seasons", "wrong", "photos", "heading", "turbidity", "gloss", "expected"]
TABLES = get_args(Table)

_UNEXPECTED: dict[str, dict[str, Any]] = {
    "nothing wrong": {},
    "cast shadows": {"shadows": True},
    "gloss of 0.2": {"gloss": 0.2, "fitted": True},
    "exposure that falls by 20 %": {"drift": 0.2, "fitted": True},
    "exposure that falls by 50 %": {"drift": 0.5, "fitted": True},
    "heading off by 180°": {"heading_error": 180.0, "fitted": True},
}

_CHANGES: dict[Table, tuple[str, dict[str, dict[str, Any]]]] = {
    "wrong": ("What is wrong", _WRONG),
    "photos": ("Photos from 9 to 16 h", {f"{count}": {"count": count} for count in range(3, 9)}),
    "heading": ("Heading off by", {f"{d:+d}°": {"heading_error": float(d)} for d in (-5, -2, 0, 2, 5)}),
    "turbidity": (
        "Turbidity, told 3",
        {f"{t:g}": {"turbidity_error": 3.0 - t, "sky": t} for t in (2.0, 3.0, 4.0, 6.0)},
    ),
    "gloss": ("Gloss", {f"{g:g}": {"gloss": g} for g in (0.0, 0.05, 0.1, 0.2)}),
}


def evaluate_normals(
    data: Path, network: Network, say: Say, *, quick: bool = False, tables: Sequence[Table] = TABLES
) -> None:
    """Print tables of errors on shapes that training never saw.

    Args:
        data: folder with `scanned_objects` and `meshes`.
        network: to score.
        say: takes each part as text.
        quick: thin the shapes of `seasons` like those of the other tables.
        tables: of TABLES.

    Raises:
        LightingError: where no shape is at hand.
    """
    coarse = list(read_subjects(data, COARSE))
    if not coarse:
        raise LightingError(f"{data} holds no scanned_objects and no meshes.")
    scanned = [subject for subject in coarse if subject.scale] or coarse
    for table in tables:
        if table == "expected":
            _expected(data, scanned, network, say)
        elif table == "seasons":
            _seasons(coarse if quick else list(read_subjects(data, FINE)), network, say)
        else:
            _table(*_CHANGES[table], scanned, network, say)


def _seasons(shapes: Sequence[Subject], network: Network, say: Say) -> None:
    """By group of shapes, channels and cast shadows; then the shapes one by one, and their depths."""
    say("\nSearch and network by season; eight photos from 9 to 16 h, 1 % noise, level camera that looks north\n")
    _head(("shapes", "channels", "cast shadows"), say)
    plain: list[list[_Result]] = []
    for group in dict.fromkeys(shape.group for shape in shapes):
        chosen = [shape for shape in shapes if shape.group == group]
        for color, shadows in ((False, False), (False, True), (True, False), (True, True)):
            trials = [Trial(day, shadows=shadows, color=color) for day in SEASONS.values()]
            results = [run_session(chosen, trial, network) for trial in trials]
            plain += [] if color or shadows else [list(row) for row in zip(*results, strict=True)]
            names = (group, "3" if color else "1", "yes" if shadows else "no")
            _row(names, [_cell(season) for season in results], say)
    _each(plain, say)


def _each(results: Sequence[Sequence[_Result]], say: Say) -> None:
    say("\nThe same by shape; one channel, no cast shadows\n")
    _head(("shape",), say)
    for seasons in results:
        _row((seasons[0].subject.name,), [_cell([season]) for season in seasons], say)
    say("\nMean error of the integrated depth [mm] on the scanned objects: of true normals, search, network\n")
    _head(("shape",), say)
    for seasons in results:
        if seasons[0].subject.scale:
            _row((seasons[0].subject.name,), [_depth(season) for season in seasons], say)


def _depth(result: _Result) -> str:
    surface, scale = result.subject.surface, result.subject.scale
    depths = (integrate_normals(normals, surface.mask) for normals in (surface.normals, result.search, result.network))
    return ", ".join(f"{scale * depth_error(depth, surface.height, surface.mask):.1f}" for depth in depths)


def _table(title: str, rows: dict[str, dict[str, Any]], shapes: Sequence[Subject], network: Network, say: Say) -> None:
    say(f"\n{title}; scanned objects, every {COARSE}th pixel, one channel\n")
    _head((title,), say)
    for name, change in rows.items():
        cells = [_cell(run_session(shapes, _trial(season, change), network)) for season in range(len(SEASONS))]
        _row((name,), cells, say)


def _expected(data: Path, shapes: Sequence[Subject], network: Network, say: Say) -> None:
    """True and expected errors where the model is wrong, also of path-traced meshes that training never saw."""
    say("\nMean error: true, expected; search and network, one channel\n")
    say("| What is wrong | " + " | ".join(SEASONS) + " |")
    say("|" + "---|" * (1 + len(SEASONS)))
    for name, change in _UNEXPECTED.items():
        results = [run_session(shapes, _trial(season, change), network) for season in range(len(SEASONS))]
        _row((name,), [_means(season) for season in results], say)
    for file in sorted((data / "meshes").glob("*.obj")):
        if is_held_out(file):
            results = [[_traced(file, day, network)] for day in SEASONS.values()]
            _row((f"path-traced {file.stem}",), [_means(season) for season in results], say)


def _means(results: Sequence[_Result]) -> str:
    true = np.concatenate([result.errors()[1] for result in results])
    expected = np.concatenate([result.expected[result.subject.surface.mask] for result in results])
    return f"{true.mean():.0f}, {expected.mean():.0f}"


def _traced(file: Path, day: CaptureDay, network: Network) -> _Result:
    rng = np.random.default_rng(5)
    skies = gray_skies(day.skies(64))
    images, normals, mask = _trace_mesh(file, random_rotation(rng), day, skies, _ALBEDO)
    noise = rng.normal(0, 0.01 * images.max(), images.shape).astype(np.float32)
    solved = solve_normals(Session(np.maximum(images + noise, 0), mask, skies, day.pose), network=network)
    subject = Subject(file.stem, "path-traced meshes", Surface(normals, np.zeros(mask.shape, np.float32), mask))
    return _Result(subject, solved.normal, solved.normal, solved.error)


def _trial(season: int, change: dict[str, Any]) -> Trial:
    """A season's trial with fields of it, the true turbidity `sky` or the `count` of photos changed."""
    day = list(SEASONS.values())[season]
    rest = dict(change)
    if count := rest.pop("count", None):
        day = replace(day, times=utc_times(_DATES[season], np.linspace(9.0, 16.0, count)))
    if sky := rest.pop("sky", None):
        day = replace(day, turbidity=sky)
    return Trial(day, **rest)


def _cell(results: Sequence[_Result]) -> str:
    """Median / mean error of the search, and of search and network together."""
    both = [np.concatenate(parts) for parts in zip(*(shape.errors() for shape in results), strict=True)]
    return ", ".join(f"{np.median(values):.1f} / {values.mean():.1f}" for values in both)


def _head(names: Sequence[str], say: Say) -> None:
    columns = [*names, *(f"{season}: search, network" for season in SEASONS)]
    say("| " + " | ".join(columns) + " |")
    say("|" + "---|" * len(columns))


def _row(names: Sequence[str], cells: Sequence[str], say: Say) -> None:
    say("| " + " | ".join([*names, *cells]) + " |")


# How long the normals of 512 x 512 pixels from eight photos take.

SIDE = 512  # pixels


def print_speed(say: Callable[[str], None]) -> None:
    """Print wall and processor seconds of the search alone and with the network, for one channel and for three.

    Args:
        say: takes each line.
    """
    day = SEASONS["47° N, June"]
    y, x = np.mgrid[:SIDE, :SIDE] / (SIDE / 2) - 1
    normals = np.stack([0.6 * x, -0.6 * y, np.sqrt(1 - 0.36 * (x * x + y * y))], axis=-1).reshape(-1, 3)
    world = camera_to_world(normals[::16], day.pose)
    for channels in (1, 3):
        skies = day.skies() if channels == 3 else gray_skies(day.skies())
        values = np.einsum("ptjc,pj->ptc", illumination_matrices(skies, world), world)
        images = np.moveaxis(np.repeat(values, 16, axis=0).reshape(SIDE, SIDE, -1, channels), 2, 0).astype(np.float32)
        images += np.random.default_rng(0).normal(0, 0.01 * images.max(), images.shape).astype(np.float32)
        session = Session(np.maximum(images, 0), np.ones((SIDE, SIDE), dtype=bool), skies, day.pose)
        for network in (None, Network.load()):
            wall, cpu = time.perf_counter(), os.times()
            solve_normals(session, network=network)
            spent = os.times().user + os.times().system - cpu.user - cpu.system
            how = "search and network" if network else "search"
            say(f"{channels} channel(s), {how}: {time.perf_counter() - wall:.0f} s, {spent:.0f} s of processor")


# Path-traced sessions.

_SIDE = 96  # pixels each way
_SAMPLES = 256  # paths for each pixel
_MAX_DEPTH = 5  # edges of a path
_MARGIN = 1.08  # of the picture, over the mesh's radius
_VARIANT = "scalar_rgb"


def _trace_mesh(
    file: Path, rotation: Floats, day: CaptureDay, skies: Skies, albedo: float
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Path-trace a mesh under each sky of a day.

    Args:
        file: an OBJ file.
        rotation: (3, 3) from the mesh's axes to the camera's.
        day: its pose is the camera's.
        skies: T skies of one channel.
        albedo: of the mesh, 0 to 1.

    Returns:
        Images (T, H, W, 1), true normals (H, W, 3) in the camera frame, and the mask (H, W).
    """
    mi = require_extra("mitsuba", "Path tracing needs Mitsuba", "test")
    mi.set_variant(_VARIANT)
    shape = _make_shape(mi, read_mesh(file), rotation, albedo)
    normals, mask = _trace_normals(mi, shape)
    images = [_trace_moment(mi, shape, skies, moment, day) for moment in range(len(skies))]
    return np.stack(images) * mask[None, :, :, None], normals, mask


def _make_shape(mi: Any, mesh: TriangleMesh, rotation: Floats, albedo: float) -> Any:
    points, triangles = mesh
    points = (points - (points.max(axis=0) + points.min(axis=0)) / 2) @ np.asarray(rotation, dtype=np.float32).T
    points = points / np.linalg.norm(points, axis=1).max()
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(
        {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}}}
    )
    shape = mi.Mesh("mesh", len(points), len(triangles), has_vertex_normals=True, props=properties)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.ascontiguousarray(points, dtype=np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(triangles, dtype=np.uint32).ravel()
    parameters.update()
    shape.recompute_vertex_normals()
    return shape


def _sensor(mi: Any) -> dict[str, Any]:
    to_world = mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0])
    return {
        "type": "orthographic",
        "to_world": to_world @ mi.ScalarTransform4f().scale([_MARGIN, _MARGIN, 1]),
        "film": {
            "type": "hdrfilm",
            "width": _SIDE,
            "height": _SIDE,
            "pixel_format": "rgb",
            "rfilter": {"type": "box"},
        },
    }


def _trace_normals(mi: Any, shape: Any) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    scene = mi.load_dict(
        {
            "type": "scene",
            "mesh": shape,
            "sensor": _sensor(mi),
            "integrator": {"type": "aov", "aovs": "normal:sh_normal,depth:depth"},
        }
    )
    planes = np.array(mi.render(scene, spp=64, seed=1))[..., -4:]
    normals = planes[..., :3]
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    mask = (length[..., 0] > 0.8) & (normals[..., 2] > 0.02)
    return np.asarray(normals / np.maximum(length, 1e-9) * mask[..., None], dtype=np.float32), mask


def _trace_moment(mi: Any, shape: Any, skies: Skies, moment: int, day: CaptureDay) -> NDArray[np.float32]:
    sun = world_to_camera(skies.sun_direction[moment], day.pose)
    sky = np.repeat(skies.radiance[moment], 3, axis=-1)
    scene = mi.load_dict(
        {
            "type": "scene",
            "mesh": shape,
            "sensor": _sensor(mi),
            "integrator": {"type": "path", "max_depth": _MAX_DEPTH, "hide_emitters": True},
            "sky": {
                "type": "envmap",
                "bitmap": mi.Bitmap(np.ascontiguousarray(sky)),
                "to_world": _sky_to_camera(mi, day),
            },
            "sun": {
                "type": "directional",
                "direction": (-sun).tolist(),
                "irradiance": {"type": "rgb", "value": float(skies.sun_irradiance[moment, 0])},
            },
        }
    )
    return np.array(mi.render(scene, spp=_SAMPLES, seed=2 + moment))[..., :1].astype(np.float32)


def _sky_to_camera(mi: Any, day: CaptureDay) -> Any:
    """Mitsuba's maps have +Z in the centre column; ours have north, -Z."""
    matrix = np.eye(4)
    matrix[:3, :3] = world_to_camera(np.diag([-1.0, 1.0, -1.0]), day.pose).T
    return mi.ScalarTransform4f(matrix)
