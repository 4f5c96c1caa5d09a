"""The pretrained backbone."""

import torch

from export.networks.network import build
from export.networks.outdoor import Outdoor
from export.networks.specs import specs

SPECS = specs("0")


def test_pretrained_features_tell_pictures_apart_like_imagenet_does() -> None:
    """The weights land in the right layers: the last features neither die nor explode, and differ between pictures."""
    torch.manual_seed(0)
    network = build(SPECS["outdoor"], pretrained=True).eval()
    assert isinstance(network, Outdoor)
    smooth = torch.linspace(-1, 1, 224).expand(1, 3, 224, 224)
    with torch.inference_mode():
        pooled = network.backbone(torch.cat([smooth, torch.randn(1, 3, 224, 224)]))[2]
    assert 0.05 < float(pooled.mean()) < 2.0
    assert float((pooled[0] - pooled[1]).abs().mean()) > 0.1


def test_frozen_layers_do_not_learn() -> None:
    network = build(SPECS["outdoor"], around=True).train()
    assert isinstance(network, Outdoor)
    frozen = [p for p in network.backbone.parameters() if not p.requires_grad]
    before = [p.clone() for p in network.backbone.stem.parameters()]
    statistics = network.backbone.stem.state_dict()["2.running_mean"].clone()
    torch.autograd.backward([part.sum() for part in network(torch.randn(2, 3, 224, 224))])
    assert frozen
    assert all(p.grad is None for p in frozen)
    assert all(p.grad is not None for p in network.parameters() if p.requires_grad)
    torch.testing.assert_close(network.backbone.stem.state_dict()["2.running_mean"], statistics)
    torch.testing.assert_close(before, list(network.backbone.stem.parameters()))
