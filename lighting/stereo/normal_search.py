"""The search of normals: which of a grid's candidates makes a pixel's brightnesses, with shadows where that is needed.

A patch of normal n and albedo rho shows b = rho e(n), with e(n) the brightness of a white patch. For each normal of a
grid the best albedo follows in closed form. The squared residual is |b|^2 - <b, e / |e|>^2, so all residuals are one
matrix product. With Gaussian noise and a prior they give each pixel a distribution over the grid. The prior: a picture
of a shape without a preferred side holds normals in proportion to their foreshortening, n_z. The distribution's peak is
the start of one damped step of least squares, within the hemisphere of that normal. There brightness is linear in rho
n, with the mean light vectors (light_vectors.py) as its derivative. Iterating such steps from a single start diverges
where the hemisphere of the start is another than that of the solution.

A cast shadow leaves a pixel with the sky's light alone, which no normal under the open sun explains. Where the search
leaves much of the images unexplained, it is repeated with every normal in every pattern of a shadow that ends or begins
during the day. Shadows that come and go between are not among the patterns.

Camera frame: +X right, +Y up in the picture, +Z towards the camera, so that visible normals have positive Z. World axes
are those of the maps: +Y up, true north at -Z, east at +X.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.geometry import Floats, camera_axes
from lighting.runtime import available_cpus
from lighting.stereo.light_vectors import Skies, illumination_matrices


@dataclass(frozen=True)
class Pose:
    """How a camera stands; the defaults look level to the north."""

    heading: float = 0.0
    """Deg clockwise from true north, where the camera looks."""
    elevation: float = 0.0
    """Deg, positive looks up."""
    roll: float = 0.0
    """Deg, positive turns the camera clockwise as its holder sees it."""


def _axes(pose: Pose) -> Floats:
    """The camera frame's X, Y and Z as rows (3, 3) in world axes."""
    right, up, forward = camera_axes(pose.heading, pose.elevation, pose.roll)
    return np.stack([right, up, -forward])


def camera_to_world(vectors: ArrayLike, pose: Pose) -> Floats:
    """Rotate vectors of the camera frame to world axes.

    Args:
        vectors: (..., 3) in the camera frame.
        pose: of the camera.
    """
    return np.asarray(np.asarray(vectors) @ _axes(pose))


def world_to_camera(vectors: ArrayLike, pose: Pose) -> Floats:
    """Rotate vectors in world axes to the camera frame.

    Args:
        vectors: (..., 3) in world axes.
        pose: of the camera.
    """
    return np.asarray(np.asarray(vectors) @ _axes(pose).T)


def sample_visible_normals(count: int) -> NDArray[np.float32]:
    """Spread unit vectors (N, 3) evenly over the camera frame's half with Z > 0, on a Fibonacci spiral.

    Args:
        count: N.
    """
    index = np.arange(count) + 0.5
    z = index / count
    angle = np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1).astype(np.float32)


Image = NDArray[np.float32]

_GRID_SIZE = 3000  # normals, 2.6 deg apart
_MIN_OTHER_ANGLE = 25.0  # deg, from the best normal to the nearest that counts as another answer
_BLOCK_RESIDUALS = 1 << 19  # residuals held at once: few enough to stay in a processor's cache
_MAX_UNTHREADED = 1 << 18  # multiplications of a matrix product up to which OpenBLAS (numpy's) starts no threads
_EPSILON = np.float32(1e-12)

_MAX_RESIDUAL_RATIO = 2.0  # times the noise, the residual from which on shadows are thought of
_SHADOW_GRID_SIZE = 700  # normals, 5.4 deg apart
_SHADOW_PENALTY, _MOMENT_PENALTY = 3.0, 0.3  # logarithms: of a shadow, and of each photo that it lasts
_MIN_SUNNY = 3  # photos in the sun, for a normal
_MAX_PATTERNS = 16  # at most


@dataclass(frozen=True)
class Candidates:
    """What a pixel may be: normals in the camera frame and how a day lights them."""

    normals: Image
    """Normals, (K, 3)."""
    light: Image
    """(K, T, 3, C), mean light vectors."""
    brightness: Image
    """(C, K, T), of white patches."""
    prior: Image
    """(K,), logarithms of how likely each is before any image is seen, up to a constant."""
    spacing: float
    """Rad, between neighboring normals."""


@dataclass(frozen=True)
class SearchResult:
    """What the search says of P pixels."""

    normal: Image
    """(P, 3), camera frame."""
    albedo: Image
    """(P, C), in units of the images over those of the skies."""
    residual: Image
    """(P,), root of the mean squared difference of the images, in their unit."""
    difference: Image
    """(P, T), the images less what normal and albedo make, mean over channels."""
    error: Image
    """(P,), expected angle [deg] of the normal to the truth."""
    error_rms: Image
    """(P,), the same as root of the mean square."""
    mean: Image
    """(P, 3), mean of the distribution over normals; its length is less than 1."""
    other: Image
    """(P, 3), the best normal _MIN_OTHER_ANGLE or more from the first."""
    log_odds: Image
    """(P,), natural logarithm of how much less likely the other one is, at most 0."""


SearchProgress = Callable[[Iterable[SearchResult], int], Iterable[SearchResult]]  # sees answers pass, of so many in all


def make_candidates(skies: Skies, pose: Pose, count: int = _GRID_SIZE) -> Candidates:
    """Make the normals that a camera can see, and how a day lights them.

    Args:
        skies: of T moments and C channels.
        pose: of the camera.
        count: K, of the normals.
    """
    normals = sample_visible_normals(count)
    vectors = illumination_matrices(skies, camera_to_world(normals, pose))  # (K, T, 3, C)
    light = np.moveaxis(world_to_camera(np.moveaxis(vectors, -2, -1), pose), -1, -2)
    brightness = np.einsum("ktjc,kj->ckt", light, normals)
    spacing = float(np.sqrt(2 * np.pi / count))
    return Candidates(normals, light.astype(np.float32), brightness.astype(np.float32), np.log(normals[:, 2]), spacing)


def ignore_progress(parts: Iterable[SearchResult], count: int) -> Iterable[SearchResult]:  # noqa: ARG001
    """Pass results on and report nothing.

    Args:
        parts: results of blocks.
        count: of all blocks.
    """
    return parts


def search_normals(
    images: Image, table: Candidates, noise: float, progress: SearchProgress = ignore_progress, threads: int = 1
) -> SearchResult:
    """Search the normals of pixels among candidates, block by block.

    Args:
        images: (P, T, C) brightnesses.
        table: the candidates.
        noise: standard deviation of the brightnesses, in their unit.
        progress: passes the results of blocks on as they come.
        threads: that share the blocks.
    """
    length = np.sqrt(np.sum(table.brightness**2, axis=-1, keepdims=True))
    units = np.ascontiguousarray(np.swapaxes(table.brightness / np.maximum(length, _EPSILON), 1, 2))  # (C, T, K)
    size = max(1, _BLOCK_RESIDUALS // len(table.normals))
    blocks = [images[start : start + size] for start in range(0, len(images), size)] or [images]
    with ThreadPoolExecutor(threads) as pool:
        results = pool.map(lambda block: _search_block(block, table, noise, units), blocks)
        parts = list(progress(results, len(blocks)))
    return SearchResult(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(SearchResult)))


def _search_block(images: Image, table: Candidates, noise: float, units: Image) -> SearchResult:
    likelihood = np.zeros((len(images), units.shape[-1]), dtype=np.float32)  # logarithms, up to a constant of a pixel
    scaled = (images / np.float32(noise * np.sqrt(2))).astype(np.float32)
    for channel, unit in enumerate(units):
        match = _multiply_in_rows(scaled[:, :, channel], unit)
        likelihood += np.square(np.maximum(match, 0, out=match), out=match)
    likelihood += table.prior
    best = likelihood.argmax(axis=1)
    likelihood -= likelihood[np.arange(len(best)), best][:, None]
    chords = np.sqrt(np.maximum(2 - 2 * _multiply_in_rows(table.normals[best], table.normals.T), 0))
    other, log_odds = _other_normal(likelihood, chords, table.normals)
    weight = np.exp(likelihood, out=likelihood)
    total = weight.sum(axis=1)
    mean = _multiply_in_rows(weight, table.normals) / total[:, None]
    error = _chord_angle(np.einsum("pk,pk->p", weight, chords) / total)
    normal, albedo, difference = _refine_normals(images, table, best, noise)
    residual = np.sqrt(np.mean(difference**2, axis=(1, 2)))
    error_rms = _chord_angle(np.sqrt(np.maximum(2 - 2 * np.sum(normal * mean, axis=1), 0)))
    return SearchResult(normal, albedo, residual, difference.mean(axis=2), error, error_rms, mean, other, log_odds)


def _chord_angle(chord: Image) -> Image:
    """Angles [deg] between unit vectors at distances (P,)."""
    return np.asarray(np.degrees(2 * np.arcsin(np.minimum(chord / 2, 1))))


def _multiply_in_rows(left: Image, right: Image) -> Image:
    """The matrix product of (P, N) and (N, M), a few rows at a time, so that each stays in the thread that asks for it.

    The threads of a pool that all ask for large products wait for each other's helpers longer than they work.
    """
    rows = max(1, _MAX_UNTHREADED // right.size)
    whole = len(left) - len(left) % rows
    result = np.empty((len(left), right.shape[1]), dtype=np.float32)
    stack = left[:whole].reshape(-1, rows, left.shape[1])
    np.matmul(stack, right, out=result[:whole].reshape(-1, rows, right.shape[1]))
    np.matmul(left[whole:], right, out=result[whole:])
    return result


def _other_normal(likelihood: Image, chords: Image, normals: Image) -> tuple[Image, Image]:
    """The likeliest normal (P, 3) _MIN_OTHER_ANGLE from the best one, and its log-likelihood (P,) relative to that."""
    is_near = chords < np.float32(2 * np.sin(np.radians(_MIN_OTHER_ANGLE) / 2))
    far_likelihood = np.where(is_near, np.float32(-np.inf), likelihood)
    index = far_likelihood.argmax(axis=1)
    return normals[index], np.maximum(far_likelihood[np.arange(len(index)), index], np.float32(-1e4))


def _refine_normals(
    images: Image, table: Candidates, best: NDArray[np.intp], noise: float
) -> tuple[Image, Image, Image]:
    """Normal (P, 3), albedo (P, C) and what they leave of the images (P, T, C), by one step from candidates (P,).

    The step is of least squares, damped by the grid's spacing. Along an axis that the light does not tell apart, noise
    then moves the normal no farther than to the edge of its cell.
    """
    start, light = table.normals[best], table.light[best]
    albedo = _fit_albedo(images, _shade(light, start))
    rows = np.swapaxes(light * albedo[:, None, None, :], 2, 3).reshape(len(best), -1, 3)
    missing = images.reshape(len(best), -1) - np.einsum("prj,pj->pr", rows, start)
    damping = np.float32((noise / table.spacing) ** 2)
    square = np.swapaxes(rows, 1, 2) @ rows + damping * np.eye(3, dtype=np.float32)
    step = np.linalg.solve(square, np.swapaxes(rows, 1, 2) @ missing[:, :, None])[..., 0]
    step *= np.minimum(1, table.spacing / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), _EPSILON))
    normal = start + step
    normal[:, 2] = np.maximum(normal[:, 2], 0)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    shading = _shade(light, normal)
    albedo = _fit_albedo(images, shading)
    residual = images - albedo[:, None] * shading
    return normal.astype(np.float32), albedo.astype(np.float32), residual.astype(np.float32)


def _shade(light: Image, normal: Image) -> Image:
    """Brightnesses (P, T, C) of white patches."""
    return np.asarray(np.maximum(np.einsum("ptjc,pj->ptc", light, normal), 0))


def _fit_albedo(images: Image, shading: Image) -> Image:
    """Albedos (P, C) that fit best."""
    power = np.maximum(np.sum(shading * shading, axis=1), _EPSILON)
    return np.asarray(np.maximum(np.sum(images * shading, axis=1), 0) / power)


def make_shadow_candidates(skies: Skies, pose: Pose) -> Candidates | None:
    """Make the normals of a grid in every pattern of shadow, the one without shadow first.

    Args:
        skies: of T moments and C channels.
        pose: of the camera.

    Returns:
        The candidates; None where too few photos are left for any.
    """
    is_lit = _shadow_patterns(len(skies))
    if len(is_lit) < 2:
        return None
    sunny = make_candidates(skies, pose, _SHADOW_GRID_SIZE)
    sunless = replace(skies, sun_irradiance=np.zeros_like(skies.sun_irradiance))
    shaded = make_candidates(sunless, pose, _SHADOW_GRID_SIZE)
    light = np.where(is_lit[:, None, :, None, None], sunny.light, shaded.light)
    brightness = np.where(is_lit[None, :, None, :], sunny.brightness[:, None], shaded.brightness[:, None])
    hidden_count = (~is_lit).sum(axis=1)
    prior = sunny.prior - np.where(hidden_count > 0, _SHADOW_PENALTY + _MOMENT_PENALTY * hidden_count, 0)[:, None]
    normals, light = np.tile(sunny.normals, (len(is_lit), 1)), light.reshape(-1, *light.shape[2:])
    brightness = brightness.reshape(len(brightness), -1, len(skies))
    return Candidates(normals, light, brightness, prior.ravel().astype(np.float32), sunny.spacing)


def _shadow_patterns(moments: int) -> NDArray[np.bool_]:
    """Which photos (M, T) the sun reaches: all, all but the first few, all but the last few."""
    longest = moments - _MIN_SUNNY
    some = range(1, longest + 1, max(1, -(-2 * longest // _MAX_PATTERNS)))
    number = np.arange(moments)
    return np.stack([number >= 0, *(number >= hidden for hidden in some), *(number < moments - h for h in some)])


def search_with_shadows(
    images: Image,
    table: Candidates,
    shaded: Candidates | None,
    noise: float,
    progress: SearchProgress = ignore_progress,
) -> SearchResult:
    """Search normals, and again with shadows where _MAX_RESIDUAL_RATIO times the noise is left.

    Args:
        images: (P, T, C) brightnesses.
        table: candidates under the open sun.
        shaded: candidates with shadows; None searches once.
        noise: standard deviation of the brightnesses, in their unit.
        progress: passes the results of blocks on as they come.
    """
    first = search_normals(images, table, noise, progress, available_cpus())
    poor = np.flatnonzero(first.residual > _MAX_RESIDUAL_RATIO * noise)
    if shaded is None or not len(poor):
        return first
    second = search_normals(images[poor], shaded, noise, progress, available_cpus())
    better = second.residual < first.residual[poor]
    for field in fields(SearchResult):
        getattr(first, field.name)[poor[better]] = getattr(second, field.name)[better]
    return first
