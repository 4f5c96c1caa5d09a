"""What training minimises."""

import numpy as np
import pytest
import torch

from export.networks.backbone import NetworkOutput
from export.networks.outdoor import camera_bin_targets, decode_parameters, encode_parameters
from export.training.dataset import Batch
from export.training.losses import training_losses


def test_unknown_targets_cost_nothing() -> None:
    nan = float("nan")
    parameters = torch.tensor([[nan, nan, 5.0, 1.0, 50.0, nan], [3.0, 2.0, 5.0, 1.0, 50.0, 1.0]])
    sun = torch.tensor([[0.0, 0.0], [0.5, 0.5]])
    raw = torch.cat([encode_parameters(torch.nan_to_num(parameters[:, :5], nan=1.0)), torch.zeros(2, 1)], dim=1)
    raw[0, :2] = 100.0
    raw.requires_grad_()
    logits = torch.tensor([[50.0, -50.0], [1.0, 1.0]])
    nothing = logits[:, :0]
    batch = Batch(torch.zeros(2, 3, 1, 1), sun, parameters, sun, nothing, nothing, torch.tensor([False, False]))
    predicted = NetworkOutput(logits, raw, logits, nothing, nothing, nothing, nothing)
    parts = training_losses(predicted, batch)
    costs = {name: part.item() for name, part in parts.items()}
    expected = {"sun": np.log(2), "parameters": 0.0, "visibility": np.log(2), "seen": np.log(2)}
    assert costs == pytest.approx(expected, abs=1e-6)
    assert "seen" not in training_losses(predicted._replace(sun_in_view=nothing), batch)
    torch.autograd.backward(sum(parts.values(), torch.zeros(())))
    assert raw.grad is not None
    assert torch.isfinite(raw.grad).all()
    assert (raw.grad[0, [0, 1, 5]] == 0).all()


def test_a_likelihood_is_met_by_any_sharp_answer_inside_it() -> None:
    """Two of four cells agree with what is known: a sure answer of one of them costs as little as an even one."""
    known = torch.tensor([[0.5, 0.5, 0.0, 0.0]])
    costs = {}
    for name, logits in {"sure": [30.0, 0, 0, 0], "even": [30.0, 30.0, 0, 0], "wrong": [0, 0, 30.0, 0]}.items():
        predicted = NetworkOutput(torch.tensor([logits]), torch.zeros(1, 6), *[torch.zeros(1, 0)] * 5)
        nan = torch.full((1, 6), float("nan"))
        batch = Batch(
            torch.zeros(1, 3, 1, 1), known, nan, known[:, :0], known[:, :0], known[:, :0], torch.tensor([True])
        )
        costs[name] = training_losses(predicted, batch)["sun"].item()
    assert costs["sure"] == pytest.approx(costs["even"], abs=1e-4)
    assert costs["wrong"] > costs["sure"] + 10


def test_light_and_camera_cost_nothing_where_they_are_right_or_unknown() -> None:
    raw = torch.zeros(1, 6)
    parameters = decode_parameters(raw)
    empty = torch.zeros(1, 0)
    light = torch.tensor([[0.1, 0.2, 0.3, -1.0, -1.1, -1.2, float("nan")]])
    around = torch.zeros(1, 6)
    bins = camera_bin_targets(raw[:, 2:5]).clamp_min(1e-9).log()
    predicted = NetworkOutput(empty, raw, empty, around, bins, light.nan_to_num(), empty)
    batch = Batch(torch.zeros(1, 3, 1, 1), empty, parameters, empty, around, light, torch.tensor([False]))
    parts = training_losses(predicted, batch)
    assert parts["light"].item() == pytest.approx(0.0, abs=1e-6)
    assert parts["around"].item() == pytest.approx(0.0, abs=1e-6)
    off = training_losses(predicted._replace(camera=bins.flip(2).roll(9, 2)), batch)
    assert off["camera"].item() > parts["camera"].item() + 0.5


@pytest.mark.parametrize("around", [float("nan"), 3.0])
def test_the_light_around_the_camera_changes_no_other_cost(around: float) -> None:
    raw = torch.tensor([[0.1, -0.2, 0.3, -0.4, 0.5, 0.0]])
    empty = torch.zeros(1, 0)
    light = torch.full((1, 7), 0.1)
    bins = torch.linspace(-1, 1, camera_bin_targets(raw[:, 2:5]).numel()).reshape(1, 3, -1)
    predicted = NetworkOutput(empty, raw, empty, torch.zeros(1, 6), bins, light, empty)
    target = torch.full((1, 6), around)
    batch = Batch(torch.zeros(1, 3, 1, 1), empty, decode_parameters(raw), empty, target, light, torch.tensor([False]))
    parts = training_losses(predicted, batch)
    without = training_losses(predicted._replace(surroundings=empty), batch)
    assert set(parts) == {*without, "around"}
    for name, cost in without.items():
        assert parts[name].item() == pytest.approx(cost.item()), name
        assert np.isfinite(cost.item())
