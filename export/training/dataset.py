"""Training crops as tensors: the processed pictures, the targets that the losses compare with, and a run's settings."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from export.crops.augmentation import augment, cutmix, cutmix_partners, matching_camera
from export.crops.crops import (
    Camera,
    Crop,
    Source,
    aimed_camera,
    crop_panorama,
    crop_rng,
    native_rows,
    paper_camera,
    sampling_weights,
    training_camera,
)
from export.crops.photos import (
    PhotoSource,
    crop_photo,
    load_photos,
    photo_sun_likelihood,
    photo_weights,
    require_photo_rows,
)
from export.crops.targets import CELLS, coarse_radiance, panorama_irradiance, sun_in_view_target, surroundings_in_camera
from export.data.panoramas import DataError, Panorama, read_index
from export.networks.outdoor import LIGHT
from lighting.geometry import Floats
from lighting.model import pad_to_input
from lighting.prediction import ModelSpec
from lighting.sun_grid import grid_directions, soft_label

MAY_CHANGE = ("out", "workers", "checkpoint_minutes")  # when a run is resumed: its folder may have moved


@dataclass(frozen=True)
class TrainConfig:
    """Everything a training run depends on besides the data; config.json has the same names."""

    data: str  # folder of panoramas
    labels: str  # CSV of `python -m export label`
    out: str  # folder for config.json, log.jsonl and checkpoint.pt
    network: str = "outdoor"  # or "transformer"
    version: str = "1.0.0"
    crops: int = 100_000  # drawn in all
    batch: int = 32
    learning_rate: float = 8e-4
    weight_decay: float = 0.05
    warmup: float = 0.03  # share of the run
    ema: float = 0.998  # decay per step of the averaged weights, which are the result
    target_width: float = 4.0  # deg per axis of the sun target, besides the label's uncertainty
    first_width: float = 0.0  # deg by which the sun target is wider at first; it falls to 0 at _NARROW of the run
    tune_share: float = 0.08  # of the training places, held out for the log
    aimed: float = 0.2  # of the crops of panoramas that show the sun, aimed at it
    joined: float = 0.0  # of the crops, divided by a line between two places under the same sun
    surroundings: bool = False  # also learn the light all around the camera and its power
    sharpness: float = 0.45  # smallest share of the canvas's resolution that a crop keeps
    licensed_only: bool = False  # train on permissively licensed panoramas and photos alone
    pretrained: bool = True
    only_camera: bool = False  # train for the camera's angles alone, all layers
    teachers: tuple[str, ...] = ()  # folders of finished runs, whose mean answer is a second target of every crop
    blended: float = 0.4  # of the crops that teachers answer, blended with another; of mirror images twice as many
    mirrored: bool = False  # learn from every crop's mirror image, too: of it the camera is known, the sun by teachers
    start: str = ""  # folder of an earlier run: start from its averaged weights, with other crops
    photos_share: float = 0.0  # of the crops, of the folder's ordinary photos
    workers: int = 2
    checkpoint_minutes: float = 4.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "teachers", tuple(self.teachers))  # JSON has them as a list

    def resolve_paths(self) -> "TrainConfig":
        """Return the settings with absolute paths: equal ones are equal, however they were written."""
        data, labels, start, *teachers = (
            str(Path(path).resolve()) if path else "" for path in (self.data, self.labels, self.start, *self.teachers)
        )
        return replace(self, data=data, labels=labels, start=start, teachers=tuple(teachers))


_NARROW = 0.6  # share of the run from which sun targets are as narrow as they get
_TUNE_EACH = 8  # crops of each held-out panorama


class Batch(NamedTuple):
    """Tensors of B crops; unknown parameters are NaN, the sun target of a crop without a sun is all zero."""

    photo: Tensor  # (B, 3, H, W)
    sun: Tensor  # (B, G)
    parameters: Tensor  # (B, 6)
    sun_in_view: Tensor  # (B, 1 + cells) where in the picture the sun is, all zero if unknown
    # (B, 3 * crops.CELLS) the light around the camera, NaN if unknown; (B, 0) without --surroundings
    surroundings: Tensor
    light: Tensor  # (B, 7) as NetworkOutput.light, the cover itself last; NaN where unknown
    is_likelihood: Tensor  # (B,) whether `sun` is a likelihood and not a target


class TrainingCrops(Dataset[Batch]):
    """Training crops by number: number i is the same crop in every run over the same panoramas.

    With `tune`, the crops of held-out places instead: eight per panorama, by the paper's protocol.
    """

    def __init__(
        self,
        sources: Sequence[Source],
        spec: ModelSpec,
        config: TrainConfig,
        *,
        photos: Sequence[PhotoSource] = (),
        tune: bool = False,
    ) -> None:
        self.sources, self.spec, self.config, self.tune = list(sources), spec, config, tune
        chances = sampling_weights(sources)
        self.chances = np.cumsum(chances)
        self.partners = cutmix_partners(self.sources, chances) if config.joined and not tune else []
        self.photos = [] if tune else list(photos)
        self.photo_chances = np.cumsum(photo_weights(photos)) if self.photos else np.zeros(0)
        lit = self.sources if config.surroundings else []
        self.irradiances = {s.panorama.path: panorama_irradiance(s) for s in lit}
        self.radiances = {s.panorama.path: coarse_radiance(s) for s in lit}
        self.purpose = f"train from {Path(config.start).name}" if config.start else "train"

    def __len__(self) -> int:
        return _TUNE_EACH * len(self.sources) if self.tune else self.config.crops

    def __getitem__(self, index: int) -> Batch:
        if index >= len(self):
            raise IndexError(index)
        if self.tune:
            return self._panorama_batch([self.sources[index % len(self.sources)]], index, "tune")
        rng = crop_rng("photo", index, self.purpose)
        if self.photos and rng.random() < self.config.photos_share:
            return self._photo_batch(self.photos[_draw(self.photo_chances, rng)], rng)
        sources = [self.sources[number] for number in self._draw_sources(index)]
        return self._panorama_batch(sources, index, self.purpose)

    def _draw_sources(self, index: int) -> list[int]:
        """The index of the source that a crop shows, and at times of a second one."""
        number = _draw(self.chances, crop_rng("panorama", index, self.purpose))
        rng = crop_rng("joined", index, self.purpose)
        if rng.random() >= self.config.joined:
            return [number]
        numbers, chances = self.partners[number]
        return [number, int(numbers[_draw(chances, rng)])]

    def _panorama_batch(self, sources: Sequence[Source], index: int, purpose: str) -> Batch:
        source = sources[0]
        rng = crop_rng(source.panorama.name, index, purpose)
        camera = paper_camera(rng) if self.tune else self._draw_camera(source, rng)
        sharpness = rng.uniform(self.config.sharpness, 1.0)
        crop = crop_panorama(source, camera, self.spec, sharpness)
        views = [(source, camera, crop.gain)]
        for other in sources[1:]:
            view = matching_camera(camera, source, other, rng)
            second = crop_panorama(other, view, self.spec, sharpness)
            views.append((other, view, second.gain))
            crop = cutmix(crop, second, rng)
        pixels, gains, hidden = augment(crop, rng)
        resolved = all(native_rows(s, camera) >= sharpness * pixels.shape[0] for s in sources)
        visible = {"unknown": None, "visible": not hidden}.get(source.panorama.sun, False)
        return Batch(
            photo=torch.from_numpy(pad_to_input(pixels, self.spec)),
            sun=torch.from_numpy(self._sun_target(crop, index)),
            parameters=torch.from_numpy(_parameters(crop, float(gains.mean()), resolved=resolved)),
            sun_in_view=torch.from_numpy(sun_in_view_target(crop, self.spec, visible)).float(),
            surroundings=torch.from_numpy(self._surroundings_target(views, gains)),
            light=torch.from_numpy(self._light_target(sources, gains * crop.gain)),
            is_likelihood=torch.tensor(False),
        )

    def _photo_batch(self, photo: PhotoSource, rng: np.random.Generator) -> Batch:
        crop = crop_photo(photo, rng, self.spec)
        pixels, _, _ = augment(crop, rng)
        return Batch(
            photo=torch.from_numpy(pad_to_input(pixels, self.spec)),
            sun=torch.from_numpy(photo_sun_likelihood(crop, self.spec.sun_grid).astype(np.float32)),
            parameters=torch.from_numpy(_parameters(crop, 1.0, resolved=True)),
            sun_in_view=torch.from_numpy(sun_in_view_target(crop, self.spec, visible=None)).float(),
            surroundings=torch.full((3 * CELLS if self.radiances else 0,), math.nan),
            light=torch.full((LIGHT if self.irradiances else 0,), math.nan),
            is_likelihood=torch.tensor(True),
        )

    def _sun_target(self, crop: Crop, index: int) -> NDArray[np.float32]:
        if not math.isfinite(crop.sun_elevation):
            return np.zeros(len(grid_directions(self.spec.sun_grid)), np.float32)
        done = 1.0 if self.tune else min(1.0, index / (_NARROW * self.config.crops))
        wider = self.config.first_width * 0.5 * (1 + math.cos(math.pi * done))
        width = math.hypot(crop.sun_std, self.config.target_width + wider)
        return soft_label(crop.sun_direction, math.radians(width) ** -2, self.spec.sun_grid).astype(np.float32)

    def _surroundings_target(self, views: Sequence[tuple[Source, Camera, float]], gains: Floats) -> Floats:
        """The light around the camera, by source, camera and gain of the crop; its mean if two places share it."""
        if not self.radiances:
            return np.zeros(0, np.float32)
        radiances = [self.radiances[source.panorama.path] for source, _, _ in views]
        pairs = zip(radiances, views, strict=True)
        maps = [surroundings_in_camera(map_, camera, gains * gain) for map_, (_, camera, gain) in pairs]
        return np.asarray(np.mean(maps, axis=0, dtype=np.float32))

    def _light_target(self, sources: Sequence[Source], gains: Floats) -> Floats:
        """Log irradiance of sun and sky in the photo's values, and the cover; unknown of two places."""
        if not self.irradiances:
            return np.zeros(0, np.float32)
        light = self.irradiances[sources[0].panorama.path]
        values = np.concatenate([np.log(light.sun * gains), np.log(light.sky * gains), [light.cover]])
        return np.where(len(sources) == 1, values, math.nan).astype(np.float32)

    def _draw_camera(self, source: Source, rng: np.random.Generator) -> Camera:
        label = source.label
        if source.panorama.sun == "visible" and rng.random() < self.config.aimed:
            return aimed_camera(rng, label.sun_azimuth, label.sun_elevation)
        return training_camera(rng)


def _parameters(crop: Crop, gain: float, *, resolved: bool) -> Floats:
    """The crop's parameters with the exposure of its processed picture; no field of view if the blur would tell it."""
    return np.where([True] * 4 + [resolved, True], crop.parameters * [1, gain, 1, 1, 1, 1], math.nan).astype(np.float32)


def _draw(chances: Floats, rng: np.random.Generator) -> int:
    """An index drawn by cumulative chances."""
    return min(int(np.searchsorted(chances, rng.random())), len(chances) - 1)


def training_panoramas(config: TrainConfig) -> tuple[list[Panorama], list[Panorama]]:
    """Panoramas of the `train` split to train on, and those held out for the log; DataError if none is left.

    Args:
        config: of the run.
    """
    panoramas = read_index(config.data, "train", licensed_only=config.licensed_only)
    kept, held_out = split_places(panoramas, config.tune_share)
    if not kept:
        raise DataError(f"There is no panorama to train on in {config.data}.")
    return kept, held_out


def split_places(panoramas: Sequence[Panorama], share: float) -> tuple[list[Panorama], list[Panorama]]:
    """Panoramas to train on and panoramas of held-out places; a place's name alone decides its side.

    Args:
        panoramas: rows of the index.
        share: of the places that are held out, 0 to 1.
    """

    def held_out(panorama: Panorama) -> bool:
        return int(hashlib.sha256(panorama.place.encode()).hexdigest(), 16) % 1000 < 1000 * share

    return [p for p in panoramas if not held_out(p)], [p for p in panoramas if held_out(p)]


def training_photos(config: TrainConfig) -> list[PhotoSource]:
    """The ordinary photos that the run mixes in, if any; DataError if it needs some and there are none.

    Args:
        config: of the run.
    """
    if not config.photos_share:
        return []
    return load_photos(require_photo_rows(config.data, licensed_only=config.licensed_only))
