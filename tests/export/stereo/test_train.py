"""A run of a few steps, and one that goes on."""

from pathlib import Path

import torch

from export.stereo.network import NormalsNetwork
from export.stereo.train import Config, average, train


def test_a_run_resumes(tmp_path: Path) -> None:
    file = train(Config(out=str(tmp_path), meshes="", minutes=0.005, batch=2, first=2))
    before = torch.load(file, weights_only=True)
    assert before["step"] > 0
    longer = before["seconds"] / 60 + 0.005
    after = torch.load(train(Config(out=str(tmp_path), meshes="", minutes=longer, batch=2, first=2)), weights_only=True)
    assert after["step"] > before["step"]
    assert after["seconds"] > before["seconds"]
    assert isinstance(average(file), NormalsNetwork)
