"""Detail all around a map: what is coarse stays as it is, what is finer comes from the photo and from real places.

Beside its edges the photo goes on by its own mirror image for some degrees; beyond them lies a panorama of the library
that looks like the photo. Both are divided by what is coarse in them, so that they add no light. Then each cell, and
the light on matte objects in each half of the map exactly, is brought back to what it was. Around the sun the sky stays
smooth, and no part of the sky becomes much brighter than its brightest was: there is one sun.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lighting.color import SRGB_LINEAR, luminance
from lighting.envmap.appearance import shows_snow
from lighting.envmap.detail_library import (
    FEATURE_CLASSES,
    FEATURE_ROWS,
    LOG_OFFSET,
    DetailChoice,
    cell_features,
    choose_detail,
    class_features,
    detail_picture,
    feature_weights,
)
from lighting.envmap.latlong import (
    Image,
    column_blocks,
    interpolate_cells,
    max_channel,
    multiply_cells,
    shrink_blocks,
    shrink_envmap,
)
from lighting.envmap.projection import CLIPPED, PhotoProjection, ProjectedPhoto, project_photo, sample_photo
from lighting.geometry import Floats, angle_between, angles, latlong_angles, latlong_directions
from lighting.records import Lighting
from lighting.segmentation import Segments

MIN_ROWS = 48  # of maps that have room for detail

_CELL_ROWS = 48  # of the cells whose light stays
_COARSE_DEG = 30.0  # standard deviation: what is coarser comes from the network
_MATCHED_DEG = 7.0  # standard deviation: what is coarser in the photo's continuation is as in the library's detail
_HORIZON_DEG = 10.0  # standard deviation by which the map is smoothed, so that its horizon vanishes
_LIGHT_DEG = 9.0  # standard deviation over which light stays as bright as it was
_COLOR_DEG = 40.0  # and over which its color stays
_DETAIL_RANGE = (0.1, 2.5)  # of a pixel over what is coarse
_CONTRAST = {20.0: 0.84, 0.0: 0.78}  # power of the library's detail at elevations [deg], linear between them
_TINT_RANGE = (0.4, 2.5)  # of the color of what is dark before the sky
_HAND_OVER_DEG = (14.0, 7.0, 3.5)  # standard deviations over which the photo's own brightness reaches beyond its edges
_RIM_WEIGHT = 0.85  # of the photo in a cell, up to which the cell lies at the photo's edge
_MIN_GAIN = 1e-6  # of a photo, in a logarithm
_CLIPPED_LOG = math.log(CLIPPED)
_HAND_OVER = 0.7  # largest logarithm of its gain
_GAIN_RANGE = (0.25, 4.0)
_SUN_DEG = (4.0, 14.0)  # around the sun: no detail within the first, all of it beyond the second
_GLARE_DEG = 20.0  # around the sun, where the sky may be bright
_BRIGHTEST = 1.15  # times the brightest cell of the sky, which no other part exceeds
_MIN_SAMPLES = 8  # sampled pixels of the photo by which a cell counts as visible
_COLORFUL = 0.12  # spread of a photo's colors, in logarithms, from which the library's are shown in full
_SEAM = 0.35  # how far the darker of two neighbors is preferred between photo and library
_SEAM_WIDTH = 0.15  # of the continuation's reach


@dataclass(frozen=True)
class DetailSource:
    """What is chosen for a photo: a panorama of the library, and how colorful it may be."""

    choice: DetailChoice
    """What the detail is taken from."""
    saturation: float
    """Factor, 0 or more, on the detail's color."""


@dataclass(frozen=True, eq=False)
class PhotoFeatures:
    """By what the detail for a photo is chosen."""

    target: Image
    """(F, FEATURE_ROWS, 2 FEATURE_ROWS), as FEATURES."""
    weight: Image
    """As `target`."""
    sun_azimuth: float | None
    """deg; None: without a sun that shines."""
    saturation: float
    """0 for a grey photo to 1."""
    snow: bool = False
    """Whether the photo shows snow."""


def describe_photo(
    lighting: Lighting, photo: NDArray[np.uint8], around: Image, segments: Segments | None = None
) -> PhotoFeatures:
    """What of a photo counts for its detail.

    Args:
        lighting: of the photo; its camera and its sun count.
        photo: (h, w, 3) sRGB, upright.
        around: (FEATURE_ROWS, 2 FEATURE_ROWS, 3) linear, the coarse map that it lies in.
        segments: what the photo shows; None: unknown.
    """
    samples, directions = sample_photo(photo, lighting)
    colors = samples.reshape(-1, 3)
    cell = _cell_indices(directions.reshape(-1, 3), FEATURE_ROWS)
    four, count = cell_features(colors, cell)
    kinds = np.zeros((len(FEATURE_CLASSES), *count.shape), np.float32)
    if segments is not None:
        kinds = class_features(segments, (len(samples), samples.shape[1]), cell)
    level = np.cos(np.radians(latlong_angles(FEATURE_ROWS)[1]))[:, None].repeat(2 * FEATURE_ROWS, axis=1)
    seen = np.where(count >= _MIN_SAMPLES, level, 0.0)
    broad = np.log(np.maximum(luminance(around), 1e-3))
    target = np.concatenate([four, broad[None], kinds]).astype(np.float32)
    weight = feature_weights(seen, level, segments is not None)
    shines = lighting.sun_painted and lighting.sun_shines
    azimuth = lighting.sun_azimuth if shines else None
    return PhotoFeatures(target, weight, azimuth, _saturation(colors), shows_snow(photo, lighting, segments))


def choose_source(features: PhotoFeatures) -> DetailSource:
    """The detail that suits a photo.

    Args:
        features: of the photo.
    """
    choice = choose_detail(features.target, features.weight, features.sun_azimuth, features.snow)
    return DetailSource(choice, features.saturation)


def _cell_indices(directions: Floats, rows: int) -> NDArray[np.intp]:
    """Row x 2 rows + column (P,) of the cells in which directions (P, 3) lie."""
    azimuth, elevation = angles(directions)
    row = np.minimum((90.0 - elevation) / 180.0 * rows, rows - 1).astype(np.intp)
    return np.asarray(row * 2 * rows + np.minimum((azimuth + 180.0) / 180.0 * rows, 2 * rows - 1).astype(np.intp))


def _saturation(colors: Image) -> float:
    """How colorful detail may be beside samples (P, 3) of a photo: 0 for a grey one."""
    log = np.log(np.maximum(colors, LOG_OFFSET))
    spread = float(np.std(log[:, 0] - log[:, 1]) + np.std(log[:, 2] - log[:, 1]))
    return round(min(spread / _COLORFUL, 1.0), 2)


class LibraryDetail:
    """A panorama of the library over what is coarse in it, to the power _CONTRAST."""

    def __init__(self, source: DetailSource, height: int) -> None:
        self.height, blocks = height, column_blocks(height)
        self._picture = detail_picture(source.choice, height, source.saturation)
        self._kept = self._picture.columns(blocks[0]) if len(blocks) == 1 else None
        reduced = np.concatenate([_reduce(self._pixels(part), height, part) for part in blocks], axis=1)
        self._log_offset = np.log(SRGB_LINEAR + LOG_OFFSET)
        coarse = _coarse_colors(reduced, self._log_offset)
        self._gains = np.exp(-coarse * _contrast(_CELL_ROWS)[:, None, None])
        self.cells = self._gains * _mean_power(reduced, self._log_offset)
        """(R, 2R, 3) means of the detail."""
        self.color = np.exp(coarse - coarse.mean(axis=2, keepdims=True))
        """(R, 2R, 3) of what is coarse in it, of mean logarithm 0."""
        self.whole = self.block(blocks[0]) if len(blocks) == 1 else None
        """(H, 2H, 3) of a map that is worked on at once; else None."""

    def _pixels(self, columns: slice) -> NDArray[np.uint8]:
        return self._picture.columns(columns) if self._kept is None else self._kept

    def block(self, columns: slice) -> Image:
        """Some columns (H, C, 3) of the detail.

        Args:
            columns: of a map of as many rows.
        """
        picture, contrast = self._pixels(columns), _contrast(self.height)
        detail = np.empty(picture.shape, np.float32)
        first = 0
        for last in [*(np.flatnonzero(np.diff(contrast)) + 1), self.height]:  # rows of one contrast
            table = np.exp(self._log_offset * contrast[first]).astype(np.float32)
            detail[first:last] = table.take(picture[first:last])
            first = last
        multiply_cells(detail, self._gains, columns)
        return detail


def _coarse_colors(picture: NDArray[np.uint8], log_offset: Floats) -> Image:
    """What is coarse in a picture (H, 2H, 3): logarithms (R, 2R, 3), as bright as its mean logarithm.

    Their color is that of the mean light. So what is bright in the picture, as the sky between leaves, gets the color
    of the map, and what is dark keeps its own.
    """
    brightness = _blur_cells(shrink_envmap(log_offset.take(picture), _CELL_ROWS), _COARSE_DEG)
    linear = shrink_envmap(SRGB_LINEAR.take(picture), _CELL_ROWS)
    color = np.log(_blur_cells(linear, _COARSE_DEG) + LOG_OFFSET)
    color += brightness.mean(axis=2, keepdims=True) - color.mean(axis=2, keepdims=True)
    return np.asarray(color, dtype=np.float32)


def _mean_power(picture: NDArray[np.uint8], log_offset: Floats) -> Image:
    """The means (R, 2R, 3) of a picture (H, 2H, 3) to the power _CONTRAST."""
    powers = np.exp(log_offset.take(picture) * _contrast(len(picture))[:, None, None])
    return shrink_envmap(powers.astype(np.float32), _CELL_ROWS)


class _PhotoDetail:
    """The library's detail with the photo's own, calm around the sun, in blocks of columns."""

    def __init__(
        self, library: LibraryDetail, photo: PhotoProjection, coarse: Image, sun: Floats | None, tint: Image
    ) -> None:
        self._library, self._photo, self._coarse, self._sun, self._tint = library, photo, coarse, sun, tint
        self._ceiling: Image | None = None
        self._limited = slice(0)  # rows of the map where the ceiling is low
        self._whole = None if library.whole is None else self._finish(library.whole, slice(0, 2 * library.height))

    def blocks(self) -> Iterator[tuple[slice, Image]]:
        """Columns of the map, and the detail (H, C, 3) in them."""
        for columns in column_blocks(self._library.height):
            yield columns, self._finish(self._library.block(columns), columns) if self._whole is None else self._whole

    def limit(self, ceiling: Image) -> bool:
        """Bring the sky's detail under cells (R, 2R, 3), which are the sky over its mirror image; False if it is."""
        rows = np.flatnonzero((ceiling[: len(ceiling) // 2] < _DETAIL_RANGE[1]).any(axis=(1, 2)))
        if rows.size:
            height = self._library.height
            self._ceiling, self._limited = ceiling, _rows_between(rows, height // 2, len(ceiling) // 2)
            if self._whole is not None:
                self._darken(self._whole, slice(0, 2 * height))
        return bool(rows.size)

    def _finish(self, detail: Image, columns: slice) -> Image:
        _color_dark(detail, columns, self._tint)
        if (block := self._photo.block(columns)) is not None:
            _blend_continuation(detail, columns, block, self._coarse)
        if self._sun is not None:
            _calm_sun(detail, columns, self._sun)
        np.clip(detail, *_DETAIL_RANGE, out=detail)
        if self._ceiling is not None:
            self._darken(detail, columns)
        return detail

    def _darken(self, detail: Image, columns: slice) -> None:
        """Bring some columns (H, C, 3) under the ceiling, where it is low."""
        assert self._ceiling is not None
        sky = detail[self._limited]
        np.minimum(sky, interpolate_cells(self._ceiling, len(detail), self._limited, columns), out=sky)


def add_detail(
    image: Image,
    library: LibraryDetail,
    lighting: Lighting,
    photo: NDArray[np.uint8],
    continued: PhotoProjection,
    gain: float = 1.0,
) -> None:
    """Give a coarse map detail; its light stays where the photo will not be laid over it.

    Args:
        image: (H, 2H, 3) linear, MIN_ROWS rows at least, without photo and disc, changed in place.
        library: the detail of a panorama, of as many rows; it cannot be used again.
        lighting: of the map; its camera and its sun count.
        photo: (h, w, 3) sRGB, upright.
        continued: the photo in the map with its continuation.
        gain: over 0, by which the photo's linear values are multiplied.
    """
    log, shown, clipped = _photo_cells(photo, lighting)
    coarse = _match_continuation(library.cells, lighting, photo, continued.segments)
    covered = _covered_share(continued)
    rim = shown * ((covered > 0.02) & (covered < _RIM_WEIGHT)) * (log.max(axis=2, keepdims=True) < _CLIPPED_LOG)
    covered *= 1 - clipped
    edge = log + np.float32(math.log(max(gain, _MIN_GAIN)))
    sun = lighting.sun_direction if lighting.sun_painted and lighting.sun_elevation > 0 else None
    before = shrink_envmap(image, _CELL_ROWS)
    detail = _PhotoDetail(library, continued, coarse, sun, _own_tint(before, library.color))
    level = np.cos(np.radians(latlong_angles(_CELL_ROWS)[1])).astype(np.float32)[:, None, None]
    open_share = (1 - covered) * level
    log = np.log(np.maximum(before, np.float32(1e-9)))
    blurred = np.exp(_blur_cells(log, _HORIZON_DEG) - log)  # the horizon is where the detail has it
    cells = before * _mean_detail(detail, len(image))
    lit = cells * blurred
    gains = blurred * _light_gains(before, lit, open_share)
    gains *= _hand_over(lit, edge, rim, _HAND_OVER_DEG[0])
    if detail.limit(_detail_ceiling(before * gains, _sky_limit(before, open_share, sun))):
        cells = before * _mean_detail(detail, len(image))
    for deg in _HAND_OVER_DEG:  # the photo's edges and the light on matte objects both come near what they are to be
        gains *= _hand_over(cells * gains, edge, rim, deg)
        _keep_moments(gains, before, cells, open_share)
    for columns, block in detail.blocks():
        image[:, columns] *= block
    for half, cells in zip(np.split(image, 2), np.split(gains, 2), strict=True):
        multiply_cells(half, cells)


def _own_tint(cells: Image, color: Image) -> Image:
    """Factors (R / 2, 2R, 3) that take the color of the sky from its cells (R, 2R, 3) and give that of the library."""
    sky = np.log(np.maximum(cells[: len(cells) // 2], np.float32(1e-9)))
    tint = color[: len(sky)] * np.exp(sky.mean(axis=2, keepdims=True) - sky)
    return np.asarray(np.clip(tint, *_TINT_RANGE), dtype=np.float32)


def _color_dark(detail: Image, columns: slice, tint: Image) -> None:
    """Give what is dark before the sky its own color in some columns (H, C, 3) of the detail: no leaves are blue.

    Args:
        detail: of the library, changed in place.
        columns: of the map, that it has.
        tint: of `_own_tint`.
    """
    sky = detail[: len(detail) // 2]
    share = np.clip(1 - sky[..., 1:2], 0, 1)
    cells = np.concatenate([tint, np.ones_like(tint)]) - 1
    sky *= 1 + share * interpolate_cells(cells, len(detail), slice(0, len(sky)), columns)


def _mean_detail(detail: _PhotoDetail, height: int) -> Image:
    """The detail's means (R, 2R, 3) in the cells of a map of so many rows."""
    return shrink_blocks((block for _, block in detail.blocks()), height, _CELL_ROWS)


def _covered_share(photo: PhotoProjection) -> Image:
    """How much (R, 2R, 1) of each cell a photo covers."""

    def weights() -> Iterator[Image]:
        for columns in column_blocks(photo.height):
            weight = np.zeros((photo.height, columns.stop - columns.start, 1), np.float32)
            if (block := photo.block(columns)) is not None:
                weight[block.rows, _shifted(block.columns, columns), 0] = block.weight
            yield weight

    return shrink_blocks(weights(), photo.height, _CELL_ROWS)


def _shifted(columns: slice, block: slice) -> slice:
    """Columns of a map as those of a block of its columns."""
    return slice(columns.start - block.start, columns.stop - block.start)


def _contrast(height: int) -> Image:
    """_CONTRAST of the rows (H,) of a map, in steps of a hundredth."""
    below, above = min(_CONTRAST), max(_CONTRAST)
    contrast = np.interp(latlong_angles(height)[1], [below, above], [_CONTRAST[below], _CONTRAST[above]])
    return np.asarray(np.round(contrast, 2), dtype=np.float32)


def _reduce(pixels: NDArray[np.uint8], height: int, columns: slice) -> NDArray[np.uint8]:
    """Some columns (H, C, 3) of a picture (H, 2H, 3) at a quarter of its pixels or so, for its cells."""
    step = max(1, height // (4 * _CELL_ROWS))
    rest = (height // step) * step
    first = columns.start + (step // 2 - columns.start) % step  # of the columns that count
    last = min(columns.stop, 2 * rest)
    return pixels[step // 2 : rest : step, first - columns.start : max(last - columns.start, 0) : step]


def _blend_continuation(detail: Image, columns: slice, continued: ProjectedPhoto, coarse: Image) -> None:
    """Lay the photo's own detail over the library's, along a seam that prefers the darker of both.

    Args:
        detail: (H, C, 3) of the library, changed in place.
        columns: of the map, that it has.
        continued: the photo in them.
        coarse: (R, 2R, 3) factors that take what is coarse from the library.
    """
    window = detail[continued.rows, _shifted(continued.columns, columns)]
    own = continued.linear + LOG_OFFSET
    own *= interpolate_cells(coarse, len(detail), continued.rows, continued.columns)
    green, own_green = window[..., 1], own[..., 1]
    contrast = (green - own_green) / (green + own_green)
    place = 2 * continued.share - 1 + np.float32(2 * _SEAM) * contrast
    mask = np.clip(place * np.float32(0.5 / _SEAM_WIDTH) + np.float32(0.5), 0, 1) * (continued.share > 0)
    own -= window
    own *= mask[..., None]
    window += own


def _match_continuation(
    library: Image, lighting: Lighting, photo: NDArray[np.uint8], segments: Segments | None
) -> Image:
    """Factors (R, 2R, 3) that make a continued photo as bright as the library's cells (R, 2R, 3), over some degrees."""
    continued = project_photo(lighting, photo, 4 * _CELL_ROWS, continued=True, segments=segments)
    linear = np.zeros((continued.height, 2 * continued.height, 4), np.float32)
    window = linear[continued.rows, continued.columns]
    whole = continued.whole
    window[..., 3] = whole.share > 0
    window[..., :3] = whole.linear * window[..., 3:]
    cells = shrink_envmap(linear, _CELL_ROWS)
    own = np.log(cells[..., :3] / np.maximum(cells[..., 3:], np.float32(1e-6)) + LOG_OFFSET)
    return np.exp(_spread(np.log(library) - own, cells[..., 3:], _MATCHED_DEG)[0])


def _photo_cells(photo: NDArray[np.uint8], lighting: Lighting) -> tuple[Image, Image, Image]:
    """The photo in each cell: mean logarithm (R, 2R, 3), 1 where it is shown, and the share that is clipped (R, 2R, 1).

    Where it is clipped, the map shows through.
    """
    samples, directions = sample_photo(photo, lighting)
    cell = _cell_indices(directions.reshape(-1, 3), _CELL_ROWS)
    cells, shape = 2 * _CELL_ROWS**2, (_CELL_ROWS, 2 * _CELL_ROWS, -1)
    colors = samples.reshape(-1, 3)
    values = np.concatenate([np.log(colors + LOG_OFFSET), max_channel(colors)[:, None] > CLIPPED], axis=1)
    count = np.bincount(cell, minlength=cells)[:, None]
    total = np.stack([np.bincount(cell, channel, cells) for channel in values.T], axis=-1)
    mean, shown = (total / np.maximum(count, 1)).astype(np.float32).reshape(shape), (count > 0).astype(np.float32)
    return mean[..., :3], shown.reshape(shape), mean[..., 3:]


def _spread(values: Image, shown: Image, deg: float) -> tuple[Image, Image]:
    """Values (R, 2R, 3) of the cells that are shown, spread to all, and the weight (R, 2R, 1) of what was spread."""
    share = _blur_cells(shown, deg)
    return np.asarray(_blur_cells(values * shown, deg) / np.maximum(share, np.float32(1e-6))), share


def _calm_sun(detail: Image, columns: slice, sun: Floats) -> None:
    """Fade some columns (H, C, 3) of the detail out around the sun."""
    cells = angle_between(latlong_directions(_CELL_ROWS), sun)
    share = np.clip((cells - _SUN_DEG[0]) / (_SUN_DEG[1] - _SUN_DEG[0]), 0, 1)
    share = np.asarray(share * share * (3 - 2 * share), dtype=np.float32)[..., None].repeat(3, axis=2)
    rows = np.flatnonzero((share < 1).any(axis=(1, 2)))
    if not rows.size:
        return
    window = _rows_between(rows, len(detail), _CELL_ROWS)
    part = detail[window]
    part -= 1
    part *= interpolate_cells(share, len(detail), window, columns)
    part += 1


def _light_gains(before: Image, lit: Image, open_share: Image) -> Image:
    """Factors of the cells of the detailed map by which its light is nearly that of the map before.

    Args:
        before: (R, 2R, 3) the map without detail.
        lit: (R, 2R, 3) the map with detail; it is changed.
        open_share: (R, 2R, 1) how much of each cell the photo will leave open, times its solid angle.
    """
    gains = np.ones_like(before)
    for _ in range(2):
        for deg in (_COLOR_DEG, _LIGHT_DEG):
            wanted, reached = (_blur_cells(one * open_share, deg) for one in (before, lit))
            if deg == _LIGHT_DEG:
                wanted, reached = luminance(wanted)[..., None], luminance(reached)[..., None]
            change = np.clip(wanted / np.maximum(reached, np.float32(1e-9)), *_GAIN_RANGE)
            _multiply_both(gains, lit, change.astype(np.float32))
    return gains


def _hand_over(lit: Image, log: Image, rim: Image, deg: float) -> Image:
    """Gains (R, 2R, 3) that take the photo's own brightness beyond its edges, so that no frame is seen.

    Args:
        lit: (R, 2R, 3) the map with detail.
        log: (R, 2R, 3) mean logarithm of the photo.
        rim: (R, 2R, 1) the cells at its edges, 1 or 0.
        deg: standard deviation over which they do.
    """
    if not rim.any():
        return np.ones_like(lit)
    off = np.clip(log - np.log(lit + LOG_OFFSET), -_HAND_OVER, _HAND_OVER)
    spread, share = _spread(off, rim, deg)
    return np.asarray(np.exp(spread * np.clip(share / _median(share[rim > 0]), 0, 1)), dtype=np.float32)


def _median(values: Image) -> np.float32:
    """Of (N,); np.median of floats imports masked arrays, which takes 10 ms."""
    middle = np.sort(values)[(len(values) - 1) // 2 : len(values) // 2 + 1]
    return np.float32(middle.mean())


def _detail_ceiling(cells: Image, limit: Floats) -> Image:
    """The largest detail (R, 2R, 3) of each cell of the sky, and below it their mirror image.

    Args:
        cells: (R, 2R, 3) what it will be multiplied with.
        limit: (R / 2, 2R) luminance that no part of the sky may exceed.
    """
    ceiling = np.maximum(limit / np.maximum(luminance(cells[: len(limit)]), 1e-9), 1).astype(np.float32)
    return np.concatenate([ceiling, ceiling[::-1]])[..., None].repeat(3, axis=2)


def _rows_between(cells: NDArray[np.intp], height: int, rows: int) -> slice:
    """The rows, of a map's or a half's height, that some rows of cells, of as many as it has, reach."""
    scale = height / rows
    return slice(int(max(0, (cells[0] - 1) * scale)), int(min(height, (cells[-1] + 2) * scale)))


def _keep_moments(gains: Image, before: Image, cells: Image, open_share: Image) -> None:
    """Change gains (R, 2R, 3) smoothly, so that the light on matte objects stays, and that on level ground exactly.

    Args:
        gains: of the cells, changed in place.
        before: (R, 2R, 3) the map without detail.
        cells: (R, 2R, 3) the map with detail, before the gains.
        open_share: (R, 2R, 1) how much of each cell the photo will leave open, times its solid angle.
    """
    lit, moments = cells * gains, _moments(len(before))
    flat = moments.reshape(-1, moments.shape[-1])
    for channel in range(3):
        power = (open_share[..., 0] * lit[..., channel]).reshape(-1)
        missing = flat.T @ (open_share[..., 0] * (before - lit)[..., channel]).reshape(-1)
        solution = np.linalg.lstsq(flat.T @ (power[:, None] * flat), missing, rcond=1e-5)[0]
        change = np.clip(1 + flat @ solution, *_GAIN_RANGE)
        gains[..., channel] *= change.reshape(gains.shape[:2]).astype(np.float32)


@lru_cache(maxsize=1)
def _moments(rows: int) -> Floats:
    """Spherical harmonics (R, 2R, 10) up to the second order, of any scale, and the cosine of level ground."""
    x, y, z = np.moveaxis(latlong_directions(rows), -1, 0)
    terms = [np.ones_like(x), x, y, z, x * y, y * z, x * z, x * x - z * z, 3 * y * y - 1, np.abs(y)]
    moments = np.stack(terms, axis=-1)
    moments.setflags(write=False)
    return moments


def _multiply_both(gains: Image, lit: Image, change: Image) -> None:
    gains *= change
    lit *= change


def _sky_limit(before: Image, open_share: Image, sun: Floats | None) -> Floats:
    """The luminance (R / 2, 2R) that no part of the sky may exceed."""
    sky = luminance(before[: len(before) // 2])
    away = open_share[: len(sky), :, 0] > 0
    if sun is not None:
        away &= angle_between(latlong_directions(len(before))[: len(sky)], sun) > _GLARE_DEG
    return np.maximum(_BRIGHTEST * float(sky[away].max()) if away.any() else np.inf, sky)


def _blur_cells(cells: Image, deg: float) -> Image:
    """Cells (r, 2R, C), some rows of a map, blurred; columns wrap and rows end."""
    rows, columns = cells.shape[:2]
    down, across = _blur_matrix(rows, columns // 2, deg, False), _blur_matrix(columns, columns // 2, deg, True)
    blurred = (down @ cells.reshape(rows, -1)).reshape(cells.shape)
    return np.asarray(across @ blurred, dtype=np.float32)


@lru_cache(maxsize=8)
def _blur_matrix(count: int, map_rows: int, deg: float, wraps: bool) -> Image:
    """Weights (count, count) of a normal distribution between cells; rows sum to 1."""
    index = np.arange(count)
    distance = np.abs(index[:, None] - index)
    distance = np.minimum(distance, count - distance) if wraps else distance
    weight = np.exp(-0.5 * (distance * (180.0 / map_rows) / deg) ** 2)
    return np.asarray(weight / weight.sum(axis=1, keepdims=True), dtype=np.float32)
