"""The constants of light that are fitted to data: ground and sky of a photo, color and power of the sun.

FIT_REPORTS names them. Each fit prints the constants, and the errors with and without them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from export.crops.augmentation import augment
from export.crops.crops import crop_panorama, crop_rng, load_sources, paper_camera, training_camera
from export.crops.photos import require_photo_rows
from export.crops.targets import clear_sun_to_sky_ratio, panorama_irradiance
from export.data.panoramas import DataError, read_index, read_table
from export.evaluation.irradiance import (
    WEATHER,
    LitCrop,
    estimate_crop,
    estimate_from_pixels,
    take_crops_of,
    take_hdr_crops,
)
from export.evaluation.metrics import (
    Bools,
    Names,
    answers_from_estimates,
    clustered_error,
    markdown_table,
    select_crops,
)
from lighting.color import luminance, tone_map
from lighting.decoding import blend_to_clear_sun, lighting_from_prediction, sun_from_prediction
from lighting.envmap.appearance import PhotoSamples, estimate_ground_albedo, ground_luminance, sky_color_ratio
from lighting.envmap.render import level_irradiance
from lighting.errors import ModelError
from lighting.estimator import Estimator
from lighting.fusion.estimate import photo_temperature
from lighting.geometry import Floats, angle_between, direction
from lighting.model import Model
from lighting.photo.reader import Photo, photo_from_array, read_photo
from lighting.sun_grid import smooth_density, temper

_SPLITS = ("train", "val")
_GROUND_SHARES = np.linspace(0.0, 1.0, 11)  # of the network's ground under a clear sky, tried
_GROUND_STOPS = np.linspace(0.0, 0.6, 7)  # stops by which it is too dark, tried
_MIN_LUMINANCE = 1e-6
_SKY_CAMERAS = (paper_camera, training_camera) * 2  # of each panorama's crops
_COVERS = ((0.0, 0.2), (0.2, 0.6), (0.6, 1.01))  # ranges of cover, 0 clear to 1 overcast, told apart
SUN_POWERS = (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8)  # of the clear sun's color, tried
_MIN_ELEVATION = 1.0  # deg, of the sun, under which a clear sky says little of its power
_ITERATIONS = 20  # of least squares, weighted so that it comes near to least absolute errors
_L1_SCALE = 0.1  # nat, error from which a crop counts for less
_NO_LIGHT = "The network states no light."


# The ground: how far the network's ground all around tells its brightness better than the photo's own pixels do.
# Panoramas tell all the ground. A network knows the places that it learnt from, so another one has to be asked.


@dataclass(frozen=True, eq=False)
class GroundSamples:
    """Log2 of the ground's luminance in crops that show ground."""

    photo: Floats  # (N,) by the photo's pixels
    network: Floats  # (N,) by the network's coarse panorama
    true: Floats  # (N,) of all the ground that the panorama shows
    cover: Floats  # (N,) of the sky, 0 clear to 1 overcast, by the network
    weather: Names  # (N,)
    place: Names  # (N,)

    def errors(self, share: float, darker: float) -> Floats:
        """Sizes (N,) of the errors [stops] where the network's ground counts for that share, less under cloud.

        Args:
            share: of the network's ground under a clear sky, 0 to 1.
            darker: stops by which it is too dark.
        """
        crop_share = share * (1 - self.cover)
        return np.abs(self.photo + crop_share * (self.network + darker - self.photo) - self.true)


def _sample_grounds(model: Model, data: Path, labels: Path, part: str, seen: Path | None = None) -> GroundSamples:
    """The grounds of a split's panoramas of WEATHER. Places of the folder `seen` are left out.

    DataError where there are none or their crops show no ground, ModelError if the network states no light.
    """
    seen_places = {panorama.place for panorama in read_index(seen)} if seen else set()
    panoramas = [p for p in read_index(data, part) if (p.sun, p.direct) in WEATHER and p.place not in seen_places]
    values: list[tuple[float, ...]] = []
    kinds: list[tuple[str, str]] = []
    for one in take_crops_of(panoramas, labels, model.spec):
        estimate, place = estimate_crop(model, one.crop)
        light, ground = estimate.lighting, float(luminance(one.truth.ground))
        if light.sky_irradiance is None:
            raise ModelError(_NO_LIGHT)
        reflectance = estimate_ground_albedo(PhotoSamples.of_photo(place.photo, light), light)
        if reflectance is None or place.coarse_panorama is None:
            continue
        radiance = float(luminance(reflectance * level_irradiance(light))) / np.pi
        levels = radiance, ground_luminance(place.coarse_panorama), max(ground, _MIN_LUMINANCE)
        values.append((*np.log2(levels), light.sky_cover or 0.0))
        kinds.append((one.weather, one.panorama.place))
    if not values:
        raise DataError(f"No crop of the panoramas of {part} that are sunny or overcast shows ground.")
    return GroundSamples(*np.array(values).T, *np.array(kinds).T)


def fit_ground_share(grounds: GroundSamples) -> tuple[float, float]:
    """The smallest share, with its stops, within one standard error of the best.

    The same crops judge both, so the error is that of the mean difference. It is over places, since crops of one place
    are not independent.

    Args:
        grounds: those to fit to.
    """
    errors = np.array([[grounds.errors(share, darker) for darker in _GROUND_STOPS] for share in _GROUND_SHARES])
    darker = errors.mean(axis=-1).argmin(axis=1)  # the best stops of each share
    at_best = errors[np.arange(len(_GROUND_SHARES)), darker]
    best = at_best[at_best.mean(axis=1).argmin()]
    good = (at_best - best).mean(axis=1) <= [clustered_error(row - best, grounds.place) for row in at_best]
    share = int(np.flatnonzero(good)[0])
    return float(_GROUND_SHARES[share]), float(_GROUND_STOPS[darker[share]])


def _report_ground(model: Model, data: Path, labels: Path, seen: Path | None = None) -> str:
    """The fit on places of `train`, both weathers alike, and errors in both splits."""
    parts = {part: _sample_grounds(model, data, labels, part, seen if part == "train" else None) for part in _SPLITS}
    share, darker = fit_ground_share(_balanced(parts["train"]))
    rows = []
    for part, grounds in parts.items():
        groups = {str(weather): grounds.weather == weather for weather in np.unique(grounds.weather)}
        rows += _error_rows(part, groups, grounds.errors(0.0, 0.0), grounds.errors(share, darker), (2, 2))
    names = ["photo, median [stops]", "with the network", "photo, mean", "with the network"]
    first = f"Share of the network: {share:.1f} x (1 - cover), {darker:.1f} stops brighter"
    return f"{first}\n\n{markdown_table(['split', 'weather', 'crops', *names], rows)}"


def _balanced(grounds: GroundSamples) -> GroundSamples:
    """The same with the rarer weather repeated, so that both count alike."""
    kinds, counts = np.unique(grounds.weather, return_counts=True)
    members = [np.flatnonzero(grounds.weather == kind) for kind in kinds]
    return select_crops(grounds, np.concatenate([np.resize(indices, int(counts.max())) for indices in members]))


# The sky's color: how far that of the sky in a photo may be trusted for the whole sky.


@dataclass(frozen=True, eq=False)
class SkySamples:
    """Crops whose sky's power is known, in the colors of many cameras."""

    ratio: Floats  # (N, 3) of the sky in the picture to the map, green 1; NaN where none is seen
    cover: Floats  # (N,)
    predicted: Floats  # (N, 3) the sky's irradiance by the network
    true: Floats  # (N, 3)

    @property
    def with_sky(self) -> "SkySamples":
        """Those whose picture shows sky."""
        return select_crops(self, np.isfinite(self.ratio[:, 0]))

    def errors(self, trust: Floats) -> Floats:
        """Angle [deg] (N,) between the sky's colors, said and true, with that trust in the picture.

        Args:
            trust: (2,) that of `fit_sky_trust`.
        """
        corrected = self.predicted * self.ratio ** (trust[0] + trust[1] * self.cover**2)[:, None]
        return angle_between(corrected, self.true)


def _sample_skies(model: Model, data: Path, labels: Path, part: str) -> SkySamples:
    """Crops of all panoramas of a split that tell the power of their sky, by the pixels alone.

    DataError if there is none, ModelError if the network states no light.
    """
    rows = []
    for source in load_sources(read_index(data, part), labels):
        true = panorama_irradiance(source).sky
        if not np.isfinite(true).all():
            continue
        for number, camera in enumerate(_SKY_CAMERAS):
            rng = crop_rng(source.panorama.name, number, "colour of the sky")  # a seed, which figures depend on
            crop = crop_panorama(source, camera(rng), model.spec)
            pixels, gains, _ = augment(crop, rng)
            height, width = pixels.shape[:2]
            light = estimate_from_pixels(model, Photo(pixels, width, height, "PIXELS")).lighting
            if light.sky_irradiance is None:
                raise ModelError(_NO_LIGHT)
            ratio = sky_color_ratio(PhotoSamples.of_photo(pixels, light), light)
            seen = np.full(3, np.nan) if ratio is None else ratio
            rows.append((seen, light.sky_cover or 0.0, np.array(light.sky_irradiance), true * gains * crop.gain))
    if not rows:
        raise DataError(f"No panorama of {data} in `{part}` tells the power of its sky.")
    return SkySamples(*(np.array(column, dtype=np.float64) for column in zip(*rows, strict=True)))


def fit_sky_trust(skies: SkySamples) -> Floats:
    """The power (2,) of the ratio under a clear sky, and what squared cover adds.

    Args:
        skies: crops that all show sky.
    """
    logs = [np.log(np.maximum(values, 1e-9)) for values in (skies.ratio, skies.true / skies.predicted)]
    shift, target = (log[:, ::2] - log[:, 1:2] for log in logs)  # of red and blue over green
    terms = (np.stack([np.ones_like(skies.cover), skies.cover**2], axis=1)[:, None] * shift[..., None]).reshape(-1, 2)
    weight = np.ones(len(terms))
    for _ in range(_ITERATIONS):
        root = np.sqrt(weight)
        trust = np.linalg.lstsq(terms * root[:, None], target.ravel() * root, rcond=None)[0]
        weight = 1 / np.maximum(np.abs(target.ravel() - terms @ trust), _L1_SCALE)
    return np.asarray(trust)


def _report_sky_color(model: Model, data: Path, labels: Path) -> str:
    """The fit on `train`, and errors of color in both splits, by cover."""
    parts = {part: _sample_skies(model, data, labels, part) for part in _SPLITS}
    trust = fit_sky_trust(parts["train"].with_sky)
    rows = []
    for part, skies in parts.items():
        visible = skies.with_sky
        cover = visible.cover
        groups = {f"{low:g} to {min(high, 1):g}": (cover >= low) & (cover < high) for low, high in _COVERS}
        before, after = (visible.errors(t) for t in (np.zeros(2), trust))
        rows += _error_rows(part, groups, before, after, (1, 2))
    shown, count = (sum(len(s.cover) for s in of) for of in ([s.with_sky for s in parts.values()], parts.values()))
    names = ["network, median [deg]", "with the photo", "network, mean", "with the photo"]
    first = f"Power of the ratio: {trust[0]:.2f} + {trust[1]:.2f} cover^2"
    share = f"sky is seen in {100 * (shown / count):.0f} % of the crops."
    return f"{first}; {share}\n\n{markdown_table(['split', 'cover', 'crops', *names], rows)}"


# The sun's color: how far it goes to that of a clear sky's sun at the same height. Most panoramas clip the sun; its
# target is then their sky's times a clear sky's ratio. In 8-bit pictures, whose sky is too blue, such a sun has too
# little red. The sunny HDR panoramas say how its color is: the network saw those of `train`, not those of `val`.
# Some clip the sun as well, so the errors on `train` stand once more without these; few notes of `val` say it.


@dataclass(frozen=True)
class SunSample:
    """A sun as it is and as the network states it, in one crop."""

    place: str
    true: Floats  # (3,) irradiance of a surface that faces it
    predicted: Floats  # (3,) the same by the network
    true_level: Floats  # (3,) irradiance of level ground by sun and sky
    predicted_sky: Floats  # (3,) that of level ground by the sky alone, by the network
    elevation: float  # deg, by the pixels
    unclipped: bool  # whether the panorama's notes say so of it


def _sample_suns(model: Model, crops: Sequence[LitCrop]) -> list[SunSample]:
    """The suns of sunny crops, where the network sees that they shine; raises ModelError if it states none."""
    samples = []
    for one in crops:
        truth = one.truth
        if truth.sun_direction is None:
            continue
        light = lighting_from_prediction(Estimator(model).predict(photo_from_array(tone_map(one.crop.linear))))
        if light.sun_irradiance is None or light.sky_irradiance is None:
            raise ModelError(_NO_LIGHT)
        level = truth.sun_irradiance * truth.sun_direction[1] + truth.sky_irradiance
        sun, sky = np.array(light.sun_irradiance), np.array(light.sky_irradiance)
        if light.sun_shines:
            place, unclipped = one.panorama.place, one.panorama.sun_is_unclipped
            samples.append(SunSample(place, truth.sun_irradiance, sun, level, sky, light.sun_elevation, unclipped))
    if not samples:
        raise ModelError("The network sees the sun shine in no crop of a sunny HDR panorama.")
    return samples


def sun_color_errors(suns: Sequence[SunSample], power: float) -> Floats:
    """Angles (2,) between colors [deg], of sun and level ground. Means of the places' medians.

    Args:
        suns: one at least.
        power: of the clear sun's color, 0 to 1.
    """
    places: dict[str, list[Floats]] = {}
    for sun in suns:
        color = blend_to_clear_sun(sun.predicted, sun.elevation, power)
        level = color * np.sin(np.radians(sun.elevation)) + sun.predicted_sky
        both = angle_between(color, sun.true), angle_between(level, sun.true_level)
        places.setdefault(sun.place, []).append(np.array(both, dtype=np.float64))
    return np.asarray(np.mean([np.median(errors, axis=0) for errors in places.values()], axis=0))


def _report_sun_color(model: Model, data: Path, labels: Path) -> str:
    """The errors of color by power, on `train` and on `val`."""
    train, val = (_sample_suns(model, take_hdr_crops(data, labels, model.spec, part)) for part in _SPLITS)
    unclipped = [sun for sun in train if sun.unclipped]
    parts = {"train": train, **({"train, unclipped": unclipped} if unclipped else {}), "val": val}
    rows = []
    for power in SUN_POWERS:
        pairs = (sun_color_errors(suns, power) for suns in parts.values())
        rows.append([f"{power:g}", *(f"{sun:.1f}° / {level:.1f}°" for sun, level in pairs)])
    counts = ", ".join(f"{len(suns)} crops of `{part}`" for part, suns in parts.items())
    header = ["power", *(f"{part}: sun / level light" for part in parts)]
    return f"Error of color in {counts}, the mean of places\n\n{markdown_table(header, rows)}"


# The sun's power: how far the network understates a sun that shines. A network that minimises errors keeps to the
# middle: of a sun that surely shines it still says a little less than such suns give. Of the ordinary photos of `train`
# it learnt the direction alone, so what it says of the power of the sun in those taken in direct sunlight is compared
# with the suns of the unclipped HDR panoramas, by the ratio of sun to sky over that of a clear sky with a sun as high.


def stops_over_clear(sun: Sequence[Floats], sky: Sequence[Floats], elevation: Sequence[float]) -> Floats:
    """Stops (N,) of suns over skies, above those of clear skies.

    Of a clear sky it is the luminance of the channels' ratios. It must only be the same for all.

    Args:
        sun: N irradiances (3,).
        sky: N irradiances (3,).
        elevation: N, deg, of the suns.
    """
    ratio = luminance(np.array(sun)) / luminance(np.array(sky))
    clear = luminance(np.array([clear_sun_to_sky_ratio(round(e)) for e in elevation]))
    return np.asarray(np.log2(ratio / clear))


def _panorama_sun_stops(data: Path, labels: Path) -> Floats:
    """What the sunny HDR panoramas of `train` with an unclipped sun have over a clear sky [stops]."""
    panoramas = [p for p in read_index(data, "train") if p.kind == "hdr" and p.direct == "yes"]
    sources = load_sources([p for p in panoramas if p.sun_is_unclipped], labels)
    if not sources:
        raise DataError(f"{data} has no sunny HDR panorama in `train` whose sun is unclipped.")
    lights = [panorama_irradiance(source) for source in sources]
    elevations = [source.label.sun_elevation for source in sources]
    return stops_over_clear([light.sun for light in lights], [light.sky for light in lights], elevations)


def _photo_sun_stops(model: Model, data: Path) -> Floats:
    """What the network says of the photos of `train` in direct sun, over a clear sky [stops]."""
    rows = [r for r in require_photo_rows(data) if r.direct == "yes" and r.sun_elevation >= _MIN_ELEVATION]
    lights = [(Estimator(model).predict(read_photo(row.path)).light, row.sun_elevation) for row in rows]
    stated = [(light.sun_irradiance, light.sky_irradiance, height) for light, height in lights if light is not None]
    if not stated:
        raise DataError(f"No photo of {data} was taken in direct sun, or the network says nothing of the light.")
    return stops_over_clear(*zip(*stated, strict=True))


def _report_sun_power(model: Model, data: Path, labels: Path) -> str:
    """The stops that are missing, and quartiles of both sides."""
    stops = _panorama_sun_stops(data, labels), _photo_sun_stops(model, data)
    true, predicted = (float(np.median(values)) for values in stops)
    header = ["`train`, in direct sun", "number", "sun / sky over a clear sky, median [stops]", "quartiles"]
    rows = []
    for name, values in zip(("HDR panoramas, unclipped sun", "photos, as said"), stops, strict=True):
        low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
        rows.append([name, str(len(values)), f"{middle:+.2f}", f"{low:+.2f} to {high:+.2f}"])
    return f"A sun that shines is understated by {true - predicted:.2f} stops\n\n{markdown_table(header, rows)}"


# How much wider the sun's distribution is in photos than in crops of panoramas, by the photos of `photos.csv`. The
# network was calibrated on crops, and saw photos of `train`.

HIDDEN_TEMPERATURES = (1.0, 1.5, 2.0, 2.5, 3.0)  # where no direct sun shows, tried
_SUN_COLUMNS = "sun_azimuth", "sun_elevation"


def _report_photo_radii(model: Model, data: Path, _labels: Path) -> str:
    """Loss of the true sun, and shares in the radii, by temperature: of all photos, and of those without direct sun."""
    rows = [row for row in read_table(data / "photos.csv", ("file", *_SUN_COLUMNS)) if all(map(row.get, _SUN_COLUMNS))]
    if not rows:
        raise DataError(f"{data}/photos.csv has no photo whose sun is known.")
    azimuth, elevation = (np.array([float(row[name]) for row in rows]) for name in _SUN_COLUMNS)
    truth = direction(azimuth, np.maximum(elevation, 0.0))
    predictions = [model.predict_one(read_photo(data / row["file"])) for row in rows]
    hidden = np.array([not lighting_from_prediction(p).sun_shines for p in predictions])
    groups = {"all": np.ones_like(hidden), "no direct sun": hidden}
    table = []
    for temperature in HIDDEN_TEMPERATURES:
        wide = [
            replace(p, sun_probability=temper(p.sun_probability, photo_temperature(p.sun_visibility, temperature)))
            for p in predictions
        ]
        answers = answers_from_estimates([sun_from_prediction(p) for p in wide])
        density = [smooth_density(p.sun_probability, t, p.spec.sun_grid) for p, t in zip(wide, truth, strict=True)]
        loss, error = -np.log(density), angle_between(answers.sun, truth)
        inside = np.stack([error <= answers.radius_50, error <= answers.radius_90], axis=1)
        for name, chosen in groups.items():
            if chosen.any():
                shares = (f"{100 * share:.0f} %" for share in inside[chosen].mean(axis=0))
                table.append([f"{temperature:g}", name, str(chosen.sum()), f"{loss[chosen].mean():.3f}", *shares])
    return markdown_table(["temperature", "photos", "number", "loss [nat]", "in `radius_50`", "in `radius_90`"], table)


FIT_REPORTS: dict[str, Callable[..., str]] = {  # of a network, `data` and `labels`; the ground's also of `seen`
    "ground": _report_ground,
    "photo-radii": _report_photo_radii,
    "sky-color": _report_sky_color,
    "sun-color": _report_sun_color,
    "sun-power": _report_sun_power,
}


def _error_rows(
    part: str, groups: dict[str, Bools], before: Floats, after: Floats, digits: tuple[int, int]
) -> list[list[str]]:
    """A row a group that is not empty: its size, medians before and after, means before and after."""
    rows = []
    for name, chosen in groups.items():
        if chosen.any():
            medians = [f"{np.median(error[chosen]):.{digits[0]}f}" for error in (before, after)]
            means = [f"{error[chosen].mean():.{digits[1]}f}" for error in (before, after)]
            rows.append([part, name, str(chosen.sum()), *medians, *means])
    return rows
