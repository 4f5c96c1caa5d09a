"""How near the estimated light comes to that of HDR panoramas, as numbers and on objects, by weather.

Beside each network stands an answer without one: the mean map of the training panoramas.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from export.crops.crops import Crop, crop_panorama, load_sources
from export.data.panoramas import DataError, Panorama, linearize, read_index
from export.evaluation.metrics import markdown_table
from export.evaluation.predictions import CROPS_EACH, load_models, protocol_views
from export.evaluation.relighting import HEIGHT, OBJECTS, object_errors, pool_map, render_object, rgb_angle
from lighting.color import luminance, tone_map
from lighting.envmap.latlong import row_irradiance, shrink_envmap
from lighting.envmap.relighting import rotate_envmap
from lighting.envmap.render import render, sky_irradiance, sun_light, with_irradiance
from lighting.envmap.surroundings import PhotoContext, render_with_surroundings
from lighting.estimator import Estimator
from lighting.fusion.estimate import apply_photo_colors, build_estimate
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.single_view import fuse
from lighting.fusion.user_input import NO_USER_INPUT
from lighting.geometry import Floats, angle_between, angles, direction, latlong_directions, latlong_solid_angle
from lighting.model import Model
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import Photo, photo_from_array
from lighting.prediction import EstimatedLight, ModelSpec
from lighting.records import Lighting

# What light is in an HDR panorama: its sun, its sky and its ground as a crop's exposure has them.

_ROWS = 256  # of the maps in which suns are split off, at least: pixels are joined whole

_SEARCH = 6.0  # deg around the label's sun in which the brightest pixel counts as the sun
_REACH = 2.5  # deg around that pixel over which the sun's light is summed: lenses spread it
_RING = (3.0, 6.0)  # deg around it whose median is the sky before the sun


@dataclass(frozen=True, eq=False)
class TrueLight:
    """The light of one crop; maps have HEIGHT rows and the crop's azimuth 0 in the middle."""

    image: Floats  # (HEIGHT, 2 HEIGHT, 3)
    sun_direction: Floats | None  # (3,), None without direct sun
    sun_irradiance: Floats  # (3,) of a surface that faces the sun; 0 without direct sun
    sky_irradiance: Floats  # (3,) of a level surface from above, without the sun
    ground: Floats  # (3,) radiance, the mean that a level surface facing down receives


@dataclass(frozen=True, eq=False)
class SplitPanorama:
    """A panorama at _ROWS rows or a few more with its sun split off, in the panorama's frame and units."""

    image: Floats  # (R, 2R, 3)
    sunless: Floats
    sun_azimuth: float  # deg, NaN without direct sun
    sun_elevation: float
    sun_irradiance: Floats  # (3,)


def split_sun(image: NDArray[np.float32], near: Floats | None) -> SplitPanorama:
    """A panorama with its sun split off.

    Args:
        image: (H, 2H, 3) linear.
        near: (3,) direction near which the sun is; None where no direct light reaches the camera.
    """
    small = shrink_envmap(image, len(image) // max(1, len(image) // _ROWS))
    if near is None:
        return SplitPanorama(small, small, math.nan, math.nan, np.zeros(3))
    rays = latlong_directions(len(small))
    bright = np.where(angle_between(rays, near) < _SEARCH, luminance(small), -1.0)
    sun = rays[np.unravel_index(int(np.argmax(bright)), bright.shape)]
    away = angle_between(rays, sun)
    ring = (away > _RING[0]) & (away < _RING[1]) & (rays[..., 1] > 0)
    disc = (away <= _REACH) & (rays[..., 1] > 0)
    beside = np.median(small[ring], axis=0)
    weight = np.broadcast_to(latlong_solid_angle(len(small))[:, None], disc.shape)[disc]
    power = weight @ np.maximum(small[disc] - beside, 0.0)
    sunless = np.array(small)
    sunless[disc] = np.minimum(sunless[disc], beside)  # the sky beside the sun
    azimuth, elevation = (float(angle) for angle in angles(sun))
    return SplitPanorama(small, sunless, azimuth, elevation, power)


def true_light(panorama: SplitPanorama, azimuth: float, gain: float) -> TrueLight:
    """The light of a camera in a panorama.

    Args:
        panorama: of `split_sun`.
        azimuth: deg of the panorama to which the camera looks.
        gain: factor of the camera's exposure.
    """
    image, sunless = (rotate_envmap(m.astype(np.float32), -azimuth) * gain for m in (panorama.image, panorama.sunless))
    sun = direction(panorama.sun_azimuth - azimuth, panorama.sun_elevation)
    above, below = _level_irradiances(sunless)
    visible_sun = sun if math.isfinite(sun[0]) else None
    return TrueLight(pool_map(image), visible_sun, panorama.sun_irradiance * gain, above, below / math.pi)


def _level_irradiances(image: Floats) -> tuple[Floats, Floats]:
    """Irradiance (3,) of level surfaces that face up and down.

    Args:
        image: (H, 2H, 3) linear, row 0 is the zenith.
    """
    rows = row_irradiance(len(image))[:, None] * image.mean(axis=1, dtype=np.float64)
    half = len(image) // 2
    return np.asarray(rows[:half].sum(axis=0)), np.asarray(rows[half:].sum(axis=0))


def mean_light_map(lights: Sequence[TrueLight]) -> Floats:
    """The mean of maps over panoramas and over azimuth (HEIGHT, 2 HEIGHT, 3).

    Args:
        lights: at least one.
    """
    mean = np.mean([light.image.mean(axis=1, keepdims=True) for light in lights], axis=0)
    return np.asarray(mean.repeat(2 * HEIGHT, axis=1))


# What the networks and other methods say of it.

WEATHER = {("visible", "yes"): "sunny", ("unknown", "no"): "overcast", ("none", "no"): "overcast"}  # by sun, direct
MIN_SUN_SHARE = 0.1  # of the sky's level irradiance, from which a sun counts as painted
_NOTE = (
    "Medians over crops, true light of the panorama in the crop's exposure. Bias and size of errors in stops, colors "
    "as angles between RGB vectors in degrees. Balls and plane: RMSE and RMSE after the best scale by the truth's "
    "root mean square, and RGB angle. A sun counts as painted where it gives level ground over a tenth of what the sky "
    "gives."
)


@dataclass(frozen=True, eq=False)
class _Guess:
    """What one method says of the light of all crops."""

    maps: Floats  # (N, HEIGHT, 2 HEIGHT, 3)
    lights: tuple[Lighting, ...] = ()  # with irradiances; none of methods that only make a map


@dataclass(frozen=True, eq=False)
class LitCrop:
    """A crop that is judged, and its true light."""

    panorama: Panorama
    crop: Crop
    truth: TrueLight

    @property
    def weather(self) -> str:
        """Of WEATHER, "sunny" or "overcast"."""
        return WEATHER[self.panorama.sun, self.panorama.direct]


def take_hdr_crops(
    data: Path, labels: Path, spec: ModelSpec, part: str = "val", each: int = CROPS_EACH
) -> list[LitCrop]:
    """Paper-protocol crops of the HDR panoramas of WEATHER; their suns may be clipped.

    Args:
        data: folder of panoramas.
        labels: CSV file of labels.
        spec: of the network that is to see the crops.
        part: "train" or "val".
        each: crops of a panorama, up to CROPS_EACH.

    Raises:
        DataError: if there are none.
    """
    panoramas = [p for p in read_index(data, part) if p.kind == "hdr" and (p.sun, p.direct) in WEATHER]
    if not panoramas:
        raise DataError(f"{data} has no HDR panorama in `{part}` that is sunny or overcast.")
    return take_crops_of(panoramas, labels, spec, each)


def take_crops_of(
    panoramas: Sequence[Panorama], labels: Path, spec: ModelSpec, each: int = CROPS_EACH
) -> list[LitCrop]:
    """Paper-protocol crops of panoramas of WEATHER; what is clipped in one is clipped in its light.

    Args:
        panoramas: HDR or 8-bit.
        labels: CSV file of labels.
        spec: of the network that is to see the crops.
        each: crops of a panorama, up to CROPS_EACH.
    """
    crops = []
    for source in load_sources(panoramas, labels):
        panorama, label = source.panorama, source.label
        is_sunny = WEATHER[panorama.sun, panorama.direct] == "sunny"
        sun = direction(label.sun_azimuth, label.sun_elevation) if is_sunny else None
        split = split_sun(linearize(panorama, source.levels[0]), sun)
        for _, camera in protocol_views([source], "paper")[:each]:
            crop = crop_panorama(source, camera, spec)
            crops.append(LitCrop(panorama, crop, true_light(split, camera.azimuth, crop.gain)))
    return crops


def estimate_crop(model: Model, crop: Crop) -> tuple[EstimatedLight, PhotoContext]:
    """What a network estimates of a crop by its pixels alone, by the path that users take.

    Args:
        model: the network.
        crop: the picture.
    """
    photo = photo_from_array(tone_map(crop.linear))
    (estimate,) = apply_photo_colors([photo], [estimate_from_pixels(model, photo)])
    return estimate, PhotoContext(photo.pixels, estimate.surroundings)


def estimate_from_pixels(model: Model, photo: Photo) -> EstimatedLight:
    """What a network estimates of a crop, before the colors that it shows are looked at.

    Args:
        model: the network.
        photo: the crop.
    """
    nothing = observations_from_metadata(PhotoMetadata(), NO_USER_INPUT)
    return build_estimate(fuse(Estimator(model).predict(photo), nothing.observations), nothing)


def _guesses(name: str, model: Model, crops: Sequence[LitCrop]) -> dict[str, _Guess]:
    """A network's bare sky, and the same with the place."""
    answers = [estimate_crop(model, one.crop) for one in crops]
    lights = tuple(with_irradiance(estimate.lighting) for estimate, _ in answers)
    bare = np.stack([render(estimate.lighting, HEIGHT) for estimate, _ in answers])
    full = np.stack([render_with_surroundings(e.lighting, context, HEIGHT) for e, context in answers])
    return {name: _Guess(bare, lights), f"{name}, surroundings": _Guess(full, lights)}


def light_report(data: Path, labels: Path, paths: Sequence[Path]) -> str:
    """Tables in Markdown of networks and baselines, for sunny and overcast panoramas.

    Args:
        data: folder of panoramas.
        labels: CSV file of labels.
        paths: of the networks, ours first.
    """
    models = load_models(paths)
    spec = next(iter(models.values())).spec
    crops = take_hdr_crops(data, labels, spec)
    mean = mean_light_map([one.truth for one in take_hdr_crops(data, labels, spec, "train", each=1)])
    kinds = {kind: [one for one in crops if one.weather == kind] for kind in ("sunny", "overcast")}
    return "\n\n".join(_section(kind, chosen, models, mean) for kind, chosen in kinds.items() if chosen)


def _section(kind: str, crops: Sequence[LitCrop], models: dict[str, Model], mean: Floats) -> str:
    """The tables of crops of one weather."""
    truth = [one.truth for one in crops]
    methods: dict[str, _Guess] = {}
    for name, model in models.items():
        methods |= _guesses(name, model, crops)
    methods["mean map"] = _Guess(np.stack([mean] * len(crops)))
    count = len({one.panorama.name for one in crops})
    title = f"## Light: {len(crops)} crops of {count} {kind} HDR panoramas"
    return "\n\n".join([title, _NOTE, _strengths_table(truth, methods), _objects_table(truth, methods)])


def _strengths_table(truth: Sequence[TrueLight], methods: dict[str, _Guess]) -> str:
    """Irradiance, ratio of sun to sky, and ground of each method."""
    header = ["", "level irradiance", "size", "sky", "sun", "sun / sky", "sun painted", "ground", "size", "colour"]
    rows = []
    for name, guess in methods.items():
        up, down = zip(*(_level_irradiances(image) for image in guess.maps), strict=True)
        level = _stops(up, [_level_irradiances(t.image)[0] for t in truth])
        ground = _stops(down, [np.pi * t.ground for t in truth])
        tint = rgb_angle(np.array(down), np.array([t.ground for t in truth]))
        level_cells, ground_cells = (
            [f"{np.median(bias):+.2f}", f"{np.median(np.abs(bias)):.2f}"] for bias in (level, ground)
        )
        rows.append([name, *level_cells, *_parts(truth, guess), *ground_cells, f"{np.median(tint):.1f}"])
    return markdown_table(header, rows)


def _parts(truth: Sequence[TrueLight], guess: _Guess) -> list[str]:
    """Bias of sky, sun and their ratio, and the share of painted suns; "-" where a method or the truth has none."""
    if not guess.lights:
        return ["-"] * 4
    sky, sun = [sky_irradiance(li) for li in guess.lights], [sun_light(li)[0] for li in guess.lights]
    up = np.array([max(float(li.sun_direction[1]), 0.0) for li in guess.lights])
    painted = luminance(np.array(sun)) * up > MIN_SUN_SHARE * luminance(np.array(sky))
    above = _stops(sky, [t.sky_irradiance for t in truth])
    cells = ["-", "-"]
    if all(t.sun_direction is not None for t in truth):
        power = _stops(sun, [t.sun_irradiance for t in truth])
        cells = [f"{np.median(power):+.2f}", f"{np.median(power - above):+.2f}"]
    return [f"{np.median(above):+.2f}", *cells, f"{100 * painted.mean():.0f} %"]


def _stops(estimates: Sequence[Floats], truth: Sequence[Floats]) -> Floats:
    """Errors of luminance (N,) in stops."""
    ratio = np.maximum(luminance(np.array(estimates)), 1e-6) / np.maximum(luminance(np.array(truth)), 1e-6)
    return np.asarray(np.log2(ratio))


def _objects_table(truth: Sequence[TrueLight], methods: dict[str, _Guess]) -> str:
    """Errors of each method on each object."""
    header = ["", *(column for kind in OBJECTS for column in (f"{kind}: RMSE", "scaled", "angle"))]
    lit = np.stack([t.image for t in truth])
    true = {kind: render_object(kind, lit) for kind in OBJECTS}
    rows = {name: [name] for name in methods}
    for (name, guess), kind in product(methods.items(), OBJECTS):
        rmse, scaled, angle = np.median(object_errors(true[kind], render_object(kind, guess.maps)), axis=0)
        rows[name] += [f"{rmse:.2f}", f"{scaled:.2f}", f"{angle:.1f}"]
    return markdown_table(header, list(rows.values()))
