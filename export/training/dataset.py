"""Crops as tensors."""

import hashlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor
from torch.utils.data import Dataset

from export.crops.augmentation import augment, cutmix, cutmix_partners, matching_camera
from export.crops.cameras import Camera, aimed_camera, paper_camera, training_camera
from export.crops.crops import (
    NOT_STRETCHED,
    Crop,
    Source,
    Stretch,
    anisotropic_scale,
    crop_panorama,
    crop_rng,
    is_resolved,
    load_sources,
    random_stretch,
    sampling_weights,
)
from export.crops.photos import PhotoSource, crop_photo, load_photos, photo_sun_likelihood, photo_weights
from export.crops.targets import CELLS, coarse_radiance, panorama_irradiance, sun_in_view_target, surroundings_in_camera
from export.data.panoramas import DataError, Panorama, read_index
from export.data.photos import require_photo_rows
from export.data.town_dataset import LABELS
from export.networks.outdoor import LIGHT, network_specs
from export.training.config import TrainConfig
from lighting.color import tone_map
from lighting.files.atomic import atomic_write
from lighting.geometry import Floats
from lighting.photo.preprocess import pad_to_input
from lighting.records import ModelSpec
from lighting.sun_grid import grid_directions, soft_label

# Training crops as tensors: the processed pictures and the targets that the losses compare with.

TUNE_EACH = 8  # crops of each held-out panorama


class Batch(NamedTuple):
    """Tensors of B crops; unknown parameters are NaN, the sun target of a crop without a sun is all zero."""

    photo: Tensor  # (B, 3, H, W)
    sun: Tensor  # (B, G)
    parameters: Tensor  # (B, 6)
    seen: Tensor  # (B, 1 + cells) where in the picture the sun is seen, all zero if unknown
    around: Tensor  # (B, 3 * crops.CELLS) the light around the camera, NaN if unknown; (B, 0) without --surroundings
    light: Tensor  # (B, 7) as Said.light, the cover itself last; NaN where unknown
    likely: Tensor  # (B,) whether `sun` is a likelihood of what is known, and not a target


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
        synthetic: Sequence[Source] = (),
        photos: Sequence[PhotoSource] = (),
        tune: bool = False,
    ) -> None:
        self.sources, self.spec, self.config, self.tune = [*sources, *synthetic], spec, config, tune
        share = config.synthetic_share if synthetic else 0.0
        parts = [(1 - share) * sampling_weights(sources), share * sampling_weights(synthetic)]
        chances = np.concatenate(parts)
        self.chances = np.cumsum(chances)
        self.companions = cutmix_partners(self.sources, chances) if config.joined and not tune else []
        self.photos = [] if tune else list(photos)
        self.photo_chances = np.cumsum(photo_weights(photos)) if self.photos else np.zeros(0)
        self.light = {s.panorama.path: panorama_irradiance(s) for s in self.sources} if config.surroundings else {}
        self.around = {s.panorama.path: coarse_radiance(s) for s in self.sources} if config.surroundings else {}
        self.purpose = f"train from {Path(config.start).name}" if config.start else "train"

    def __len__(self) -> int:
        return TUNE_EACH * len(self.sources) if self.tune else self.config.crops

    def __getitem__(self, index: int) -> Batch:
        if index >= len(self):
            raise IndexError(index)
        if self.tune:
            return self._batch([self.sources[index % len(self.sources)]], index, "tune")
        rng = crop_rng("photo", index, self.purpose)
        if self.photos and rng.random() < self.config.photos_share:
            return self._photo(self.photos[_draw(self.photo_chances, rng)], rng, self._stretch(index).upwards)
        stretch = self._stretch(index)
        shown = [anisotropic_scale(self.sources[number], stretch) for number in self._drawn(index)]
        return self._batch(shown, index, self.purpose)

    def _drawn(self, index: int) -> list[int]:
        """The index of the source that a crop shows, and at times of a second one."""
        number = _draw(self.chances, crop_rng("panorama", index, self.purpose))
        rng = crop_rng("joined", index, self.purpose)
        if rng.random() >= self.config.joined:
            return [number]
        numbers, chances = self.companions[number]
        return [number, int(numbers[_draw(chances, rng)])]

    def _stretch(self, index: int) -> Stretch:
        """The stretch of a crop's world, at times."""
        rng = crop_rng("stretch", index, self.purpose)
        return random_stretch(rng) if rng.random() < self.config.stretched else NOT_STRETCHED

    def _batch(self, shown: Sequence[Source], index: int, purpose: str) -> Batch:
        source = shown[0]
        rng = crop_rng(source.panorama.name, index, purpose)
        camera = paper_camera(rng) if self.tune else self._camera(source, rng)
        sharpness = rng.uniform(self.config.sharpness, 1.0)
        crop = crop_panorama(source, camera, self.spec, sharpness)
        taken = [(source, camera, crop.gain)]
        for other in shown[1:]:
            view = matching_camera(camera, source, other, rng)
            second = crop_panorama(other, view, self.spec, sharpness)
            taken.append((other, view, second.gain))
            crop = cutmix(crop, second, rng)
        pixels, gains, hidden = augment(crop, rng)
        resolved = all(is_resolved(s, camera, sharpness * pixels.shape[0]) for s in shown)
        visible = {"unknown": None, "visible": not hidden}.get(source.panorama.sun, False)
        return Batch(
            photo=torch.from_numpy(pad_to_input(pixels, self.spec)),
            sun=torch.from_numpy(self._sun(crop)),
            parameters=torch.from_numpy(_parameters(crop, float(gains.mean()), resolved=resolved)),
            seen=torch.from_numpy(sun_in_view_target(crop, self.spec, visible)).float(),
            around=torch.from_numpy(self._around(taken, gains)),
            light=torch.from_numpy(self._light(shown, gains * crop.gain)),
            likely=torch.tensor(False),
        )

    def _photo(self, photo: PhotoSource, rng: np.random.Generator, upwards: float) -> Batch:
        crop = crop_photo(photo, rng, self.spec, upwards)
        pixels, _, _ = augment(crop, rng)
        return Batch(
            photo=torch.from_numpy(pad_to_input(pixels, self.spec)),
            sun=torch.from_numpy(photo_sun_likelihood(crop, self.spec.sun_grid).astype(np.float32)),
            parameters=torch.from_numpy(_parameters(crop, 1.0, resolved=True)),
            seen=torch.from_numpy(sun_in_view_target(crop, self.spec, visible=None)).float(),
            around=torch.full((3 * CELLS if self.around else 0,), math.nan),
            light=torch.full((LIGHT if self.around else 0,), math.nan),
            likely=torch.tensor(True),
        )

    def _sun(self, crop: Crop) -> NDArray[np.float32]:
        if not math.isfinite(crop.sun_elevation):
            return np.zeros(len(grid_directions(self.spec.sun_grid)), np.float32)
        width = math.hypot(crop.sun_uncertainty, self.config.target_width)
        return soft_label(crop.sun_direction, math.radians(width) ** -2, self.spec.sun_grid).astype(np.float32)

    def _around(self, taken: Sequence[tuple[Source, Camera, float]], gains: Floats) -> Floats:
        """The light around the camera, by source, camera and the crop's own gain; its mean if two places share it."""
        if not self.around:
            return np.zeros(0, np.float32)
        maps = [
            surroundings_in_camera(self.around[source.panorama.path], camera, gains * own, source.stretch)
            for source, camera, own in taken
        ]
        return np.asarray(np.mean(maps, axis=0, dtype=np.float32))

    def _light(self, shown: Sequence[Source], gains: Floats) -> Floats:
        """Log irradiance of sun and sky in the photo's values, and the cover; unknown of two or of stretched places."""
        if not self.light:
            return np.zeros(0, np.float32)
        known = self.light[shown[0].panorama.path]
        values = np.concatenate([np.log(known.sun * gains), np.log(known.sky * gains), [known.cover]])
        known_here = len(shown) == 1 and shown[0].stretch == NOT_STRETCHED
        return np.where(known_here, values, math.nan).astype(np.float32)

    def _camera(self, source: Source, rng: np.random.Generator) -> Camera:
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


# Which panoramas a run trains on, and which it holds out.


def training_panoramas(config: TrainConfig) -> tuple[list[Panorama], list[Panorama]]:
    """Panoramas of the `train` split to train on, and those held out for the log; DataError if none is left."""
    panoramas = read_index(config.data, "train", licensed_only=config.licensed_only)
    kept, held_out = split_places(panoramas, config.tune_share)
    if not kept:
        raise DataError(f"There is no panorama to train on in {config.data}.")
    return kept, held_out


def split_places(panoramas: Sequence[Panorama], share: float) -> tuple[list[Panorama], list[Panorama]]:
    """Panoramas to train on and panoramas of held-out places; a place's name alone decides its side."""

    def held_out(panorama: Panorama) -> bool:
        return int(hashlib.sha256(panorama.place.encode()).hexdigest(), 16) % 1000 < 1000 * share

    return [p for p in panoramas if not held_out(p)], [p for p in panoramas if held_out(p)]


def training_photos(config: TrainConfig) -> list[PhotoSource]:
    """The ordinary photos that the run mixes in, if any; DataError if it asks for a share and there are none."""
    if not config.photos_share:
        return []
    return load_photos(require_photo_rows(config.data, licensed_only=config.licensed_only))


def synthetic_sources(config: TrainConfig) -> list[Source]:
    """The rendered places that the run mixes in, if any."""
    if not config.synthetic:
        return []
    return load_sources(read_index(config.synthetic, "train"), Path(config.synthetic) / LABELS)


# A picture of rendered places as training sees them, before augmentation.

ACROSS, DOWN = 8, 6  # one crop each of the first 48 places


def write_samples(folder: Path, target: Path) -> None:
    """One crop of each of the first ACROSS x DOWN places of a folder, as a JPEG; DataError if it holds fewer."""
    panoramas = read_index(folder, "train")[: ACROSS * DOWN]
    if len(panoramas) < ACROSS * DOWN:
        raise DataError(f"{folder} holds {len(panoramas)} places; the picture shows {ACROSS * DOWN}.")
    spec = network_specs("")["outdoor"]
    sources = load_sources(panoramas, folder / LABELS)
    crops = [
        crop_panorama(source, paper_camera(crop_rng(source.panorama.name, 0, "sample")), spec) for source in sources
    ]
    tiles = np.stack([tone_map(crop.linear) for crop in crops])
    height, width = tiles.shape[1:3]
    rows = tiles.reshape(DOWN, ACROSS, height, width, 3).swapaxes(1, 2)
    with atomic_write(target) as temporary:
        Image.fromarray(rows.reshape(DOWN * height, ACROSS * width, 3)).save(temporary, "JPEG", quality=80)
