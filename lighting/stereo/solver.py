"""From photos and skies to a map of normals: the noise, the search, the network where it wins; and the turbidity.

Haze dims a low sun more than a high one, which changes the brightnesses over a day as much as normals do. So a wrong
turbidity bends all of them, and few photographers know it: it is fitted to the photos.

The network improves a search's normals. Its inputs: `by_image`, float32 (1, T, BY_IMAGE, H, W), and `shared`, float32
(1, SHARED, H, W), T any number of images of a day, H and W multiples of 8. Its outputs: `normal`, float32 (1, 3, H, W),
unit vectors in the camera frame, and `error`, float32 (1, 1, H, W), their expected angle to the truth [rad].
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import ModelError, PhotoError
from lighting.onnx_session import create_session, packaged_network
from lighting.stereo.grid_search import (
    Candidates,
    Pose,
    SearchProgress,
    SearchResult,
    ignore_progress,
    make_candidates,
    make_shadow_candidates,
    search_normals,
    search_with_shadows,
    world_to_camera,
)
from lighting.stereo.light_vectors import Skies

Image = NDArray[np.float32]

BY_IMAGE = 6  # planes of each image: relative brightness, difference to the search's fit, cosine to the sun, sun x y z
SHARED = 15  # planes of the search: best, mean and other normal, residual, odds, spread, brightness, noise, mask

_LARGE_DIFFERENCE = 0.05  # of the mean brightness, what counts as a large difference


@dataclass(frozen=True)
class NormalFeatures:
    """Planes of a picture."""

    by_image: Image
    """(T, BY_IMAGE, H, W)."""
    shared: Image
    """(SHARED, H, W)."""


def normal_features(
    images: Image, mask: NDArray[np.bool_], suns: NDArray[Any], search: SearchResult, noise: float
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


def _search_planes(search: SearchResult, size: Image, noise: float) -> Image:
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
    return packaged_network(Path(__file__).parents[1] / "data", "normals")


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
_MIN_SUN_MOTION = np.radians(2.0)  # apart, for light to differ


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
    result = search_with_shadows(pixels, table, make_shadow_candidates(skies, pose), noise_std, progress)
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


def _make_normal_map(mask: NDArray[np.bool_], result: SearchResult, noise: float) -> NormalMap:
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
class OtherHeading:
    """A heading that explains the photos better than the one that was told."""

    heading: float
    """Deg clockwise from true north."""
    noise_ratio: float
    """Of what it leaves unexplained to what the one that was told leaves, under 1."""
    angle: float
    """Deg, median between the normals of both."""


def find_other_heading(session: Session) -> OtherHeading:
    """Find the heading that explains the photos best among those _HEADING_STEP and more from the one that was told.

    Args:
        session: photos and their light.
    """
    pixels = _relative_pixels(session)
    pixels = pixels[:: max(1, len(pixels) // _NOISE_PIXELS)]

    def explain(heading: float) -> SearchResult:
        pose = replace(session.pose, heading=heading)
        return search_normals(pixels, make_candidates(session.skies, pose, _COARSE_GRID_SIZE), MIN_NOISE)

    told = explain(session.pose.heading)
    headings = session.pose.heading + np.arange(_HEADING_STEP, 360.0, _HEADING_STEP)
    others = [(explain(float(heading)), float(heading) % 360) for heading in headings]
    best, heading = min(others, key=lambda other: float(np.median(other[0].residual)))
    ratio = float(np.median(best.residual)) / max(float(np.median(told.residual)), 1e-9)
    cosine = np.clip(np.sum(best.normal * told.normal, axis=1), -1, 1)
    return OtherHeading(heading, ratio, float(np.degrees(np.median(np.arccos(cosine)))))


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


def check_sun_moves(skies: Skies) -> None:
    """Check that the light of the moments differs.

    Args:
        skies: of all photos.

    Raises:
        PhotoError: the sun does not move.
    """
    suns = skies.sun_direction
    if np.arccos(np.clip(suns @ suns.T, -1, 1)).max() < _MIN_SUN_MOTION:
        raise PhotoError("The sun is in the same place in all photos; take them over hours.")


TURBIDITIES = (2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.5)  # tried, from very clear to hazy


def fit_turbidity(session_at: Callable[[float], Session]) -> float:
    """Fit the turbidity whose skies leave least of the photos unexplained; between those tried by a parabola.

    Args:
        session_at: makes the session of a turbidity, 1 to 10.
    """
    residual = np.array([_session_noise(session) for session in map(session_at, TURBIDITIES)])
    best = int(np.clip(residual.argmin(), 1, len(residual) - 2))
    nearby = slice(best - 1, best + 2)
    curve = np.polyfit(TURBIDITIES[nearby], residual[nearby] ** 2, 2)
    if curve[0] <= 0:
        return TURBIDITIES[int(residual.argmin())]
    return float(np.clip(-curve[1] / (2 * curve[0]), TURBIDITIES[best - 1], TURBIDITIES[best + 1]))
