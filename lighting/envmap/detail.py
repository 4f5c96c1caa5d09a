"""Detail all around a map: what is coarse stays as it is, what is finer comes from a real place.

Around the photo lies a panorama of the library that looks like it, divided by what is coarse in it, so that it adds no
light. Beside its edges the map takes the photo's own light over some degrees. Then the light on matte objects in each
half of the map is brought back exactly to what it was. Around the sun the sky stays smooth, and no part of the sky
becomes much brighter than its brightest was: there is one sun.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

import lighting.envmap.latlong as latlong
from lighting.color import LUMINANCE_WEIGHTS, SRGB_LINEAR
from lighting.envmap.detail_library import DETAIL_ROWS, LOG_OFFSET
from lighting.envmap.latlong import Image
from lighting.envmap.library_picture import LibraryDetail
from lighting.envmap.projection import CLIPPED, PhotoProjection, cell_means, sample_cells
from lighting.geometry import Floats, angle_between, latlong_angles, latlong_directions
from lighting.prediction import Segments, SurfaceClass, pixel_share
from lighting.records import Lighting

MIN_ROWS = 48  # of maps that have room for detail

_HORIZON_DEG = 10.0  # standard deviation by which the map is smoothed, so that its horizon vanishes
_LIGHT_DEG = 20.0  # standard deviation over which light stays as bright as it was
_COLOR_DEG = 40.0  # and over which its color stays
_DETAIL_RANGE = (0.1, 2.5)  # of a pixel over what is coarse
_TINT_RANGE = (0.4, 2.5)  # of the color of what is dark before the sky
_DARK = 0.7  # of a pixel over what is coarse, up to which it is no sky
_LOW_SKY_DEG = 30.0  # up to which the sky's mean brightness counts for what is dark before a brighter part of it
_MIN_SHADED = 0.15  # share of such a part's brightness that counts at least
# Standard deviations along rows and columns over which the photo's own light reaches beyond its edges: first all
# around, then sideways, as clouds and horizons go on.
_HAND_OVER_DEG = ((14.0, 14.0), (7.0, 7.0))
_BAND_DEG = ((16.0, 3.0), (5.0, 1.5))
_RIM_ROWS = 2 * DETAIL_ROWS  # of the cells in which the photo's edges are seen
_LEAST_COVERED = 0.02  # of a cell that the photo reaches
_RIM_WEIGHT = 0.85  # of the photo in a cell, up to which the cell lies at the photo's edge
_MIN_GAIN = 1e-6  # of a photo, in a logarithm
_TINY = np.float32(1e-6)
_HAND_OVER = 1.6  # largest logarithm of its gain
_LEAST_OPEN = 0.05  # weight in that of what the photo shows of plants, walls and things: they end where they end
_OPEN_ABOVE = (SurfaceClass.SKY,)  # classes that go on beyond the edge, above the horizon and below it
_OPEN_BELOW = (SurfaceClass.GROUND, SurfaceClass.UNEVEN, SurfaceClass.WATER, SurfaceClass.FAR_TERRAIN)
_GAIN_RANGE = (0.25, 4.0)
_SUN_DEG = (4.0, 14.0)  # around the sun: no detail within the first, all of it beyond the second
_GLOW_DEG = (8.0, 30.0)  # the same of what the map's horizon is smoothed with, so that the glow stays
_GLARE_DEG = 20.0  # around the sun, where the sky may be bright
_BRIGHTEST = 1.25  # times the brightest cell of the sky, which no other part exceeds


class AddedDetail:
    """What `add_detail` gives a map, for any of its rows, also where it has more of them.

    It is the library's detail, calm around the sun, times gains. It is made in blocks of columns, and that of a small
    map kept.
    """

    gains: Image
    """(R, 2R, 3) of cells, by which the detail is multiplied."""

    def __init__(self, library: LibraryDetail, calm: Image | None, tint: Image) -> None:
        self._library = library
        self._tint = tint
        self._calm = calm
        self._calmed = slice(0)  # rows of the map around the sun
        if calm is not None:
            rows = np.flatnonzero((calm < 1).any(axis=(1, 2)))
            self._calmed = _rows_between(rows, library.height, DETAIL_ROWS)
        self._ceiling: Image | None = None
        self._limited = slice(0)  # rows of the map where the ceiling is low
        self._blocks = latlong.column_blocks(library.height)
        self._whole = self._make(self._blocks[0], 0, library.height) if len(self._blocks) == 1 else None

    def taller(self, height: int) -> "AddedDetail":
        """Return the same for a map of more rows.

        Args:
            height: rows.
        """
        taller = AddedDetail(self._library.taller(height), self._calm, self._tint)
        taller.gains = self.gains
        if self._ceiling is not None:
            taller.limit(self._ceiling)
        return taller

    def means(self, rows: int) -> Image:
        """Return the means (R, 2R, 3) of the library's detail in cells of some rows.

        Args:
            rows: of the cells.
        """
        if self._whole is not None:
            return latlong.shrink_envmap(self._whole, rows)
        height = self._library.height
        blocks = [latlong.shrink_axis(self._make(columns, 0, height), 0, rows) for columns in self._blocks]
        return latlong.shrink_axis(np.concatenate(blocks, axis=1), 1, 2 * rows)

    def multiply(self, image: Image, first: int = 0) -> None:
        """Give rows of one half of a map, or all, the detail.

        Args:
            image: (R, 2H, 3), changed in place.
            first: of the map's rows that they are.
        """
        if self._whole is not None:
            image *= self._whole[first : first + len(image)]
        else:
            for columns in latlong.column_blocks(self._library.height, len(image)):
                image[:, columns] *= self._make(columns, first, len(image))
        latlong.multiply_cells(image, self.gains, first)

    def limit(self, ceiling: Image) -> bool:
        """Bring the sky's detail under a ceiling; return False if it is.

        Args:
            ceiling: (R, 2R, 3) of cells, which are the sky over its mirror image.
        """
        rows = np.flatnonzero((ceiling[: len(ceiling) // 2] < _DETAIL_RANGE[1]).any(axis=(1, 2)))
        if rows.size:
            self._ceiling = ceiling
            self._limited = _rows_between(rows, self._library.height // 2, len(ceiling) // 2)
            if self._whole is not None:
                self._darken(self._whole, self._blocks[0], 0)
        return bool(rows.size)

    def _make(self, columns: slice, first: int, count: int) -> Image:
        """Some columns (R, C, 3) of R rows, a few at a time, so that they stay in the processor's cache."""
        height = self._library.height
        detail = np.empty((count, columns.stop - columns.start, 3), np.float32)
        tint = latlong.widen_cells(self._tint, 2 * height, columns)
        calm = None if self._calm is None else latlong.widen_cells(self._calm, 2 * height, columns)
        gains = latlong.widen_cells(self._library.gains, 2 * height, columns)
        pixels = np.ascontiguousarray(self._library.pixels(columns, first, count)).reshape(count, -1).view(np.uint16)
        flat, pairs = detail.reshape(count, -1), _light_pairs()
        for band, near, shares in latlong.cell_bands(height, DETAIL_ROWS, first, count):
            here = slice(band.start - first, band.stop - first)
            pairs.take(pixels[here], out=flat[here].view(np.uint64), mode="clip")  # which needs no copy
            flat[here] *= shares @ gains[near]
            part = detail[here]
            if band.start < height // 2:
                _color_dark(part, (shares @ tint[near]).reshape(part.shape))
            if calm is not None and (rows := _common_rows(band, self._calmed)):
                around_sun = part[rows]
                around_sun -= 1
                around_sun *= (shares[rows] @ calm[near]).reshape(around_sun.shape)
                around_sun += 1
            np.clip(part, *_DETAIL_RANGE, out=part)
        if self._ceiling is not None:
            self._darken(detail, columns, first)
        return detail

    def _darken(self, detail: Image, columns: slice, first: int) -> None:
        """Bring some columns (R, C, 3), from a first row on, under the ceiling, where it is low."""
        assert self._ceiling is not None
        height = self._library.height
        ceiling = latlong.widen_cells(self._ceiling, 2 * height, columns)
        for band, near, shares in latlong.cell_bands(height, DETAIL_ROWS, first, len(detail)):
            if rows := _common_rows(band, self._limited):
                sky = detail[band.start - first : band.stop - first][rows]
                np.minimum(sky, (shares[rows] @ ceiling[near]).reshape(sky.shape), out=sky)


@lru_cache(maxsize=1)
def _light_pairs() -> NDArray[np.uint64]:
    """SRGB_LINEAR + LOG_OFFSET of two values, (65536,), each pair as one number: half as much is looked up."""
    values = np.arange(1 << 16, dtype=np.uint16).view(np.uint8)
    pairs = (SRGB_LINEAR + LOG_OFFSET).take(values).view(np.uint64)
    pairs.setflags(write=False)
    return pairs


def add_detail(
    image: Image,
    library: LibraryDetail,
    lighting: Lighting,
    photo: NDArray[np.uint8],
    segments: Segments | None,
    projection: PhotoProjection,
    gain: float,
) -> AddedDetail:
    """Give a coarse map detail, which is returned; its light stays where the photo will not be laid over it.

    Args:
        image: (H, 2H, 3) linear, MIN_ROWS rows at least, without photo and disc, changed in place.
        library: the detail of a panorama, of as many rows.
        lighting: of the map; its camera and its sun count.
        photo: (h, w, 3) sRGB, upright.
        segments: what the photo shows; None: unknown.
        projection: the photo in the map.
        gain: over 0, by which the photo's linear values are multiplied.
    """
    fine = _photo_cells(photo, lighting, segments, projection, gain)
    rows = len(fine.log)
    rim = fine if rows == DETAIL_ROWS else fine.pooled()
    fine_before = latlong.shrink_envmap(image, rows)
    before = _pool(fine_before, DETAIL_ROWS)
    has_sun = lighting.sun_painted and lighting.sun_elevation > 0
    sun_angle = angle_between(latlong_directions(DETAIL_ROWS), lighting.sun_direction) if has_sun else None
    log = np.log(np.maximum(before, np.float32(1e-9)))
    smoothing = latlong.blur_cells(log, _HORIZON_DEG) - log  # the horizon is where the detail has it
    blurred = np.exp(smoothing if sun_angle is None else smoothing * _share_off_sun(sun_angle, _GLOW_DEG))
    level = np.cos(np.radians(latlong_angles(DETAIL_ROWS)[1])).astype(np.float32)[:, None, None]
    open_share = (1 - rim.covered * (1 - rim.clipped)) * level
    calm = None if sun_angle is None else _share_off_sun(sun_angle, _SUN_DEG)
    tint = _own_tint(before, library.color)
    detail = AddedDetail(library, calm, np.concatenate([tint, np.ones_like(tint)]) - 1)
    fine_cells = fine_before * detail.means(rows)
    cells = _pool(fine_cells, DETAIL_ROWS)
    gains = blurred * _light_gains(before, cells * blurred, open_share)
    lit = cells * gains
    if calm is not None:
        gains **= calm  # the glow stays as bright as it was, as its detail has none
    gains *= _hand_over(lit, rim, _HAND_OVER_DEG[0])
    for reach in _HAND_OVER_DEG:  # the photo's edges and the light on matte objects both come near what they are to be
        gains *= _hand_over(cells * gains, rim, reach)
        _keep_moments(gains, before, cells, open_share)
    limit = _sky_limit(before, rim.covered, sun_angle)
    if detail.limit(_detail_ceiling(before * gains, limit)):  # what the bright sky loses, darker parts of it get
        fine_cells = fine_before * detail.means(rows)
        cells = _pool(fine_cells, DETAIL_ROWS)
        _keep_moments(gains, before, cells, open_share, _limit_gains(gains, cells, limit))
    fine_gains = np.ones_like(fine_cells)
    latlong.multiply_cells(fine_gains, gains)
    fine_gains *= _hand_over(fine_cells * fine_gains, fine, *_BAND_DEG)
    detail.gains = fine_gains
    detail.multiply(image)
    return detail


def _own_tint(cells: Image, color: Image) -> Image:
    """Factors (R / 2, 2R, 3) that take the sky's color from its cells (R, 2R, 3) and give that of the library.

    They also take what is brighter than the low sky: what stands before a glow is dark.
    """
    sky = np.log(np.maximum(cells[: len(cells) // 2], np.float32(1e-9)))
    level = sky.mean(axis=2, keepdims=True)
    tint = color[: len(sky)] * np.exp(level - sky)
    low = float(level[latlong_angles(DETAIL_ROWS)[1][: len(sky)] < _LOW_SKY_DEG].mean())
    tint = np.clip(tint, *_TINT_RANGE) * np.clip(np.exp(low - level), _MIN_SHADED, 1)
    return np.asarray(tint, dtype=np.float32)


def _color_dark(detail: Image, tint: Image) -> None:
    """Give what is dark before the sky its own color in some columns (H, C, 3) of the detail: no leaves are blue.

    Args:
        detail: of the library, changed in place.
        tint: (H / 2, C, 3) factors of `_own_tint`, less 1; changed.
    """
    sky = detail[: len(tint)]
    tint *= np.clip(1 - sky[..., 1] / _DARK, 0, 1).repeat(3, axis=1).reshape(tint.shape)
    tint += 1
    sky *= tint


@dataclass(frozen=True, eq=False)
class _PhotoCells:
    """A photo in the cells of a map of R rows."""

    log: Image
    """(R, 2R, 3) mean logarithm of its light."""
    shown: Image
    """(R, 2R, 1) how far it counts beyond its edge: sky, ground, water and what is far go on; things do not."""
    clipped: Image
    """(R, 2R, 1) share that is clipped, through which the map shows."""
    covered: Image
    """(R, 2R, 1) share that it covers."""

    @cached_property
    def rim(self) -> Image:
        """(R, 2R, 1) how far cells count: those at its edges, 0 to 1."""
        return self.shown * ((self.covered > _LEAST_COVERED) & (self.covered < _RIM_WEIGHT)) * (self.clipped < 0.5)

    def pooled(self) -> "_PhotoCells":
        """The same in cells twice as large."""
        rows = len(self.log) // 2
        shown, clipped, covered = (_pool(part, rows) for part in (self.shown, self.clipped, self.covered))
        log = _pool(self.log * self.shown, rows) / np.maximum(shown, _TINY)
        return _PhotoCells(np.asarray(log, dtype=np.float32), shown, clipped, covered)


def _pool(cells: Image, rows: int) -> Image:
    """Cells (R, 2R, C) in larger ones of fewer rows, each of as many."""
    count = len(cells) // rows
    for axis in range(2):  # sums of slices: numpy takes ten times as long with an innermost axis of few
        parts = np.moveaxis(cells, axis, 0)
        cells = np.moveaxis(sum((parts[first::count] for first in range(1, count)), parts[::count]), 0, axis)
    return np.asarray(cells / np.float32(count**2))


def _photo_cells(
    photo: NDArray[np.uint8], lighting: Lighting, segments: Segments | None, projection: PhotoProjection, gain: float
) -> _PhotoCells:
    """The photo, times a gain, in cells of _RIM_ROWS rows, or of DETAIL_ROWS in a small map."""
    map_rows = _RIM_ROWS if projection.height >= _RIM_ROWS else DETAIL_ROWS
    samples, cell = sample_cells(photo, lighting, map_rows)
    colors, rows, columns = samples.reshape(-1, 3), *cell.shape
    clipped = colors.max(axis=1, keepdims=True) > CLIPPED
    weight = np.ones((len(colors), 1), np.float32)
    if segments is not None:
        above = pixel_share(segments, columns, rows, *_OPEN_ABOVE)
        below = pixel_share(segments, columns, rows, *_OPEN_BELOW)
        share = np.where(cell < map_rows**2, above, below).reshape(-1, 1)
        weight = np.maximum(share, np.float32(_LEAST_OPEN))
    log = np.log(colors * np.float32(max(gain, _MIN_GAIN)) + LOG_OFFSET)
    mean, _ = cell_means(np.concatenate([weight * log, weight, clipped], axis=1), cell.reshape(-1), map_rows)
    shown, clipped_share = mean[..., 3:4], mean[..., 4:]
    parts = (mean[..., :3] / np.maximum(shown, 1e-6), shown, clipped_share)
    log_cells, shown, clipped_share = (np.asarray(part, dtype=np.float32) for part in parts)
    return _PhotoCells(log_cells, shown, clipped_share, projection.covered_share(map_rows))


def _share_off_sun(sun_angle: Floats, reach: tuple[float, float]) -> Image:
    """0 to 1 (R, 2R, 3) by the angle [deg] (R, 2R) from the sun: from 0 within the first of `reach` to 1 beyond it."""
    share = np.clip((sun_angle - reach[0]) / (reach[1] - reach[0]), 0, 1)
    return np.asarray(share * share * (3 - 2 * share), dtype=np.float32)[..., None].repeat(3, axis=2)


def _light_gains(before: Image, lit: Image, open_share: Image) -> Image:
    """Factors of the cells of the detailed map by which its light is nearly that of the map before.

    Args:
        before: (R, 2R, 3) the map without detail.
        lit: (R, 2R, 3) the map with detail.
        open_share: (R, 2R, 1) how much of each cell the photo will leave open, times its solid angle.
    """
    share = np.ascontiguousarray(open_share[..., 0])
    light, reached = (np.ascontiguousarray(np.moveaxis(image, 2, 0)) * share for image in (before, lit))
    color, level = latlong.blur_channels(light, _COLOR_DEG), latlong.blur_channels(light, _LIGHT_DEG)
    level, gains = np.tensordot(LUMINANCE_WEIGHTS, level, axes=1), np.ones_like(light)
    for deg, wanted in 2 * ((_COLOR_DEG, color), (_LIGHT_DEG, level)):
        blurred = latlong.blur_channels(reached, deg)
        if deg == _LIGHT_DEG:
            blurred = np.tensordot(LUMINANCE_WEIGHTS, blurred, axes=1)
        change = np.clip(wanted / np.maximum(blurred, np.float32(1e-9)), *_GAIN_RANGE)
        gains *= change
        reached *= change
    return np.ascontiguousarray(np.moveaxis(gains, 0, 2))


def _hand_over(lit: Image, photo: _PhotoCells, *reaches: tuple[float, float]) -> Image:
    """Gains (R, 2R, 3) that take the photo's own light beyond its edges, so that no frame is seen.

    Each half of the map has its own: the sky's brightness is not that of the ground.

    Args:
        lit: (R, 2R, 3) the map with detail.
        photo: in the same cells.
        reaches: standard deviations along the rows and the columns over which it does, one after the other.
    """
    log_gains, all_rims = np.zeros((3, *lit.shape[:2]), np.float32), photo.rim[..., 0]
    for half in (slice(0, len(lit) // 2), slice(len(lit) // 2, len(lit))):
        rim = all_rims[half]
        edge = rim > 0
        if not edge.any():
            continue
        off, parts = np.zeros((3, *rim.shape), np.float32), np.empty((5, *rim.shape), np.float32)
        log_ratio = photo.log[half][edge] - np.log(lit[half][edge] + LOG_OFFSET)
        off[:, edge] = np.clip(log_ratio, -_HAND_OVER, _HAND_OVER).T
        parts[3], parts[4] = edge, photo.covered[half, :, 0] > _LEAST_COVERED
        for reach in reaches:
            np.multiply(off, rim, out=parts[:3])
            blurred = latlong.blur_channels(parts, *reach)
            spread, whole, inside = blurred[:3], blurred[3], blurred[4]
            change = spread * (np.minimum(2 * inside, 1) / np.maximum(whole, _TINY))  # less and less beyond the edges
            log_gains[:, half] += change
            off -= change
    return np.asarray(np.exp(np.ascontiguousarray(np.moveaxis(log_gains, 0, 2))))


def _sky_limit(before: Image, covered: Image, sun_angle: Floats | None) -> Floats:
    """The luminance (R / 2, 2R) that no part of the sky may exceed: a little more than the brightest had before.

    Args:
        before: (R, 2R, 3) the map without detail.
        covered: (R, 2R, 1) share of each cell that the photo covers; such cells do not count.
        sun_angle: (R, 2R) deg from the sun, whose glare does not count; None: there is none.
    """
    sky = before[: len(before) // 2] @ LUMINANCE_WEIGHTS
    away = covered[: len(sky), :, 0] == 0
    if sun_angle is not None:
        away &= sun_angle[: len(sky)] > _GLARE_DEG
    return np.asarray(np.maximum(_BRIGHTEST * float(sky[away].max()) if away.any() else np.inf, sky))


def _detail_ceiling(cells: Image, limit: Floats) -> Image:
    """The largest detail (R, 2R, 3) of each cell of the sky, and below it their mirror image.

    Args:
        cells: (R, 2R, 3) what it will be multiplied with.
        limit: of `_sky_limit`.
    """
    level = cells[: len(limit)] @ LUMINANCE_WEIGHTS
    ceiling = np.maximum(limit / np.maximum(level, 1e-9), 1).astype(np.float32)
    return np.concatenate([ceiling, ceiling[::-1]])[..., None].repeat(3, axis=2)


def _limit_gains(gains: Image, cells: Image, limit: Floats) -> Image:
    """Bring cells of the sky under a limit; how far (R, 2R, 1), 0 to 1, each cell of the map may then get brighter.

    Args:
        gains: (R, 2R, 3) of the cells, changed in place.
        cells: (R, 2R, 3) the map with detail, before the gains.
        limit: of `_sky_limit`.
    """
    sky = slice(0, len(limit))
    margin = (limit / np.maximum((cells[sky] * gains[sky]) @ LUMINANCE_WEIGHTS, 1e-9))[..., None].astype(np.float32)
    gains[sky] *= np.minimum(margin, 1)
    room = np.ones_like(gains[..., :1])
    room[sky] = np.clip(margin - 1, 0, 1)
    return room


def _rows_between(cells: NDArray[np.intp], height: int, rows: int) -> slice:
    """The rows, of a map's or a half's height, that some rows of cells, of as many as it has, reach."""
    scale = height / rows
    return slice(int(max(0, (cells[0] - 1) * scale)), int(min(height, (cells[-1] + 2) * scale)))


def _common_rows(band: slice, rows: slice) -> slice | None:
    """Which of a band's rows, from 0, are among some rows of the map; None: none."""
    first, last = max(rows.start or 0, band.start), min(rows.stop, band.stop)
    return slice(first - band.start, last - band.start) if first < last else None


def _keep_moments(gains: Image, before: Image, cells: Image, open_share: Image, room: Image | float = 1.0) -> None:
    """Change gains (R, 2R, 3) smoothly, so that the light on matte objects stays, and that on level ground exactly.

    Args:
        gains: of the cells, changed in place.
        before: (R, 2R, 3) the map without detail.
        cells: (R, 2R, 3) the map with detail, before the gains.
        open_share: (R, 2R, 1) how much of each cell the photo will leave open, times its solid angle.
        room: (R, 2R, 1) share, 0 to 1, of the change that each cell takes.
    """
    lit, (moments, products) = cells * gains, _moments()
    terms = moments.shape[1]
    power, missing = ((open_share * part).reshape(-1, 3).T for part in (lit * room, before - lit))
    normal, wanted = (power @ products).reshape(3, terms, terms), missing @ moments
    solutions = [np.linalg.lstsq(*pair, rcond=1e-5)[0] for pair in zip(normal, wanted, strict=True)]
    change = (moments @ np.stack(solutions, axis=1)).reshape(gains.shape).astype(np.float32)
    gains *= np.clip(1 + room * change, *_GAIN_RANGE)


@lru_cache(maxsize=1)
def _moments() -> tuple[Floats, Floats]:
    """Spherical harmonics (2 R², 10) up to the second order, of any scale, and the cosine of level ground.

    Also the product of each with each (2 R², 100).
    """
    x, y, z = np.moveaxis(latlong_directions(DETAIL_ROWS), -1, 0)
    terms = [np.ones_like(x), x, y, z, x * y, y * z, x * z, x * x - z * z, 3 * y * y - 1, np.abs(y)]
    moments = np.stack(terms, axis=-1).reshape(-1, len(terms))
    products = (moments[:, :, None] * moments[:, None]).reshape(len(moments), -1)
    for values in (moments, products):
        values.setflags(write=False)
    return moments, products
