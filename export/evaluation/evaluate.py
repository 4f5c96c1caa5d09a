"""Accuracy of ONNX networks on crops of panoramas that training never saw, beside what needs no network at all."""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from export.crops.crops import PROTOCOLS, Camera, Crop, Source, aimed_camera, generator, take
from export.data.labels import Label
from export.data.panoramas import DataError, Panorama, read_index
from export.evaluation import suncompass
from export.evaluation.diagnostics import Judged, honesty_sections
from export.evaluation.evidence import evidence_report
from export.evaluation.groups import groups_report
from export.evaluation.metrics import Answers, Floats, Truth, answers, median, select, sun_error
from export.evaluation.mirror import mirror_averaged
from export.evaluation.photos import photo_report, photo_seers
from export.evaluation.report import in_view_report, report
from export.evaluation.simulated_metadata import take_metadata
from export.training.train import labels_of, load_sources
from lighting.colour import tone_map
from lighting.decoding import lighting_from
from lighting.files import replacing
from lighting.geometry import angle_between, camera_directions, direction
from lighting.model import Model
from lighting.photo import place
from lighting.records import Prediction
from lighting.sun_grid import density

CONSTANT = "constant direction"
CERTAIN = 12.0  # deg, the largest label uncertainty of a sun that is scored
CROPS_EACH = 8  # per panorama and protocol, at azimuths spread evenly
AIMED_EACH = 4  # per panorama that shows its sun
MIDDLE_CAMERA = (0.0, 0.0, 51.5)  # deg, elevation, roll and vertical field of view in the middle of the paper's ranges
SKY_SHARE = 0.1  # of a crop's pixels above the horizon, under which there is "no sky"


@dataclass(frozen=True)
class Scene:
    """The crops of one protocol, taken once and shown to every network."""

    crops: list[tuple[Source, Camera]]


def cameras(sources: Sequence[Source], protocol: str) -> Scene:
    """CROPS_EACH cameras per panorama, with a random start and even steps of azimuth."""
    taken = []
    for source in sources:
        start = generator(source.panorama.name, 0, "azimuth").uniform(-180, 180)
        for index in range(CROPS_EACH):
            drawn = PROTOCOLS[protocol](generator(source.panorama.name, index, protocol))
            azimuth = (start + index * 360 / CROPS_EACH + 180) % 360 - 180
            taken.append((source, Camera(azimuth, drawn.elevation, drawn.roll, drawn.vertical_fov, drawn.aspect)))
    return Scene(taken)


def aimed(sources: Sequence[Source]) -> Scene:
    """AIMED_EACH cameras per panorama that shows its sun, turned until the picture holds it."""
    taken = []
    for source in (source for source in sources if source.panorama.sun == "visible"):
        for index in range(AIMED_EACH):
            rng = generator(source.panorama.name, index, "sun in view")
            drawn = aimed_camera(rng, source.label.sun_azimuth, source.label.sun_elevation)
            taken.append((source, replace(drawn, mirrored=False)))
    return Scene(taken)


def see(model: Model, scene: Scene, *, mirrored: bool = False, batch: int = 16) -> tuple[Truth, list[Prediction]]:
    """The truth about the scene's crops and what the network says of them, by the path that users take.

    With `mirrored` it says it of the crops' mirror images.
    """
    crops: list[Crop] = []
    said: list[Prediction] = []
    for first in range(0, len(scene.crops), batch):
        part = [take(source, camera, model.spec) for source, camera in scene.crops[first : first + batch]]
        pictures = [tone_map(crop.linear)[:, :: -1 if mirrored else 1] for crop in part]
        said += model.predict(np.stack([place(picture, model.spec) for picture in pictures]))
        crops += part
    return collect([source.panorama for source, _ in scene.crops], crops), said


def collect(panoramas: Sequence[Panorama], crops: Sequence[Crop]) -> Truth:
    """The targets of crops as arrays."""
    sun = np.array([c.sun_direction for c in crops])
    uncertainty = np.array([c.sun_uncertainty for c in crops])
    return Truth(
        panorama=np.array([p.name for p in panoramas]),
        place=np.array([p.place for p in panoramas]),
        scored=np.isfinite(sun[:, 0]) & (uncertainty <= CERTAIN),
        sun=sun,
        camera=np.array([[c.camera.elevation, c.camera.roll, c.camera.vertical_fov] for c in crops]),
        visibility=np.array([c.sun_visibility for c in crops]),
        turbidity=np.array([c.turbidity for c in crops]),
        exposure=np.array([c.exposure for c in crops]),
        in_view=np.array([what_is_in_view(p, c) for p, c in zip(panoramas, crops, strict=True)]),
    )


def what_is_in_view(panorama: Panorama, crop: Crop) -> str:
    """By geometry: the frame holds a visible sun; or more than SKY_SHARE of it looks above the horizon; or neither."""
    if panorama.sun == "visible" and crop.sun_pixel:
        return "sun in view"
    c = crop.camera
    rays = camera_directions(32, 24, c.vertical_fov, 0.0, c.elevation, c.roll)
    return "sky in view" if np.mean(rays[..., 1] > 0) > SKY_SHARE else "no sky"


def interpret(said: Sequence[Prediction], sun: Floats) -> Answers:
    """Predictions as arrays, decoded as users get them; NLL at the true suns (N, 3)."""
    lights = [lighting_from(p) for p in said]
    probability = np.array([p.sun_probability for p in said])
    known = np.isfinite(sun[:, 0])
    nll = np.full(len(said), np.nan)
    nll[known] = -np.log(np.maximum(density(probability[known], sun[known], said[0].spec.sun_grid), 1e-9))
    return Answers(
        sun=np.array([light.sun_direction for light in lights]),
        radius_50=np.array([light.radius_50 for light in lights]),
        radius_90=np.array([light.radius_90 for light in lights]),
        nll=nll,
        camera=np.array([[li.camera_elevation, li.camera_roll, li.vertical_fov] for li in lights]),
        visibility=np.array([light.sun_visibility for light in lights]),
        turbidity=np.array([light.turbidity for light in lights]),
        exposure=np.array([light.exposure for light in lights]),
    )


def without_network(truth: Truth, training: Sequence[Label]) -> dict[str, Answers]:
    """Answers that look at no pixel; the constants are the best for the training panoramas."""
    count = len(truth.scored)
    elevation = sun_elevations(training)
    fits = [label for label in training if label.fit_ok]
    uniform = np.full(count, math.log(2 * math.pi))
    constants = {
        "camera": np.tile(MIDDLE_CAMERA, (count, 1)),
        "visibility": np.zeros(count),
        "turbidity": np.full(count, median(np.array([label.turbidity for label in fits]))),
        "exposure": np.full(count, median(np.array([label.exposure for label in fits]))),
    }
    azimuth = np.random.default_rng(0).uniform(-180, 180, count)
    constant = np.tile(direction(0.0, best_constant(elevation)), (count, 1))
    return {
        CONSTANT: answers(constant, nll=uniform, **constants),
        "zenith": answers(np.tile([0.0, 1.0, 0.0], (count, 1)), nll=uniform),
        "random azimuth": answers(direction(azimuth, np.full(count, median(elevation))), nll=uniform),
    }


def sun_elevations(labels: Sequence[Label]) -> Floats:
    """Of the panoramas that have a sun [deg]."""
    return np.array([label.sun_elevation for label in labels if math.isfinite(label.sun_elevation)])


def best_constant(elevation: Floats) -> float:
    """Elevation of the fixed direction with the least median error to suns at these elevations and any azimuth."""
    azimuth = np.linspace(-180, 180, 72, endpoint=False)
    suns = direction(azimuth[None, :], elevation[:, None])
    candidates = np.arange(0.0, 91.0)
    errors = [np.median(angle_between(suns, direction(0.0, candidate))) for candidate in candidates]
    return float(candidates[int(np.argmin(errors))])


def evaluate(
    data: Path,
    labels: Path,
    models: Sequence[Path],
    out: Path,
    *,
    with_metadata: bool = False,
    with_mirror: bool = False,
    with_suncompass: bool = False,
    failures: bool = False,
) -> str:
    """Score the networks (ours first) on the `val` split; returns the report in Markdown and writes it into `out`.

    `with_metadata` adds what simulated metadata and several views of a panorama make of our network's answers;
    `with_mirror` its answers averaged with those about mirror images; `with_suncompass` the outside peer, whose package
    must be installed; `failures` writes our worst crops as failures.csv and failures.png.
    """
    peer = suncompass.load() if with_suncompass else None
    training = labels_of(read_index(data, "train"), labels)
    middle = median(sun_elevations(training))
    sources = load_sources(read_index(data, "val"), labels)
    loaded = by_name(list(map(Model.load, models)))
    ours = next(iter(loaded))
    out.mkdir(parents=True, exist_ok=True)
    sections, further = [], []
    judged: dict[str, Judged] = {}
    for protocol in ("paper", "phone"):
        scene = cameras(sources, protocol)
        results = {name: see(model, scene) for name, model in loaded.items()}
        truth, predictions = results[ours]
        said = {name: interpret(p, truth.sun) for name, (_, p) in results.items()}
        if with_mirror:
            mirrors = see(loaded[ours], scene, mirrored=True)[1]
            said[f"{ours}, mirror averaged"] = interpret(mirror_averaged(predictions, mirrors), truth.sun)
        if peer:
            said[suncompass.NAME] = answers(suncompass.suns(peer, suncompass.crop_pictures(scene.crops), middle))
        said |= without_network(truth, training)
        sections.append(report(protocol, truth, said, ours=ours))
        write_crops(out / f"crops-{protocol}.csv", scene, truth, said)
        if truth.scored.any():
            judged[protocol] = Judged(scene.crops, truth, predictions, said[ours], said[CONSTANT])
        if with_metadata and truth.scored.any():
            further += metadata_sections(protocol, scene, truth, predictions)
    sections += sun_in_view(sources, loaded)
    if (data / "photos.csv").exists():
        sections.append(photo_report(data / "photos.csv", photo_seers(loaded, peer, middle)))
    sections += honesty_sections(judged, out, failures=failures)
    text = "\n\n".join([*sections, *([suncompass.NOTE] if peer else []), *further]) + "\n"
    with replacing(out / "report.md") as path:
        path.write_text(text)
    return text


def sun_in_view(sources: Sequence[Source], models: dict[str, Model]) -> list[str]:
    """The section about crops that hold the sun; none without panoramas that show theirs."""
    scene = aimed(sources)
    if not scene.crops:
        return []
    seen = {name: see(model, scene) for name, model in models.items()}
    truth = next(iter(seen.values()))[0]
    chosen = truth.scored & (truth.in_view == "sun in view")
    said = {name: select(interpret(predictions, truth.sun), chosen) for name, (_, predictions) in seen.items()}
    return [in_view_report(select(truth, chosen), said)] if chosen.any() else []


def by_name(models: Sequence[Model]) -> dict[str, Model]:
    """Networks by name, with the version where two share one; DataError where two share both."""
    names = [model.spec.name for model in models]
    labels = [
        name if names.count(name) == 1 else f"{name} {model.spec.version}"
        for name, model in zip(names, models, strict=True)
    ]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice:
        raise DataError(f"Two of the networks are {twice}; `python -m export onnx --version` tells them apart.")
    return dict(zip(labels, models, strict=True))


def metadata_sections(protocol: str, scene: Scene, truth: Truth, said: Sequence[Prediction]) -> list[str]:
    """What simulated metadata and several views make of one network's answers."""
    taken = take_metadata(truth, CROPS_EACH)
    azimuth = np.array([camera.azimuth for _, camera in scene.crops])
    return [
        evidence_report(protocol, truth, said, taken),
        groups_report(protocol, truth, said, taken, azimuth, CROPS_EACH),
    ]


def write_crops(path: Path, scene: Scene, truth: Truth, said: dict[str, Answers]) -> None:
    """One line a crop: how it was taken and each method's error, for looking at failures."""
    errors = {name: sun_error(truth, a) for name, a in said.items()}
    with replacing(path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(
            ["panorama", "azimuth", "elevation", "roll", "vertical_fov", "aspect", "in_view", "scored", *errors]
        )
        for i, (source, c) in enumerate(scene.crops):
            taken = (f"{v:.3f}" for v in (c.azimuth, c.elevation, c.roll, c.vertical_fov, c.aspect))
            own = (f"{error[i]:.2f}" for error in errors.values())
            writer.writerow([source.panorama.name, *taken, truth.in_view[i], int(truth.scored[i]), *own])
