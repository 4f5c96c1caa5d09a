"""Simulated sessions: a shape photographed over a day, solved from what the photographer knows of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from export.stereo.days import Day, hours_of
from export.stereo.objects import Subject
from export.stereo.shading import Material, cast_shadows, shade
from lighting.geometry import Floats
from lighting.stereo.days import in_grey
from lighting.stereo.mean_light import Skies
from lighting.stereo.normals.frame import to_camera
from lighting.stereo.normals.haze import fitted_turbidity
from lighting.stereo.normals.network import Network
from lighting.stereo.normals.solve import Session, improved, solve_with_planes

Image = NDArray[np.float32]

HOURS = np.arange(9.0, 17.0)  # local solar time, about, of the eight photos
SEASONS = {
    "47° N, March": Day(hours_of("2024-03-21", HOURS), 47.0),
    "47° N, June": Day(hours_of("2024-06-21", HOURS), 47.0),
    "35° N, December": Day(hours_of("2024-12-21", HOURS), 35.0),
}

_ALBEDO = 0.6
_GAP = 8  # pixels between shapes


@dataclass(frozen=True)
class Trial:
    """How a session goes, and what its photographer gets wrong."""

    day: Day
    shadows: bool = False  # whether the surface shades itself from the sun
    gloss: float = 0.0
    colour: bool = False  # three channels in place of one
    noise: float = 0.01  # standard deviation, of the brightest pixel
    heading_error: float = 0.0  # deg
    clock_error: float = 0.0  # min
    turbidity_error: float = 0.0
    fitted: bool = False  # whether the turbidity is found from the photos

    def told(self) -> Day:
        """The day as its photographer believes it to be."""
        day = self.day
        late = np.timedelta64(round(60 * self.clock_error), "s")
        pose = replace(day.pose, heading=day.pose.heading + self.heading_error)
        return replace(day, times=day.times + late, turbidity=day.turbidity + self.turbidity_error, pose=pose)


@dataclass(frozen=True)
class Found:
    """What was found of one shape."""

    subject: Subject
    search: Image  # (H, W, 3), normals
    network: Image  # (H, W, 3), those of search and network together
    expected: Image  # (H, W), expected error of the latter [deg]

    def errors(self) -> tuple[Image, Image]:
        """Angles [deg] to the truth (P,), of the search and of both."""
        surface = self.subject.surface
        truth = surface.normals[surface.mask]
        search, network = (angle(normals[surface.mask], truth) for normals in (self.search, self.network))
        return search, network


def photograph(subject: Subject, trial: Trial, skies: Skies) -> Image:
    """Images (T, H, W, C) without noise."""
    surface, pose = subject.surface, trial.day.pose
    lit = None
    if trial.shadows:
        lit = cast_shadows(surface, np.argwhere(surface.mask), to_camera(skies.sun_direction, pose))
    normals = surface.normals[surface.mask]
    material = Material(np.full(len(normals), _ALBEDO, dtype=np.float32), trial.gloss)
    values = shade(normals, skies, pose, material, lit)
    images = np.zeros((values.shape[1], *surface.mask.shape, values.shape[2]), dtype=np.float32)
    images[:, surface.mask] = np.moveaxis(values, 1, 0)
    return images


def session(subjects: Sequence[Subject], trial: Trial, network: Network | None) -> list[Found]:
    """Shapes that stand side by side in the photos of one day, solved together."""
    told, skies = trial.told(), trial.day.skies()
    skies = skies if trial.colour else in_grey(skies)
    sheet, windows = _side_by_side([photograph(subject, trial, skies) for subject in subjects])
    mask = np.zeros(sheet.shape[1:3], dtype=bool)
    for subject, window in zip(subjects, windows, strict=True):
        mask[window] = subject.surface.mask
    noise = np.random.default_rng(7).normal(0, trial.noise * sheet.max(), sheet.shape).astype(np.float32)
    images = np.maximum(sheet + noise, 0)

    def believed(turbidity: float, height: int = 32) -> Session:
        seen = replace(told, turbidity=turbidity).skies(height)
        return Session(images, mask, seen if trial.colour else in_grey(seen), told.pose)

    turbidity = fitted_turbidity(believed) if trial.fitted else told.turbidity
    alone, planes = solve_with_planes(believed(turbidity, 64))
    both = alone if network is None else improved(alone, network, planes)
    return [
        Found(subject, alone.normal[window], both.normal[window], both.error[window])
        for subject, window in zip(subjects, windows, strict=True)
    ]


def _side_by_side(pictures: list[Image]) -> tuple[Image, list[tuple[slice, slice]]]:
    """Pictures (T, H, W, C) of any sizes in one, and where each is."""
    height = max(picture.shape[1] for picture in pictures)
    padded = [np.pad(p, [(0, 0), (0, height - p.shape[1]), (0, _GAP), (0, 0)]) for p in pictures]
    starts = np.cumsum([0, *(picture.shape[2] for picture in padded)])
    windows = [
        (slice(0, picture.shape[1]), slice(int(start), int(start) + picture.shape[2]))
        for picture, start in zip(pictures, starts[:-1], strict=True)
    ]
    return np.concatenate(padded, axis=2), windows


def angle(a: Floats, b: Floats) -> Image:
    """Angles [deg] between unit vectors (P, 3)."""
    half = np.linalg.norm(a - b, axis=-1) / 2
    return np.asarray(np.degrees(2 * np.arcsin(np.minimum(half, 1))), dtype=np.float32)
