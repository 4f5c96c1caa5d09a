"""The weights that a training folder holds."""

from pathlib import Path

import torch

from export.networks.checkpoints import CHECKPOINT, averaged_weights, read_network
from export.networks.network import build, load_weights
from export.networks.runs import read_spec


def test_averaged_weights_have_the_network_s_own_names(trained: Path) -> None:
    weights = averaged_weights(trained)
    network = build(read_spec(trained))
    assert set(weights) == set(network.state_dict())
    state = torch.load(trained / CHECKPOINT, weights_only=True)
    assert {"network", "average", "optimizer", "step"} <= set(state)


def test_the_network_that_is_read_is_ready_to_answer(trained: Path) -> None:
    network, expected = read_network(trained), build(read_spec(trained))
    load_weights(expected, averaged_weights(trained))
    assert not network.training
    photo = torch.randn(1, 3, 224, 224)
    with torch.inference_mode():
        torch.testing.assert_close(network(photo).sun, expected.eval()(photo).sun)
