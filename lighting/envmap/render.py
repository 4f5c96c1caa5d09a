"""Lighting -> lat-long map: clear, cloudy and overcast sky, ground and the sun's disc.

An environment map is a lat-long image (H, 2H, 3), float32, linear Rec.709, in the pixel layout of geometry.py. Its
values are the photo's own linear values. A lighting that has `sky_irradiance` and `sun_irradiance` gets a map whose
integrals equal them; else they follow from `exposure` x the sky model's radiance.

Clear skies by Hosek and Wilkie and by the Prague model are painted with tables by the angles from zenith and sun. The
disc is smaller than most pixels, so it is painted by the solid angle that it covers. Where its radiance would be more
than half floats hold, its power is spread evenly over as wide a disc as it needs.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

import lighting.envmap.latlong as latlong
import lighting.geometry as geometry
from lighting.color import luminance
from lighting.envmap.latlong import EPSILON_IRRADIANCE, MAX_RADIANCE, Image
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import SUN_RADIUS, Floats, angle_between, angles, direction, latlong_angles
from lighting.map_options import MAX_WHOLE_HEIGHT, check_height
from lighting.records import GROUND_REFLECTANCE, Lighting, check_lighting
from lighting.sky import PAINTED_SKY, SKY_MODEL, SKY_MODELS, Weather, sky_shape
from lighting.sky.clear_sky import LUX, sky_gradation, sky_lobe, sky_parameters, sun_disc_points, sun_disc_radiance

_LOBE_STEPS = 1 << 16  # of the table by the angle to the sun; taking the nearest entry errs by less than 4e-4
_TABLE_STEPS = 512  # of a row's table by that angle; values between its entries are interpolated
_TABLE_ROWS = 256  # whose tables are kept at once
_CHUNK_PIXELS = 1 << 14  # painted at once, few enough for the processor's cache
_GLOW_STEPS, _PEAK_SHARE = 200, 0.9  # attempts to flatten a sun's glow, and what each leaves of its peak
_MAX_PEAK = 500.0  # radiance of the brightest part of any sky over the irradiance of the ground
_IRRADIANCE_ROWS = 128  # of the sky that is integrated to light the ground; accurate to 2e-4
_EFFICACY = 120.0  # lm / W of skylight

_FINE_HEIGHT = 8192  # rows of the grid that samples the disc: 24 across it
_FINE_PER_PIXEL = 4  # least number of grid rows per row of pixels

_MAX_RADIUS = 90.0  # deg, of a sun that is spread
_FITS = 1 - 1e-6  # of MAX_RADIANCE that float32 surely keeps below it
_MIN_GROWTH, _MAX_GROWTH = 1.03, 1.5  # of its radius between attempts
_FLATTEST = 3.0  # how much smaller than the radius half its height may be
_MAX_SLOPE = 0.9  # by which its radiance may differ from above to below
_CAP_STEPS, _CAP_TOLERANCE = 50, 1e-3  # attempts to keep an irradiance, and the share of it that may be missing


def render(lighting: Lighting, height: int = 512, *, sun: bool | None = None, disc: bool = True) -> Image:
    """Environment map (H, 2H, 3) of a lighting: float32, linear Rec.709, in the photo's linear values.

    The sum of the disc's radiance x solid angle is the same at every height. The ground is lit by what is painted.
    No value is over 65,504, the largest half float: a sun that would be is a wider one of the same irradiances.
    ParameterError where a light is too bright for that.

    Args:
        lighting: else ParameterError.
        height: rows, even, 16 to 4096, else ParameterError.
        sun: whether the sun is in the map; None: by `Lighting.sun_painted`.
        disc: False leaves the disc for a light of its own; the sun still lights the ground.
    """
    image, _ = render_bare(lighting, height, sun=sun)
    if disc and (lighting.sun_painted if sun is None else sun):
        add_sun(image, lighting)
    return image


def render_bare(lighting: Lighting, height: int, *, sun: bool | None = None) -> tuple[Image, Floats | None]:
    """`render` without the disc, and the `gain` (3,) with which `render_rows` renders its rows.

    Args:
        lighting: as there.
        height: as there.
        sun: as there.
    """
    check_height(height, MAX_WHOLE_HEIGHT)
    check_lighting(lighting)
    sky, shines = lighting.map_sky, lighting.sun_painted if sun is None else sun
    image = np.empty((height, 2 * height, 3), dtype=np.float32)
    gain = _render_sky(image[: height // 2], 0, lighting, sky, None)
    _render_ground(image[height // 2 :], lighting, shines)
    cap_map(image, lighting)
    return image, gain


def render_rows(
    rows: Image, first: int, lighting: Lighting, *, sun: bool | None = None, gain: Floats | None = None
) -> None:
    """Render some rows of one half of a map, without the disc.

    Args:
        rows: (R, 2H, 3) filled with them.
        first: of the map's rows that they are.
        lighting: of the map. So much light that the map must be capped is a ParameterError.
        sun: as in `render`.
        gain: of a sky without a unit of its own, as `render_bare` finds it.
    """
    if _may_be_capped(lighting):
        raise _too_bright(f"a map of over {MAX_WHOLE_HEIGHT} rows")
    if first < rows.shape[1] // 4:
        _render_sky(rows, first, lighting, lighting.map_sky, gain)
    else:
        _render_ground(rows, lighting, lighting.sun_painted if sun is None else sun)


def _render_sky(rows: Image, first: int, lighting: Lighting, sky: str, gain: Floats | None) -> Floats | None:
    """Render rows (R, 2H, 3) of the sky from `first` on, and return the gain (3,) of one without a unit of its own.

    The clear sky and the overcast sky of the CIE contribute shares 1 - cover and cover of the irradiance of level
    ground, in each channel. Without a gain the rows are all of the sky, by which it is found.
    """
    if lighting.sky_irradiance is None and sky == SKY_MODEL:  # others have no unit of their own
        _render_clear_sky(rows, first, lighting)
        return None
    irradiance, cover, height = sky_irradiance(lighting), lighting.sky_cover or 0.0, rows.shape[1] // 2
    overcast = _overcast_rows(height // 2)[first : first + len(rows)] if cover > 0 else None
    if overcast is not None and cover >= 1:
        rows[:] = overcast * np.asarray(irradiance, dtype=np.float32)
        return None
    _render_sky_shape(rows, first, lighting, sky)
    if gain is None:
        reached = latlong.irradiance_from_rows(latlong.row_irradiance(height)[: len(rows)], rows)
        gain = (1 - cover) * irradiance / np.maximum(reached, EPSILON_IRRADIANCE)
    latlong.scale_colors(rows, gain)
    if overcast is not None:
        added = np.tile(np.asarray(cover * irradiance, dtype=np.float32), rows.shape[1])  # as in `scale_colors`
        flat, count = rows.reshape(len(rows), -1), max(1, _CHUNK_PIXELS // added.size)
        for start in range(0, len(flat), count):
            flat[start : start + count] += overcast[start : start + count, 0] * added
    return gain


def _render_ground(rows: Image, lighting: Lighting, shines: bool) -> None:
    level = level_irradiance(lighting) if shines else sky_irradiance(lighting)
    rows[0] = ground_reflectance(lighting) / math.pi * level
    rows[1:] = rows[0]  # copying whole rows is fastest


def add_sun(image: Image, lighting: Lighting) -> None:
    """Add the sun to a map that lacks it; one below the horizon adds nothing.

    Args:
        image: (H, 2H, 3), changed in place.
        lighting: of the map.
    """
    if lighting.sun_elevation >= 0:
        sun_in_map(image, lighting, len(image))(image, 0)


def sun_in_map(background: Image, lighting: Lighting, height: int) -> Callable[[Image, int], None]:
    """Return a function that adds the sun, above the horizon, to rows (R, 2H, 3) of a map from a first one on.

    Args:
        background: (h, 2h, 3) the map without it, perhaps of fewer rows.
        lighting: of the map.
        height: rows of the map, H.
    """
    power, glow = sun_light(lighting)[0], SKY_MODELS[lighting.map_sky].sun_glow
    if glow is not None:
        return _sun_glow(background, lighting, glow, power)
    pixels, added = _sun_disc_pixels(background, lighting, power, height)

    def add(rows: Image, first: int) -> None:
        start, size = first * rows.shape[1], len(rows) * rows.shape[1]
        inside = (pixels >= start) & (pixels < start + size)
        rows.reshape(-1, 3)[pixels[inside] - start] += np.asarray(added[inside], dtype=np.float32)

    return add


def cap_map(image: Image, lighting: Lighting) -> None:
    """Bring a map to at most MAX_RADIANCE in place; the irradiances of level ground by both halves stay.

    Args:
        image: (H, 2H, 3), without the sun's disc.
        lighting: of the map, by which nearly all maps need no look.

    Raises:
        ParameterError: so much light does not fit.
    """
    if not _may_be_capped(lighting):
        return
    limit = np.float32(MAX_RADIANCE)
    for levels, rows in zip(np.split(latlong.row_irradiance(len(image)), 2), np.split(image, 2), strict=True):
        if rows.max() <= limit:
            continue
        target = latlong.irradiance_from_rows(levels, rows)
        for _ in range(_CAP_STEPS):
            np.minimum(rows, limit, out=rows)
            short = target / np.maximum(latlong.irradiance_from_rows(levels, rows), EPSILON_IRRADIANCE)
            if short.max() <= 1 + _CAP_TOLERANCE:
                break
            latlong.scale_colors(rows, short)
        else:
            raise _too_bright()


def _may_be_capped(lighting: Lighting) -> bool:
    return bool(level_irradiance(lighting).max() * _MAX_PEAK > MAX_RADIANCE)


def sky_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of open level ground by the sky, without the sun's disc.

    Args:
        lighting: stated, or by the sky model.
    """
    return clear_irradiance(lighting) if lighting.sky_irradiance is None else np.array(lighting.sky_irradiance)


def level_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of open level ground by sky and sun.

    Args:
        lighting: whose sun counts, painted or not.
    """
    return sky_irradiance(lighting) + sun_light(lighting)[1]


def ground_reflectance(lighting: Lighting) -> Floats:
    """Reflectance (3,) of the ground, 0 to 1: its color; else `ground_albedo`, or 0.12 where irradiances are stated.

    Args:
        lighting: with a color of the ground or none.
    """
    if lighting.ground_color is not None:
        return np.array(lighting.ground_color)
    return np.full(3, lighting.ground_albedo if lighting.sky_irradiance is None else GROUND_REFLECTANCE)


def with_irradiance(lighting: Lighting) -> Lighting:
    """The same light with its irradiances stated; a sun that is not painted has none.

    Args:
        lighting: returned as it is where it states them.
    """
    if lighting.sky_irradiance is not None:
        return lighting
    sun = sun_light(lighting)[0] if lighting.sun_painted else np.zeros(3)
    sky = sky_irradiance(lighting)
    facing, level, ground = ((float(r), float(g), float(b)) for r, g, b in (sun, sky, ground_reflectance(lighting)))
    return replace(lighting, sun_irradiance=facing, sky_irradiance=level, ground_color=ground)


def _sun_glow(
    background: Image, lighting: Lighting, shape: Callable[[Floats, Floats], Floats], power: Floats
) -> Callable[[Image, int], None]:
    """A function that adds a glow to rows (R, 2H, 3) of a map so that its radiance x solid angle is (3,).

    Where that would be over MAX_RADIANCE, its peak is flattened as far as it must be.
    """
    upper = background[: len(background) // 2]
    weight = geometry.latlong_solid_angle(len(background))[: len(upper)]
    glow = shape(geometry.latlong_directions(len(background))[: len(upper)], lighting.sun_direction)
    for _ in range(_GLOW_STEPS):
        total = max(float(weight @ glow.sum(axis=1)), EPSILON_IRRADIANCE)
        peak = glow >= _PEAK_SHARE * glow.max()
        if (upper[peak] + glow[peak][:, None] * (power / total)).max() <= MAX_RADIANCE:
            limit, gain = glow.max(), power / total
            break
        glow = np.minimum(glow, _PEAK_SHARE * glow.max())
    else:
        raise _too_bright()

    def add(rows: Image, first: int) -> None:
        azimuth, elevation = latlong_angles(rows.shape[1] // 2)
        sky = rows[: max(rows.shape[1] // 4 - first, 0)]
        part = direction(azimuth, elevation[first : first + len(sky), None])
        sky += np.asarray(np.minimum(shape(part, lighting.sun_direction), limit)[..., None] * gain, dtype=np.float32)

    return add


def _overcast_rows(rows: int) -> Image:
    """Radiance (rows, 1, 1) of the overcast sky of irradiance 1, row by row from the zenith."""
    up = np.sin(np.radians(latlong_angles(2 * rows)[1][:rows]))
    radiance = (1 + 2 * up) / 3
    return np.asarray(radiance / (latlong.row_irradiance(2 * rows)[:rows] @ radiance), dtype=np.float32)[:, None, None]


def _render_sky_shape(image: Image, first: int, lighting: Lighting, sky: str) -> None:
    """Fill rows (R, 2H, 3) of the sky with the radiance of one of SKY_MODELS at any scale."""
    if sky == SKY_MODEL:
        _render_clear_sky(image, first, lighting)
        return
    if (by_angles := SKY_MODELS[sky].by_angles) is not None:
        _render_by_angles(image, first, lighting, by_angles)
        return
    azimuth, elevation = latlong_angles(image.shape[1] // 2)
    elevation = elevation[first : first + len(image)]
    rows, weather = max(1, _CHUNK_PIXELS // image.shape[1]), _weather(lighting)
    for start in range(0, len(image), rows):
        part = slice(start, min(start + rows, len(image)))
        directions = direction(azimuth, elevation[part, None])
        image[part] = sky_shape(sky, directions, lighting.sun_direction, weather)


@lru_cache(maxsize=4)  # a photo's light is that of several maps
def _weather(lighting: Lighting) -> Weather:
    """What shapes the sky. The strength of sun and sky is as stated, else as Hosek and Wilkie's models have it."""
    clear = clear_irradiance(lighting) / lighting.exposure
    sun = sun_light(lighting)[0]
    sky = clear * lighting.exposure if lighting.sky_irradiance is None else np.array(lighting.sky_irradiance)
    beam = float(luminance(sun)) / max(float(luminance(sky)), EPSILON_IRRADIANCE)
    diffuse = float(luminance(clear)) * LUX / _EFFICACY
    return Weather(lighting.turbidity, lighting.ground_albedo, beam, diffuse)


@lru_cache(maxsize=1)  # a photo's sky is compared before it is painted
def _lobe_table(sun_elevation: float, turbidity: float, ground_albedo: float) -> Image:
    """`sky_lobe` of each channel (3, steps + 1) at the angles to the sun that `_render_clear_sky` looks up."""
    angle, chord2 = _lobe_angles()
    coefficients, _ = sky_parameters(sun_elevation, turbidity, ground_albedo)
    table = np.stack([sky_lobe(row, chord2, angle) for row in coefficients])
    table.setflags(write=False)  # since others get it as well
    return table


@lru_cache(maxsize=1)
def _lobe_angles() -> tuple[Image, Image]:
    """The table's angles to the sun [rad] (steps + 1,), and their squared chords."""
    share = np.linspace(0.0, 1.0, _LOBE_STEPS + 1)
    angle = np.asarray(2 * np.arctan2(share, 1 - share), dtype=np.float32)
    return angle, np.square(2 * np.sin(angle / 2))


def _render_clear_sky(image: Image, first: int, lighting: Lighting) -> None:
    """Fill rows (R, 2H, 3) of the sky: a factor and an offset per row, a look-up of the lobe per pixel.

    The factor holds exposure and mean radiance.
    """
    lobe = _lobe_table(lighting.sun_elevation, lighting.turbidity, lighting.ground_albedo)
    up = np.sin(np.radians(latlong_angles(image.shape[1] // 2)[1][first : image.shape[1] // 4]))
    coefficients, radiance = sky_parameters(lighting.sun_elevation, lighting.turbidity, lighting.ground_albedo)
    factors, offsets = zip(*(sky_gradation(row, up) for row in coefficients), strict=True)
    factor = np.asarray(np.stack(factors) * radiance[:, None] * lighting.exposure, dtype=np.float32)
    offset = np.asarray(np.stack(offsets), dtype=np.float32)
    for part, share in _sun_shares(image, first, lighting):
        index = (share * np.float32(_LOBE_STEPS) + np.float32(0.5)).astype(np.intp)
        for channel in range(3):
            value = lobe[channel].take(index)
            value += offset[channel, part, None]
            value *= factor[channel, part, None]
            image[part, :, channel] = np.clip(value, 0, np.inf, out=value)


def _render_by_angles(image: Image, first: int, lighting: Lighting, by_angles: Callable[..., Floats]) -> None:
    """Fill rows (R, 2H, 3) of the sky: a look-up in its row's table per pixel, between entries linear."""
    zenith = 90.0 - latlong_angles(image.shape[1] // 2)[1][first : first + len(image)]
    steps = np.linspace(0.0, 1.0, _TABLE_STEPS + 1)
    sun_angle = np.degrees(2 * np.arctan2(steps, 1 - steps))
    for start in range(0, len(image), _TABLE_ROWS):
        rows = image[start : start + _TABLE_ROWS]
        table = by_angles(zenith[start : start + len(rows)], sun_angle, lighting.sun_elevation, lighting.turbidity)
        table = np.asarray(table, dtype=np.float32)
        step = np.zeros_like(table)  # to the next entry; the last has none
        np.subtract(table[..., 1:], table[..., :-1], out=step[..., :-1])
        for part, share in _sun_shares(rows, first + start, lighting):
            share *= np.float32(_TABLE_STEPS)
            low = share.astype(np.intp)
            share -= low
            low += np.arange(len(low))[:, None] * (_TABLE_STEPS + 1)
            for channel in range(3):
                value = step[channel, part].take(low)
                value *= share
                value += table[channel, part].take(low)
                rows[part, :, channel] = value


def _sun_shares(image: Image, first: int, lighting: Lighting) -> Iterator[tuple[slice, Image]]:
    """A few at a time of rows (R, 2H, 3) of the sky, and their pixels' angles from the sun.

    The angle g between two directions follows from sin^2(g / 2) = sin^2(de / 2) + cos e cos e' sin^2(da / 2). The row
    gives all but the last factor, and the column that one. This keeps its precision next to the sun. The angle is told
    by sin(g / 2) / (sin(g / 2) + cos(g / 2)), 0 to 1, which is as fine at both ends and needs no arcsine.
    """
    azimuth, elevation = latlong_angles(image.shape[1] // 2)
    elevation = elevation[first : first + len(image)]
    sun = math.radians(lighting.sun_elevation)
    vertical = np.asarray(np.sin((np.radians(elevation) - sun) / 2) ** 2, dtype=np.float32)
    horizontal = np.asarray(np.cos(np.radians(elevation)) * math.cos(sun), dtype=np.float32)
    column = np.asarray(np.sin(np.radians(azimuth - lighting.sun_azimuth) / 2) ** 2, dtype=np.float32)
    count = max(1, _CHUNK_PIXELS // image.shape[1])
    for start in range(0, len(image), count):
        part = slice(start, min(start + count, len(image)))
        # numpy clips at two ends in a third of the time that it takes at one
        sine2 = np.clip(vertical[part, None] + horizontal[part, None] * column, 0, 1)
        sine, cosine = np.sqrt(sine2), np.sqrt(1 - sine2)
        yield part, sine / (sine + cosine)


def clear_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of a horizontal surface by the model's clear sky without the disc.

    That of a sun below the horizon is the one of a sun on it, times how much less the Prague sky then gives.

    Args:
        lighting: whose sun, turbidity, ground albedo and exposure count.
    """
    if lighting.sun_elevation < 0:
        horizon = replace(lighting, sun_elevation=0.0)
        fading = _painted_irradiance(lighting) / _painted_irradiance(horizon)
        return np.asarray(clear_irradiance(horizon) * fading)
    sky = np.empty((_IRRADIANCE_ROWS // 2, 2 * _IRRADIANCE_ROWS, 3), dtype=np.float32)
    _render_clear_sky(sky, 0, lighting)
    return _level_irradiance(sky)


def _painted_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of a horizontal surface by PAINTED_SKY, in its own unit."""
    model, directions = SKY_MODELS[PAINTED_SKY], geometry.latlong_directions(_IRRADIANCE_ROWS)[: _IRRADIANCE_ROWS // 2]
    weather = Weather(lighting.turbidity, lighting.ground_albedo, 0.0, 0.0)
    return _level_irradiance(np.asarray(model.shape(directions, lighting.sun_direction, weather), dtype=np.float32))


def _level_irradiance(sky: Image) -> Floats:
    """Irradiance (3,) of a horizontal surface by the upper half (R, 4R, 3) of a map."""
    return np.asarray(latlong.row_irradiance(2 * len(sky))[: len(sky)] @ sky.mean(axis=1, dtype=np.float64))


def _sun_disc_pixels(
    background: Image, lighting: Lighting, power: Floats, height: int
) -> tuple[NDArray[np.intp], Floats]:
    """The disc's pixels (N,) and its radiance (N, 3): the mean of a finer grid, scaled to the disc's exact power.

    Args:
        background: (h, 2h, 3) linear radiance of the map without it, perhaps of fewer rows.
        lighting: with the sun's direction and color.
        power: (3,) radiance x solid angle of the disc.
        height: rows of the map.
    """
    width = 2 * height
    row, column, directions = _fine_grid(lighting, height)
    solid_angle = geometry.latlong_solid_angle(height)
    if lighting.sun_irradiance is None:
        radiance = sun_disc_radiance(directions, lighting.sun_direction, lighting.turbidity) * lighting.exposure
    else:  # in one color: through haze, the model's of a setting sun lacks channels or is black
        clearest = sun_disc_radiance(directions, lighting.sun_direction, 1.0)
        radiance = np.repeat(clearest.mean(axis=-1, keepdims=True), 3, axis=-1)
    share = radiance * np.hypot(directions[..., 0], directions[..., 2])[..., None]  # x the cell's relative solid angle
    lit = radiance.any(axis=-1)
    pixels, inverse = np.unique((row[:, None] * width + column % width)[lit], return_inverse=True)
    sums = np.stack([np.bincount(inverse, share[lit][:, channel], len(pixels)) for channel in range(3)], axis=-1)
    scale = power / np.maximum(sums.sum(axis=0), np.finfo(np.float64).tiny)
    added = sums * scale / solid_angle[pixels // width, None]
    if (_radiance_at(background, pixels, height) + added).max(initial=0.0) > MAX_RADIANCE:
        return _spread_power(background, pixels, added, solid_angle)
    return pixels, added


def _radiance_at(background: Image, pixels: NDArray[np.intp], height: int) -> Image:
    """The radiance (N, 3) of a map, perhaps of fewer rows than `height`, at pixels (N,) of one of these."""
    row, column = (place * len(background) // height for place in np.divmod(pixels, 2 * height))
    return np.asarray(background[row, column])


def _spread_power(
    background: Image, pixels: NDArray[np.intp], added: Floats, solid_angle: Floats
) -> tuple[NDArray[np.intp], Floats]:
    """Pixels (M,) and radiance (M, 3) of a wider sun, which gives a surface that faces it and level ground the same.

    Args:
        background: (h, 2h, 3) to which it is to be added, perhaps of fewer rows.
        pixels: (N,) indices of the pixels of the sun.
        added: (N, 3) its radiance there.
        solid_angle: (H,) of a pixel of each row.
    """
    height = len(solid_angle)
    weighted = added * solid_angle[pixels // (2 * height), None]
    vectors = weighted.T @ _pixel_directions(pixels, height)  # (channels, 3)
    total = vectors.sum(axis=0)
    sun = total / np.linalg.norm(total)
    elevation = float(angles(sun)[1])
    facing = vectors @ sun
    shrink = 1 - min(facing.max() / MAX_RADIANCE / math.pi / 2, 1.0)
    radius = max(math.degrees(math.acos(shrink)), SUN_RADIUS)
    while radius <= _MAX_RADIUS:
        wider, share, directions = _even_disc(sun, elevation, radius, height)
        solid = solid_angle[wider // (2 * height)]
        share = _at_height(share, solid, directions, sun)
        spread = share[:, None] * (facing / (solid * share @ (directions @ sun)))
        if (over := float((_radiance_at(background, wider, height) + spread).max()) / MAX_RADIANCE) <= _FITS:
            return wider, spread
        radius *= min(max(math.sqrt(over), _MIN_GROWTH), _MAX_GROWTH)
    raise _too_bright()


def _even_disc(sun: Floats, elevation: float, radius: float, height: int) -> tuple[NDArray[np.intp], Floats, Floats]:
    """A disc [deg] around a direction (3,) and its elevation: pixels (M,) above the horizon of a map.

    Also their shares (M,) of it and their directions (M, 3). A disc that would reach below the horizon is as flat and
    wide as keeps its height, up to a ratio.
    """
    pixel = 180.0 / height
    vertical = max(min(radius, max(elevation, pixel / 2)), radius / _FLATTEST)
    horizontal = radius**2 / vertical
    rows = np.arange(max(0, math.floor((90.0 - elevation - vertical) / pixel - 1)), height // 2)
    rows = rows[: max(1, math.ceil((90.0 - elevation + vertical) / pixel + 1) - rows[0])]
    reach = max(vertical, horizontal) * (1 + 0.5 * pixel / min(vertical, horizontal))
    columns, azimuth = np.arange(2 * height), float(angles(sun)[0])
    if (beside := _azimuth_reach(elevation, reach)) is not None:
        within = _cells_between(azimuth + 180.0 - beside, azimuth + 180.0 + beside, height / 180.0)
        columns = np.flatnonzero(np.bincount(within % (2 * height)))  # numpy.unique would import masked arrays
    pixels = (rows[:, None] * 2 * height + columns).ravel()
    directions = _pixel_directions(pixels, height)
    up = np.degrees(np.arcsin(directions[:, 1])) - elevation
    beside2 = np.maximum(np.square(angle_between(directions, sun)) - np.square(up), 0.0)
    outward = np.sqrt(np.square(up / vertical) + beside2 / horizontal**2)
    share = np.clip((1 - outward) * min(vertical, horizontal) / pixel + 0.5, 0.0, 1.0)
    inside = share > 0
    return pixels[inside], share[inside], directions[inside]


def _azimuth_reach(elevation: float, reach: float) -> float | None:
    """How far beside a direction [deg] what lies within an angle [deg] of it reaches; None: all around."""
    if elevation + reach >= 90.0:
        return None
    return math.degrees(math.asin(math.sin(math.radians(reach)) / math.cos(math.radians(elevation))))


def _at_height(share: Floats, solid_angle: Floats, directions: Floats, sun: Floats) -> Floats:
    """Shares (M,) of a disc, more above or below, so that level ground gets as much of it as from a direction (3,)."""
    weight = share * solid_angle
    up, facing = directions[:, 1], directions @ sun
    off = up - weight @ up / weight.sum()
    missing = sun[1] * (weight @ facing) - weight @ up
    gained = (weight * off) @ up - sun[1] * ((weight * off) @ facing)
    if gained <= 0 or not off.any():
        return share
    slope = np.clip(missing / gained, *(np.array([-1, 1]) * _MAX_SLOPE / np.abs(off).max()))
    return np.asarray(share * (1 + slope * off))


def _pixel_directions(pixels: NDArray[np.intp], height: int) -> Floats:
    """Unit vectors (N, 3) of a map's pixels by their indices."""
    row, column = np.divmod(pixels, 2 * height)
    return direction((column + 0.5) * (180.0 / height) - 180.0, 90.0 - (row + 0.5) * (180.0 / height))


def sun_light(lighting: Lighting) -> tuple[Floats, Floats]:
    """Irradiance (3,) by the sun of a surface that faces it, and of level ground: as stated, else by the model's disc.

    Of a disc that sets, what is above the horizon counts. Both are 0 of a sun below it.

    Args:
        lighting: of the sun, painted or not.
    """
    if lighting.sun_elevation < 0:
        return np.zeros(3), np.zeros(3)
    if lighting.sun_irradiance is not None:
        facing = np.array(lighting.sun_irradiance)
        return facing, facing * max(float(np.sin(np.radians(lighting.sun_elevation))), 0.0)
    points, weight = sun_disc_points(lighting.sun_direction)
    radiance = sun_disc_radiance(points, lighting.sun_direction, lighting.turbidity) * lighting.exposure
    return np.asarray(weight @ radiance), np.asarray((weight * points[:, 1]) @ radiance)


def _fine_grid(lighting: Lighting, height: int) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """A grid over the visible disc, finer than a map's pixels.

    The map's row (R,) and column (C,) of each of its rows and columns, and its directions (R, C, 3); columns may run
    over the seam.
    """
    azimuth, elevation = lighting.sun_azimuth, lighting.sun_elevation
    widest = math.cos(math.radians(max(elevation - SUN_RADIUS, 0.0)))
    split = max(_FINE_PER_PIXEL, -(-_FINE_HEIGHT // height))
    across = math.ceil(split * widest)
    if (reach := _azimuth_reach(elevation, SUN_RADIUS)) is None:
        columns = np.arange(2 * height * across)
    else:
        columns = _cells_between(azimuth + 180.0 - reach, azimuth + 180.0 + reach, height * across / 180.0)
    rows = _cells_between(90.0 - elevation - SUN_RADIUS, 90.0 - elevation + SUN_RADIUS, height * split / 180.0)
    rows = rows[rows >= 0]
    fine_azimuth = (columns + 0.5) * (180.0 / (height * across)) - 180.0
    fine_elevation = 90.0 - (rows + 0.5) * (180.0 / (height * split))
    return rows // split, columns // across, direction(fine_azimuth, fine_elevation[:, None])


def _cells_between(start: float, end: float, per_degree: float) -> NDArray[np.intp]:
    """Indices of the cells between two angles [deg]."""
    return np.arange(math.floor(start * per_degree), math.ceil(end * per_degree))


def _too_bright(image: str = "a map") -> ParameterError:
    """Return the error of a light that an image cannot hold, whose values end at MAX_RADIANCE."""
    sentence = f"The light is too bright for {image}, whose values end at {MAX_RADIANCE:.0f}; lower the exposure."
    return ParameterError(sentence, "exposure", ErrorCode.OUT_OF_RANGE)
