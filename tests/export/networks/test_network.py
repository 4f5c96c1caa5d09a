"""The two networks: shapes, the pretrained weights, targets that decode to what they encoded."""

import numpy as np
import pytest
import torch

from export.networks.network import Outdoor, Served, build, decode, encode, load_weights, specs
from lighting.sun_grid import grid_directions

SPECS = specs("0")
GRID = SPECS["outdoor"].sun_grid


@pytest.mark.parametrize("name", ["outdoor", "cvpr2017"])
def test_outputs_fit_the_grid_and_the_parameters(name: str) -> None:
    spec = SPECS[name]
    served = Served([build(spec)], spec.sun_grid).eval()
    with torch.inference_mode():
        probability, parameters = served(torch.zeros(2, 3, spec.height, spec.width))
    assert probability.shape == (2, len(grid_directions(spec.sun_grid)))
    np.testing.assert_allclose(probability.sum(dim=1), 1.0, rtol=1e-5)
    assert parameters.shape == (2, 6)
    assert torch.isfinite(parameters).all()


def test_the_cvpr_network_has_the_published_size() -> None:
    """Seven convolutions, FC-2048 over 256 x 8 x 10 features, 160 sun bins: about 45 million weights."""
    network = build(SPECS["cvpr2017"])
    assert len(grid_directions(SPECS["cvpr2017"].sun_grid)) == 160
    assert sum(isinstance(m, torch.nn.Conv2d) for m in network.modules()) == 7
    assert sum(p.numel() for p in network.parameters()) == pytest.approx(45e6, rel=0.02)


def test_encode_and_decode_are_inverse() -> None:
    parameters = torch.tensor([[1.0, 0.01, -35.0, -10.0, 25.0], [10.0, 40.0, 35.0, 10.0, 90.0]])
    raw = torch.cat([encode(parameters), torch.zeros(2, 1)], dim=1)
    torch.testing.assert_close(decode(raw)[:, :5], parameters)
    assert (decode(raw)[:, 5] == 0.5).all()


def test_temperature_widens_the_distribution() -> None:
    network = build(SPECS["outdoor"], sees=False).eval()
    photo = torch.randn(1, 3, 224, 224)
    with torch.inference_mode():
        sharp, soft = Served([network], GRID, 0.5)(photo)[0], Served([network], GRID, 2.0)(photo)[0]
    assert sharp.max() > soft.max()
    assert sharp.argmax() == soft.argmax()


def test_networks_together_answer_their_mean() -> None:
    torch.manual_seed(3)
    networks = [build(SPECS["outdoor"]).eval() for _ in range(2)]
    photo = torch.randn(2, 3, 224, 224)
    with torch.inference_mode():
        alone = [Served([network], GRID, 1.4)(photo) for network in networks]
        both = Served(networks, GRID, 1.4)(photo)
    torch.testing.assert_close(both[0], (alone[0][0] + alone[1][0]) / 2)
    torch.testing.assert_close(both[1][:, 2:5], (alone[0][1] + alone[1][1])[:, 2:5] / 2)
    torch.testing.assert_close(both[1][:, :2], (alone[0][1] * alone[1][1])[:, :2].sqrt())  # turbidity and exposure


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


def test_weights_with_the_light_around_fit_a_network_without_it_and_the_other_way_round() -> None:
    learnt, served = build(SPECS["outdoor"], around=True), build(SPECS["outdoor"])
    load_weights(served, learnt.state_dict())
    again = build(SPECS["outdoor"], around=True)
    load_weights(again, served.state_dict())
    for name, value in served.state_dict().items():
        torch.testing.assert_close(value, learnt.state_dict()[name])
        torch.testing.assert_close(value, again.state_dict()[name])
    with pytest.raises(ValueError, match="do not fit"):
        load_weights(served, {"sun.2.weight": torch.zeros(3)} | build(SPECS["cvpr2017"]).state_dict())
