"""Rooms with furniture, lamps and windows, drawn at random by casting rays: pictures that show no outdoors.

They are far simpler than real rooms. What they share with them is corners, light that falls off with distance, lamps of
one tint, and windows beside which all is dark. Lengths in m, +Y up, the room's corner at the origin.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.colour import SRGB_LINEAR, srgb_encode
from lighting.geometry import Floats, Pinhole, camera_directions

Picture = NDArray[np.uint8]

BULB, DAY = (1.0, 0.72, 0.42), (0.9, 1.0, 1.15)  # light of lamps and of windows
WOOD = ((0.35, 0.2, 0.1), (0.2, 0.1, 0.05), (0.5, 0.35, 0.2), (0.08, 0.05, 0.04))
SHADE = 0.12  # m, over which corners are darker


@dataclass(frozen=True, eq=False)
class Room:
    """Boxes in a box; whatever shines has an emission."""

    size: Floats  # (3,)
    low: Floats  # (N, 3) corners of the boxes
    high: Floats  # (N, 3)
    colour: Floats  # (N + 6, 3) linear, of the boxes and then of the walls: -x, -y, -z, +x, +y, +z
    emission: Floats  # (N, 3)
    printed: NDArray[np.bool_]  # (N + 6,) what carries the texture
    lamps: Floats  # (L, 3) where light comes from
    power: Floats  # (L, 3)
    ambient: Floats  # (3,)


def room_picture(texture: Picture, size: tuple[int, int], rng: np.random.Generator) -> Picture:
    """A picture of `size` (height, width) in a random room; its cloths, floors and windows show parts of `texture`."""
    room = _room(rng)
    eye = room.size * [rng.uniform(0.15, 0.85), 0.0, rng.uniform(0.15, 0.85)]
    eye[1] = rng.uniform(0.9, min(1.8, room.size[1] - 0.4))
    inside = np.all((room.low < eye) & (eye < room.high), axis=1)
    kept = ~inside
    room = replace(
        room,
        low=room.low[kept],
        high=room.high[kept],
        emission=room.emission[kept],
        colour=np.concatenate([room.colour[:-6][kept], room.colour[-6:]]),
        printed=np.concatenate([room.printed[:-6][kept], room.printed[-6:]]),
    )
    middle = room.size / 2 - eye
    azimuth = float(np.degrees(np.arctan2(middle[0], -middle[2])) + rng.normal(0, 50))
    tilt = (rng.normal(-6, 10), rng.normal(0, 2))
    camera = Pinhole(size[1], size[0], rng.uniform(38, 75), azimuth, float(tilt[0]), float(tilt[1]))
    rays = camera_directions(camera).reshape(-1, 3).astype(np.float32)
    radiance = _radiance(room, eye.astype(np.float32), rays, SRGB_LINEAR[texture], rng)
    return _exposed(radiance.reshape(*size, 3), rng)


def _room(rng: np.random.Generator) -> Room:
    size = np.array([rng.uniform(2.2, 9), rng.uniform(2.2, 3.6), rng.uniform(2.2, 9)])
    low, high, colour, emission, printed = [], [], [], [], []

    def add(corner: Floats, extent: Floats, tint: Floats, shine: Floats, cloth: bool) -> None:
        low.append(corner)
        high.append(corner + extent)
        colour.append(tint)
        emission.append(shine)
        printed.append(cloth)

    dark = np.zeros(3)
    for _ in range(int(rng.integers(3, 14))):
        extent = rng.uniform((0.3, 0.3, 0.3), (2.2, 1.3, 2.2))
        at = rng.uniform(0, 1, 3) * (size - extent) * [1, 0, 1]
        if rng.random() < 0.6:  # along a wall
            axis = int(rng.choice([0, 2]))
            at[axis] = rng.choice([0.0, size[axis] - extent[axis]])
        tint = _tint(rng)
        if rng.random() < 0.3:  # a table: a top on legs
            height, thin = rng.uniform(0.4, 1.0), 0.06
            add(at + [0, height, 0], extent * [1, 0, 1] + [0, thin, 0], tint, dark, False)
            for x, z in ((0, 0), (1, 0), (0, 1), (1, 1)):
                foot = at + np.array([x, 0, z]) * (extent - thin)
                add(foot * [1, 0, 1], np.array([thin, height, thin]), tint, dark, False)
            at = at + [0, height + thin, 0]
            extent = extent * rng.uniform(0.05, 0.4, 3)
        add(at, extent, tint, dark, rng.random() < 0.4)
    for _ in range(int(rng.integers(0, 8))):  # pictures, doors and shelves on walls
        axis = int(rng.choice([0, 2]))
        extent = rng.uniform((0.2, 0.2, 0.2), (1.2, 2.0, 1.2))
        extent[axis] = rng.uniform(0.02, 0.3)
        at = rng.uniform(0, 1, 3) * np.maximum(size - extent, 0.0)
        at[axis] = rng.choice([0.0, size[axis] - extent[axis]])
        add(at, extent, _tint(rng), dark, rng.random() < 0.5)
    lamps, power = [], []
    by_day = rng.random() < 0.55
    for _ in range(int(rng.integers(1, 4)) if by_day else 0):  # windows
        axis = int(rng.choice([0, 2]))
        extent = rng.uniform((0.6, 0.7, 0.6), (2.0, 1.8, 2.0))
        extent[axis] = 0.03
        at = rng.uniform(0, 1, 3) * np.maximum(size - extent, 0.0)
        side = rng.choice([0.0, 1.0])
        at[axis], at[1] = side * (size[axis] - 0.03), rng.uniform(0.4, 1.0)
        shine = np.array(DAY) * rng.uniform(4, 25)
        add(at, extent, np.ones(3), shine, True)
        lamps.append(at + extent / 2)
        power.append(shine * float(np.prod(extent) / 0.03))
    bulb = np.array(BULB) ** rng.uniform(0, 1.2)
    for _ in range(int(rng.integers(0 if by_day else 1, 4))):  # lamps, on the ceiling or standing
        extent = rng.uniform((0.15, 0.05, 0.15), (1.2, 0.12, 0.6)) if rng.random() < 0.6 else np.full(3, 0.25)
        at = rng.uniform(0.1, 0.9, 3) * (size - extent)
        at[1] = size[1] - extent[1] if extent[1] < 0.2 else rng.uniform(0.6, 1.6)
        shine = bulb * rng.uniform(8, 40)
        add(at, extent, np.ones(3), shine, False)
        lamps.append(at + extent / 2 - [0, 0.3 * (extent[1] < 0.2), 0])
        power.append(shine * float(extent[0] * extent[2] + extent[1] * extent[2]))
    wall = np.clip(rng.uniform(0.25, 0.85) * np.exp(rng.normal(0, 0.12, 3)), 0.05, 0.9)
    walls = np.tile(wall, (6, 1))
    walls[1] = np.array(WOOD[rng.integers(len(WOOD))]) if rng.random() < 0.6 else _tint(rng)
    walls[4] = rng.uniform(0.6, 0.9)
    if rng.random() < 0.3:
        walls[rng.choice([0, 2, 3, 5])] = _tint(rng)
    cloth = np.array([False, rng.random() < 0.5, False, False, False, False])
    strength = np.array(power)
    ambient = rng.uniform(0.02, 0.12) * strength.sum(axis=0) / float(np.prod(size) ** (2 / 3))
    return Room(
        size,
        np.array(low),
        np.array(high),
        np.concatenate([np.array(colour), walls]),
        np.array(emission),
        np.concatenate([np.array(printed), cloth]),
        np.array(lamps),
        strength,
        ambient,
    )


def _tint(rng: np.random.Generator) -> Floats:
    """A thing's reflectance (3,): wood, grey or a colour."""
    if rng.random() < 0.35:
        return np.asarray(np.clip(np.array(WOOD[rng.integers(len(WOOD))]) * rng.uniform(0.6, 1.6), 0.02, 0.9))
    return np.asarray(np.clip(np.exp(rng.normal(-1.3, 0.7)) * np.exp(rng.normal(0, rng.choice([0.1, 0.7]), 3)), 0.02, 0.85))


def _nearest(room: Room, origin: Floats, rays: Floats) -> tuple[Floats, NDArray[np.intp], NDArray[np.intp]]:
    """Distance (N,), index (N,) of the box or N + wall, and axis (N,) of the face that rays (N, 3) meet first."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / np.where(np.abs(rays) < 1e-6, np.float32(1e-6), rays)
        to_walls = np.where(rays > 0, (room.size.astype(np.float32) - origin) * inverse, -origin * inverse)
    axis = np.argmin(to_walls, axis=1)
    rows = np.arange(len(rays))
    distance = to_walls[rows, axis]
    index = len(room.low) + axis + 3 * (rays[rows, axis] > 0)
    for i, (low, high) in enumerate(zip(room.low.astype(np.float32), room.high.astype(np.float32), strict=True)):
        a, b = (low - origin) * inverse, (high - origin) * inverse
        near = np.minimum(a, b)
        enter = near.max(axis=1)
        closer = np.flatnonzero((enter > 1e-3) & (enter < np.maximum(a, b).min(axis=1)) & (enter < distance))
        distance[closer], index[closer], axis[closer] = enter[closer], i, near[closer].argmax(axis=1)
    return distance, index, axis


def _radiance(room: Room, eye: Floats, rays: Floats, texture: Floats, rng: np.random.Generator) -> Floats:
    """Radiance (N, 3) along rays (N, 3)."""
    distance, index, axis = _nearest(room, eye, rays)
    points = eye + rays * distance[:, None]
    rows = np.arange(len(rays))
    normal = np.zeros_like(rays)
    normal[rows, axis] = -np.sign(rays[rows, axis])
    albedo = room.colour[index] * np.exp(rng.normal(0, 0.03, (len(rays), 1)))
    printed = room.printed[index]
    print_ = _printed(points[printed], axis[printed], texture, rng)
    albedo[printed] = albedo[printed] * print_
    gap = np.minimum(points, room.size - points)
    gap[rows, axis] = np.inf
    corner = np.prod(1 - 0.5 * np.exp(-np.maximum(gap, 0) / SHADE / 3), axis=1, keepdims=True)
    light = room.ambient * corner
    for k, (lamp, power) in enumerate(zip(room.lamps.astype(np.float32), room.power, strict=True)):
        towards = lamp - points
        far = np.linalg.norm(towards, axis=1, keepdims=True)
        cosine = np.maximum(np.sum(towards * normal, axis=1, keepdims=True) / far, 0)
        seen = np.ones(len(rays)) if k else _sees(room, points + 1e-3 * normal, towards, far[:, 0])
        light = light + seen[:, None] * cosine * power / (np.pi * far**2 + 0.1)
    shines = index < len(room.low)
    radiance = albedo * light
    radiance[shines] += room.emission[index[shines]] * np.where(printed[shines, None], albedo[shines], 1.0)
    return np.asarray(radiance)


def _sees(room: Room, points: Floats, towards: Floats, far: Floats) -> Floats:
    """Whether points (N, 3) see what lies `towards` (N, 3), a length `far` (N,) away, past the dark boxes: 1 or 0."""
    inverse = 1 / np.where(np.abs(towards) < 1e-6, 1e-6, towards)
    hidden = np.zeros(len(points), dtype=bool)
    for low, high, shine in zip(room.low, room.high, room.emission, strict=True):
        if shine.any():
            continue
        a, b = (low - points) * inverse, (high - points) * inverse
        enter = np.minimum(a, b).max(axis=1)
        hidden |= (enter < np.maximum(a, b).min(axis=1)) & (enter > 1e-3) & (enter < 0.95)
    return 1.0 - 0.9 * hidden


def _printed(points: Floats, axis: NDArray[np.intp], texture: Floats, rng: np.random.Generator) -> Floats:
    """The texture (h, w, 3) over its mean at points (N, 3) of faces across `axis` (N,)."""
    u = np.where(axis == 0, points[:, 2], points[:, 0])
    v = np.where(axis == 1, points[:, 2], points[:, 1])
    scale = rng.uniform(60, 300)  # pixels for each m
    height, width = texture.shape[:2]
    x, y = (u * scale).astype(int) % (2 * width), (v * scale).astype(int) % (2 * height)
    x, y = np.minimum(x, 2 * width - 1 - x), np.minimum(y, 2 * height - 1 - y)
    return np.asarray(texture[height - 1 - y, x] / max(float(texture.mean()), 0.02))


def _exposed(radiance: Floats, rng: np.random.Generator) -> Picture:
    """The picture of a camera that exposes for the room and leaves a part of the lamps' tint."""
    grey = radiance.mean(axis=-1)
    gain = rng.uniform(0.12, 0.5) / max(float(np.percentile(grey, rng.uniform(50, 85))), 1e-6)
    balance = (grey.mean() / np.maximum(radiance.mean(axis=(0, 1)), 1e-6)) ** rng.uniform(0.0, 0.9)
    height, width = grey.shape
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    linear = radiance * gain * balance * (1 - rng.uniform(0, 0.3) * (x**2 + y**2)[..., None] / 2)
    linear = linear + rng.normal(0, rng.uniform(0.001, 0.02), radiance.shape) * np.sqrt(np.maximum(linear, 0.01))
    return np.asarray(np.round(255 * srgb_encode(linear)), dtype=np.uint8)
