"""Views on which networks are scored, what is true of them, and what networks answer."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from export.crops.crops import (
    PROTOCOLS,
    Camera,
    Crop,
    Source,
    aimed_camera,
    crop_panorama,
    crop_rng,
    native_rows,
    pinhole_camera,
)
from export.data.panoramas import DataError, Panorama
from export.evaluation.metrics import Answers, Truth
from lighting.color import tone_map
from lighting.decoding import lighting_from_prediction
from lighting.fusion.estimate import refine_camera
from lighting.geometry import Floats, camera_directions
from lighting.model import Model, pad_to_input
from lighting.photo.reader import TARGET
from lighting.prediction import Prediction
from lighting.sun_grid import nearest_cell_density

View = tuple[Source, Camera]

_MAX_SUN_UNCERTAINTY = 12.0  # deg, the largest label uncertainty of a sun that is scored
CROPS_EACH = 8  # views of each panorama and protocol
SUN_VIEWS_EACH = 4  # views of each panorama that shows its sun
_BATCH = 16  # photos that a network sees at once
_MIN_SKY_SHARE = 0.1  # least share of a crop above the horizon for "sky in view"
MIN_DENSITY = 1e-9  # 1/sr, counted in the negative log likelihood


@dataclass(frozen=True, eq=False)
class ScoredCrops:
    """The crops of views, and what is answered for them."""

    views: Sequence[View]
    truth: Truth
    predictions: Sequence[Prediction]  # by our network and what else the pictures show, as users get it
    with_lens: Sequence[Prediction]  # the same, of photos that state their lens
    answers: dict[str, Answers]  # of each method, our network first
    network_answers: dict[str, Answers]  # of each network without what else the pictures show

    @property
    def ours(self) -> str:
        """The name of our network."""
        return next(iter(self.answers))


def protocol_views(sources: Sequence[Source], protocol: str) -> list[View]:
    """CROPS_EACH views of each panorama, at even steps of azimuth from a random start.

    Args:
        sources: panoramas with their labels.
        protocol: of PROTOCOLS, "paper" or "phone".
    """
    views: list[View] = []
    for source in sources:
        start = crop_rng(source.panorama.name, 0, "azimuth").uniform(-180, 180)
        for index in range(CROPS_EACH):
            drawn = PROTOCOLS[protocol](crop_rng(source.panorama.name, index, protocol))
            azimuth = (start + index * 360 / CROPS_EACH + 180) % 360 - 180
            views.append((source, Camera(azimuth, drawn.elevation, drawn.roll, drawn.vertical_fov, drawn.aspect)))
    return views


def sun_centered_views(sources: Sequence[Source]) -> list[View]:
    """SUN_VIEWS_EACH views of each panorama that shows its sun, rotated until they see it.

    Args:
        sources: panoramas with their labels.
    """
    views: list[View] = []
    for source in (source for source in sources if source.panorama.sun == "visible"):
        for index in range(SUN_VIEWS_EACH):
            rng = crop_rng(source.panorama.name, index, "sun in view")
            drawn = aimed_camera(rng, source.label.sun_azimuth, source.label.sun_elevation)
            views.append((source, replace(drawn, mirrored=False)))
    return views


def predict_crops(model: Model, views: Sequence[View]) -> tuple[Truth, list[Prediction]]:
    """The truth about the views' crops and what a network alone predicts of them.

    Args:
        model: the network.
        views: N.
    """
    crops: list[Crop] = []
    predictions: list[Prediction] = []
    for first in range(0, len(views), _BATCH):
        part = [crop_panorama(source, camera, model.spec) for source, camera in views[first : first + _BATCH]]
        predictions += model.predict(np.stack([pad_to_input(tone_map(crop.linear), model.spec) for crop in part]))
        crops += part
    return collect_truth([source.panorama for source, _ in views], crops), predictions


def score_views(models: dict[str, Model], views: Sequence[View]) -> ScoredCrops:
    """The truth about views, and what each network answers for them alone and as users get it.

    Args:
        models: networks by name, ours first.
        views: panoramas and cameras.
    """
    results = {name: predict_crops(model, views) for name, model in models.items()}
    ours, (truth, first) = next(iter(results.items()))
    network = {name: predictions for name, (_, predictions) in results.items()}
    refined: dict[str, list[Prediction]] = {name: [] for name in models}
    with_lens = []
    for i, view in enumerate(views):
        side = int(min(TARGET, max(view[1].aspect, 1.0) * native_rows(*view)))  # TARGET, or what the panorama has
        pixels = tone_map(crop_panorama(*view, replace(first[i].spec, width=side, height=side)).linear)
        for name, predictions in network.items():
            refined[name].append(refine_camera(predictions[i], pixels))
        with_lens.append(refine_camera(first[i], pixels, view[1].vertical_fov))
    answers, network_answers = (
        {name: decode_answers(predictions, truth.sun) for name, predictions in of.items()} for of in (refined, network)
    )
    return ScoredCrops(views, truth, refined[ours], with_lens, answers, network_answers)


def collect_truth(panoramas: Sequence[Panorama], crops: Sequence[Crop]) -> Truth:
    """The targets of N crops as arrays.

    Args:
        panoramas: N, of each crop.
        crops: N.
    """
    sun = np.array([c.sun_direction for c in crops])
    uncertainty = np.array([c.sun_std for c in crops])
    return Truth(
        panorama=np.array([p.name for p in panoramas]),
        place=np.array([p.place for p in panoramas]),
        scored=np.isfinite(sun[:, 0]) & (uncertainty <= _MAX_SUN_UNCERTAINTY),
        sun=sun,
        camera=np.array([[c.camera.elevation, c.camera.roll, c.camera.vertical_fov] for c in crops]),
        aspect=np.array([c.camera.aspect for c in crops]),
        visibility=np.array([c.sun_visibility for c in crops]),
        turbidity=np.array([c.turbidity for c in crops]),
        exposure=np.array([c.exposure for c in crops]),
        in_view=np.array([_name_view(p, c) for p, c in zip(panoramas, crops, strict=True)]),
    )


def _name_view(panorama: Panorama, crop: Crop) -> str:
    """By geometry: a visible sun, or more than _MIN_SKY_SHARE of the frame above the horizon, or neither."""
    if panorama.sun == "visible" and crop.sun_pixel:
        return "sun in view"
    rays = camera_directions(pinhole_camera(crop.camera, 32, 24))
    return "sky in view" if np.mean(rays[..., 1] > 0) > _MIN_SKY_SHARE else "no sky"


def decode_answers(predictions: Sequence[Prediction], sun: Floats) -> Answers:
    """Predictions decoded as users get them, with the negative log likelihood of the true suns.

    Args:
        predictions: N.
        sun: (N, 3) true directions, NaN where there is none.
    """
    lights = [lighting_from_prediction(p) for p in predictions]
    return Answers(
        sun=np.array([light.sun_direction for light in lights]),
        radius_50=np.array([light.radius_50 for light in lights]),
        radius_90=np.array([light.radius_90 for light in lights]),
        nll=sun_nll(predictions, sun),
        camera=np.array([[li.camera_elevation, li.camera_roll, li.vertical_fov] for li in lights]),
        visibility=np.array([light.sun_visibility for light in lights]),
        turbidity=np.array([light.turbidity for light in lights]),
        exposure=np.array([light.exposure for light in lights]),
    )


def sun_nll(predictions: Sequence[Prediction], sun: Floats) -> Floats:
    """Negative log likelihood (N,) [nat, of 1/sr] of true suns, NaN where there is none.

    Args:
        predictions: N.
        sun: (N, 3) true directions, NaN where there is none.
    """
    probability, layout = np.array([p.sun_probability for p in predictions]), predictions[0].spec.sun_grid
    scored = np.isfinite(sun[:, 0])
    nll = np.full(len(predictions), np.nan)
    nll[scored] = -np.log(np.maximum(nearest_cell_density(probability[scored], sun[scored], layout), MIN_DENSITY))
    return nll


def load_models(paths: Sequence[Path]) -> dict[str, Model]:
    """ONNX networks by name, and by version if two share a name, in the order of their files.

    Args:
        paths: of the files.

    Raises:
        DataError: if two share name and version.
    """
    models = [Model.load(path) for path in paths]
    names = [model.spec.name for model in models]
    versions = [f"{name} {model.spec.version}" for name, model in zip(names, models, strict=True)]
    labels = [n if names.count(n) == 1 else version for n, version in zip(names, versions, strict=True)]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice:
        raise DataError(f"Two networks are {twice}; `python -m export onnx --version` gives one another version.")
    return dict(zip(labels, models, strict=True))
