"""Where a photo lies in a map, its pixels there, and how its edges go on beside it."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

import lighting.geometry as geometry
from lighting.color import SRGB_LINEAR, max_channel
from lighting.envmap.latlong import EPSILON_IRRADIANCE, Image, column_blocks, row_irradiance, scale_colors, shrink_axis
from lighting.geometry import Floats, Pinhole, latlong_angles, wrap_azimuth
from lighting.prediction import PASSING_THINGS, Segments, pixel_share
from lighting.records import Lighting

_FEATHER = 0.15  # share of the picture's half width and half height over which it fades into its surroundings
CLIPPED = 0.95  # linear value from which a pixel may have been brighter
CELL_RATIO_RANGE = (0.05, 4.0)  # by which a cell of the bare map may be dimmed or lit

_SAMPLED_SIDE = 96  # pixels along the longer side at which a photo's colors are sampled
_WINDOW_ROWS = 48  # rows of a map in which the photo's window is sought
_MAX_SIDE = 2048  # pixels of the photo's longer side
_REST_SCALE_RANGE = (0.1, 4.0)  # of what the photo does not show; beyond it the photo is scaled too
_IRRADIANCE_TOLERANCE = 1e-5  # share by which an irradiance may differ from the target

# By which a photo goes on. The last three were tried on panoramas of `train`.
_MIN_SAMPLES = 8  # sampled pixels of the photo by which a cell counts as visible
_MAX_PASSING = 0.5  # probability of PASSING_THINGS at a pixel that counts
_NEAR_DEG = 5.0  # within which the photo's cells count alike
_VERTICAL_STRETCH = 3.0  # how much farther off a cell is above another than beside it
_DISTANCE_POWER = 2.5  # of the squared distance, by which cells count less
_FADE_DEG = 60.0  # from the photo, at which a third of its difference is left


@dataclass(frozen=True, eq=False)
class ProjectedPhoto:
    """A photo in some rows and columns of a map."""

    rows: slice
    """Of the map, from 0, that this reaches."""
    columns: slice
    """Of the map, from 0, that this reaches."""
    linear: Image
    """Linear, (R, C, 3)."""
    weight: Image
    """(R, C, 3) 1 inside the photo, 0 outside it; alike in all channels."""
    clipped: NDArray[np.bool_]
    """(R, C, 3) whether any channel is clipped."""

    def over(self, window: Image, gain: float) -> Image:
        """Its linear values (R, C, 3) times a gain. Where it is clipped and the map brighter, the map's value counts.

        Args:
            window: (R, C, 3) the map there.
            gain: over 0.
        """
        linear = self.linear * np.float32(gain)
        return np.asarray(np.maximum(linear, window, out=linear, where=self.clipped))


@dataclass(frozen=True, eq=False)
class PhotoScale:
    """What a half of a map is multiplied with so that it keeps its irradiance with a photo over it."""

    rest: Floats
    """(3,) of what the photo leaves open."""
    whole: Floats | None
    """(3,) of all, afterwards. None: 1."""


@dataclass(frozen=True, eq=False)
class PhotoProjection:
    """Where a photo lies in a map. Its pixels there are found for a block of columns at a time."""

    rows: slice
    """Of the map, from 0, that the photo reaches."""
    columns: slice
    """Of the map, from 0, that the photo reaches."""
    height: int
    """Rows of the map."""
    picture: NDArray[np.uint8]
    """(h, w, 3) sRGB, at about the map's resolution."""
    camera: Pinhole
    """Of the picture."""
    blocks: list[slice]
    """Of the map's columns, in which its pixels are found; one of a small map."""

    def measure(
        self, image: Image, half: slice, now: Floats, irradiance: Floats, gain: float, *, shown: bool = True
    ) -> PhotoScale:
        """Find by what one half of a map is scaled when it is laid over it.

        Args:
            image: (H, 2H, 3) the map.
            half: rows of the map, above or below the horizon.
            now: (3,) irradiance of level ground by this half.
            irradiance: (3,) which it then has.
            gain: of the photo, over 0.
            shown: False leaves it out, but the rest is as bright as with it.
        """
        if not self._reaches(half):
            return PhotoScale(irradiance / np.maximum(now, EPSILON_IRRADIANCE), None)
        levels = row_irradiance(self.height)
        by_photo, behind = np.zeros(3), np.zeros(3)  # as were all columns one
        for columns in self.blocks:
            if (part := self.block(columns, half)) is not None:
                level = np.asarray(levels[part.rows], dtype=np.float32)[:, None, None] * part.weight
                window = image[part.rows, part.columns]
                by_photo += _sum_product(level, part.over(window, gain))
                behind += _sum_product(level, window)
        added, hidden = by_photo / image.shape[1], behind / image.shape[1]
        left = now - hidden
        rest = np.clip((irradiance - added) / np.maximum(left, EPSILON_IRRADIANCE), *_REST_SCALE_RANGE)
        reached = rest * left + added
        if shown and np.any(np.abs(reached - irradiance) > _IRRADIANCE_TOLERANCE * irradiance):
            return PhotoScale(rest, irradiance / np.maximum(reached, EPSILON_IRRADIANCE))
        return PhotoScale(rest, None)

    def lay(self, image: Image, rows: slice, scale: PhotoScale, gain: float, *, shown: bool = True) -> None:
        """Lay it times a gain over some rows of one half of a map, and scale what it leaves open.

        Args:
            image: (R, 2H, 3) these rows, changed in place.
            rows: of the map.
            scale: as `measure` finds it.
            gain: of the photo, over 0.
            shown: False leaves it out, but the rest is as bright as with it.
        """
        for columns in self.blocks if self._reaches(rows) else [slice(0, image.shape[1])]:
            part = self.block(columns, rows) if shown else None
            if part is None:
                scale_colors(image, scale.rest, columns)
                continue
            window = image[part.rows.start - rows.start : part.rows.stop - rows.start, part.columns]
            linear = part.over(window, gain)
            scale_colors(image, scale.rest, columns)
            linear -= window
            linear *= part.weight
            window += linear
        if scale.whole is not None:
            scale_colors(image, scale.whole)

    def _reaches(self, rows: slice) -> bool:
        """Whether it lies in some rows of the map."""
        return bool(max(self.rows.start, rows.start) < min(self.rows.stop, rows.stop))

    def block(self, columns: slice, rows: slice | None = None) -> ProjectedPhoto | None:
        """Its pixels in some columns of the map; None where it has none. Those of a small map are found once.

        Args:
            columns: of the map.
            rows: of the map, some of which it reaches; None: all that it reaches.
        """
        rows = self.rows if rows is None else rows
        top, bottom = max(self.rows.start, rows.start), min(self.rows.stop, rows.stop)
        left, right = max(self.columns.start, columns.start), min(self.columns.stop, columns.stop)
        if left >= right or top >= bottom:
            return None
        if len(self.blocks) > 1:
            return self._pixels(slice(top, bottom), slice(left, right))
        part = slice(top - self.rows.start, bottom - self.rows.start)
        values = self.whole.linear[part], self.whole.weight[part], self.whole.clipped[part]
        return ProjectedPhoto(slice(top, bottom), self.columns, *values)

    def covered_share(self, rows: int) -> Image:
        """How much (R, 2R, 1) of each of a map's cells it covers.

        Args:
            rows: of the cells.
        """
        shares = []
        for columns in self.blocks:
            weight = np.zeros((self.height, columns.stop - columns.start, 1), np.float32)
            if (block := self.block(columns)) is not None:
                left, right = block.columns.start - columns.start, block.columns.stop - columns.start
                weight[block.rows, left:right] = block.weight[..., :1]
            shares.append(shrink_axis(weight, 0, rows))
        return shrink_axis(np.concatenate(shares, axis=1), 1, 2 * rows)

    @cached_property
    def whole(self) -> ProjectedPhoto:
        """All its pixels at once, as in a small map."""
        return self._pixels(self.rows, self.columns)

    def _pixels(self, rows: slice, columns: slice) -> ProjectedPhoto:
        """Its pixels in some rows and columns of the map; its weight falls to 0 at its edges."""
        x, y = _map_to_picture(self.camera, self.height, rows, columns)
        height, width = self.picture.shape[:2]
        row = np.clip((1 - y) * np.float32(height / 2), 0, height - 1).astype(np.intp)
        column = np.clip((x + 1) * np.float32(width / 2), 0, width - 1).astype(np.intp)
        pixels = self.picture.reshape(-1, 3).take(row * width + column, axis=0)
        ramp = np.clip(np.minimum(1 - np.abs(x), 1 - np.abs(y)) / np.float32(_FEATHER), 0, 1)
        linear, weight = SRGB_LINEAR.take(pixels), ramp * ramp * (3 - 2 * ramp)
        clipped = max_channel(linear) > CLIPPED
        # both of each channel, since numpy takes ten times as long with an innermost axis of 1
        weight, clipped = weight[..., None].repeat(3, axis=2), clipped[..., None].repeat(3, axis=2)
        return ProjectedPhoto(rows, columns, linear, weight, clipped)


def _sum_product(weight: Image, image: Image) -> Floats:
    """The sums (3,) of a weight (R, C, 3) times an image."""
    shape = len(weight), -1
    columns = np.einsum("rx,rx->x", weight.reshape(shape), image.reshape(shape))
    return np.asarray(columns.reshape(-1, 3).sum(axis=0, dtype=np.float64))


def photo_camera(lighting: Lighting, width: int, height: int) -> Pinhole:
    """The camera that took a photo; it looks to azimuth 0.

    Args:
        lighting: with the camera's elevation, roll and field of view.
        width: pixels at which the photo is projected.
        height: pixels, as the width.
    """
    return Pinhole(width, height, lighting.vertical_fov, elevation=lighting.camera_elevation, roll=lighting.camera_roll)


def project_photo(
    lighting: Lighting, photo: NDArray[np.uint8], height: int, strip: int | None = None
) -> PhotoProjection:
    """A photo in the pixels of a map; it reaches none where it is under a few degrees wide.

    Args:
        lighting: with the photo's camera.
        photo: (h, w, 3) sRGB.
        height: rows of the map.
        strip: rows of it that are made at once; None: all.
    """
    from PIL import Image as Picture

    camera = photo_camera(lighting, photo.shape[1], photo.shape[0])
    width, rows = size_in_envmap(camera, height)
    camera = replace(camera, width=width, height=rows)
    x, y = np.moveaxis(geometry.camera_pixel(geometry.latlong_directions(_WINDOW_ROWS), camera), -1, 0)
    inside = (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)  # false for NaN
    window = geometry.pixel_window(inside, height, 2 * height) or (slice(0, 0), slice(0, 0))
    # at about the map's resolution, so that single pixels may be taken from it
    picture = Picture.fromarray(photo).resize((width, rows), Picture.Resampling.HAMMING, reducing_gap=1.0)
    return PhotoProjection(*window, height, np.asarray(picture), camera, column_blocks(height, strip))


def sample_photo(pixels: NDArray[np.uint8], lighting: Lighting) -> tuple[Image, Floats]:
    """Linear values (h, w, 3) of a few of a photo's pixels, and their directions (h, w, 3).

    Args:
        pixels: (H, W, 3) sRGB.
        lighting: with the photo's camera.
    """
    colors, camera = _few_pixels(pixels, lighting)
    return colors, _sample_directions(camera)


def sample_cells(pixels: NDArray[np.uint8], lighting: Lighting, rows: int) -> tuple[Image, NDArray[np.intp]]:
    """The linear values (h, w, 3) of `sample_photo`, and in which cell (h, w) of a map each lies.

    Args:
        pixels: (H, W, 3) sRGB.
        lighting: with the photo's camera.
        rows: of the cells; a cell is told by row x 2 rows + column.
    """
    colors, camera = _few_pixels(pixels, lighting)
    return colors, _cells_of_samples(camera, rows)


def cell_means(values: Image, cell: NDArray[np.intp], rows: int) -> tuple[Floats, NDArray[np.intp]]:
    """Means (R, 2R, C) of samples in the cells of a map, 0 where there are none, and how many (R, 2R) there are.

    Args:
        values: (P, C).
        cell: (P,) of each, as `sample_cells` tells it.
        rows: of the cells, R.
    """
    count = np.bincount(cell, minlength=2 * rows**2)
    total = np.stack([np.bincount(cell, channel, len(count)) for channel in values.T], axis=-1)
    return (total / np.maximum(count, 1)[:, None]).reshape(rows, 2 * rows, -1), count.reshape(rows, -1)


def _few_pixels(pixels: NDArray[np.uint8], lighting: Lighting) -> tuple[Image, Pinhole]:
    """The linear values (h, w, 3) of the pixels that are sampled, and the camera that saw them alone."""
    step = max(1, -(-max(pixels.shape[:2]) // _SAMPLED_SIDE))
    first = [min(step, count) // 2 for count in pixels.shape[:2]]
    small = pixels[first[0] :: step, first[1] :: step]
    return SRGB_LINEAR.take(small), photo_camera(lighting, small.shape[1], small.shape[0])


@lru_cache(maxsize=1)  # the sky, the ground and the edges of a photo are sampled one after the other
def _sample_directions(camera: Pinhole) -> Floats:
    """`camera_directions` of the sampled pixels."""
    directions = geometry.camera_directions(camera)
    directions.setflags(write=False)  # since others get it as well
    return directions


@lru_cache(maxsize=2)  # of the coarse map, and of the detail's cells
def _cells_of_samples(camera: Pinhole, rows: int) -> NDArray[np.intp]:
    """In which cell (h, w) of a map each sampled pixel lies."""
    azimuth, elevation = geometry.angles(_sample_directions(camera))
    row = np.minimum((90.0 - elevation) / 180.0 * rows, rows - 1).astype(np.intp)
    column = np.minimum((azimuth + 180.0) / 180.0 * rows, 2 * rows - 1).astype(np.intp)
    cell = np.asarray(row * 2 * rows + column)
    cell.setflags(write=False)
    return cell


def size_in_envmap(camera: Pinhole, height: int) -> tuple[int, int]:
    """Width and height in pixels at which a photo has about the resolution of a map.

    Args:
        camera: of the photo, in its pixels.
        height: rows of the map.
    """
    scale = min(height / np.pi / camera.focal_length * 1.2, _MAX_SIDE / max(camera.width, camera.height))
    return geometry.scale_size(camera.width, camera.height, scale)


def _map_to_picture(camera: Pinhole, height: int, rows: slice, columns: slice) -> tuple[Image, Image]:
    """Where the map's pixels lie in the picture, each way -1 to 1 inside it; 2 behind the camera.

    A direction's part along a camera axis is a product plus a term of its row. The product is that of a term of its row
    and one of its column. So no pixel needs an angle.
    """
    axes, focal = camera.axes.astype(np.float32), np.float32(2 * camera.focal_length)
    angles = latlong_angles(height)
    azimuth, elevation = np.radians(angles[0])[columns], np.radians(angles[1])[rows]
    level, up = np.cos(elevation).astype(np.float32)[:, None], np.sin(elevation).astype(np.float32)[:, None]
    side, ahead = np.sin(azimuth).astype(np.float32), -np.cos(azimuth).astype(np.float32)
    right, above, depth = (level * (axis[0] * side + axis[2] * ahead) + axis[1] * up for axis in axes)
    behind = depth <= 1e-6
    depth[behind] = 1
    x, y = right / depth * (focal / camera.width), above / depth * (focal / camera.height)
    x[behind] = y[behind] = 2
    return x, y


def extrapolate_edges(
    cells: Image, pixels: NDArray[np.uint8], lighting: Lighting, gain: float = 1.0, segments: Segments | None = None
) -> Image:
    """Factors (R, 2R, 3) on the cells of a coarse map (R, 2R, 3) that continue a photo (h, w, 3, sRGB) beside its view.

    A cell that the photo shows becomes the mean of its pixels in it. Others follow the nearest of these on their side
    of the horizon, by their ratio, those at the same height first, and the less the farther off they are. People,
    vehicles and other things, of which the segments tell, do not go on.

    Args:
        cells: linear.
        pixels: of the photo.
        lighting: with the photo's camera.
        gain: from the photo's linear values to the map's, over 0.
        segments: of the photo; None: all of it goes on.
    """
    ratio, visible = _photo_ratios(cells, pixels, lighting, gain, segments)
    azimuth, elevation = latlong_angles(len(cells))
    columns, elevation = np.asarray(azimuth, dtype=np.float32), np.asarray(elevation, dtype=np.float32)
    turns = np.asarray(wrap_azimuth(columns[:, None] - columns), dtype=np.float32)
    factors, half = np.ones_like(cells), len(cells) // 2
    for part in (slice(0, half), slice(half, None)):
        if visible[part].any():
            spread = _spread_ratios(np.log(ratio[part]), visible[part], elevation[part], turns)
            factors[part] = np.exp(spread)
    return factors


def _photo_ratios(
    cells: Image, pixels: NDArray[np.uint8], lighting: Lighting, gain: float, segments: Segments | None
) -> tuple[Image, NDArray[np.bool_]]:
    """The photo, times its gain, over the map in each cell (R, 2R, 3), and which cells it shows (R, 2R).

    Where the photo is clipped and the map is brighter, the map counts.
    """
    photo, cell = sample_cells(pixels, lighting, len(cells))
    chosen = np.arange(cell.size)
    if segments is not None:
        passing = pixel_share(segments, cell.shape[1], cell.shape[0], *PASSING_THINGS)
        chosen = np.flatnonzero(passing < _MAX_PASSING)
    cell, colors, map_colors = cell.take(chosen), photo.reshape(-1, 3).take(chosen, axis=0), cells.reshape(-1, 3)
    clipped = np.flatnonzero(max_channel(colors) > CLIPPED)
    colors *= np.float32(gain)
    colors[clipped] = np.maximum(colors[clipped], map_colors[cell[clipped]])
    mean, count = cell_means(colors, cell, len(cells))
    ratio = np.clip(mean / np.maximum(cells, EPSILON_IRRADIANCE), *CELL_RATIO_RANGE)
    return ratio.astype(np.float32), count >= _MIN_SAMPLES


def _spread_ratios(values: Image, visible: NDArray[np.bool_], elevation: Image, turns: Image) -> Image:
    """Values (P, 2R, 3) of some rows of a map, spread from the cells (P, 2R) that the photo shows to all others.

    `elevation` (P,) is of the rows, `turns` (2R, 2R) from each column to each, both in deg.
    """
    row, column = np.nonzero(visible)
    beside2 = (np.cos(np.radians(elevation))[:, None, None] * turns.take(column, axis=1)) ** 2  # (P, 2R, K)
    above2 = (elevation[:, None, None] - elevation[row]) ** 2
    distance2 = np.float32(_NEAR_DEG**2) + beside2 + np.float32(_VERTICAL_STRETCH**2) * above2
    weight = distance2 ** np.float32(-_DISTANCE_POWER)
    mean = weight @ values[visible] / weight.sum(axis=2, keepdims=True)
    fading = np.exp(-np.sqrt((beside2 + 4 * above2).min(axis=2)) / np.float32(_FADE_DEG))
    return np.where(visible[..., None], values, fading[..., None] * mean).astype(np.float32)
