"""The baseline."""

import pytest
import torch

from export.networks.outdoor import build_network, network_specs
from lighting.sun_grid import grid_directions

SPECS = network_specs("0")


def test_the_cvpr_network_has_the_published_size() -> None:
    """Seven convolutions, FC-2048 over 256 x 8 x 10 features, 160 sun bins: about 45 million weights."""
    network = build_network(SPECS["cvpr2017"])
    assert len(grid_directions(SPECS["cvpr2017"].sun_grid)) == 160
    assert sum(isinstance(m, torch.nn.Conv2d) for m in network.modules()) == 7
    assert sum(p.numel() for p in network.parameters()) == pytest.approx(45e6, rel=0.02)
