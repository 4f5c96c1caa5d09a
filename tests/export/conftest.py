"""Rendered panoramas and a network trained on them for a few steps, shared by all tests of export.

Modules that need PyTorch are imported where they are used, for most of these tests need none.
"""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from filelock import FileLock

from export.data.labels import label_panorama, write_labels
from export.data.panoramas import read_index
from export.data.rendered_panoramas import render_folder

if TYPE_CHECKING:
    from export.training.dataset import TrainConfig


def _make_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """A folder that the first process of the test run fills, and that the others share."""
    base = factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name
    with FileLock(folder.with_suffix(".lock")):
        if not folder.exists():
            part = folder.with_suffix(".part")
            make(part)
            part.rename(folder)
    return folder


@pytest.fixture(scope="session")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of rendered panoramas and its labels."""

    def make(folder: Path) -> None:
        render_folder(folder, 12, height=64)
        write_labels([label_panorama(p) for p in read_index(folder)], folder / "labels.csv")

    return _make_once(tmp_path_factory, "panoramas", make)


@pytest.fixture(scope="session")
def config(data: Path, tmp_path_factory: pytest.TempPathFactory) -> "TrainConfig":
    from export.training.dataset import TrainConfig

    out = tmp_path_factory.mktemp("run")
    return TrainConfig(str(data), str(data / "labels.csv"), str(out), crops=16, batch=4, workers=0, tune_share=0.3)


@pytest.fixture(scope="session")
def trained(config: "TrainConfig", tmp_path_factory: pytest.TempPathFactory) -> Path:
    from export.training.loop import train_network

    return _make_once(tmp_path_factory, "trained", lambda folder: train_network(replace(config, out=str(folder))))


@pytest.fixture(scope="session")
def trained_network(trained: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from export.networks.onnx_export import write_onnx

    def make(folder: Path) -> None:
        folder.mkdir()
        write_onnx([trained], folder / "outdoor.onnx", temperature=1.3)

    return _make_once(tmp_path_factory, "trained-network", make) / "outdoor.onnx"


@pytest.fixture
def small_backbone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Networks have one block a stage, and begin without the weights of ImageNet, which do not fit."""
    from export.networks import backbone, outdoor

    monkeypatch.setattr(backbone, "_STAGES", [(*stage[:-1], 1) for stage in backbone._STAGES])
    monkeypatch.setattr(backbone.Backbone, "MIDDLE_BLOCKS", 5)
    monkeypatch.setattr(outdoor, "load_imagenet", lambda _: None)
