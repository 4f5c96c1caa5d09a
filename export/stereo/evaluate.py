"""Errors of normals on shapes and latitudes that training never saw.

Every figure is of simulated photos under Hosek-Wilkie skies, median / mean angle in degrees over all pixels; none is of
real photographs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.stereo.renders import CaptureDay, Material, Subject, cast_shadows, read_subjects, shade_surface, utc_times
from lighting.errors import LightingError
from lighting.geometry import Floats
from lighting.stereo.light_vectors import Skies, gray_skies
from lighting.stereo.normal_network import Network
from lighting.stereo.normal_search import world_to_camera
from lighting.stereo.output import depth_error, integrate_normals
from lighting.stereo.solver import Session, add_model_error, apply_network, fit_turbidity, solve_with_planes

# Simulated sessions: a shape photographed over a day, solved from what the photographer knows of it.

Image = NDArray[np.float32]

_HOURS = np.arange(9.0, 17.0)  # local solar time, about, of the eight photos
SEASONS = {
    "47° N, March": CaptureDay(utc_times("2024-03-21", _HOURS), 47.0),
    "47° N, June": CaptureDay(utc_times("2024-06-21", _HOURS), 47.0),
    "35° N, December": CaptureDay(utc_times("2024-12-21", _HOURS), 35.0),
}

_ALBEDO = 0.6
_NOISE = 0.01  # standard deviation, of the brightest pixel
_GAP = 8  # pixels between shapes


@dataclass(frozen=True)
class Trial:
    """How a session goes, and what its photographer gets wrong."""

    day: CaptureDay
    shadows: bool = False  # whether the surface shades itself from the sun
    gloss: float = 0.0
    color: bool = False  # three channels in place of one
    heading_error: float = 0.0  # deg
    fitted: bool = False  # whether the turbidity is fitted to the photos
    drift: float = 0.0  # share by which the last photo is darker than its EXIF says, the others in proportion

    def believed(self) -> CaptureDay:
        """The day as its photographer believes it to be."""
        pose = replace(self.day.pose, heading=self.day.pose.heading + self.heading_error)
        return replace(self.day, pose=pose)


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
    noise = np.random.default_rng(7).normal(0, _NOISE * sheet.max(), sheet.shape).astype(np.float32)
    gain = np.linspace(1, 1 - trial.drift, len(sheet), dtype=np.float32)
    images = np.maximum(sheet + noise, 0) * gain[:, None, None, None]

    def solver_input(turbidity: float, height: int = 32) -> Session:
        skies = replace(believed, turbidity=turbidity).skies(height)
        return Session(images, mask, skies if trial.color else gray_skies(skies), believed.pose)

    turbidity = fit_turbidity(solver_input) if trial.fitted else believed.turbidity
    alone, planes = solve_with_planes(solver_input(turbidity, 64))
    both = add_model_error(alone if network is None else apply_network(alone, network, planes))
    placed = zip(subjects, windows, strict=True)
    return [_Result(s, alone.normal[at], both.normal[at], both.error[at]) for s, at in placed]


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

FINE, _COARSE = 2, 4  # every so many pixels of the shapes, in the tables of seasons and in the other

TABLES = ("seasons", "expected")

_UNEXPECTED: dict[str, dict[str, Any]] = {
    "nothing wrong": {},
    "cast shadows": {"shadows": True},
    "gloss of 0.2": {"gloss": 0.2, "fitted": True},
    "exposure that falls by 20 %": {"drift": 0.2, "fitted": True},
    "exposure that falls by 50 %": {"drift": 0.5, "fitted": True},
    "heading off by 180°": {"heading_error": 180.0, "fitted": True},
}


def evaluate_normals(data: Path, network: Network, say: Say, tables: Sequence[str] = TABLES) -> None:
    """Print tables of errors on shapes that training never saw.

    Args:
        data: folder with `scanned_objects` and `meshes`.
        network: to score.
        say: takes each part as text.
        tables: of TABLES.

    Raises:
        LightingError: where no shape is at hand.
    """
    coarse = list(read_subjects(data, _COARSE))
    if not coarse:
        raise LightingError(f"{data} holds no scanned_objects and no meshes.")
    scanned = [subject for subject in coarse if subject.scale] or coarse
    for table in tables:
        if table == "expected":
            _expected(scanned, network, say)
        else:
            _seasons(list(read_subjects(data, FINE)), network, say)


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


def _expected(shapes: Sequence[Subject], network: Network, say: Say) -> None:
    """True and expected errors where the model is wrong."""
    say("\nMean error: true, expected; search and network, one channel\n")
    say("| What is wrong | " + " | ".join(SEASONS) + " |")
    say("|" + "---|" * (1 + len(SEASONS)))
    for name, change in _UNEXPECTED.items():
        cells = []
        for day in SEASONS.values():
            results = run_session(shapes, Trial(day, **change), network)
            true = np.concatenate([result.errors()[1] for result in results])
            expected = np.concatenate([result.expected[result.subject.surface.mask] for result in results])
            cells.append(f"{true.mean():.0f}, {expected.mean():.0f}")
        _row((name,), cells, say)


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
