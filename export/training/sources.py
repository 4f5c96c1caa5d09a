"""Which panoramas a run trains on, and which it holds out."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from export.crops import PhotoSource, Source, load_photos, load_sources
from export.data import DataError, Panorama, needed_photo_rows, read_index
from export.towns import LABELS
from export.training.config import TrainConfig


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
    return load_photos(needed_photo_rows(config.data, licensed_only=config.licensed_only))


def synthetic_sources(config: TrainConfig) -> list[Source]:
    """The rendered places that the run mixes in, if any."""
    if not config.synthetic:
        return []
    return load_sources(read_index(config.synthetic, "train"), Path(config.synthetic) / LABELS)
