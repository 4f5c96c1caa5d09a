"""Map with the photo and extrapolated surroundings.

Above the horizon the sky model fills what the photo does not show, dimmed and tinted as the network's coarse panorama
has it, and beside the photo as the photo's edges: trees, walls and hills. Below it lies the ground's colour, varied in
the same way. Nothing of this changes how much light there is: each half of the map is scaled until its irradiance is
that of the bare map, and the sun's disc is painted last, so there is one sun.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lighting.color import checked_pixels, luminance
from lighting.envmap.latlong import Image, irradiance_from_rows, max_channel, row_irradiance, scale_colors, to_float32
from lighting.envmap.projection import CLIPPED, ProjectedPhoto, project_photo, sample_photo, size_in_envmap
from lighting.envmap.relighting import edit_lighting, rotate_envmap, rotate_lighting
from lighting.envmap.render import add_sun, check_height, render
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import angle_between, angles, latlong_angles, latlong_directions, wrap_azimuth
from lighting.records import Estimate, Lighting, check_estimate, check_lighting

# Beside a photo goes on what it shows at its edges: trees, walls, and the colours of its sky and its ground.

_CELL_RATIO_RANGE = (0.05, 4.0)  # how far a cell of the bare map may be dimmed or lit

_MIN_SAMPLES = 8  # sampled pixels of the photo by which a cell is known
_NEAR_DEG = 5.0  # deg within which the photo's cells count alike; with
_VERTICAL_STRETCH = 3.0  # how much farther off a cell is above another than beside it, and
_DISTANCE_POWER = 2.5  # the power of the squared distance by which they count less, tried on panoramas of `train`
_FADE_DEG = 60.0  # deg from the photo at which a third of its difference is left, tried there as well
_EPSILON = 1e-9  # radiance that stands for none


def _extrapolate_edges(cells: Image, pixels: NDArray[np.uint8], lighting: Lighting, gain: float = 1.0) -> Image:
    """Factors (R, 2R, 3) on the cells of a coarse map (R, 2R, 3) that continue a photo (h, w, 3, sRGB) beside its view.

    A cell that the photo shows becomes the mean of its pixels there. Others follow the nearest of these on their side
    of the horizon, by their ratio, those at the same height first, and the less the farther off they are.
    """
    ratio, known = _photo_ratios(cells, pixels, lighting, gain)
    factors = np.ones_like(cells)
    half = len(cells) // 2
    for part in (slice(0, half), slice(half, None)):
        if known[part].any():
            factors[part] = np.exp(_spread_ratios(np.log(ratio[part]), known[part], len(cells), part))
    return factors


def _photo_ratios(
    cells: Image, pixels: NDArray[np.uint8], lighting: Lighting, gain: float
) -> tuple[Image, NDArray[np.bool_]]:
    """The photo, times its gain, over the map in each cell (R, 2R, 3), and which cells it shows (R, 2R).

    Where the photo is clipped and the map is brighter, the map stands.
    """
    photo, directions = sample_photo(pixels, lighting)
    azimuth, elevation = angles(directions.reshape(-1, 3))
    rows, columns = cells.shape[:2]
    row = np.minimum((90.0 - elevation) / 180.0 * rows, rows - 1).astype(np.intp)
    cell = row * columns + np.minimum((azimuth + 180.0) / 360.0 * columns, columns - 1).astype(np.intp)
    seen, there = photo.reshape(-1, 3), cells.reshape(-1, 3)
    clipped = max_channel(seen) > CLIPPED
    seen = seen * np.float32(gain)
    seen = np.where(clipped[:, None], np.maximum(seen, there[cell]), seen)
    count = np.bincount(cell, minlength=rows * columns)
    total = np.stack([np.bincount(cell, channel, rows * columns) for channel in seen.T], axis=-1)
    mean = total / np.maximum(count, 1)[:, None]
    ratio = np.clip(mean / np.maximum(there, _EPSILON), *_CELL_RATIO_RANGE).astype(np.float32)
    return ratio.reshape(cells.shape), (count >= _MIN_SAMPLES).reshape(rows, columns)


def _spread_ratios(values: Image, known: NDArray[np.bool_], rows: int, part: slice) -> Image:
    """Values (P, 2R, 3) of a part of a map's rows, drawn from the cells (P, 2R) where they are known to all others."""
    azimuth, elevation = (to_float32(angle) for angle in latlong_angles(rows))
    row, column = np.nonzero(known)
    level = np.cos(np.radians(elevation[part]))[:, None, None]
    beside2 = (level * to_float32(wrap_azimuth(azimuth[:, None] - azimuth[column]))) ** 2  # (P, 2R, K)
    above2 = (elevation[part][:, None, None] - elevation[part][row]) ** 2
    weight = (np.float32(_NEAR_DEG**2) + beside2 + np.float32(_VERTICAL_STRETCH**2) * above2) ** np.float32(
        -_DISTANCE_POWER
    )
    mean = weight @ values[known] / weight.sum(axis=2, keepdims=True)
    fading = np.exp(-np.sqrt((beside2 + 4 * above2).min(axis=2)) / np.float32(_FADE_DEG))
    return np.where(known[..., None], values, fading[..., None] * mean).astype(np.float32)


# A map that shows the place: the photo's own pixels in its view, and around it what is known or likely.

_FINE_SIDE = 1000  # pixels along the longer side of a photo of which a map shows more than the network takes
_HIDDEN_SCALE_RANGE = (
    0.1,
    4.0,
)  # how far what the photo does not show is scaled; beyond it the photo is scaled as well
_ROWS = 24  # of the cells in which the map is changed
_BAND_ROWS = 32  # rows that are multiplied at once
_SAMPLES_PER_CELL = 4  # rows and columns of the bare map that are looked at for each cell
_GLOW_DEG = 40.0  # deg around a sun within which the sky's brightness is the sun's
_MOVED_DEG = 20.0  # deg by which a sun was moved for its glow to have gone
_CONTRAST = 0.7  # power of what the network says of the place, for of other places than it saw it says too much
_IRRADIANCE_TOLERANCE = 1e-5  # share by which an irradiance may differ from the one aimed at
_EPSILON_IRRADIANCE = 1e-9  # irradiance, radiance or exposure that stands for none


@dataclass(frozen=True, eq=False)
class PhotoContext:
    """What is known of the place where a photo was taken. PhotoError for what is no photo's pixels."""

    photo: NDArray[np.uint8]  # (h, w, 3) sRGB, upright
    around: NDArray[np.float32] | None = None  # `Estimate.around`; without it bare sky and ground lie beside the photo
    exposure: float | None = None  # of the light that both are of; one that is changed by hand brightens them, too
    light: Lighting | None = None  # that light, where it is known: what it makes of the place stays under another sun

    def __post_init__(self) -> None:
        object.__setattr__(self, "photo", checked_pixels(self.photo))

    def gain(self, lighting: Lighting) -> float:
        """What brings the place to the exposure of a light that may have been changed since."""
        return 1.0 if self.exposure is None else lighting.exposure / max(self.exposure, _EPSILON_IRRADIANCE)

    def shown_light(self, lighting: Lighting) -> Lighting:
        """A light that may have been changed since, at the exposure at which the photo is as it is."""
        return lighting if self.exposure is None else edit_lighting(lighting, {"exposure": self.exposure})


def photo_context(
    estimate: Estimate, photo: NDArray[np.uint8], *, wanted: bool | None = None, exposure: float | None = None
) -> PhotoContext | None:
    """The place as a photo (h, w, 3) shows it: as wanted, by default where the network predicted what lies around.

    `exposure` is that of the light which the photo shows, by default the estimate's. Raises ParameterError for what is
    no Estimate, and PhotoError for what is no photo's pixels.
    """
    check_estimate(estimate)
    if not (estimate.around is not None if wanted is None else wanted):
        return None
    if exposure is not None:
        return PhotoContext(photo, estimate.around, exposure)
    return PhotoContext(photo, estimate.around, estimate.lighting.exposure, estimate.lighting)


def photo_context_for_height(
    estimate: Estimate,
    photo: NDArray[np.uint8],
    height: int,
    finer: Callable[[int], NDArray[np.uint8]],
    *,
    wanted: bool | None = None,
    exposure: float | None = None,
) -> PhotoContext | None:
    """`known_place` for a map of `height` rows.

    `photo` (h, w, 3) is what the estimate was made from. Only where the map shows more pixels than those,
    `finer(side)` reads it again with `side` pixels along its longer side, for decoding costs as much as the network.
    """
    check_height(height)
    place = photo_context(estimate, photo, wanted=wanted, exposure=exposure)
    if place is None or max(size_in_envmap(photo, estimate.lighting.vertical_fov, height)) <= max(photo.shape[:2]):
        return place
    return replace(place, photo=finer(_FINE_SIDE))


def render_with_surroundings(
    lighting: Lighting, place: PhotoContext, height: int = 512, *, sun: bool | None = None, disc: bool = True
) -> Image:
    """Environment map (H, 2H, 3) of the lighting of a photo, with the place.

    The parameters, the irradiances of level ground from above and from below, and the errors are those of `render`.
    """
    check_lighting(lighting)
    check_height(height)
    _check_context(place)
    halves = slice(0, height // 2), slice(height // 2, height)
    with ThreadPoolExecutor(1) as beside:  # the photo is laid out while the sky is painted, and each half has a thread
        laid = beside.submit(project_photo, lighting, place.photo, height)
        image = render(lighting, height, sun=sun, disc=False)
        factors, seen = _context_factors(image, lighting, place), laid.result()
        gain = place.gain(lighting)
        upper, lower = (
            partial(_lay_surroundings, image, half, cells, seen.within(half) if seen else None, gain)
            for half, cells in zip(halves, np.split(factors, 2), strict=True)
        )
        above = beside.submit(upper)
        lower()
        above.result()
    if disc and (lighting.sun_painted if sun is None else sun):
        add_sun(image, lighting)
    return image


def surroundings_gain(lighting: Lighting, place: PhotoContext) -> Image:
    """Factors (24, 48, 3) on the cells of the bare map beside the photo's view, before its halves are scaled.

    With them and the photo a program that renders the bare sky itself shows the place as `surround` does.
    """
    _check_context(place)
    return _surroundings_factors(_pool_cells(render(lighting, _ROWS * _SAMPLES_PER_CELL, disc=False)), lighting, place)


def _check_context(thing: object) -> None:
    if not isinstance(thing, PhotoContext):
        raise ParameterError(
            f"A Place is needed, not {type(thing).__name__}; known_place makes one of an estimate.",
            code=ErrorCode.WRONG_TYPE,
        )


def _context_factors(image: Image, lighting: Lighting, place: PhotoContext) -> Image:
    """What the light of the place makes of the cells (_ROWS, 2 _ROWS, 3) of the bare map; what is finer stays."""
    if place.light is None or _sky_parameters(place.light) == _sky_parameters(lighting):
        return _surroundings_factors(_pool_cells(image), lighting, place)
    return _move_glow(surroundings_gain(place.light, place), place.light, lighting)


def _move_glow(factors: Image, before: Lighting, now: Lighting) -> Image:
    """The factors (R, 2R, 3) of a place for a sun that was moved: around where it was they become those of their row.

    There they say how bright the sky is near the sun, and that moves with it.
    """
    sun = before.sun_direction
    moved = 1 - math.exp(-((float(angle_between(sun, now.sun_direction)) / _MOVED_DEG) ** 2))
    sky = factors[: len(factors) // 2]
    near = np.exp(-((angle_between(latlong_directions(len(factors))[: len(sky)], sun) / _GLOW_DEG) ** 2))[..., None]
    rest = np.log(sky)
    row = ((1 - near) * rest).sum(axis=1, keepdims=True) / (1 - near).sum(axis=1, keepdims=True)
    share = moved * near
    return np.concatenate([to_float32(np.exp((1 - share) * rest + share * row)), factors[len(sky) :]])


def _sky_parameters(lighting: Lighting) -> tuple[object, ...]:
    """What the sky's gradation follows from."""
    return lighting.sun_azimuth, lighting.sun_elevation, lighting.turbidity, lighting.sky_model


def _surroundings_factors(bare: Image, lighting: Lighting, place: PhotoContext) -> Image:
    """What the place makes of the cells (_ROWS, 2 _ROWS, 3) of the bare map."""
    ratio, gain = np.ones_like(bare), place.gain(lighting)
    if place.around is not None:
        _multiply_cells(ratio, _panorama_ratio(np.float32(gain) * place.around, bare))
    return np.asarray(ratio * _extrapolate_edges(ratio * bare, place.photo, lighting, gain))


def _pool_cells(image: Image) -> Image:
    """A map's cells (_ROWS, 2 _ROWS, 3), by some of their pixels."""
    height, width = image.shape[:2]
    y = ((np.arange(_ROWS * _SAMPLES_PER_CELL) + 0.5) * height / (_ROWS * _SAMPLES_PER_CELL)).astype(np.intp)
    x = ((np.arange(2 * _ROWS * _SAMPLES_PER_CELL) + 0.5) * width / (2 * _ROWS * _SAMPLES_PER_CELL)).astype(np.intp)
    rows = image.take(y, axis=0).take(x, axis=1).reshape(_ROWS, _SAMPLES_PER_CELL, -1).mean(axis=1)
    return np.asarray(rows.reshape(_ROWS, 2 * _ROWS, _SAMPLES_PER_CELL, 3).mean(axis=2))


def _panorama_ratio(around: Image, bare: Image) -> Image:
    """The coarse panorama (R, 2R, 3) over the same cells of the bare map (_ROWS, 2 _ROWS, 3), with less contrast."""
    rows, step = len(around), _ROWS // len(around)
    pooled = bare.reshape(rows, step, 2 * rows, step, 3).mean(axis=(1, 3))
    return _reduce_contrast(np.clip(around / np.maximum(pooled, np.float32(_EPSILON_IRRADIANCE)), *_CELL_RATIO_RANGE))


def _reduce_contrast(ratio: Image) -> Image:
    """Ratios (R, 2R, 3) drawn to their geometric mean in each half: above the horizon in brightness alone."""
    sky, ground = np.split(np.log(ratio), 2)
    grey = np.log(luminance(ratio[: len(sky)]))[..., None]
    sky -= np.float32(1 - _CONTRAST) * (grey - grey.mean())
    ground -= np.float32(1 - _CONTRAST) * (ground - ground.mean(axis=(0, 1)))
    return np.asarray(np.exp(np.concatenate([sky, ground])))


def _multiply_cells(image: Image, cells: Image) -> None:
    """Multiply a map (H, 2H, 3) by cells (R, 2R, 3) that blend into each other but for the horizon."""
    middle, horizon = len(image) // 2, len(cells) // 2
    _multiply_half(image[:middle], cells[:horizon])
    _multiply_half(image[middle:], cells[horizon:])


def _multiply_half(image: Image, cells: Image) -> None:
    """Multiply rows of a map (H, W, 3), contiguous in memory, by cells (R, C, 3), linear between their centres.

    Columns wrap and rows end. A few rows at once lie between few rows of cells, and only those count for them.
    """
    (height, width), (rows, columns) = image.shape[:2], cells.shape[:2]
    wide = (_interpolation_weights(width, columns, lambda cell: cell % columns) @ cells).reshape(rows, -1)  # (R, 3 W)
    down = _interpolation_weights(height, rows, lambda cell: np.clip(cell, 0, rows - 1))
    flat = image.reshape(height, -1)
    for start in range(0, height, _BAND_ROWS):
        band = slice(start, start + _BAND_ROWS)
        near = np.flatnonzero(down[band].any(axis=0))
        between = slice(near[0], near[-1] + 1)
        flat[band] *= down[band, between] @ wide[between]


def _interpolation_weights(
    pixels: int, cells: int, inside: Callable[[NDArray[np.intp]], NDArray[np.intp]]
) -> NDArray[np.float32]:
    """The shares (pixels, cells) of the cells on either side of each pixel; `inside` places those beyond the ends."""
    at = (np.arange(pixels) + 0.5) * cells / pixels - 0.5
    low = np.floor(at).astype(np.intp)
    shares = np.zeros((pixels, cells), np.float32)
    for cell, share in ((low, 1 - (at - low)), (low + 1, at - low)):
        shares[np.arange(pixels), inside(cell)] += to_float32(share)
    return shares


def _lay_surroundings(image: Image, half: slice, cells: Image, photo: ProjectedPhoto | None, gain: float) -> None:
    """Give one half of the bare map the place: its cells, and the photo times a gain. Its irradiance stays."""
    levels = row_irradiance(len(image))
    target = irradiance_from_rows(levels[half], image[half])
    _multiply_half(image[half], cells)
    total = irradiance_from_rows(levels[half], image[half])
    if photo is None:
        scale_colors(image[half], target / np.maximum(total, _EPSILON_IRRADIANCE))
        return
    seen = photo.over(image, gain)
    there, weight = image[seen.rows, seen.columns], seen.weight[..., None].repeat(3, axis=2)
    share = there.shape[1] / image.shape[1]  # of the columns
    shown_light = irradiance_from_rows(levels[seen.rows], weight * seen.linear) * share
    hidden = irradiance_from_rows(levels[seen.rows], weight * there) * share
    rest = np.clip((target - shown_light) / np.maximum(total - hidden, _EPSILON_IRRADIANCE), *_HIDDEN_SCALE_RANGE)
    scale_colors(image[half], rest)
    there += weight * (seen.linear - there)
    reached = rest * (total - hidden) + shown_light
    if np.any(np.abs(reached - target) > _IRRADIANCE_TOLERANCE * target):
        scale_colors(image[half], target / np.maximum(reached, _EPSILON_IRRADIANCE))


# The map that a caller asks for: of which sky, with the place or without, turned or not.


def render_view(
    lighting: Lighting,
    height: int = 512,
    *,
    sun: bool | None = None,
    yaw: float = 0.0,
    sky: str | None = None,
    place: PhotoContext | None = None,
) -> tuple[Image, Lighting]:
    """The rendered map turned by `yaw` [deg], and the lighting turned with it; other parameters as in `render`.

    `sky` is another model of SKY_MODELS than the record's. With a `place`, the map shows it as `surround` does.
    """
    lighting = lighting if sky is None else replace(lighting, sky_model=sky)
    image = (
        render(lighting, height, sun=sun)
        if place is None
        else render_with_surroundings(lighting, place, height, sun=sun)
    )
    return (rotate_envmap(image, yaw), rotate_lighting(lighting, yaw)) if yaw else (image, lighting)
