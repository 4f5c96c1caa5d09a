"""Training crops as tensors."""

import torch

from export.crops.sources import load_sources
from export.data.panoramas import read_index
from export.training.batches import TrainingCrops
from export.training.config import TrainConfig
from export.training.run import Run


def test_a_crop_number_is_the_same_crop_every_time(config: TrainConfig) -> None:
    sources = load_sources(read_index(config.data, "train"), config.labels)
    spec = Run(config).spec
    one, two = TrainingCrops(sources, spec, config)[5], TrainingCrops(sources, spec, config)[5]
    for a, b in zip(one, two, strict=True):
        torch.testing.assert_close(a, b, equal_nan=True)
