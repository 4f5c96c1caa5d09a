"""Networks read back from an ONNX file answer as they did, before and after their statistics are restored."""

from pathlib import Path

import pytest
import torch
from torch import nn

from export.data import DataError
from export.networks.checkpoints import read_network
from export.networks.onnx import write_onnx
from export.networks.outdoor import Outdoor
from export.networks.runs import history, read_record
from export.networks.unpack import read_shipped, recalibrate, write_run


def test_a_network_read_back_answers_as_before(trained: Path, tmp_path: Path) -> None:
    file = tmp_path / "outdoor.onnx"
    write_onnx([trained], file)
    network, metadata = read_shipped(file, 0)
    photo = torch.randn(4, 3, 224, 224)
    with torch.inference_mode():
        expected, found = read_network(trained)(photo), network.eval()(photo)
        assert (found.sun - expected.sun).abs().max() < 0.03 * expected.sun.abs().max()
        assert (found.raw - expected.raw).abs().max() < 0.05 * expected.raw.abs().max()
        recalibrate(network, [photo])
        again = network(photo)
    torch.testing.assert_close(again.sun, found.sun, rtol=1e-3, atol=1e-4)
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d) and module.weight.requires_grad:
            assert module.running_mean is not None
            assert module.running_mean.abs().max() > 0
    write_run(network, metadata, file, 0, tmp_path / "run")
    assert history(read_record(tmp_path / "run")) == history(read_record(trained))
    read = read_network(tmp_path / "run")
    assert isinstance(read, Outdoor)
    with pytest.raises(DataError, match="already holds a run"):
        write_run(network, metadata, file, 0, tmp_path / "run")
    with pytest.raises(DataError, match="no network number 1"):
        read_shipped(file, 1)
