"""Normals by exhaustive search: every pixel's brightnesses against what each of a few thousand normals would show.

A patch of normal n and albedo rho shows b = rho e(n), with e(n) the brightness of a white patch. For each normal of a
grid the best albedo follows in closed form, and the squared residual is |b|^2 - <b, e / |e|>^2, so that all residuals
are one matrix product. With Gaussian noise and the prior that a picture of a shape without a preferred side holds
normals in proportion to their foreshortening, n_z, they give each pixel a distribution over the grid. Its peak is the
start of one damped step of least squares, within the hemisphere of that normal: there brightness is linear in rho n,
with the mean light vectors (mean_light.py) as its derivative. Iterating such steps from a single start
diverges where the hemisphere of the start is another than that of the solution.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from lighting.stereo.mean_light import Skies, illumination
from lighting.stereo.normals.frame import Pose, to_camera, to_world, visible_normals

Image = NDArray[np.float32]

GRID = 3000  # normals, 2.6 deg apart
APART = 25.0  # deg, from the best normal to the nearest that counts as another answer

_BLOCK = 1 << 19  # residuals held at once: few enough to stay in a processor's cache
_ALONE = 1 << 18  # multiplications of a matrix product up to which OpenBLAS, numpy's library, starts no threads
_TINY = np.float32(1e-12)


@dataclass(frozen=True)
class Candidates:
    """What a pixel may be: normals in the camera frame and how a day lights them."""

    normals: Image  # (K, 3)
    light: Image  # (K, T, 3, C), mean light vectors
    brightness: Image  # (C, K, T), of white patches
    prior: Image  # (K,), logarithms of how likely each is before any image is seen, up to a constant
    spacing: float  # rad, between neighbouring normals


@dataclass(frozen=True)
class Answer:
    """What the search says of P pixels."""

    normal: Image  # (P, 3), camera frame
    albedo: Image  # (P, C), in units of the images over those of the skies
    residual: Image  # (P,), root of the mean squared difference of the images, in their unit
    difference: Image  # (P, T), the images less what normal and albedo make, mean over channels
    error: Image  # (P,), expected angle [deg] of the normal to the truth
    spread: Image  # (P,), the same as root of the mean square
    mean: Image  # (P, 3), mean of the distribution over normals; its length is less than 1
    other: Image  # (P, 3), the best normal that is APART from the first
    odds: Image  # (P,), natural logarithm of how much less likely the other one is, at most 0


Progress = Callable[[Iterable[Answer], int], Iterable[Answer]]  # sees answers pass, of so many in all


def candidates(skies: Skies, pose: Pose, count: int = GRID) -> Candidates:
    """The normals that a camera can see, under skies of T moments and C channels."""
    normals = visible_normals(count)
    vectors = illumination(skies, to_world(normals, pose))  # (K, T, 3, C)
    light = np.moveaxis(to_camera(np.moveaxis(vectors, -2, -1), pose), -1, -2)
    brightness = np.einsum("ktjc,kj->ckt", light, normals)
    spacing = float(np.sqrt(2 * np.pi / count))
    return Candidates(normals, light.astype(np.float32), brightness.astype(np.float32), np.log(normals[:, 2]), spacing)


def quiet(parts: Iterable[Answer], count: int) -> Iterable[Answer]:  # noqa: ARG001
    """Progress that nobody watches."""
    return parts


def search(images: Image, table: Candidates, noise: float, progress: Progress = quiet, threads: int = 1) -> Answer:
    """The normals of P pixels from brightnesses (P, T, C); `noise` is their standard deviation, in their unit.

    Pixels are searched in blocks, which `progress` sees pass and which so many threads share.
    """
    units, size = _units(table), max(1, _BLOCK // len(table.normals))
    blocks = [images[start : start + size] for start in range(0, len(images), size)] or [images]
    with ThreadPoolExecutor(threads) as pool:
        found = pool.map(lambda block: _search_block(block, table, noise, units), blocks)
        parts = list(progress(found, len(blocks)))
    return Answer(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Answer)))


def _units(table: Candidates) -> Image:
    """Brightnesses (C, T, K) scaled to length 1 over the moments."""
    length = np.sqrt(np.sum(table.brightness**2, axis=-1, keepdims=True))
    return np.ascontiguousarray(np.swapaxes(table.brightness / np.maximum(length, _TINY), 1, 2))


def _search_block(images: Image, table: Candidates, noise: float, units: Image) -> Answer:
    likelihood = _log_likelihood(images, units, noise)
    likelihood += table.prior
    best = likelihood.argmax(axis=1)
    likelihood -= likelihood[np.arange(len(best)), best][:, None]
    chords = np.sqrt(np.maximum(2 - 2 * product(table.normals[best], table.normals.T), 0))
    other, odds = _other(likelihood, chords, table.normals)
    weight = np.exp(likelihood, out=likelihood)
    total = weight.sum(axis=1)
    mean = product(weight, table.normals) / total[:, None]
    error = _angle(np.einsum("pk,pk->p", weight, chords) / total)
    normal, albedo, difference = refine(images, table, best, noise)
    residual = np.sqrt(np.mean(difference**2, axis=(1, 2)))
    spread = _angle(np.sqrt(np.maximum(2 - 2 * np.sum(normal * mean, axis=1), 0)))
    return Answer(normal, albedo, residual, difference.mean(axis=2), error, spread, mean, other, odds)


def _angle(chord: Image) -> Image:
    """Angles [deg] between unit vectors at distances (P,)."""
    return np.asarray(np.degrees(2 * np.arcsin(np.minimum(chord / 2, 1))))


def _log_likelihood(images: Image, units: Image, noise: float) -> Image:
    """Logarithms (P, K) of how likely each normal makes the images, up to a constant for each pixel."""
    scaled = (images / np.float32(noise * np.sqrt(2))).astype(np.float32)
    total = np.zeros((len(images), units.shape[-1]), dtype=np.float32)
    for channel, unit in enumerate(units):
        match = product(scaled[:, :, channel], unit)
        total += np.square(np.maximum(match, 0, out=match), out=match)
    return total


def product(left: Image, right: Image) -> Image:
    """The matrix product of (P, N) and (N, M), a few rows at a time, so that each stays in the thread that asks for it.

    The threads of a pool that all ask for large products wait for each other's helpers longer than they work.
    """
    rows = max(1, _ALONE // right.size)
    whole = len(left) - len(left) % rows
    result = np.empty((len(left), right.shape[1]), dtype=np.float32)
    stack = left[:whole].reshape(-1, rows, left.shape[1])
    np.matmul(stack, right, out=result[:whole].reshape(-1, rows, right.shape[1]))
    np.matmul(left[whole:], right, out=result[whole:])
    return result


def _other(likelihood: Image, chords: Image, normals: Image) -> tuple[Image, Image]:
    """The likeliest normal (P, 3) APART from the best one, and its logarithm of likelihood (P,) relative to that."""
    near = chords < np.float32(2 * np.sin(np.radians(APART) / 2))
    rest = np.where(near, np.float32(-np.inf), likelihood)
    index = rest.argmax(axis=1)
    return normals[index], np.maximum(rest[np.arange(len(index)), index], np.float32(-1e4))


def refine(images: Image, table: Candidates, best: NDArray[np.intp], noise: float) -> tuple[Image, Image, Image]:
    """Normal (P, 3), albedo (P, C) and what they leave of the images (P, T, C), by one step from candidates (P,).

    The step is of least squares, damped by the grid's spacing, so that noise along an axis that the light does not tell
    apart moves the normal no farther than to the edge of its cell.
    """
    start, light = table.normals[best], table.light[best]
    albedo = _albedo(images, _shading(light, start))
    rows = np.swapaxes(light * albedo[:, None, None, :], 2, 3).reshape(len(best), -1, 3)
    missing = images.reshape(len(best), -1) - np.einsum("prj,pj->pr", rows, start)
    damping = np.float32((noise / table.spacing) ** 2)
    square = np.swapaxes(rows, 1, 2) @ rows + damping * np.eye(3, dtype=np.float32)
    step = np.linalg.solve(square, np.swapaxes(rows, 1, 2) @ missing[:, :, None])[..., 0]
    step *= np.minimum(1, table.spacing / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), _TINY))
    normal = start + step
    normal[:, 2] = np.maximum(normal[:, 2], 0)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    shading = _shading(light, normal)
    albedo = _albedo(images, shading)
    left = images - albedo[:, None] * shading
    return normal.astype(np.float32), albedo.astype(np.float32), left.astype(np.float32)


def _shading(light: Image, normal: Image) -> Image:
    """Brightnesses (P, T, C) of white patches."""
    return np.asarray(np.maximum(np.einsum("ptjc,pj->ptc", light, normal), 0))


def _albedo(images: Image, shading: Image) -> Image:
    """Albedos (P, C) that fit best."""
    power = np.maximum(np.sum(shading * shading, axis=1), _TINY)
    return np.asarray(np.maximum(np.sum(images * shading, axis=1), 0) / power)
