"""Training crops as tensors."""

from dataclasses import replace
from pathlib import Path

import torch

from export.crops.sources import load_sources
from export.data.panoramas import read_index
from export.training.batches import TrainingCrops
from export.training.config import TrainConfig
from export.training.run import Run
from tests.export.crops.examples import SPEC, source


def test_a_crop_number_is_the_same_crop_every_time(config: TrainConfig) -> None:
    sources = load_sources(read_index(config.data, "train"), config.labels)
    spec = Run(config).spec
    one, two = TrainingCrops(sources, spec, config)[5], TrainingCrops(sources, spec, config)[5]
    for a, b in zip(one, two, strict=True):
        torch.testing.assert_close(a, b, equal_nan=True)


def test_the_light_around_two_places_that_share_a_crop_is_in_the_exposure_of_each(config: TrainConfig) -> None:
    one, other = source(place="a"), source(place="b")
    other = replace(other, panorama=replace(other.panorama, name="q", path=Path("q")))
    brighter = replace(other, levels=tuple(10 * level for level in other.levels))  # as its camera exposes, no change
    both = replace(config, joined=1.0, surroundings=True)
    same, scaled = (TrainingCrops([one, second], SPEC, both) for second in (other, brighter))
    for index in range(4):
        assert len(same._drawn(index)) == 2
        torch.testing.assert_close(same[index].photo, scaled[index].photo)
        torch.testing.assert_close(same[index].around, scaled[index].around, rtol=1e-4, atol=1e-4)
