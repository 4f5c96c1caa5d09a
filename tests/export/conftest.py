"""Rendered panoramas, a network trained on them for a few steps, and an LLVM, shared by all tests of export."""

from pathlib import Path

import pytest

from export.data.labels import _label_panorama, write_labels
from export.data.panoramas import DataError, read_index
from export.data.path_tracing import find_llvm
from export.data.rendered_panoramas import _write_dataset
from export.networks.onnx_export import write_onnx
from export.training.config import TrainConfig
from export.training.loop import train_network


@pytest.fixture(scope="session")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of rendered panoramas and its labels."""
    folder = tmp_path_factory.mktemp("data")
    _write_dataset(folder, 12, height=64)
    write_labels([_label_panorama(p) for p in read_index(folder)], folder / "labels.csv")
    return folder


@pytest.fixture(scope="session")
def config(data: Path, tmp_path_factory: pytest.TempPathFactory) -> TrainConfig:
    out = tmp_path_factory.mktemp("run")
    return TrainConfig(str(data), str(data / "labels.csv"), str(out), crops=16, batch=4, workers=0, tune_share=0.3)


@pytest.fixture(scope="session")
def trained(config: TrainConfig) -> Path:
    train_network(config)
    return Path(config.out)


@pytest.fixture(scope="session")
def trained_network(trained: Path) -> Path:
    target = trained / "outdoor.onnx"
    write_onnx([trained], target, temperature=1.3)
    return target


@pytest.fixture(scope="session")
def llvm() -> None:
    """An LLVM that Mitsuba can use; tests that need one are skipped with the reason if there is none."""
    try:
        find_llvm()
    except DataError as error:
        pytest.skip(str(error))
