"""A shipped network as the folder of a run that training can start from."""

from collections.abc import Iterator
from pathlib import Path

import torch
from torch import Tensor
from torch.utils.data import DataLoader

from export.crops.crops import load_sources
from export.networks.onnx_import import read_onnx_network, recalibrate_batch_norm, write_run
from export.networks.weights import check_new
from export.training.config import TrainConfig
from export.training.dataset import TrainingCrops, training_panoramas
from lighting.records import ModelSpec

CROPS = 768  # that the statistics are taken from
BATCH = 32


def unpack_network(file: Path, number: int, config: TrainConfig) -> None:
    """Write network `number` (from 0) of an ONNX file into `config.out`, with statistics of training crops.

    DataError if the file holds no such network or if the folder holds a run.
    """
    check_new(Path(config.out))
    network, metadata = read_onnx_network(file, number)
    recalibrate_batch_norm(network, _photos(config, ModelSpec.from_json(metadata["spec"])))
    write_run(network, metadata, file, number, Path(config.out))


def _photos(config: TrainConfig, spec: ModelSpec) -> Iterator[Tensor]:
    kept, _ = training_panoramas(config)
    crops = TrainingCrops(load_sources(kept, config.labels), spec, config)
    with torch.inference_mode():
        for batch in DataLoader(crops, BATCH, sampler=range(CROPS), num_workers=config.workers):
            yield batch.photo.to(memory_format=torch.channels_last)
