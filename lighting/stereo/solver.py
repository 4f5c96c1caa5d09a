"""From photos and skies to a map of normals: the noise, the search, the network where it wins; and the turbidity.

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

Camera frame: +X right, +Y up in the picture, +Z towards the camera, so that visible normals have positive Z.
World axes are those of the maps: +Y up, true north at -Z, east at +X.

Haze dims a low sun more than a high one, which changes the brightnesses over a day as much as normals do. So a wrong
turbidity bends all of them, and few photographers know it: it is fitted to the photos.

The network improves a search's normals. Its inputs: `by_image`, float32 (1, T, BY_IMAGE, H, W), and `shared`, float32
(1, SHARED, H, W), T any number of images of a day, H and W multiples of 8. Its outputs: `normal`, float32 (1, 3, H, W),
unit vectors in the camera frame, and `error`, float32 (1, 1, H, W), their expected angle to the truth [rad].
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.checksum import DATA_FOLDER
from lighting.errors import ModelError, PhotoError
from lighting.geometry import Floats, camera_axes
from lighting.onnx_session import create_session, packaged_network
from lighting.runtime import available_cpus
from lighting.stereo.light_vectors import Skies, illumination_matrices

Image = NDArray[np.float32]

BY_IMAGE = 6  # planes of each image: relative brightness, difference to the search's fit, cosine to the sun, sun x y z
SHARED = 15  # planes of the search: best, mean and other normal, residual, odds, spread, brightness, noise, mask

_LARGE_DIFFERENCE = 0.05  # of the mean brightness, what counts as a large difference


@dataclass(frozen=True)
class Pose:
    """How a camera stands; the defaults look level to the north."""

    heading: float = 0.0
    """Deg clockwise from true north, where the camera looks."""
    pitch: float = 0.0
    """Deg, positive looks up."""
    roll: float = 0.0
    """Deg, positive turns the camera clockwise as its holder sees it."""


def _axes(pose: Pose) -> Floats:
    """The camera frame's X, Y and Z as rows (3, 3) in world axes."""
    right, up, forward = camera_axes(pose.heading, pose.pitch, pose.roll)
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


GRID_SIZE = 3000  # normals, 2.6 deg apart
MIN_OTHER_ANGLE = 25.0  # deg, from the best normal to the nearest that counts as another answer

_BLOCK_RESIDUALS = 1 << 19  # residuals held at once: few enough to stay in a processor's cache
_MAX_UNTHREADED = 1 << 18  # multiplications of a matrix product up to which OpenBLAS (numpy's) starts no threads
_EPSILON = np.float32(1e-12)


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
    """Rad, between neighbouring normals."""


@dataclass(frozen=True)
class _SearchResult:
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
    """(P, 3), the best normal MIN_OTHER_ANGLE or more from the first."""
    log_odds: Image
    """(P,), natural logarithm of how much less likely the other one is, at most 0."""


SearchProgress = Callable[
    [Iterable[_SearchResult], int], Iterable[_SearchResult]
]  # sees answers pass, of so many in all


def make_candidates(skies: Skies, pose: Pose, count: int = GRID_SIZE) -> Candidates:
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


def ignore_progress(parts: Iterable[_SearchResult], count: int) -> Iterable[_SearchResult]:  # noqa: ARG001
    """Pass results on and report nothing.

    Args:
        parts: results of blocks.
        count: of all blocks.
    """
    return parts


def search_normals(
    images: Image, table: Candidates, noise: float, progress: SearchProgress = ignore_progress, threads: int = 1
) -> _SearchResult:
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
    return _SearchResult(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(_SearchResult)))


def _search_block(images: Image, table: Candidates, noise: float, units: Image) -> _SearchResult:
    likelihood = _log_likelihood(images, units, noise)
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
    return _SearchResult(normal, albedo, residual, difference.mean(axis=2), error, error_rms, mean, other, log_odds)


def _chord_angle(chord: Image) -> Image:
    """Angles [deg] between unit vectors at distances (P,)."""
    return np.asarray(np.degrees(2 * np.arcsin(np.minimum(chord / 2, 1))))


def _log_likelihood(images: Image, units: Image, noise: float) -> Image:
    """Logarithms (P, K) of how likely each normal makes the images, up to a constant for each pixel."""
    scaled = (images / np.float32(noise * np.sqrt(2))).astype(np.float32)
    total = np.zeros((len(images), units.shape[-1]), dtype=np.float32)
    for channel, unit in enumerate(units):
        match = _multiply_in_rows(scaled[:, :, channel], unit)
        total += np.square(np.maximum(match, 0, out=match), out=match)
    return total


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
    """The likeliest normal (P, 3) MIN_OTHER_ANGLE from the best one, and its log-likelihood (P,) relative to that."""
    is_near = chords < np.float32(2 * np.sin(np.radians(MIN_OTHER_ANGLE) / 2))
    far_likelihood = np.where(is_near, np.float32(-np.inf), likelihood)
    index = far_likelihood.argmax(axis=1)
    return normals[index], np.maximum(far_likelihood[np.arange(len(index)), index], np.float32(-1e4))


def _refine_normals(images: Image, table: Candidates, best: NDArray[Any], noise: float) -> tuple[Image, Image, Image]:
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


# Shadows.

MAX_RESIDUAL_RATIO = 2.0  # times the noise, the residual from which on shadows are thought of

_SHADOW_GRID_SIZE = 700  # normals, 5.4 deg apart
_SHADOW_PENALTY, _MOMENT_PENALTY = 3.0, 0.3  # logarithms: of a shadow, and of each photo that it lasts
_MIN_SUNNY = 3  # photos in the sun, for a normal
_MAX_PATTERNS = 16  # at most


def _make_shadow_candidates(skies: Skies, pose: Pose) -> Candidates | None:
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


def _search_with_shadows(
    images: Image,
    table: Candidates,
    shaded: Candidates | None,
    noise: float,
    progress: SearchProgress = ignore_progress,
) -> _SearchResult:
    """Search normals, and again with shadows where MAX_RESIDUAL_RATIO times the noise is left.

    Args:
        images: (P, T, C) brightnesses.
        table: candidates under the open sun.
        shaded: candidates with shadows; None searches once.
        noise: standard deviation of the brightnesses, in their unit.
        progress: passes the results of blocks on as they come.
    """
    first = search_normals(images, table, noise, progress, available_cpus())
    poor = np.flatnonzero(first.residual > MAX_RESIDUAL_RATIO * noise)
    if shaded is None or not len(poor):
        return first
    second = search_normals(images[poor], shaded, noise, progress, available_cpus())
    better = second.residual < first.residual[poor]
    for field in fields(_SearchResult):
        getattr(first, field.name)[poor[better]] = getattr(second, field.name)[better]
    return first


@dataclass(frozen=True)
class NormalFeatures:
    """Planes of a picture."""

    by_image: Image
    """(T, BY_IMAGE, H, W)."""
    shared: Image
    """(SHARED, H, W)."""


def normal_features(
    images: Image, mask: NDArray[np.bool_], suns: NDArray[Any], search: _SearchResult, noise: float
) -> NormalFeatures:
    """Make the planes that the network sees; 0 outside the mask.

    Args:
        images: (P, T, C) brightnesses of the mask's pixels.
        mask: (H, W).
        suns: (T, 3) unit vectors in the camera frame.
        search: what the search says of the pixels.
        noise: standard deviation of the brightnesses, in their unit.
    """
    brightness = images.mean(axis=2)
    size = np.sqrt(np.mean(brightness**2, axis=1)) + np.float32(1e-9)
    by_image = np.zeros((images.shape[1], BY_IMAGE, *mask.shape), dtype=np.float32)
    by_image[:, 0, mask] = (brightness / size[:, None]).T
    by_image[:, 1, mask] = np.tanh(search.difference / (_LARGE_DIFFERENCE * size[:, None])).T
    by_image[:, 2, mask] = suns.astype(np.float32) @ search.normal.T
    by_image[:, 3:][..., mask] = suns[:, :, None]
    shared = np.zeros((SHARED, *mask.shape), dtype=np.float32)
    shared[:, mask] = _search_planes(search, size, noise)
    return NormalFeatures(by_image, shared)


def _search_planes(search: _SearchResult, size: Image, noise: float) -> Image:
    """The planes (SHARED, P) of the search."""
    residual, odds, spread = np.log1p(search.residual / noise), np.tanh(search.log_odds / 4), search.error_rms / 30
    brightness = np.clip(np.log(size / np.median(size)), -3, 3)
    numbers = (residual, odds, spread, brightness, np.clip(np.log(noise / size), -8, 0) / 4, np.ones_like(size))
    vectors = (search.normal.T, search.mean.T, search.other.T)
    return np.concatenate([*vectors, np.stack(numbers)]).astype(np.float32)


_TILE, _MARGIN = 384, 48  # pixels that are answered at once, and that the network sees beyond them
_SIZE_MULTIPLE = 8  # pixels, of the sizes that the network takes


class Network:
    """A loaded network."""

    def __init__(self, session: Any) -> None:
        self.session = session

    @classmethod
    def load(cls, path: Path | None = None, threads: int = 0) -> "Network":
        """Load a network.

        Args:
            path: an ONNX file; None is the one in this package.
            threads: of onnxruntime; 0 lets it choose.

        Raises:
            ModelError: the file is not a network of normals of this version.
        """
        file = _packaged_network() if path is None else path
        session = create_session(file, threads)
        if {port.name: port.shape[-3] for port in session.get_inputs()} != {"by_image": BY_IMAGE, "shared": SHARED}:
            raise ModelError(f"{file} is not a network of normals of this version.")
        return cls(session)

    def predict(self, features: NormalFeatures) -> tuple[Image, Image]:
        """Predict normals (H, W, 3) and expected errors (H, W) [deg], tile by tile.

        Args:
            features: of one day.

        Raises:
            ModelError: the network fails.
        """
        height, width = features.shared.shape[1:]
        normal, error = np.zeros((height, width, 3), np.float32), np.zeros((height, width), np.float32)
        for tile in _iter_tiles(height, width):
            if features.shared[-1][tile].any():
                normal[tile], error[tile] = self._tile(features, tile)
        return normal, error

    def _tile(self, features: NormalFeatures, tile: tuple[slice, slice]) -> tuple[Image, Image]:
        starts, ends = [max(0, part.start - _MARGIN) for part in tile], [part.stop + _MARGIN for part in tile]
        rows, columns = map(slice, starts, ends)
        by_image, shared = (_pad_planes(every[..., rows, columns]) for every in (features.by_image, features.shared))
        try:
            normal, error = self.session.run(("normal", "error"), {"by_image": by_image[None], "shared": shared[None]})
        except Exception as failure:  # onnxruntime's errors share no public base class
            raise ModelError(f"The network of normals failed: {failure}.") from failure
        core = tuple(slice(part.start - start, part.stop - start) for part, start in zip(tile, starts, strict=True))
        return np.moveaxis(normal[0], 0, -1)[core], np.degrees(error[0, 0])[core]


def _packaged_network() -> Path:
    """The one network of normals in this package; ModelError if there is none or a choice."""
    return packaged_network(DATA_FOLDER, "normals")


def _iter_tiles(height: int, width: int) -> Iterator[tuple[slice, slice]]:
    for top in range(0, height, _TILE):
        for left in range(0, width, _TILE):
            yield slice(top, min(top + _TILE, height)), slice(left, min(left + _TILE, width))


def _pad_planes(planes: Image) -> Image:
    """Planes (..., H, W) with zeros below and to the right up to sizes that the network takes."""
    missing = [-side % _SIZE_MULTIPLE for side in planes.shape[-2:]]
    return np.pad(planes, [(0, 0)] * (planes.ndim - 2) + [(0, more) for more in missing])


MIN_NOISE = 0.01  # of the brightest pixel, the standard deviation of a photo's noise

_NOISE_PIXELS = 3000  # pixels at which the noise is measured
_BRIGHT_QUANTILE = 0.999  # quantile that counts as the brightest pixel
_NORMAL_PARAMETERS = 2  # numbers that a normal takes from a pixel's brightnesses, besides an albedo for each channel
_COARSE_GRID_SIZE = 1000  # normals of the grid on which skies are compared
_MIN_SKY_NOISE = 2e-3  # taken for the noise where skies are compared
_MIN_WINDOW = 2  # pixels each way, over which residuals are averaged
_WINDOW_SHARE = 1 / 128  # of the picture's longer side, the same
_ERROR_BY_MISFIT = 160.0  # deg, by the root of a shared residual; fitted to path-traced sessions (export/stereo)
_CHANCE = 2.0  # times the variance that noise alone leaves in an average, which is not counted
_MAX_ERROR = 90.0  # deg
_HEADING_STEP = 30.0  # deg, between the headings that are compared
_MAX_ERROR_RATIO = 0.7  # times the search's expected error, below which the network's normal is taken


@dataclass(frozen=True)
class Session:
    """What is solved: a camera's photos of several moments and the light of each."""

    images: Image
    """(T, H, W, C), linear, in one unit."""
    mask: NDArray[np.bool_]
    """(H, W), the pixels to solve."""
    skies: Skies
    """Of T moments and C channels."""
    pose: Pose
    """How the camera stands."""


@dataclass(frozen=True)
class NormalMap:
    """The normals of a picture; everything is 0 outside the mask."""

    mask: NDArray[np.bool_]
    """Mask, (H, W)."""
    normal: Image
    """(H, W, 3), unit vectors in the camera frame."""
    albedo: Image
    """(H, W, C), relative: the brightest hundredth is 1."""
    error: Image
    """(H, W), expected angle [deg] to the truth."""
    misfit: Image
    """(H, W), the residual that neighbours share, as a share of the brightest pixel; noise leaves none."""
    residual: Image
    """(H, W), what the model misses of the photos, as a share of the brightest pixel."""
    network: NDArray[np.bool_]
    """(H, W), where the network's normal was taken."""
    noise: float
    """Of the photos and the model together, as a share of the brightest pixel."""

    @property
    def median_misfit(self) -> float:
        """Median of the misfit inside the mask."""
        return float(np.median(self.misfit[self.mask]))


def solve_normals(
    session: Session,
    noise: float = MIN_NOISE,
    network: Network | None = None,
    progress: SearchProgress = ignore_progress,
) -> NormalMap:
    """Find the normals of a session's pixels.

    Args:
        session: photos and their light.
        noise: least standard deviation of the images, as a share of the brightest pixel; what the model misses counts
            where it is more.
        network: improves what the search finds; None searches alone.
        progress: passes the results of blocks on as they come.

    Raises:
        PhotoError: the mask is empty, or the images have no light.
    """
    normals, features = solve_with_planes(session, noise, progress)
    return add_model_error(normals if network is None else apply_network(normals, network, features))


def solve_with_planes(
    session: Session, noise: float = MIN_NOISE, progress: SearchProgress = ignore_progress
) -> tuple[NormalMap, NormalFeatures]:
    """Find normals by search alone, and the planes that the network improves them from.

    Args:
        session: photos and their light.
        noise: least standard deviation of the images, as a share of the brightest pixel.
        progress: passes the results of blocks on as they come.
    """
    mask, skies, pose = session.mask, session.skies, session.pose
    pixels = _relative_pixels(session)
    table = make_candidates(skies, pose)
    noise_std = _measure_noise(pixels, table, noise)
    result = _search_with_shadows(pixels, table, _make_shadow_candidates(skies, pose), noise_std, progress)
    features = normal_features(pixels, mask, world_to_camera(skies.sun_direction, pose), result, noise_std)
    return _make_normal_map(mask, result, noise_std), features


def _session_noise(session: Session) -> float:
    """Standard deviation of what a session's skies leave unexplained, as a share of the brightest pixel."""
    table = make_candidates(session.skies, session.pose, _COARSE_GRID_SIZE)
    return _measure_noise(_relative_pixels(session), table, _MIN_SKY_NOISE)


def _relative_pixels(session: Session) -> Image:
    """Brightnesses (P, T, C) in the mask, as shares of the brightest pixel."""
    pixels = np.ascontiguousarray(np.moveaxis(session.images, 0, -2)[session.mask])
    if not len(pixels):
        raise PhotoError("The mask leaves no pixel.")
    white = float(np.quantile(pixels, _BRIGHT_QUANTILE))
    if not white > 0:
        raise PhotoError("The photos are black where the mask is white.")
    return np.asarray(pixels / np.float32(white))


def _measure_noise(pixels: Image, table: Candidates, least: float) -> float:
    """Standard deviation of what the model misses of pixels (P, T, C), in their unit, but at least `least`."""
    moments, channels = pixels.shape[1:]
    degrees_of_freedom = moments * channels - channels - _NORMAL_PARAMETERS
    if degrees_of_freedom <= 0:
        return least
    result = search_normals(pixels[:: max(1, len(pixels) // _NOISE_PIXELS)], table, least)
    std = np.sqrt(np.median(result.residual**2) * moments * channels / degrees_of_freedom)
    return float(max(least, std))


def _make_normal_map(mask: NDArray[np.bool_], result: _SearchResult, noise: float) -> NormalMap:
    albedo = result.albedo / max(float(np.quantile(result.albedo, 0.99)), 1e-9)
    misfit = _shared_residual(_fill_mask(mask, result.difference), mask)
    planes = (result.normal, albedo.astype(np.float32), result.error, result.residual)
    normal, albedo, error, residual = (_fill_mask(mask, plane) for plane in planes)
    return NormalMap(mask, normal, albedo, error, misfit, residual, np.zeros(mask.shape, dtype=bool), noise)


def _shared_residual(difference: Image, mask: NDArray[np.bool_]) -> Image:
    """Measure what the model misses of pixels and their neighbours alike.

    The noise of pixels is independent and averages out; a wrong sun, a changed exposure or light between parts of the
    surface do not.

    Args:
        difference: (H, W, T) images less what normal and albedo make of them.
        mask: (H, W), the pixels that were solved.

    Returns:
        Standard deviation (H, W) for each degree of freedom, in the unit of the images; 0 outside the mask.
    """
    moments = difference.shape[2]
    reach = max(_MIN_WINDOW, round(_WINDOW_SHARE * max(mask.shape)))
    count = np.maximum(_sum_window(mask[..., None].astype(np.float32), reach)[..., 0], 1)
    power = np.sum(np.square(_sum_window(difference, reach) / count[..., None]), axis=2)
    many = mask & (count > 1)
    own = (np.sum(np.square(difference), axis=2) - power)[many] / (1 - 1 / count[many])
    noise = float(np.median(own)) if own.size else 0.0
    shared = np.maximum(power - _CHANCE * noise / count, 0) / max(moments - 3, 1)
    return np.asarray(np.sqrt(shared) * mask, dtype=np.float32)


def _sum_window(planes: Image, reach: int) -> Image:
    """Sums (H, W, N) over squares of 2 reach + 1 pixels."""
    for axis in (0, 1):
        margins = [(reach + 1, reach) if a == axis else (0, 0) for a in range(3)]
        total = np.cumsum(np.pad(planes, margins), axis=axis, dtype=np.float64)
        size = planes.shape[axis]
        high = np.take(total, range(2 * reach + 1, 2 * reach + 1 + size), axis)
        planes = (high - np.take(total, range(size), axis)).astype(np.float32)
    return planes


def add_model_error(normals: NormalMap) -> NormalMap:
    """Add to the expected errors what a model that misses the photos costs.

    Args:
        normals: whose expected errors know of noise alone.
    """
    return raise_error(normals, _ERROR_BY_MISFIT * np.sqrt(normals.misfit))


def raise_error(normals: NormalMap, angle: ArrayLike) -> NormalMap:
    """Add an error that is independent of what is expected so far.

    Args:
        normals: raised within their mask.
        angle: deg, one or (H, W).
    """
    error = np.minimum(np.hypot(normals.error, angle), _MAX_ERROR) * normals.mask
    return replace(normals, error=error.astype(np.float32))


@dataclass(frozen=True)
class _OtherHeading:
    """A heading that explains the photos better than the one that was told."""

    heading: float
    """Deg clockwise from true north."""
    noise_ratio: float
    """Of what it leaves unexplained to what the one that was told leaves, under 1."""
    angle: float
    """Deg, median between the normals of both."""


def find_other_heading(session: Session) -> _OtherHeading:
    """Find the heading that explains the photos best among those _HEADING_STEP and more from the one that was told.

    Args:
        session: photos and their light.
    """
    pixels = _relative_pixels(session)
    pixels = pixels[:: max(1, len(pixels) // _NOISE_PIXELS)]

    def explain(heading: float) -> _SearchResult:
        pose = replace(session.pose, heading=heading)
        return search_normals(pixels, make_candidates(session.skies, pose, _COARSE_GRID_SIZE), MIN_NOISE)

    told = explain(session.pose.heading)
    headings = session.pose.heading + np.arange(_HEADING_STEP, 360.0, _HEADING_STEP)
    others = [(explain(float(heading)), float(heading) % 360) for heading in headings]
    best, heading = min(others, key=lambda other: float(np.median(other[0].residual)))
    ratio = float(np.median(best.residual)) / max(float(np.median(told.residual)), 1e-9)
    cosine = np.clip(np.sum(best.normal * told.normal, axis=1), -1, 1)
    return _OtherHeading(heading, ratio, float(np.degrees(np.median(np.arccos(cosine)))))


def _fill_mask(mask: NDArray[np.bool_], values: Image) -> Image:
    """Values (P, ...) of a mask's pixels as a picture (H, W, ...)."""
    picture = np.zeros((*mask.shape, *values.shape[1:]), dtype=np.float32)
    picture[mask] = values
    return picture


def apply_network(normals: NormalMap, network: Network, features: NormalFeatures) -> NormalMap:
    """Take the network's normals where it expects to err clearly less than the search.

    It is at times too sure of itself. _MAX_ERROR_RATIO is one of 0.4, 0.5 and so on to 1, tried on 159 scenes like
    those that it was trained on. It is the largest at which the median rose by more than 0.2 deg on fewer than 5 % of
    them. With 1 it rose so on 10 %, with 0.7 on 4 %.

    Args:
        normals: of the search.
        network: the network of normals.
        features: planes of the search.
    """
    normal, error = network.predict(features)
    better = normals.mask & (error < _MAX_ERROR_RATIO * normals.error)
    normal, error = np.where(better[..., None], normal, normals.normal), np.where(better, error, normals.error)
    return replace(normals, normal=normal, error=error, network=better)


_TURBIDITIES = (2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.5)  # tried, from very clear to hazy


def fit_turbidity(session_at: Callable[[float], Session]) -> float:
    """Fit the turbidity whose skies leave least of the photos unexplained; between those tried by a parabola.

    Args:
        session_at: makes the session of a turbidity, 1 to 10.
    """
    residual = np.array([_session_noise(session) for session in map(session_at, _TURBIDITIES)])
    best = int(np.clip(residual.argmin(), 1, len(residual) - 2))
    nearby = slice(best - 1, best + 2)
    curve = np.polyfit(_TURBIDITIES[nearby], residual[nearby] ** 2, 2)
    if curve[0] <= 0:
        return _TURBIDITIES[int(residual.argmin())]
    return float(np.clip(-curve[1] / (2 * curve[0]), _TURBIDITIES[best - 1], _TURBIDITIES[best + 1]))
