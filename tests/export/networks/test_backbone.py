"""Tests of backbone."""

import pytest
import torch

from export.networks.backbone import _InvertedResidual, conv_batch_norm, empty_output
from export.networks.outdoor import Outdoor, build_network, network_specs

SPECS = network_specs("0")


def test_pretrained_features_tell_pictures_apart_like_imagenet_does() -> None:
    """The weights land in the right layers: the last features neither die nor explode, and differ between pictures."""
    torch.manual_seed(0)
    network = build_network(SPECS["outdoor"], pretrained=True).eval()
    assert isinstance(network, Outdoor)
    smooth = torch.linspace(-1, 1, 224).expand(1, 3, 224, 224)
    with torch.inference_mode():
        pooled = network.backbone(torch.cat([smooth, torch.randn(1, 3, 224, 224)]))[2]
    assert 0.05 < float(pooled.mean()) < 2.0
    assert float((pooled[0] - pooled[1]).abs().mean()) > 0.1


def test_frozen_layers_do_not_learn() -> None:
    network = build_network(SPECS["outdoor"], has_surroundings=True).train()
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


@pytest.mark.parametrize(("kernel", "stride"), [(1, 1), (3, 1), (5, 1), (3, 2), (5, 2)])
def test_a_convolution_keeps_or_halves_the_map(kernel: int, stride: int) -> None:
    layer = conv_batch_norm(2, 4, kernel, stride).eval()
    assert layer(torch.zeros(1, 2, 16, 16)).shape == (1, 4, 16 // stride, 16 // stride)


def test_a_strided_convolution_pads_right_and_bottom_first() -> None:
    """TensorFlow's SAME on an even input: a kernel of 3 with stride 2 begins at the first pixel."""
    layer = conv_batch_norm(1, 1, 3, 2).eval()
    weight = layer.get_parameter("1.weight")
    weight.data.zero_()
    weight.data[0, 0, 0, 0] = 1.0  # passes its upper left input
    picture = torch.arange(16.0).reshape(1, 1, 4, 4)
    torch.testing.assert_close(layer(picture)[0, 0], torch.tensor([[0.0, 2.0], [8.0, 10.0]]), rtol=1e-3, atol=1e-3)


def test_a_block_adds_its_input_only_where_shapes_agree() -> None:
    same, other = (_InvertedResidual(8, outside, 3, 1, 2, drop=0.0).eval() for outside in (8, 12))
    assert same.residual
    assert not other.residual
    same.get_parameter("project.1.weight").data.zero_()  # the last normalisation then gives zero
    x = torch.randn(2, 8, 6, 6)
    torch.testing.assert_close(same(x), x)


def test_dropped_blocks_pass_their_input_in_training_alone() -> None:
    torch.manual_seed(0)
    block = _InvertedResidual(4, 4, 3, 1, 1, drop=0.5)
    x = torch.randn(64, 4, 4, 4)
    passed = [bool(torch.equal(a, b)) for a, b in zip(block.train()(x), x, strict=True)]
    assert 16 < sum(passed) < 48
    assert not any(torch.equal(a, b) for a, b in zip(block.eval()(x), x, strict=True))


def test_a_missing_head_answers_nothing() -> None:
    assert empty_output(torch.zeros(3, 3, 8, 8)).shape == (3, 0)
