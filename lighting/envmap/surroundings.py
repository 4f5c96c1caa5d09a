"""Map with the photo and extrapolated surroundings.

Above the horizon the sky model fills what the photo does not show, dimmed and tinted by the network's coarse panorama.
Beside the photo it continues the photo's edges: trees, walls and hills. Below lies the ground's color, varied alike.
Nothing of this changes how much light there is: each half of the map keeps the irradiance of the bare map. The sun's
disc is painted last, so there is one sun.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

import lighting.envmap.detail_library as detail_library
import lighting.envmap.library_picture as library_picture
from lighting.color import LUMINANCE_WEIGHTS, check_pixels
from lighting.envmap.detail import MIN_ROWS, AddedDetail, add_detail
from lighting.envmap.latlong import EPSILON_IRRADIANCE, Image, irradiance_from_rows, multiply_cells, row_irradiance
from lighting.envmap.projection import CELL_RATIO_RANGE, PhotoProjection, PhotoScale, extrapolate_edges, project_photo
from lighting.envmap.render import add_sun, cap_map, render, render_bare, render_rows, sun_in_map
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, angle_between, latlong_directions
from lighting.prediction import Segments
from lighting.records import Lighting

_CELL_ROWS = 24  # of the cells in which the map is changed
_SAMPLES_PER_CELL = 4  # rows and columns of the bare map that are sampled for each cell
COARSE_ROWS = _CELL_ROWS * _SAMPLES_PER_CELL  # of a map that light probes are made of: more change hardly any by 1 %
FINE_SIDE = 1000  # pixels along the longer side of a photo of which a map shows more than the network takes
_PLAN_ROWS = 2048  # of the map by which a taller one is planned
_STRIP_ROWS = 256  # of a tall map that are made at once: 50 MB of 8192 rows
_CONTRAST = 0.7  # power of the network's panorama, whose contrast is too high at places that it has not learnt

_GLOW_DEG = 40.0  # around a sun within which the sky's brightness is the sun's
_MOVED_DEG = 20.0  # by which a sun was moved for its glow to have gone


@dataclass(frozen=True, eq=False)
class PhotoContext:
    """A photo and what the network predicts beside it. PhotoError for what is no photo's pixels."""

    photo: NDArray[np.uint8]
    """(h, w, 3) sRGB, upright."""
    coarse_panorama: NDArray[np.float32] | None = None
    """`EstimatedLight.surroundings`; None: bare sky and ground."""
    exposure: float | None = None
    """Of the light that both are of; one that is changed by hand brightens them, too."""
    light: Lighting | None = None
    """That light; what it makes of the surroundings stays under another sun."""
    segments: Segments | None = None
    """What the photo shows, as `photo_segments` returns it; None: unknown."""
    detail: bool = False
    """Whether the map has detail all around."""
    backdrop: str | None = None
    """The kind of place, one of BACKDROPS, that its detail is taken from; None: what suits the photo."""
    first: "PhotoContext | None" = None
    """The same with the pixels by which its detail is chosen, once for all resolutions; None: these."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "photo", check_pixels(self.photo))

    @cached_property
    def coarse(self) -> tuple[Image, Image] | None:
        """The bare map (96, 192, 3) of `light` without the disc, and the factors on its cells, to be read alone."""
        if self.light is None:
            return None
        coarse = _render_coarse(self.light, self)
        for values in coarse:
            values.setflags(write=False)
        return coarse

    @cached_property
    def own_choice(self) -> detail_library.DetailChoice:
        """What its detail is taken from, by the light that the photo shows."""
        assert self.light is not None
        return detail_library.choose_detail(describe_place(self.light, self), self.backdrop)

    def gain(self, lighting: Lighting) -> float:
        """The factor that brings photo and panorama to the exposure of a light.

        Args:
            lighting: that may have changed since.
        """
        return 1.0 if self.exposure is None else lighting.exposure / max(self.exposure, EPSILON_IRRADIANCE)

    def light_at_exposure(self, lighting: Lighting) -> Lighting:
        """A light at the exposure of the photo.

        Args:
            lighting: that may have changed since.
        """
        if self.exposure is None:
            return lighting
        from lighting.envmap.relighting import edit_lighting

        return edit_lighting(lighting, {"exposure": self.exposure})


def render_view(
    lighting: Lighting,
    height: int = 512,
    *,
    sun: bool | None = None,
    yaw: float = 0.0,
    context: PhotoContext | None = None,
    disc: bool = True,
) -> tuple[Image, Lighting]:
    """A map with or without surroundings, rotated, and the lighting rotated with it.

    Args:
        lighting: of the map before it is rotated.
        height: rows of the map, even, 16 to 4096.
        sun: whether the sun is in it; None: by `Lighting.sun_painted`.
        yaw: deg by which the map is rotated: what was at azimuth a is at a + yaw.
        context: the photo and its surroundings; None: bare sky and ground.
        disc: False leaves the sun's disc for a light of its own.
    """
    paint = render if context is None else partial(render_with_surroundings, context=context)
    image = paint(lighting, height=height, sun=sun, disc=disc)
    if not yaw:
        return image, lighting
    from lighting.envmap.relighting import rotate_lighting

    return _rotated(image, yaw), rotate_lighting(lighting, yaw)


def render_with_surroundings(
    lighting: Lighting, context: PhotoContext, height: int = 512, *, sun: bool | None = None, disc: bool = True
) -> Image:
    """Environment map (H, 2H, 3) of the lighting of a photo, with the photo and its surroundings.

    The irradiances of level ground from above and from below are those of `render`.

    Args:
        lighting: of the photo, perhaps changed since.
        context: the photo and its surroundings.
        height: rows of the map, even, 16 to 4096.
        sun: whether the sun is in it; None: by `Lighting.sun_painted`.
        disc: False leaves the sun's disc for a light of its own.
    """
    image, _ = _render_layers(lighting, context, height, sun)
    if disc and (lighting.sun_painted if sun is None else sun):
        add_sun(image, lighting)
    return image


@dataclass(frozen=True, eq=False)
class _Layers:
    """What turns any rows of the bare map into those with the surroundings, also where they are more."""

    sky_gain: Floats | None
    """Of `render_rows`."""
    cells: Image
    """(_CELL_ROWS, 2 _CELL_ROWS, 3) factors."""
    scales: tuple[PhotoScale, ...]
    """Of the photo, above and below the horizon."""
    detail: AddedDetail | None
    """Between the first photo, which is not shown, and the second. None: there is one photo."""
    detail_scales: tuple[PhotoScale, ...] = ()
    """Of the second photo."""


def _render_layers(lighting: Lighting, context: PhotoContext, height: int, sun: bool | None) -> tuple[Image, _Layers]:
    """`render_with_surroundings` without the disc, and of what it is made."""
    _check_context(context)
    image, sky_gain = render_bare(lighting, height, sun=sun)
    factors, photo = _context_factors(image, lighting, context), project_photo(lighting, context.photo, height)
    gain, targets = context.gain(lighting), _half_irradiances(image)
    detailed = context.detail and height >= MIN_ROWS
    multiply_cells(image, factors)
    scales = _lay_photo(photo, image, targets, gain, shown=not detailed)
    detail, detail_scales = None, tuple[PhotoScale, ...]()
    if detailed:
        chosen_by = context.first or context
        if chosen_by.light:
            choice = chosen_by.own_choice
        else:
            choice = detail_library.choose_detail(describe_place(lighting, context), context.backdrop)
        library = library_picture.LibraryDetail(choice, height)
        detail = add_detail(image, library, lighting, context.photo, context.segments, photo, gain)
        detail_scales = _lay_photo(photo, image, targets, gain)
    cap_map(image, lighting)
    return image, _Layers(sky_gain, factors, scales, detail, detail_scales)


def _lay_photo(
    photo: PhotoProjection, image: Image, targets: tuple[Floats, Floats], gain: float, *, shown: bool = True
) -> tuple[PhotoScale, ...]:
    """Lay a photo over a map, and return by what its halves are scaled, which then have these irradiances (3,)."""
    scales = []
    levels = row_irradiance(len(image))
    for rows, target in zip(_halves(len(image)), targets, strict=True):
        now = irradiance_from_rows(levels[rows], image[rows])
        scales.append(photo.measure(image, rows, now, target, gain, shown=shown))
        photo.lay(image[rows], rows, scales[-1], gain, shown=shown)
    return tuple(scales)


def render_strips(
    lighting: Lighting,
    height: int,
    *,
    sun: bool | None = None,
    yaw: float = 0.0,
    context: PhotoContext | None = None,
    disc: bool = True,
    plan_height: int = _PLAN_ROWS,
    strip: int = _STRIP_ROWS,
) -> Iterator[Image]:
    """Yield `render_view` of a tall map from the zenith down, a few rows (R, 2H, 3) at a time.

    What is found of a whole map, such as its irradiances, is found of one of fewer rows.

    Args:
        lighting: as there.
        height: as there.
        sun: as there.
        yaw: as there.
        context: as there.
        disc: as there.
        plan_height: rows of that map; with as many as the map's, bits are those of `render_view`.
        strip: rows that are yielded at once, a multiple of 32; the horizon should not lie among them.
    """
    layers, photo, gain, detail = None, None, 1.0, None
    if context is None:
        plan, sky_gain = render_bare(lighting, plan_height, sun=sun)
    else:
        plan, layers = _render_layers(lighting, context, plan_height, sun)
        sky_gain, gain = layers.sky_gain, context.gain(lighting)
        photo = project_photo(lighting, context.photo, height, strip)
        if layers.detail is not None:
            detail = layers.detail.taller(height)
    add_disc = None
    if disc and (lighting.sun_painted if sun is None else sun) and lighting.sun_elevation >= 0:
        add_disc = sun_in_map(plan, lighting, height)
    del plan
    for first in range(0, height, strip):
        image = np.empty((min(strip, height - first), 2 * height, 3), np.float32)
        for number, half in enumerate(_halves(height)):
            rows = slice(max(first, half.start), min(first + len(image), half.stop))
            if rows.start >= rows.stop:
                continue
            part = image[rows.start - first : rows.stop - first]
            render_rows(part, rows.start, lighting, sun=sun, gain=sky_gain)
            if layers is not None and photo is not None:
                multiply_cells(part, layers.cells, rows.start)
                photo.lay(part, rows, layers.scales[number], gain, shown=detail is None)
                if detail is not None:
                    detail.multiply(part, rows.start)
                    photo.lay(part, rows, layers.detail_scales[number], gain)
        if add_disc is not None:
            add_disc(image, first)
        yield _rotated(image, yaw)


def _rotated(image: Image, yaw: float) -> Image:
    if not yaw:
        return image
    from lighting.envmap.relighting import rotate_envmap

    return rotate_envmap(image, yaw)


def render_coarse(lighting: Lighting, context: PhotoContext, *, sun: bool | None = None) -> Image:
    """`render_with_surroundings` in 96 rows, without detail and the sun's disc: enough for a light probe.

    Args:
        lighting: of the photo, perhaps changed since.
        context: the photo and its surroundings.
        sun: whether the sun is in it; None: by `Lighting.sun_painted`.
    """
    _check_context(context)
    own = lighting == context.light and (sun is None or sun == lighting.sun_painted)
    if own and context.coarse is not None:
        bare, factors = context.coarse
    else:
        bare = render(lighting, COARSE_ROWS, sun=sun, disc=False)
        factors = _context_factors(bare, lighting, context)
    targets, image = _half_irradiances(bare), bare.copy()
    photo = project_photo(lighting, context.photo, len(bare))
    multiply_cells(image, factors)
    _lay_photo(photo, image, targets, context.gain(lighting))
    cap_map(image, lighting)
    return image


def surroundings_gain(lighting: Lighting, context: PhotoContext) -> Image:
    """Factors (24, 48, 3) on the cells of the bare map beside the photo's view, before its halves are scaled.

    With them and the photo a program that renders the bare sky itself makes the map of `render_with_surroundings`.

    Args:
        lighting: of the bare map.
        context: the photo and its surroundings.
    """
    _check_context(context)
    return _coarse_map(lighting, context)[1]


def describe_place(lighting: Lighting, context: PhotoContext) -> detail_library.PhotoFeatures:
    """By what a photo's detail is chosen: by the light that it shows, so that the detail stays under another sun.

    Args:
        lighting: of the map.
        context: the photo and its surroundings.
    """
    light = context.light or lighting
    bare, factors = _coarse_map(light, context)
    cells = _pool_cells(bare) * factors
    return detail_library.describe_photo(light, context.photo, cells, context.segments, context.coarse_panorama)


def _coarse_map(lighting: Lighting, context: PhotoContext) -> tuple[Image, Image]:
    """The bare map of a light, and the factors (_CELL_ROWS, 2 _CELL_ROWS, 3) on its cells."""
    return context.coarse if context.coarse and lighting == context.light else _render_coarse(lighting, context)


def _render_coarse(lighting: Lighting, context: PhotoContext) -> tuple[Image, Image]:
    bare = render(lighting, COARSE_ROWS, disc=False)
    return bare, _surroundings_factors(_pool_cells(bare), lighting, context)


def _check_context(thing: object) -> None:
    if not isinstance(thing, PhotoContext):
        sentence = f"A PhotoContext is needed, not {type(thing).__name__}; an Estimate has one as `context()`."
        raise ParameterError(sentence, code=ErrorCode.WRONG_TYPE)


def _context_factors(image: Image, lighting: Lighting, context: PhotoContext) -> Image:
    """Factors (_CELL_ROWS, 2 _CELL_ROWS, 3) on the cells of the bare map; what is finer stays."""
    names = "sun_azimuth", "sun_elevation", "turbidity", "sky_cover", "map_sky"  # which shape the sky
    if context.light is None or all(getattr(context.light, name) == getattr(lighting, name) for name in names):
        return _surroundings_factors(_pool_cells(image), lighting, context)
    return _move_glow(surroundings_gain(context.light, context), context.light, lighting)


def _move_glow(factors: Image, before: Lighting, now: Lighting) -> Image:
    """Factors (R, 2R, 3) for a sun that was moved: around where it was they become those of their row.

    There they say how bright the sky is near the sun, and that moves with it.
    """
    sun = before.sun_direction
    moved = 1 - math.exp(-((float(angle_between(sun, now.sun_direction)) / _MOVED_DEG) ** 2))
    sky = factors[: len(factors) // 2]
    near = np.exp(-((angle_between(latlong_directions(len(factors))[: len(sky)], sun) / _GLOW_DEG) ** 2))[..., None]
    rest = np.log(sky)
    row = ((1 - near) * rest).sum(axis=1, keepdims=True) / (1 - near).sum(axis=1, keepdims=True)
    share = moved * near
    return np.concatenate([np.asarray(np.exp((1 - share) * rest + share * row), dtype=np.float32), factors[len(sky) :]])


def _surroundings_factors(bare: Image, lighting: Lighting, context: PhotoContext) -> Image:
    """Factors (_CELL_ROWS, 2 _CELL_ROWS, 3) of panorama and photo on the cells of the bare map."""
    ratio, gain = np.ones_like(bare), context.gain(lighting)
    if context.coarse_panorama is not None:
        multiply_cells(ratio, _panorama_ratio(np.float32(gain) * context.coarse_panorama, bare))
    return np.asarray(ratio * extrapolate_edges(ratio * bare, context.photo, lighting, gain, context.segments))


def _pool_cells(image: Image) -> Image:
    """A map's cells (_CELL_ROWS, 2 _CELL_ROWS, 3), by some of their pixels."""
    rows, columns = (
        ((np.arange(count * _SAMPLES_PER_CELL) + 0.5) * pixels / (count * _SAMPLES_PER_CELL)).astype(np.intp)
        for count, pixels in zip((_CELL_ROWS, 2 * _CELL_ROWS), image.shape[:2], strict=True)
    )
    samples = image.take(rows, axis=0).take(columns, axis=1)
    bands = samples.reshape(_CELL_ROWS, _SAMPLES_PER_CELL, -1).mean(axis=1)
    parts = bands.reshape(_CELL_ROWS, 2 * _CELL_ROWS, _SAMPLES_PER_CELL, 3)
    return np.asarray(sum(parts[:, :, number] for number in range(_SAMPLES_PER_CELL)) / _SAMPLES_PER_CELL)


def _panorama_ratio(panorama: Image, bare: Image) -> Image:
    """A coarse panorama (R, 2R, 3) over the same cells of the bare map, with less contrast.

    Each half is drawn to its geometric mean, above the horizon in brightness alone.
    """
    rows, step = len(panorama), _CELL_ROWS // len(panorama)
    pooled = bare.reshape(rows, step, 2 * rows, step, 3).mean(axis=(1, 3))
    ratio = np.clip(panorama / np.maximum(pooled, np.float32(EPSILON_IRRADIANCE)), *CELL_RATIO_RANGE)
    sky, ground = np.split(np.log(ratio), 2)
    gray = np.log(ratio[: len(sky)] @ LUMINANCE_WEIGHTS)[..., None]
    sky -= np.float32(1 - _CONTRAST) * (gray - gray.mean())
    ground -= np.float32(1 - _CONTRAST) * (ground - ground.mean(axis=(0, 1)))
    return np.asarray(np.exp(np.concatenate([sky, ground])))


def _halves(height: int) -> tuple[slice, slice]:
    """The rows of a map above and below the horizon."""
    return slice(0, height // 2), slice(height // 2, height)


def _half_irradiances(image: Image) -> tuple[Floats, Floats]:
    """Irradiances (3,) of level ground from above and from below."""
    levels = np.split(row_irradiance(len(image)), 2)
    above, below = map(irradiance_from_rows, levels, np.split(image, 2))
    return above, below
