"""Simulated sessions: a shape photographed over a day, solved from what the photographer knows of it."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.stereo.days import Day, hours_of
from export.stereo.objects import Subject
from export.stereo.shading import Material, cast_shadows, shade
from lighting.stereo.days import in_grey
from lighting.stereo.normals_frame import to_camera
from lighting.stereo.normals_network import Network
from lighting.stereo.normals_solve import NormalMap, improved, solve_with_planes

Floats = NDArray[np.floating[Any]]
Image = NDArray[np.float32]

HOURS = np.arange(9.0, 17.0)  # local solar time, about, of the eight photos
SEASONS = {
    "47° N, March": Day(hours_of("2024-03-21", HOURS), 47.0),
    "47° N, June": Day(hours_of("2024-06-21", HOURS), 47.0),
    "35° N, December": Day(hours_of("2024-12-21", HOURS), 35.0),
}

_ALBEDO = 0.6


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

    def told(self) -> Day:
        """The day as its photographer believes it to be."""
        day = self.day
        late = np.timedelta64(round(60 * self.clock_error), "s")
        pose = replace(day.pose, heading=day.pose.heading + self.heading_error)
        return replace(day, times=day.times + late, turbidity=day.turbidity + self.turbidity_error, pose=pose)


@dataclass
class Errors:
    """Angles [deg] between found and true normals, gathered over shapes."""

    search: list[Image] = field(default_factory=list)
    network: list[Image] = field(default_factory=list)
    expected: list[Image] = field(default_factory=list)  # by the network, or by the search without one

    def add(self, other: "Errors") -> None:
        """Take over what another one gathered."""
        self.search += other.search
        self.network += other.network
        self.expected += other.expected


def photograph(subject: Subject, trial: Trial) -> Image:
    """Images (T, H, W, C) with noise; the shape is the same every time it is photographed alike."""
    surface, day = subject.surface, trial.day
    skies = day.skies() if trial.colour else in_grey(day.skies())
    lit = None
    if trial.shadows:
        lit = cast_shadows(surface, np.argwhere(surface.mask), to_camera(skies.sun_direction, day.pose))
    normals = surface.normals[surface.mask]
    material = Material(np.full(len(normals), _ALBEDO, dtype=np.float32), trial.gloss)
    values = shade(normals, skies, day.pose, material, lit)
    values += np.random.default_rng(7).normal(0, trial.noise * values.max(), values.shape).astype(np.float32)
    images = np.zeros((values.shape[1], *surface.mask.shape, values.shape[2]), dtype=np.float32)
    images[:, surface.mask] = np.moveaxis(np.maximum(values, 0), 1, 0)
    return images


def solved(subject: Subject, trial: Trial, network: Network | None) -> tuple[NormalMap, NormalMap]:
    """What the search alone and the default, search and network, find."""
    told = trial.told()
    skies = told.skies() if trial.colour else in_grey(told.skies())
    images, mask = photograph(subject, trial), subject.surface.mask
    alone, planes = solve_with_planes(images, mask, skies, told.pose)
    return alone, alone if network is None else improved(alone, network, planes)


def errors(subject: Subject, trial: Trial, network: Network | None) -> Errors:
    """How far the normals are off at each pixel."""
    alone, both = solved(subject, trial, network)
    mask = subject.surface.mask
    truth = subject.surface.normals[mask]
    return Errors([angle(alone.normal[mask], truth)], [angle(both.normal[mask], truth)], [both.error[mask]])


def angle(a: Floats, b: Floats) -> Image:
    """Angles [deg] between unit vectors (P, 3)."""
    half = np.linalg.norm(a - b, axis=-1) / 2
    return np.asarray(np.degrees(2 * np.arcsin(np.minimum(half, 1))), dtype=np.float32)
