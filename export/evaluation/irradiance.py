"""How near the estimated light comes to that of HDR panoramas, as numbers and on objects, by weather.

Beside each network stand answers without one: the mean map of the training panoramas, the photo mirrored around, and
oracles. Oracles are our own answer with parts of the truth put in.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from export.crops.crops import Crop, Source, crop_panorama, load_sources
from export.data.panoramas import DataError, Panorama, linearize, read_index
from export.evaluation import hdr_truth
from export.evaluation.metrics import Names, markdown_table
from export.evaluation.predictions import CROPS_EACH, View, load_models, protocol_views
from export.evaluation.relighting import OBJECTS, object_errors, render_object, rgb_angle
from lighting.color import luminance, tone_map
from lighting.envmap.render import level_irradiance, render, sky_irradiance, sun_irradiance, with_irradiance
from lighting.envmap.surroundings import PhotoContext, render_with_surroundings
from lighting.estimator import apply_photo_colors
from lighting.fields import clip_color
from lighting.fusion.estimate import build_estimate, predict_photo
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.single_view import fuse
from lighting.fusion.user_input import NO_USER_INPUT
from lighting.geometry import Floats, angles, direction
from lighting.model import Model
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import Photo, photo_from_array
from lighting.records import EstimatedLight, Lighting, ModelSpec

WEATHER = {("visible", "yes"): "sunny", ("unknown", "no"): "overcast", ("none", "no"): "overcast"}  # by sun, direct
MIN_SUN_SHARE = 0.1  # of the sky's level irradiance, from which a sun counts as painted
NOTE = (
    "Medians over crops, true light of the panorama in the crop's exposure. Bias and size of errors in stops, colours "
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
class HdrCrops:
    """The crops that are judged and the light of each."""

    views: tuple[View, ...]
    crops: tuple[Crop, ...]
    truth: tuple[hdr_truth.TrueLight, ...]
    weather: Names  # (N,) "sunny" or "overcast"

    @property
    def panoramas(self) -> Names:
        """(N,) of each crop."""
        return np.array([source.panorama.name for source, _ in self.views])


def take_hdr_crops(data: Path, labels: Path, spec: ModelSpec, part: str = "val", each: int = CROPS_EACH) -> HdrCrops:
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


def take_crops_of(panoramas: Sequence[Panorama], labels: Path, spec: ModelSpec, each: int = CROPS_EACH) -> HdrCrops:
    """Paper-protocol crops of panoramas of WEATHER; what is clipped in one is clipped in its light.

    Args:
        panoramas: HDR or 8-bit.
        labels: CSV file of labels.
        spec: of the network that is to see the crops.
        each: crops of a panorama, up to CROPS_EACH.
    """
    sources = load_sources(panoramas, labels)
    split = {s.panorama.name: hdr_truth.split_sun(linearize(s.panorama, s.levels[0]), _sun_of(s)) for s in sources}
    views = [view for i, view in enumerate(protocol_views(sources, "paper")) if i % CROPS_EACH < each]
    crops = [crop_panorama(source, camera, spec) for source, camera in views]
    taken = [(split[s.panorama.name], camera.azimuth, c.gain) for (s, camera), c in zip(views, crops, strict=True)]
    truth = [hdr_truth.true_light(*one) for one in taken]
    kind = np.array([WEATHER[source.panorama.sun, source.panorama.direct] for source, _ in views])
    return HdrCrops(tuple(views), tuple(crops), tuple(truth), kind)


def _sun_of(source: Source) -> Floats | None:
    """Where the label has the sun of a sunny panorama."""
    if WEATHER[source.panorama.sun, source.panorama.direct] != "sunny":
        return None
    return direction(source.label.sun_azimuth, source.label.sun_elevation)


def estimate_crops(model: Model, crops: Sequence[Crop]) -> list[tuple[EstimatedLight, PhotoContext]]:
    """What a network estimates of each crop by its pixels alone, by the path that users take.

    Args:
        model: the network.
        crops: N pictures.
    """
    estimates = []
    for crop in crops:
        photo = photo_from_array(tone_map(crop.linear))
        (estimate,) = apply_photo_colors([photo], [estimate_from_pixels(model, photo)])
        estimates.append((estimate, PhotoContext(photo.pixels, estimate.surroundings)))
    return estimates


def estimate_from_pixels(model: Model, photo: Photo) -> EstimatedLight:
    """What a network estimates of a crop, before the colors that it shows are looked at.

    Args:
        model: the network.
        photo: the crop.
    """
    nothing = observations_from_metadata(PhotoMetadata(), NO_USER_INPUT)
    return build_estimate(fuse(predict_photo(model, photo), nothing.observations), nothing)


def _guesses(name: str, model: Model, crops: HdrCrops) -> dict[str, _Guess]:
    """A network's bare sky, the same with the place, and the oracles."""
    answers = estimate_crops(model, crops.crops)
    lights = tuple(with_irradiance(estimate.lighting) for estimate, _ in answers)
    bare = np.stack([render(estimate.lighting, hdr_truth.HEIGHT) for estimate, _ in answers])
    full = np.stack([render_with_surroundings(e.lighting, context, hdr_truth.HEIGHT) for e, context in answers])
    guesses = {name: _Guess(bare, lights), f"{name}, surroundings": _Guess(full, lights)}
    for what, change in ORACLES.items():
        changed = tuple(change(light, truth) for light, truth in zip(lights, crops.truth, strict=True))
        guesses[f"{name}, {what}"] = _Guess(np.stack([render(light, hdr_truth.HEIGHT) for light in changed]), changed)
    return guesses


def _true_direction(light: Lighting, truth: hdr_truth.TrueLight) -> Lighting:
    if truth.sun_direction is None:
        return light
    azimuth, elevation = (float(angle) for angle in angles(truth.sun_direction))
    return replace(light, sun_azimuth=azimuth, sun_elevation=max(elevation, 0.0))


def _true_power(light: Lighting, truth: hdr_truth.TrueLight) -> Lighting:
    sun = clip_color(truth.sun_irradiance, "sun_irradiance")
    return replace(light, sun_irradiance=sun, sky_irradiance=clip_color(truth.sky_irradiance, "sky_irradiance"))


def _true_both(light: Lighting, truth: hdr_truth.TrueLight) -> Lighting:
    return _true_power(_true_direction(light, truth), truth)


def _true_ground(light: Lighting, truth: hdr_truth.TrueLight) -> Lighting:
    light = _true_both(light, truth)
    level = np.maximum(level_irradiance(light), 1e-9)
    return replace(light, ground_color=clip_color(np.pi * truth.ground / level, "ground_color"))


ORACLES: dict[str, Callable[[Lighting, hdr_truth.TrueLight], Lighting]] = {
    "true direction": _true_direction,
    "true power and colour": _true_power,
    "both": _true_both,
    "and true ground": _true_ground,
}


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
    methods: dict[str, _Guess] = {}
    for name, model in models.items():
        methods |= _guesses(name, model, crops)
    training = take_hdr_crops(data, labels, spec, "train", each=1).truth
    methods["mean map"] = _Guess(np.stack([hdr_truth.mean_light_map(training)] * len(crops.crops)))
    methods["photo mirrored around"] = _Guess(np.stack([hdr_truth.mirror_photo(crop) for crop in crops.crops]))
    return "\n\n".join(_section(crops, methods, str(kind)) for kind in ("sunny", "overcast") if kind in crops.weather)


def _section(crops: HdrCrops, methods: dict[str, _Guess], kind: str) -> str:
    chosen = np.flatnonzero(crops.weather == kind)
    truth = [crops.truth[i] for i in chosen]
    lights = {name: tuple(guess.lights[i] for i in chosen) if guess.lights else () for name, guess in methods.items()}
    part = {name: _Guess(guess.maps[chosen], lights[name]) for name, guess in methods.items()}
    title = f"## Light: {len(chosen)} crops of {len(np.unique(crops.panoramas[chosen]))} {kind} HDR panoramas"
    return "\n\n".join([title, NOTE, _strengths_table(truth, part), _objects_table(truth, part)])


def _strengths_table(truth: Sequence[hdr_truth.TrueLight], methods: dict[str, _Guess]) -> str:
    """Irradiance, ratio of sun to sky, and ground of each method."""
    header = ["", "level irradiance", "size", "sky", "sun", "sun / sky", "sun painted", "ground", "size", "colour"]
    rows = []
    for name, guess in methods.items():
        up, down = zip(*(hdr_truth.level_irradiances(image) for image in guess.maps), strict=True)
        level = _stops(up, [hdr_truth.level_irradiances(t.image)[0] for t in truth])
        ground = _stops(down, [np.pi * t.ground for t in truth])
        tint = rgb_angle(np.array(down), np.array([t.ground for t in truth]))
        rows.append(
            [
                name, f"{np.median(level):+.2f}", f"{np.median(np.abs(level)):.2f}", *_parts(truth, guess),
                f"{np.median(ground):+.2f}", f"{np.median(np.abs(ground)):.2f}", f"{np.median(tint):.1f}",
            ]
        )  # fmt: skip
    return markdown_table(header, rows)


def _parts(truth: Sequence[hdr_truth.TrueLight], guess: _Guess) -> list[str]:
    """Bias of sky, sun and their ratio, and the share of painted suns; "-" where a method or the truth has none."""
    if not guess.lights:
        return ["-"] * 4
    sky, sun = [sky_irradiance(li) for li in guess.lights], [sun_irradiance(li) for li in guess.lights]
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


def _objects_table(truth: Sequence[hdr_truth.TrueLight], methods: dict[str, _Guess]) -> str:
    """Errors of each method on each object."""
    header = ["", *(column for kind in OBJECTS for column in (f"{kind}: RMSE", "scaled", "angle"))]
    lit = np.stack([t.image for t in truth])
    true = {kind: render_object(kind, lit) for kind in OBJECTS}
    rows = []
    for name, guess in methods.items():
        row = [name]
        for kind in OBJECTS:
            rmse, scaled, angle = np.median(object_errors(true[kind], render_object(kind, guess.maps)), axis=0)
            row += [f"{rmse:.2f}", f"{scaled:.2f}", f"{angle:.1f}"]
        rows.append(row)
    return markdown_table(header, rows)
