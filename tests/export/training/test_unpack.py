"""Shipped networks as runs: what is in the way is said before the work."""

from pathlib import Path

import pytest

from export.data.panoramas import DataError
from export.networks.weights import CHECKPOINT
from export.training.config import TrainConfig
from export.training.unpack import unpack_network


def test_a_folder_that_cannot_take_a_run_is_refused_before_the_file_is_read(tmp_path: Path) -> None:
    (tmp_path / CHECKPOINT).touch()
    for out, words in ((tmp_path, "already holds a run"), (tmp_path / CHECKPOINT, "is a file; a run takes a folder")):
        with pytest.raises(DataError, match=words):
            unpack_network(tmp_path / "none.onnx", 0, TrainConfig("data", "labels.csv", str(out)))
