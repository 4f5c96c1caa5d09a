"""How well the turn of two photos is found: panoramas seen twice from one point or zoomed, walks, strangers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from tqdm import tqdm

from export.crops import Camera, generator
from export.data import Panorama
from export.turns.sets import FOVS, GAINS, HEIGHT, WIDTH, across, exposed, photo, sweep
from export.turns.walk import Standpoint, Walk
from lighting.geometry import angles, wrap_azimuth
from lighting.turns import GUESSED_FOV_SIGMA, Features, Turn, features, relative_rotation
from lighting.turns.upright import own_axes

ZOOMS, ASIDE = (1.2, 3.0), (3.0, 15.0)  # times, and deg between two photos of which one is zoomed
STEPS = (0.3, 3.0)  # m between two standpoints
WALKED_OVERLAPS = (0.4, 0.9)
ELEVATIONS = 8.0  # deg, of a walker's camera, up or down
WRONG = 2.0  # deg of heading from which a turn is wrong
GUESS = 5.0  # deg, standard deviation of the field of view that a network would guess


@dataclass(frozen=True)
class Answer:
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


def turned(panoramas: Sequence[Panorama]) -> tuple[list[Answer], list[Turn | None]]:
    """The answers about two overlapping photos of each panorama, and about one of each with one of the next."""
    answers, shown = [], []
    for panorama in tqdm(panoramas, unit="pair"):
        a, b = sweep(panorama, 2, "pair")
        seen = features(a.pixels), features(b.pixels)
        shown.append(seen)
        answers.append(Answer(relative_rotation(*seen), a.camera, b.camera))
    strangers = [relative_rotation(a[0], b[1]) for a, b in zip(shown, [*shown[1:], shown[0]], strict=True)]
    return answers, strangers


def zoomed(panoramas: Sequence[Panorama]) -> Iterator[Answer]:
    """The answers about two photos of each panorama, the second through a longer lens."""
    for panorama in tqdm(panoramas, unit="zoom"):
        rng = generator(panorama.name, 2, "zoom")
        a, b = (Camera(0.0, rng.uniform(-10, 15), rng.normal(0, 2), fov, WIDTH / HEIGHT) for fov in _two_lenses(rng))
        b = replace(b, azimuth=rng.uniform(*ASIDE) * rng.choice([-1, 1]))
        picture, fov = exposed(panorama), 0.5 * (a.vertical_fov + b.vertical_fov) + rng.normal(0, GUESS)
        first, second = (features(photo(picture, camera, rng.uniform(*GAINS, 3))) for camera in (a, b))
        yield Answer(relative_rotation(first, second, fov, fov, GUESSED_FOV_SIGMA), a, b)


def _two_lenses(rng: np.random.Generator) -> tuple[float, float]:
    fov = rng.uniform(*FOVS)
    return fov, float(2 * np.degrees(np.arctan(np.tan(np.radians(fov / 2)) / rng.uniform(*ZOOMS))))


def walked(count: int) -> Iterator[Answer]:
    """The answers about two photos of each of `count` rendered places, from standpoints some steps apart."""
    for number in tqdm(range(count), unit="walk"):
        (a, first), (b, second) = two_of(number)
        rng = np.random.default_rng([6, number])
        fov = first.vertical_fov + rng.normal(0, GUESS)
        yield Answer(relative_rotation(a, b, fov, fov, GUESSED_FOV_SIGMA), first, second)


def two_of(number: int) -> list[tuple[Features, Camera]]:
    """Two photos of a walk, neither with something just before the lens."""
    walk, rng = Walk(number), np.random.default_rng([5, number])
    for _ in range(60):
        pair = _standpoints(rng)
        if all(walk.is_clear(at) for at in pair):
            break
    return [(features(walk.photo(at, WIDTH, HEIGHT)), at.camera(WIDTH / HEIGHT)) for at in pair]


def _standpoints(rng: np.random.Generator) -> tuple[Standpoint, Standpoint]:
    fov = rng.uniform(40, 65)
    turn = across(fov) * (1 - rng.uniform(*WALKED_OVERLAPS)) * rng.choice([-1, 1])
    azimuth, step, way = rng.uniform(-180, 180), rng.uniform(*STEPS), rng.uniform(0, 2 * np.pi)
    there = (float(step * np.sin(way)), float(step * np.cos(way)))
    tilts = [(rng.uniform(-ELEVATIONS, ELEVATIONS), rng.normal(0, 2)) for _ in range(2)]
    return Standpoint((0.0, 0.0), azimuth, *tilts[0], fov), Standpoint(there, azimuth + turn, *tilts[1], fov)


def figures(answers: Sequence[Answer]) -> dict[str, float]:
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
        "over 2° [% of all]": 100 * float(np.sum(heading > WRONG)) / len(answers),
        "field of view, 50 %": float(np.median(fov)),
        "field of view, 95 %": float(np.quantile(fov, 0.95)),
        "rotation over its sigma, 50 %": float(np.median(off / sigma)),
        "95 %": float(np.quantile(off / sigma, 0.95)),
    }


def by_overlap(answers: Sequence[Answer]) -> dict[str, list[Answer]]:
    """The answers in thirds of the overlap."""
    share = np.array([1 - _apart(a) / across(a.first.vertical_fov) for a in answers])
    edges = (0.25, 0.4, 0.55, 0.71)
    return {
        f"overlap {100 * low:.0f} to {100 * high:.0f} %": [
            a for a, s in zip(answers, share, strict=True) if low <= s < high
        ]
        for low, high in pairwise(edges)
    }


def _apart(answer: Answer) -> float:
    return abs(float(wrap_azimuth(answer.second.azimuth - answer.first.azimuth)))
