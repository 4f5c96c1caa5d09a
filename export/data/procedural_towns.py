"""Streets, squares, courtyards, woods and open country as meshes of colored quads; m, +Y up, the ground at y = 0."""

from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats

EYE = 1.65  # m, the camera's height
_KINDS = ("street", "square", "courtyard", "wood", "country")

# Linear albedos.
_STONE = (
    (0.55, 0.48, 0.4),
    (0.6, 0.58, 0.55),
    (0.45, 0.22, 0.16),
    (0.7, 0.66, 0.58),
    (0.4, 0.42, 0.45),
    (0.66, 0.5, 0.3),
)
_LEAVES = ((0.06, 0.12, 0.03), (0.09, 0.15, 0.04), (0.14, 0.16, 0.05), (0.2, 0.13, 0.05), (0.05, 0.09, 0.05))
_GROUND = (
    (0.09, 0.13, 0.04),
    (0.25, 0.2, 0.14),
    (0.16, 0.16, 0.16),
    (0.35, 0.3, 0.22),
    (0.45, 0.42, 0.38),
    (0.12, 0.1, 0.08),
)
_BARK = (0.12, 0.09, 0.07)
_GLASS = (0.05, 0.06, 0.08)


@dataclass(frozen=True)
class Mesh:
    """Quads with one color each: corners (Q, 4, 3) and linear albedos (Q, 3)."""

    corners: Floats
    albedo: Floats


def _join(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    return Mesh(np.concatenate([m.corners for m in meshes]), np.concatenate([m.albedo for m in meshes]))


def _rotate(points: Floats, yaw: float) -> Floats:
    """Points (..., 3) rotated about +Y by `yaw` [deg]."""
    s, c = np.sin(np.radians(yaw)), np.cos(np.radians(yaw))
    return np.asarray(points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T)


def _box(center: Floats, size: Floats, yaw: float, color: Floats) -> Mesh:
    """A box standing on the ground at `center` (x, z), rotated by `yaw` [deg]."""
    x, y, z = np.array([[-1, 1, 1, -1], [0, 0, 0, 0], [-1, -1, 1, 1]], float) / 2
    low, high = np.stack([x, y, z], 1), np.stack([x, y + 1, z], 1)
    sides = [np.stack([low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i]]) for i in range(4)]
    corners = np.stack([*sides, high]) * size
    return Mesh(_translate(_rotate(corners, yaw), center), np.tile(color, (5, 1)))


def _translate(points: Floats, center: Floats) -> Floats:
    """Points (..., 3) moved over the ground by `center` (x, z)."""
    return np.asarray(points + np.array([center[0], 0.0, center[1]]))


def _house(rng: np.random.Generator, center: Floats, yaw: float) -> list[Mesh]:
    """A block with rows of windows, and a gabled roof on the lower ones."""
    floors = int(rng.integers(1, 7))
    size = np.array([rng.uniform(6, 22), 3.1 * floors, rng.uniform(6, 16)])
    wall = _color(rng, _STONE)
    body = _box(center, size, yaw, wall)
    parts = [body, _windows(rng, size, yaw, center, floors)]
    if floors < 4 and rng.random() < 0.7:
        parts.append(_roof(size, rng.uniform(1.5, 4), yaw, center, _color(rng, _STONE[2:])))
    return parts


def _windows(rng: np.random.Generator, size: Floats, yaw: float, center: Floats, floors: int) -> Mesh:
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
                quads.append(_rotate(_rotate(flat, 90.0 * side), yaw))
    if not quads:
        return Mesh(np.zeros((0, 4, 3)), np.zeros((0, 3)))
    corners = _translate(np.stack(quads), center)
    return Mesh(corners, np.tile(_GLASS, (len(corners), 1)))


def _roof(size: Floats, rise: float, yaw: float, center: Floats, tint: Floats) -> Mesh:
    """A gabled roof along x over a box, with eaves of half a metre."""
    w, d, base = size[0] / 2 + 0.4, size[2] / 2 + 0.5, size[1]
    ridge = [[-w, base + rise, 0], [w, base + rise, 0]]
    front = [[-w, base - 0.2, d], [w, base - 0.2, d], ridge[1], ridge[0]]
    back = [[w, base - 0.2, -d], [-w, base - 0.2, -d], ridge[0], ridge[1]]
    gables = [[[x, base, -d], [x, base, d], [x, base + rise, 0], [x, base + rise, 0]] for x in (-w + 0.4, w - 0.4)]
    corners = _translate(_rotate(np.array([front, back, *gables], float), yaw), center)
    return Mesh(corners, np.tile(tint, (4, 1)))


def _tree(rng: np.random.Generator, center: Floats) -> list[Mesh]:
    """A trunk and a crown of loose leaves, round or conical: light falls through it."""
    height = rng.uniform(3, 14)
    crown, foot = height * rng.uniform(0.2, 0.4), height * rng.uniform(0.1, 0.35)
    leaves = int(rng.uniform(700, 2500))
    middle = rng.normal(size=(leaves, 3))
    middle *= (rng.random(leaves) ** (1 / 3) / np.linalg.norm(middle, axis=1))[:, None]
    if rng.random() < 0.35:
        middle[:, [0, 2]] *= (0.5 - middle[:, 1:2] / 2) * 1.3
    middle = middle * [crown, (height - foot) / 2, crown] + [center[0], (height + foot) / 2, center[1]]
    size = rng.uniform(0.08, 0.2) * height**0.5
    a, b = rng.normal(size=(2, leaves, 3)) * size / 2
    corners = np.stack([middle - a - b, middle + a - b, middle + a + b, middle - a + b], axis=1)
    tint = _color(rng, _LEAVES) * np.exp(rng.normal(0, 0.25, (leaves, 1)))
    thick = 0.05 * height**0.7 + 0.08
    trunk = _box(center, np.array([thick, (height + foot) / 2, thick]), rng.uniform(0, 90), np.array(_BARK))
    return [Mesh(corners, tint), trunk]


def _car(rng: np.random.Generator, center: Floats, yaw: float) -> list[Mesh]:
    """Two boxes: body and cabin."""
    grey = rng.choice([0.03, 0.2, 0.5, 0.7])
    paint = np.clip(grey * np.exp(rng.normal(0, 0.5, 3) * rng.choice([0.05, 1])), 0.02, 0.8)
    body = _box(center, np.array([4.3, 0.9, 1.8]), yaw, paint)
    cabin = _box(center, np.array([2.2, 1.45, 1.6]), yaw, np.array(_GLASS))
    return [body, cabin]


def _person(rng: np.random.Generator, center: Floats) -> list[Mesh]:
    """A body, legs and a head, as boxes."""
    yaw, height = rng.uniform(0, 360), rng.uniform(1.5, 1.9)
    coat, skin = np.clip(np.exp(rng.normal(-1.6, 0.8, 3)), 0.02, 0.7), np.array([0.4, 0.27, 0.2])
    body, head = np.array([0.45, height * 0.84, 0.28]), np.array([0.2, height, 0.22])
    return [_box(center, body, yaw, coat), _box(center, head, yaw, skin)]


def _color(rng: np.random.Generator, palette: tuple[tuple[float, ...], ...]) -> Floats:
    """One of the palette's albedos, varied."""
    albedo = np.array(palette[rng.integers(len(palette))]) * np.exp(rng.normal(0, (0.15, 0.1, 0.15)))
    return np.asarray(np.clip(albedo, 0.02, 0.85))


def _ground(rng: np.random.Generator) -> Mesh:
    """Rings of cells around the camera, finer near it, rising to hills at times, colored by patches and grain."""
    rings = np.concatenate([np.linspace(0, 12, 90), np.geomspace(12.5, 900, 80)])
    azimuth = np.linspace(0, 2 * np.pi, 241)
    hills = rng.uniform(0, 70) * (rng.random() < 0.4)
    wave, phase = rng.normal(0, 1 / 90, (6, 2)), rng.uniform(0, 2 * np.pi, 6)
    x, z = np.outer(rings, np.cos(azimuth)), np.outer(rings, np.sin(azimuth))
    height = np.sin(x[..., None] * wave[:, 0] + z[..., None] * wave[:, 1] + phase).sum(axis=-1) / 3
    y = hills * height * np.clip((rings[:, None] - 60) / 200, 0, 1) ** 1.5
    grid = np.stack([x, y, z], axis=-1)
    corners = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4, 3)
    middle = corners.mean(axis=1)
    first, second = _color(rng, _GROUND), _color(rng, _GROUND)
    waves = rng.normal(0, rng.choice([0.05, 0.3]), (2, 4))
    patch = np.sin(middle[:, [0, 2]] @ waves + rng.uniform(0, 6, 4)).sum(axis=1)
    albedo = np.where((patch > rng.uniform(-1.5, 1.5))[:, None], first, second)
    return Mesh(corners, np.clip(albedo * np.exp(rng.normal(0, rng.uniform(0.02, 0.2), (len(albedo), 1))), 0.01, 0.85))


def _road(rng: np.random.Generator, yaw: float, offset: float) -> Mesh:
    """A strip of asphalt with a dashed line, `offset` beside the camera."""
    dark, white = np.full(3, rng.uniform(0.06, 0.2)), np.full(3, 0.7)
    half = rng.uniform(2.5, 6)

    def rectangle(x0: float, x1: float, y: float, half: float) -> list[list[float]]:
        return [[x0, y, offset - half], [x1, y, offset - half], [x1, y, offset + half], [x0, y, offset + half]]

    dashes = [rectangle(start, start + 3, 0.03, 0.07) for start in np.arange(-90, 90, 6.0)]
    quads = np.array([rectangle(-300, 300, 0.02, half), *dashes], float)
    return Mesh(_rotate(quads, yaw), np.array([dark, *[white] * len(dashes)]))


def _wall(rng: np.random.Generator, yaw: float) -> Mesh:
    """A low wall or a hedge, along the street or across it."""
    size = np.array([rng.uniform(2, 20), rng.uniform(0.5, 2.2), rng.uniform(0.15, 0.8)])
    tint = _color(rng, _STONE if rng.random() < 0.6 else _LEAVES)
    return _box(_spot(rng, 5, 30), size, yaw + rng.choice([0.0, 90.0, rng.uniform(0, 180)]), tint)


def _rock(rng: np.random.Generator) -> Mesh:
    """A stone, a bin, a box: something small that throws a shadow."""
    return _box(_spot(rng, 1.5, 20), rng.uniform(0.1, 1.1, 3), rng.uniform(0, 90), _color(rng, _STONE + _GROUND))


def _spot(rng: np.random.Generator, near: float, far: float) -> Floats:
    """Where a thing stands (x, z), more often near than far."""
    azimuth, distance = rng.uniform(0, 2 * np.pi), near + (far - near) * rng.random() ** 1.5
    return np.asarray(distance * np.array([np.sin(azimuth), np.cos(azimuth)]))


def random_town(rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    """The matte and the glossy mesh of a random town: a street, a square, a courtyard, a wood or open country.

    Args:
        rng: draws everything.
    """
    kind, yaw = str(rng.choice(_KINDS)), rng.uniform(0, 360)
    matte, glossy = [_ground(rng)], [_box(np.array([900.0, 900.0]), np.ones(3), 0, np.array(_GLASS))]
    if kind in ("street", "square") or rng.random() < 0.4:
        matte.append(_road(rng, yaw, rng.uniform(-4, 4)))
    for center, facing in _plots(rng, kind, yaw):
        matte += _house(rng, center, facing)
    for _ in range(int(rng.integers(0, {"wood": 60, "country": 30}.get(kind, 14)))):
        matte += _tree(rng, _spot(rng, 3.5, 80))
    for _ in range(int(rng.integers(0, 9 if kind != "wood" else 2))):
        glossy += _car(rng, _spot(rng, 3.5, 35), yaw + rng.normal(0, 3))
    for _ in range(int(rng.integers(0, 12))):
        matte += _person(rng, _spot(rng, 2, 25))
    for _ in range(int(rng.integers(0, 12))):
        thin = rng.uniform(0.08, 0.25)
        matte.append(_box(_spot(rng, 2, 30), np.array([thin, rng.uniform(1, 8), thin]), 0, _color(rng, _STONE)))
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
        along, distance = np.arange(-110, 110, rng.uniform(10, 22)), rng.uniform(12, 26)
        sides = [(a, side * (distance + rng.uniform(0, 3))) for a in along for side in (-1, 1) if rng.random() < 0.85]
        return [(_rotate(np.array([a, 0, b]), yaw)[[0, 2]], float(yaw)) for a, b in sides]
    radius = rng.uniform(15, 24) if kind == "courtyard" else rng.uniform(24, 50)
    angles = np.arange(0, 360, np.degrees(rng.uniform(11, 20) / radius))
    spots = [radius * np.array([np.sin(a), np.cos(a)]) for a in np.radians(angles)]
    return [(s, float(a)) for s, a in zip(spots, angles, strict=True) if rng.random() < 0.8]
