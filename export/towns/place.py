"""Procedural places: streets, squares, courtyards, woods and open country, with the camera at EYE above the origin."""

import numpy as np

from export.towns.mesh import Mesh, box, join, turned
from export.towns.things import GLASS, STONE, car, colour, ground, house, person, road, rock, spot, tree, wall
from lighting.geometry import Floats

EYE = 1.65  # m, the camera's height
KINDS = ("street", "square", "courtyard", "wood", "country")


def place(rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    """The matte and the glossy mesh of a random place of one of KINDS."""
    kind, yaw = str(rng.choice(KINDS)), rng.uniform(0, 360)
    matte, glossy = [ground(rng)], [box(np.array([900.0, 900.0]), np.ones(3), 0, np.array(GLASS))]
    if kind in ("street", "square") or rng.random() < 0.4:
        matte.append(road(rng, yaw, rng.uniform(-4, 4)))
    for centre, facing in _plots(rng, kind, yaw):
        matte += house(rng, centre, facing)
    for _ in range(int(rng.integers(0, {"wood": 60, "country": 30}.get(kind, 14)))):
        matte += tree(rng, spot(rng, 3.5, 80))
    for _ in range(int(rng.integers(0, 9 if kind != "wood" else 2))):
        glossy += car(rng, spot(rng, 3.5, 35), yaw + rng.normal(0, 3))
    for _ in range(int(rng.integers(0, 12))):
        matte += person(rng, spot(rng, 2, 25))
    for _ in range(int(rng.integers(0, 12))):
        thin = rng.uniform(0.08, 0.25)
        matte.append(box(spot(rng, 2, 30), np.array([thin, rng.uniform(1, 8), thin]), 0, colour(rng, STONE)))
    for _ in range(int(rng.integers(0, 6))):
        matte.append(wall(rng, yaw))
    for _ in range(int(rng.integers(0, 30))):
        matte.append(rock(rng))
    return join(matte), join(glossy)


def _plots(rng: np.random.Generator, kind: str, yaw: float) -> list[tuple[Floats, float]]:
    """Where houses stand (x, z) and the direction [deg] that they face."""
    if kind in ("country", "wood"):
        return [(spot(rng, 30, 120), rng.uniform(0, 360)) for _ in range(rng.integers(0, 4))]
    if kind == "street":
        along, apart = np.arange(-110, 110, rng.uniform(10, 22)), rng.uniform(12, 26)
        sides = [(a, side * (apart + rng.uniform(0, 3))) for a in along for side in (-1, 1) if rng.random() < 0.85]
        return [(turned(np.array([a, 0, b]), yaw)[[0, 2]], float(yaw)) for a, b in sides]
    radius = rng.uniform(15, 24) if kind == "courtyard" else rng.uniform(24, 50)
    angles = np.arange(0, 360, np.degrees(rng.uniform(11, 20) / radius))
    spots = [radius * np.array([np.sin(a), np.cos(a)]) for a in np.radians(angles)]
    return [(s, float(a)) for s, a in zip(spots, angles, strict=True) if rng.random() < 0.8]
