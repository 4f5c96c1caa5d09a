"""Procedural shapes: façades, carved panels, rough ground, heaps of ellipsoids, turned vessels."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from export.stereo.surfaces import Surface, of_height
from lighting.geometry import Floats


def relief(size: int, rng: np.random.Generator) -> Surface:
    """A shape of `size` pixels each way, of a kind and with details drawn at random."""
    kind = _KINDS[rng.choice(len(_KINDS), p=_SHARES)]
    height = kind(size, rng)
    if rng.random() < 0.4:
        height = height + _rough(size, rng) * rng.uniform(0.2, 1.5)
    mask = np.isfinite(height)
    filled = np.where(mask, height, np.nanmin(height))
    inner = mask & ~_edge(mask)
    return of_height(filled.astype(np.float32), inner)


def _edge(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels of the mask beside one outside it, whose slopes would be those of a cliff."""
    padded = np.pad(mask, 1, mode="edge")
    inside = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return np.asarray(mask & ~inside)


def _rough(size: int, rng: np.random.Generator, roughness: float | None = None) -> Floats:
    """A field (size, size) of noise whose spectrum falls as a power of the frequency, of standard deviation 1."""
    power = rng.uniform(1.4, 2.6) if roughness is None else roughness
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    frequency[0, 0] = np.inf
    spectrum = np.fft.rfft2(rng.normal(size=(size, size))) / frequency**power
    field = np.fft.irfft2(spectrum, s=(size, size))
    return np.asarray(field / field.std())


def _ground(size: int, rng: np.random.Generator) -> Floats:
    return _rough(size, rng, rng.uniform(1.8, 3.0)) * size * rng.uniform(0.03, 0.15)


def _heap(size: int, rng: np.random.Generator) -> Floats:
    """The nearest of several ellipsoids, with nothing or a wall behind them."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2.0
    height = np.full((size, size), -np.inf)
    for index in range(rng.integers(1, 9)):
        spread = 0.1 if index == 0 else 0.35
        u, v = x - rng.normal(0, spread * size), y - rng.normal(0, spread * size)
        turn, (a, b, c) = rng.uniform(0, np.pi), size * rng.uniform(0.1, 0.45, 3)
        p, q = (u * np.cos(turn) + v * np.sin(turn)) / a, (v * np.cos(turn) - u * np.sin(turn)) / b
        inside = 1 - p * p - q * q
        height = np.maximum(height, np.where(inside > 0, c * np.sqrt(np.maximum(inside, 0)), -np.inf))
    back = 0.0 if rng.random() < 0.4 else np.nan
    return np.where(np.isfinite(height), height, back)


def _vessel(size: int, rng: np.random.Generator) -> Floats:
    """A body turned about an upright or tilted axis, with a profile of a few waves and perhaps flutes."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2.0
    turn = rng.normal(0, 0.3)
    x, y = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    t = y / size
    radius = 0.3 + sum(rng.normal(0, 0.09 / k) * np.cos(np.pi * k * (2 * t + rng.uniform(0, 2))) for k in range(1, 6))
    radius = np.clip(radius, 0.06, 0.48) * size
    share = x / radius
    depth = radius * np.sqrt(np.maximum(1 - share**2, 0))
    if rng.random() < 0.4:
        depth = depth + rng.uniform(0.5, 2.5) * np.cos(rng.integers(6, 24) * np.arcsin(np.clip(share, -1, 1)))
    return np.where((np.abs(share) < 1) & (np.abs(t) < 0.47), depth, np.nan)


def _panel(size: int, rng: np.random.Generator) -> Floats:
    """A slab with carved strokes, raised or sunk, their flanks sloped."""
    y, x = np.mgrid[:size, :size].astype(float)
    near = np.full((size, size), np.inf)
    for _ in range(rng.integers(6, 40)):
        start, along = rng.uniform(0, size, 2), rng.normal(0, 0.12 * size, 2)
        length2 = max(float(along @ along), 1.0)
        t = np.clip(((x - start[0]) * along[0] + (y - start[1]) * along[1]) / length2, 0, 1)
        near = np.minimum(near, np.hypot(x - start[0] - t * along[0], y - start[1] - t * along[1]))
    width = rng.uniform(2, 8)
    depth = rng.choice([-1, 1]) * width * rng.uniform(0.3, 1.2)
    profile = np.clip(1 - near / width, 0, 1)
    profile = profile if rng.random() < 0.5 else np.minimum(1, 2 * profile)
    return np.asarray(depth * profile + x * rng.normal(0, 0.15) + y * rng.normal(0, 0.15))


def _facade(size: int, rng: np.random.Generator) -> Floats:
    """A wall of blocks and openings at several depths, its edges softened."""
    height = np.zeros((size, size))
    for _ in range(rng.integers(4, 30)):
        top, left = rng.integers(0, size, 2)
        tall, wide = rng.integers(size // 16, size // 2, 2)
        height[top : top + tall, left : left + wide] += rng.normal(0, 0.04 * size)
    kernel = np.exp(-0.5 * (np.fft.fftfreq(size) * size / rng.uniform(0.8, 3)) ** 2)
    kernel /= kernel.sum()
    soft = np.fft.fft2(kernel[:, None] * kernel[None, :])
    y, x = np.mgrid[:size, :size] / size
    lean = size * (x * rng.normal(0, 0.2) + y * rng.normal(0, 0.2))
    return np.asarray(np.fft.ifft2(np.fft.fft2(height) * soft).real + lean)


_KINDS: tuple[Callable[[int, np.random.Generator], Floats], ...] = (_ground, _heap, _vessel, _panel, _facade)
_SHARES = (0.2, 0.3, 0.25, 0.15, 0.1)
