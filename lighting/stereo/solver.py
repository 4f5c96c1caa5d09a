"""From photos and skies to a map of normals: the noise, the search, the network where it wins; and the turbidity.

Haze dims a low sun more than a high one, which changes the brightnesses over a day as much as normals do. So a wrong
turbidity bends all of them, and few photographers know it: it is fitted to the photos.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import PhotoError
from lighting.stereo.light_vectors import Skies
from lighting.stereo.normal_network import Network, NormalFeatures, normal_features
from lighting.stereo.normal_search import (
    Candidates,
    Image,
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
_TURBIDITIES = (2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.5)  # tried, from very clear to hazy


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
    """(H, W), the residual that neighbors share, as a share of the brightest pixel; noise leaves none."""
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
    albedo = result.albedo / max(float(np.quantile(result.albedo, 0.99)), 1e-9)
    misfit = _shared_residual(_fill_mask(mask, result.difference), mask)
    normal, albedo, error = (_fill_mask(mask, plane) for plane in (result.normal, albedo, result.error))
    return NormalMap(mask, normal, albedo, error, misfit, np.zeros(mask.shape, dtype=bool), noise_std), features


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


def _shared_residual(difference: Image, mask: NDArray[np.bool_]) -> Image:
    """Measure what the model misses of pixels and their neighbors alike.

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


def find_other_heading(session: Session) -> tuple[float, float, float]:
    """Find the heading that explains the photos best among those _HEADING_STEP and more from the one that was told.

    Args:
        session: photos and their light.

    Returns:
        The heading, deg clockwise from true north. What it leaves unexplained, as a ratio to what the one that was told
        leaves. The median angle, deg, between the normals of both.
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
    return heading, ratio, float(np.degrees(np.median(np.arccos(cosine))))


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


def fit_turbidity(session_at: Callable[[float], Session]) -> float:
    """Fit the turbidity whose skies leave least of the photos unexplained; between those tried by a parabola.

    Args:
        session_at: makes the session of a turbidity, 1 to 10.
    """
    residual = np.empty(len(_TURBIDITIES))
    for number, session in enumerate(map(session_at, _TURBIDITIES)):
        table = make_candidates(session.skies, session.pose, _COARSE_GRID_SIZE)
        residual[number] = _measure_noise(_relative_pixels(session), table, _MIN_SKY_NOISE)
    best = int(np.clip(residual.argmin(), 1, len(residual) - 2))
    nearby = slice(best - 1, best + 2)
    curve = np.polyfit(_TURBIDITIES[nearby], residual[nearby] ** 2, 2)
    if curve[0] <= 0:
        return _TURBIDITIES[int(residual.argmin())]
    return float(np.clip(-curve[1] / (2 * curve[0]), _TURBIDITIES[best - 1], _TURBIDITIES[best + 1]))
