"""A map that shows the place: the photo's own pixels in its view, and around it what is known or likely.

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

from lighting.colour import checked_pixels, luminance
from lighting.envmap.changing import change
from lighting.envmap.continued import RATIO, continued
from lighting.envmap.maps import Image, f32, irradiance_of, row_levels, scale
from lighting.envmap.photo_view import Shown, shown, shown_size
from lighting.envmap.render import add_sun, check_height, render
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import angle_between, latlong_directions
from lighting.records import Estimate, Lighting, check_estimate, check_lighting

_FINER = 1000  # pixels along the longer side of a photo of which a map shows more than the network takes
_REST = (0.1, 4.0)  # how far what the photo does not show is scaled; beyond it the photo is scaled as well
_ROWS = 24  # of the cells in which the map is changed
_BAND = 32  # rows that are multiplied at once
_SAMPLES = 4  # rows and columns of the bare map that are looked at for each cell
_GLOW = 40.0  # deg around a sun within which the sky's brightness is the sun's
_MOVED = 20.0  # deg by which a sun was moved for its glow to have gone
_CONTRAST = 0.7  # power of what the network says of the place, for of other places than it saw it says too much
_EXACT = 1e-5  # share by which an irradiance may differ from the one aimed at
_LEAST = 1e-9  # irradiance, radiance or exposure that stands for none


@dataclass(frozen=True, eq=False)
class Place:
    """What is known of the place where a photo was taken. PhotoError for what is no photo's pixels."""

    photo: NDArray[np.uint8]  # (h, w, 3) sRGB, upright
    around: NDArray[np.float32] | None = None  # `Estimate.around`; without it bare sky and ground lie beside the photo
    exposure: float | None = None  # of the light that both are of; one that is changed by hand brightens them, too
    light: Lighting | None = None  # that light, where it is known: what it makes of the place stays under another sun

    def __post_init__(self) -> None:
        object.__setattr__(self, "photo", checked_pixels(self.photo))

    def gain(self, lighting: Lighting) -> float:
        """What brings the place to the exposure of a light that may have been changed since."""
        return 1.0 if self.exposure is None else lighting.exposure / max(self.exposure, _LEAST)

    def shown_light(self, lighting: Lighting) -> Lighting:
        """A light that may have been changed since, at the exposure at which the photo is as it is."""
        return lighting if self.exposure is None else change(lighting, {"exposure": self.exposure})


def known_place(
    estimate: Estimate, photo: NDArray[np.uint8], *, wanted: bool | None = None, exposure: float | None = None
) -> Place | None:
    """The place as a photo (h, w, 3) shows it: as wanted, by default where the network predicted what lies around.

    `exposure` is that of the light which the photo shows, by default the estimate's. Raises ParameterError for what is
    no Estimate, and PhotoError for what is no photo's pixels.
    """
    check_estimate(estimate)
    if not (estimate.around is not None if wanted is None else wanted):
        return None
    if exposure is not None:
        return Place(photo, estimate.around, exposure)
    return Place(photo, estimate.around, estimate.lighting.exposure, estimate.lighting)


def place_of(
    estimate: Estimate,
    photo: NDArray[np.uint8],
    height: int,
    finer: Callable[[int], NDArray[np.uint8]],
    *,
    wanted: bool | None = None,
    exposure: float | None = None,
) -> Place | None:
    """`known_place` for a map of `height` rows.

    `photo` (h, w, 3) is what the estimate was made from. Only where the map shows more pixels than those,
    `finer(side)` reads it again with `side` pixels along its longer side, for decoding costs as much as the network.
    """
    check_height(height)
    place = known_place(estimate, photo, wanted=wanted, exposure=exposure)
    if place is None or max(shown_size(photo, estimate.lighting.vertical_fov, height)) <= max(photo.shape[:2]):
        return place
    return replace(place, photo=finer(_FINER))


def surround(
    lighting: Lighting, place: Place, height: int = 512, *, sun: bool | None = None, disc: bool = True
) -> Image:
    """Environment map (H, 2H, 3) of the lighting of a photo, with the place.

    The parameters, the irradiances of level ground from above and from below, and the errors are those of `render`.
    """
    check_lighting(lighting)
    check_height(height)
    _check_place(place)
    halves = slice(0, height // 2), slice(height // 2, height)
    with ThreadPoolExecutor(1) as beside:  # the photo is laid out while the sky is painted, and each half has a thread
        laid = beside.submit(shown, lighting, place.photo, height)
        image = render(lighting, height, sun=sun, disc=False)
        factors, seen = _there(image, lighting, place), laid.result()
        gain = place.gain(lighting)
        upper, lower = (
            partial(_lay, image, half, cells, seen.within(half) if seen else None, gain)
            for half, cells in zip(halves, np.split(factors, 2), strict=True)
        )
        above = beside.submit(upper)
        lower()
        above.result()
    if disc and (lighting.sun_painted if sun is None else sun):
        add_sun(image, lighting)
    return image


def place_factors(lighting: Lighting, place: Place) -> Image:
    """Factors (24, 48, 3) on the cells of the bare map beside the photo's view, before its halves are scaled.

    With them and the photo a program that renders the bare sky itself shows the place as `surround` does.
    """
    _check_place(place)
    return _factors(_pooled(render(lighting, _ROWS * _SAMPLES, disc=False)), lighting, place)


def _check_place(thing: object) -> None:
    if not isinstance(thing, Place):
        raise ParameterError(
            f"A Place is needed, not {type(thing).__name__}; known_place makes one of an estimate.",
            code=ErrorCode.WRONG_TYPE,
        )


def _there(image: Image, lighting: Lighting, place: Place) -> Image:
    """What the light of the place makes of the cells (_ROWS, 2 _ROWS, 3) of the bare map; what is finer stays."""
    if place.light is None or _sky(place.light) == _sky(lighting):
        return _factors(_pooled(image), lighting, place)
    return without_glow(place_factors(place.light, place), place.light, lighting)


def without_glow(factors: Image, before: Lighting, now: Lighting) -> Image:
    """The factors (R, 2R, 3) of a place for a sun that was moved: around where it was they become those of their row.

    There they say how bright the sky is near the sun, and that moves with it.
    """
    sun = before.sun_direction
    moved = 1 - math.exp(-((float(angle_between(sun, now.sun_direction)) / _MOVED) ** 2))
    sky = factors[: len(factors) // 2]
    near = np.exp(-((angle_between(latlong_directions(len(factors))[: len(sky)], sun) / _GLOW) ** 2))[..., None]
    rest = np.log(sky)
    row = ((1 - near) * rest).sum(axis=1, keepdims=True) / (1 - near).sum(axis=1, keepdims=True)
    share = moved * near
    return np.concatenate([f32(np.exp((1 - share) * rest + share * row)), factors[len(sky) :]])


def _sky(lighting: Lighting) -> tuple[object, ...]:
    """What the sky's gradation follows from."""
    return lighting.sun_azimuth, lighting.sun_elevation, lighting.turbidity, lighting.sky_model


def _factors(bare: Image, lighting: Lighting, place: Place) -> Image:
    """What the place makes of the cells (_ROWS, 2 _ROWS, 3) of the bare map."""
    ratio, gain = np.ones_like(bare), place.gain(lighting)
    if place.around is not None:
        _multiply(ratio, _ratio(np.float32(gain) * place.around, bare))
    return np.asarray(ratio * continued(ratio * bare, place.photo, lighting, gain))


def _pooled(image: Image) -> Image:
    """A map's cells (_ROWS, 2 _ROWS, 3), by some of their pixels."""
    height, width = image.shape[:2]
    y = ((np.arange(_ROWS * _SAMPLES) + 0.5) * height / (_ROWS * _SAMPLES)).astype(np.intp)
    x = ((np.arange(2 * _ROWS * _SAMPLES) + 0.5) * width / (2 * _ROWS * _SAMPLES)).astype(np.intp)
    rows = image.take(y, axis=0).take(x, axis=1).reshape(_ROWS, _SAMPLES, -1).mean(axis=1)
    return np.asarray(rows.reshape(_ROWS, 2 * _ROWS, _SAMPLES, 3).mean(axis=2))


def _ratio(around: Image, bare: Image) -> Image:
    """The coarse panorama (R, 2R, 3) over the same cells of the bare map (_ROWS, 2 _ROWS, 3), with less contrast."""
    rows, step = len(around), _ROWS // len(around)
    pooled = bare.reshape(rows, step, 2 * rows, step, 3).mean(axis=(1, 3))
    return _softened(np.clip(around / np.maximum(pooled, np.float32(_LEAST)), *RATIO))


def _softened(ratio: Image) -> Image:
    """Ratios (R, 2R, 3) drawn to their geometric mean in each half: above the horizon in brightness alone."""
    sky, ground = np.split(np.log(ratio), 2)
    grey = np.log(luminance(ratio[: len(sky)]))[..., None]
    sky -= np.float32(1 - _CONTRAST) * (grey - grey.mean())
    ground -= np.float32(1 - _CONTRAST) * (ground - ground.mean(axis=(0, 1)))
    return np.asarray(np.exp(np.concatenate([sky, ground])))


def _multiply(image: Image, cells: Image) -> None:
    """Multiply a map (H, 2H, 3) by cells (R, 2R, 3) that blend into each other but for the horizon."""
    middle, horizon = len(image) // 2, len(cells) // 2
    _multiply_half(image[:middle], cells[:horizon])
    _multiply_half(image[middle:], cells[horizon:])


def _multiply_half(image: Image, cells: Image) -> None:
    """Multiply rows of a map (H, W, 3), contiguous in memory, by cells (R, C, 3), linear between their centres.

    Columns wrap and rows end. A few rows at once lie between few rows of cells, and only those count for them.
    """
    (height, width), (rows, columns) = image.shape[:2], cells.shape[:2]
    wide = (_between(width, columns, lambda cell: cell % columns) @ cells).reshape(rows, -1)  # (R, 3 W)
    down = _between(height, rows, lambda cell: np.clip(cell, 0, rows - 1))
    flat = image.reshape(height, -1)
    for start in range(0, height, _BAND):
        band = slice(start, start + _BAND)
        near = np.flatnonzero(down[band].any(axis=0))
        between = slice(near[0], near[-1] + 1)
        flat[band] *= down[band, between] @ wide[between]


def _between(pixels: int, cells: int, inside: Callable[[NDArray[np.intp]], NDArray[np.intp]]) -> NDArray[np.float32]:
    """The shares (pixels, cells) of the cells on either side of each pixel; `inside` places those beyond the ends."""
    at = (np.arange(pixels) + 0.5) * cells / pixels - 0.5
    low = np.floor(at).astype(np.intp)
    shares = np.zeros((pixels, cells), np.float32)
    for cell, share in ((low, 1 - (at - low)), (low + 1, at - low)):
        shares[np.arange(pixels), inside(cell)] += f32(share)
    return shares


def _lay(image: Image, half: slice, cells: Image, photo: Shown | None, gain: float) -> None:
    """Give one half of the bare map the place: its cells, and the photo times a gain. Its irradiance stays."""
    levels = row_levels(len(image))
    target = irradiance_of(levels[half], image[half])
    _multiply_half(image[half], cells)
    total = irradiance_of(levels[half], image[half])
    if photo is None:
        scale(image[half], target / np.maximum(total, _LEAST))
        return
    seen = photo.over(image, gain)
    there, weight = image[seen.rows, seen.columns], seen.weight[..., None].repeat(3, axis=2)
    share = there.shape[1] / image.shape[1]  # of the columns
    shown_light = irradiance_of(levels[seen.rows], weight * seen.linear) * share
    hidden = irradiance_of(levels[seen.rows], weight * there) * share
    rest = np.clip((target - shown_light) / np.maximum(total - hidden, _LEAST), *_REST)
    scale(image[half], rest)
    there += weight * (seen.linear - there)
    reached = rest * (total - hidden) + shown_light
    if np.any(np.abs(reached - target) > _EXACT * target):
        scale(image[half], target / np.maximum(reached, _LEAST))
