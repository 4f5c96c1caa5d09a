"""Streets, woods, courtyards as meshes."""

from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats

# Meshes of coloured quads and the box that most things are built of; lengths in m, +Y up, the ground at y = 0.


@dataclass(frozen=True)
class Mesh:
    """Quads with one colour each: corners (Q, 4, 3) and linear albedos (Q, 3)."""

    corners: Floats
    albedo: Floats


def _join(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    return Mesh(np.concatenate([m.corners for m in meshes]), np.concatenate([m.albedo for m in meshes]))


def _turned(points: Floats, yaw: float) -> Floats:
    """Points (..., 3) turned about +Y by `yaw` [deg]."""
    s, c = np.sin(np.radians(yaw)), np.cos(np.radians(yaw))
    return np.asarray(points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T)


def _box(centre: Floats, size: Floats, yaw: float, colour: Floats) -> Mesh:
    """A box standing on the ground at `centre` (x, z), turned by `yaw` [deg]."""
    x, y, z = np.array([[-1, 1, 1, -1], [0, 0, 0, 0], [-1, -1, 1, 1]], float) / 2
    low, high = np.stack([x, y, z], 1), np.stack([x, y + 1, z], 1)
    sides = [np.stack([low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i]]) for i in range(4)]
    corners = np.stack([*sides, high]) * size
    return Mesh(_moved(_turned(corners, yaw), centre), np.tile(colour, (5, 1)))


def _moved(points: Floats, centre: Floats) -> Floats:
    """Points (..., 3) moved over the ground by `centre` (x, z)."""
    return np.asarray(points + np.array([centre[0], 0.0, centre[1]]))


# What stands in a place: houses, trees, cars, people, walls, stones, roads and the ground, drawn at random.

STONE = (
    (0.55, 0.48, 0.4),
    (0.6, 0.58, 0.55),
    (0.45, 0.22, 0.16),
    (0.7, 0.66, 0.58),
    (0.4, 0.42, 0.45),
    (0.66, 0.5, 0.3),
)
LEAVES = ((0.06, 0.12, 0.03), (0.09, 0.15, 0.04), (0.14, 0.16, 0.05), (0.2, 0.13, 0.05), (0.05, 0.09, 0.05))
GROUND = (
    (0.09, 0.13, 0.04),
    (0.25, 0.2, 0.14),
    (0.16, 0.16, 0.16),
    (0.35, 0.3, 0.22),
    (0.45, 0.42, 0.38),
    (0.12, 0.1, 0.08),
)
BARK = (0.12, 0.09, 0.07)
GLASS = (0.05, 0.06, 0.08)


def _house(rng: np.random.Generator, centre: Floats, yaw: float) -> list[Mesh]:
    """A block with rows of windows, and a gabled roof on the lower ones."""
    floors = int(rng.integers(1, 7))
    size = np.array([rng.uniform(6, 22), 3.1 * floors, rng.uniform(6, 16)])
    wall = _colour(rng, STONE)
    body = _box(centre, size, yaw, wall)
    parts = [body, _windows(rng, size, yaw, centre, floors)]
    if floors < 4 and rng.random() < 0.7:
        parts.append(_roof(size, rng.uniform(1.5, 4), yaw, centre, _colour(rng, STONE[2:])))
    return parts


def _windows(rng: np.random.Generator, size: Floats, yaw: float, centre: Floats, floors: int) -> Mesh:
    """Dark panes just in front of the walls of a house."""
    pane = rng.uniform((0.7, 1.0), (1.6, 2.0))
    quads = []
    for side in range(4):
        width, depth = (size[0], size[2]) if side % 2 == 0 else (size[2], size[0])
        across = np.arange(1.5, width - 1.5, pane[0] + rng.uniform(0.8, 2.5)) - width / 2
        for floor in range(floors):
            for x in across:
                y = 3.1 * floor + 0.8
                quad = np.array([[x, y], [x + pane[0], y], [x + pane[0], y + pane[1]], [x, y + pane[1]]])
                flat = np.column_stack([quad, np.full(4, depth / 2 + 0.04)])
                quads.append(_turned(_turned(flat, 90.0 * side), yaw))
    if not quads:
        return Mesh(np.zeros((0, 4, 3)), np.zeros((0, 3)))
    corners = _moved(np.stack(quads), centre)
    return Mesh(corners, np.tile(GLASS, (len(corners), 1)))


def _roof(size: Floats, rise: float, yaw: float, centre: Floats, tint: Floats) -> Mesh:
    """A gabled roof along x over a box, with eaves of half a metre."""
    w, d, base = size[0] / 2 + 0.4, size[2] / 2 + 0.5, size[1]
    ridge = [[-w, base + rise, 0], [w, base + rise, 0]]
    front = [[-w, base - 0.2, d], [w, base - 0.2, d], ridge[1], ridge[0]]
    back = [[w, base - 0.2, -d], [-w, base - 0.2, -d], ridge[0], ridge[1]]
    gables = [[[x, base, -d], [x, base, d], [x, base + rise, 0], [x, base + rise, 0]] for x in (-w + 0.4, w - 0.4)]
    corners = _moved(_turned(np.array([front, back, *gables], float), yaw), centre)
    return Mesh(corners, np.tile(tint, (4, 1)))


def _tree(rng: np.random.Generator, centre: Floats) -> list[Mesh]:
    """A trunk and a crown of loose leaves, round or conical: light falls through it."""
    height = rng.uniform(3, 14)
    crown, foot = height * rng.uniform(0.2, 0.4), height * rng.uniform(0.1, 0.35)
    leaves = int(rng.uniform(700, 2500))
    middle = rng.normal(size=(leaves, 3))
    middle *= (rng.random(leaves) ** (1 / 3) / np.linalg.norm(middle, axis=1))[:, None]
    if rng.random() < 0.35:
        middle[:, [0, 2]] *= (0.5 - middle[:, 1:2] / 2) * 1.3
    middle = middle * [crown, (height - foot) / 2, crown] + [centre[0], (height + foot) / 2, centre[1]]
    size = rng.uniform(0.08, 0.2) * height**0.5
    a, b = rng.normal(size=(2, leaves, 3)) * size / 2
    corners = np.stack([middle - a - b, middle + a - b, middle + a + b, middle - a + b], axis=1)
    tint = _colour(rng, LEAVES) * np.exp(rng.normal(0, 0.25, (leaves, 1)))
    thick = 0.05 * height**0.7 + 0.08
    trunk = _box(centre, np.array([thick, (height + foot) / 2, thick]), rng.uniform(0, 90), np.array(BARK))
    return [Mesh(corners, tint), trunk]


def _car(rng: np.random.Generator, centre: Floats, yaw: float) -> list[Mesh]:
    """Two boxes: body and cabin."""
    paint = np.clip(
        rng.choice([0.03, 0.2, 0.5, 0.7]) * np.exp(rng.normal(0, 0.5, 3) * rng.choice([0.05, 1])), 0.02, 0.8
    )
    body = _box(centre, np.array([4.3, 0.9, 1.8]), yaw, paint)
    cabin = _box(centre, np.array([2.2, 1.45, 1.6]), yaw, np.array(GLASS))
    return [body, cabin]


def _person(rng: np.random.Generator, centre: Floats) -> list[Mesh]:
    """A body, legs and a head, as boxes."""
    yaw, tall = rng.uniform(0, 360), rng.uniform(1.5, 1.9)
    coat, skin = np.clip(np.exp(rng.normal(-1.6, 0.8, 3)), 0.02, 0.7), np.array([0.4, 0.27, 0.2])
    return [
        _box(centre, np.array([0.45, tall * 0.84, 0.28]), yaw, coat),
        _box(centre, np.array([0.2, tall, 0.22]), yaw, skin),
    ]


def _colour(rng: np.random.Generator, palette: tuple[tuple[float, ...], ...]) -> Floats:
    """One of the palette's albedos, varied."""
    albedo = np.array(palette[rng.integers(len(palette))]) * np.exp(rng.normal(0, (0.15, 0.1, 0.15)))
    return np.asarray(np.clip(albedo, 0.02, 0.85))


def _ground(rng: np.random.Generator) -> Mesh:
    """Rings of cells around the camera, finer near it, rising to hills at times, coloured by patches and grain."""
    rings = np.concatenate([np.linspace(0, 12, 90), np.geomspace(12.5, 900, 80)])
    around = np.linspace(0, 2 * np.pi, 241)
    hills = rng.uniform(0, 70) * (rng.random() < 0.4)
    wave, phase = rng.normal(0, 1 / 90, (6, 2)), rng.uniform(0, 2 * np.pi, 6)
    x, z = np.outer(rings, np.cos(around)), np.outer(rings, np.sin(around))
    height = np.sin(x[..., None] * wave[:, 0] + z[..., None] * wave[:, 1] + phase).sum(axis=-1) / 3
    y = hills * height * np.clip((rings[:, None] - 60) / 200, 0, 1) ** 1.5
    grid = np.stack([x, y, z], axis=-1)
    corners = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4, 3)
    middle = corners.mean(axis=1)
    first, second = _colour(rng, GROUND), _colour(rng, GROUND)
    patch = np.sin(middle[:, [0, 2]] @ rng.normal(0, rng.choice([0.05, 0.3]), (2, 4)) + rng.uniform(0, 6, 4)).sum(
        axis=1
    )
    albedo = np.where((patch > rng.uniform(-1.5, 1.5))[:, None], first, second)
    return Mesh(corners, np.clip(albedo * np.exp(rng.normal(0, rng.uniform(0.02, 0.2), (len(albedo), 1))), 0.01, 0.85))


def _road(rng: np.random.Generator, yaw: float, offset: float) -> Mesh:
    """A strip of asphalt with a dashed line, `offset` beside the camera."""
    dark, white = np.full(3, rng.uniform(0.06, 0.2)), np.full(3, 0.7)
    half = rng.uniform(2.5, 6)
    strip = [
        [-300, 0.02, offset - half],
        [300, 0.02, offset - half],
        [300, 0.02, offset + half],
        [-300, 0.02, offset + half],
    ]
    start = np.arange(-90, 90, 6.0)
    dash = [
        [[s, 0.03, offset - 0.07], [s + 3, 0.03, offset - 0.07], [s + 3, 0.03, offset + 0.07], [s, 0.03, offset + 0.07]]
        for s in start
    ]
    return Mesh(_turned(np.array([strip, *dash], float), yaw), np.array([dark, *[white] * len(dash)]))


def _wall(rng: np.random.Generator, yaw: float) -> Mesh:
    """A low wall or a hedge, along the street or across it."""
    size = np.array([rng.uniform(2, 20), rng.uniform(0.5, 2.2), rng.uniform(0.15, 0.8)])
    tint = _colour(rng, STONE if rng.random() < 0.6 else LEAVES)
    return _box(_spot(rng, 5, 30), size, yaw + rng.choice([0.0, 90.0, rng.uniform(0, 180)]), tint)


def _rock(rng: np.random.Generator) -> Mesh:
    """A stone, a bin, a box: something small that throws a shadow."""
    return _box(_spot(rng, 1.5, 20), rng.uniform(0.1, 1.1, 3), rng.uniform(0, 90), _colour(rng, STONE + GROUND))


def _spot(rng: np.random.Generator, near: float, far: float) -> Floats:
    """Where a thing stands (x, z), more often near than far."""
    azimuth, distance = rng.uniform(0, 2 * np.pi), near + (far - near) * rng.random() ** 1.5
    return np.asarray(distance * np.array([np.sin(azimuth), np.cos(azimuth)]))


EYE = 1.65  # m, the camera's height
KINDS = ("street", "square", "courtyard", "wood", "country")


def random_town(rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    """The matte and the glossy mesh of a random place of one of KINDS."""
    kind, yaw = str(rng.choice(KINDS)), rng.uniform(0, 360)
    matte, glossy = [_ground(rng)], [_box(np.array([900.0, 900.0]), np.ones(3), 0, np.array(GLASS))]
    if kind in ("street", "square") or rng.random() < 0.4:
        matte.append(_road(rng, yaw, rng.uniform(-4, 4)))
    for centre, facing in _plots(rng, kind, yaw):
        matte += _house(rng, centre, facing)
    for _ in range(int(rng.integers(0, {"wood": 60, "country": 30}.get(kind, 14)))):
        matte += _tree(rng, _spot(rng, 3.5, 80))
    for _ in range(int(rng.integers(0, 9 if kind != "wood" else 2))):
        glossy += _car(rng, _spot(rng, 3.5, 35), yaw + rng.normal(0, 3))
    for _ in range(int(rng.integers(0, 12))):
        matte += _person(rng, _spot(rng, 2, 25))
    for _ in range(int(rng.integers(0, 12))):
        thin = rng.uniform(0.08, 0.25)
        matte.append(_box(_spot(rng, 2, 30), np.array([thin, rng.uniform(1, 8), thin]), 0, _colour(rng, STONE)))
    for _ in range(int(rng.integers(0, 6))):
        matte.append(_wall(rng, yaw))
    for _ in range(int(rng.integers(0, 30))):
        matte.append(_rock(rng))
    return _join(matte), _join(glossy)


def _plots(rng: np.random.Generator, kind: str, yaw: float) -> list[tuple[Floats, float]]:
    """Where houses stand (x, z) and the direction [deg] that they face."""
    if kind in ("country", "wood"):
        return [(_spot(rng, 30, 120), rng.uniform(0, 360)) for _ in range(rng.integers(0, 4))]
    if kind == "street":
        along, apart = np.arange(-110, 110, rng.uniform(10, 22)), rng.uniform(12, 26)
        sides = [(a, side * (apart + rng.uniform(0, 3))) for a in along for side in (-1, 1) if rng.random() < 0.85]
        return [(_turned(np.array([a, 0, b]), yaw)[[0, 2]], float(yaw)) for a, b in sides]
    radius = rng.uniform(15, 24) if kind == "courtyard" else rng.uniform(24, 50)
    angles = np.arange(0, 360, np.degrees(rng.uniform(11, 20) / radius))
    spots = [radius * np.array([np.sin(a), np.cos(a)]) for a in np.radians(angles)]
    return [(s, float(a)) for s, a in zip(spots, angles, strict=True) if rng.random() < 0.8]
