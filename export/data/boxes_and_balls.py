"""Boxes on the ground and balls above it: where rays from a camera meet them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, direction, ray_sphere

NEAR = 1e-3  # m, the least distance that counts as a hit


@dataclass(frozen=True)
class Things:
    """B boxes and S balls, with one albedo each; corners, centres and albedos are (B, 3) or (S, 3)."""

    low: Floats
    high: Floats
    box_albedo: Floats
    centre: Floats
    radius: Floats  # (S,)
    ball_albedo: Floats


def place_things(rng: np.random.Generator, count: int) -> Things:
    """`count` random things around the origin, half of them boxes."""
    boxes, balls = count - count // 2, count // 2
    turn, far = rng.uniform(-180, 180, count), rng.uniform(9, 40, count)
    foot = direction(turn, np.zeros(count)) * far[:, None]
    half = rng.uniform(1.5, 5.0, (boxes, 3)) * [1, 0, 1]
    roof = rng.uniform(3, 18, (boxes, 1)) * [0, 1, 0]
    radius = rng.uniform(1, 3, balls)
    centre = foot[boxes:] + radius[:, None] * [0, 1.3, 0]
    walls = rng.uniform(0.15, 0.6, (boxes, 1)) * rng.uniform(0.8, 1.2, (boxes, 3))
    leaves = rng.uniform(0.5, 1.0, (balls, 1)) * [0.08, 0.14, 0.05]
    return Things(foot[:boxes] - half, foot[:boxes] + half + roof, walls, centre, radius, leaves)


def blocked(origin: Floats, sun: Floats, things: Things) -> NDArray[np.bool_]:
    """Whether a thing stands between each point (N, 3) and the sun."""
    return np.isfinite(nearest(origin, np.broadcast_to(sun, origin.shape), things)[0])


def nearest(origin: Floats, rays: Floats, things: Things) -> tuple[Floats, Floats, Floats]:
    """Distance (N,), inf where nothing is met, normal (N, 3) and albedo (N, 3) of the nearest thing along each ray."""
    distance, normal, albedo = np.full(len(rays), np.inf), np.zeros(rays.shape), np.zeros(rays.shape)
    boxes = zip(things.low, things.high, things.box_albedo, strict=True)
    hits = [(_hit_box(origin, rays, low, high), colour) for low, high, colour in boxes]
    balls = zip(things.centre, things.radius, things.ball_albedo, strict=True)
    hits += [(_hit_ball(origin, rays, centre, radius), colour) for centre, radius, colour in balls]
    for (reach, facing), colour in hits:
        closer = reach < distance
        distance = np.where(closer, reach, distance)
        normal[closer], albedo[closer] = facing[closer], colour
    return distance, normal, albedo


def _hit_box(origin: Floats, rays: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    safe = np.where(np.abs(rays) < 1e-9, 1e-9, rays)
    one, other = (low - origin) / safe, (high - origin) / safe
    enter, leave = np.minimum(one, other), np.maximum(one, other).min(axis=1)
    axis = enter.argmax(axis=1)
    start = enter.max(axis=1)
    normal = -np.sign(rays) * (np.arange(3) == axis[:, None])
    return np.where((start < leave) & (start > NEAR), start, np.inf), normal


def _hit_ball(origin: Floats, rays: Floats, centre: Floats, radius: float) -> tuple[Floats, Floats]:
    distance = ray_sphere(origin, rays, centre, radius)
    hit = distance > NEAR
    reach = np.where(hit & np.isfinite(distance), distance, 0.0)
    return np.where(hit, distance, np.inf), (origin - centre + rays * reach[:, None]) / radius
