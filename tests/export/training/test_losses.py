"""What training minimises."""

import numpy as np
import pytest
import torch

from export.networks.layers import Said
from export.networks.parameters import encode
from export.training.batches import Batch
from export.training.losses import losses


def test_unknown_targets_cost_nothing() -> None:
    nan = float("nan")
    parameters = torch.tensor([[nan, nan, 5.0, 1.0, 50.0, nan], [3.0, 2.0, 5.0, 1.0, 50.0, 1.0]])
    sun = torch.tensor([[0.0, 0.0], [0.5, 0.5]])
    raw = torch.cat([encode(torch.nan_to_num(parameters[:, :5], nan=1.0)), torch.zeros(2, 1)], dim=1)
    raw[0, :2] = 100.0
    raw.requires_grad_()
    logits = torch.tensor([[50.0, -50.0], [1.0, 1.0]])
    nothing = logits[:, :0]
    batch = Batch(torch.zeros(2, 3, 1, 1), sun, parameters, seen=sun, around=nothing)
    parts = losses(Said(logits, raw, seen=logits, around=nothing), batch)
    found = {name: part.item() for name, part in parts.items()}
    expected = {"sun": np.log(2), "parameters": 0.0, "visibility": np.log(2), "seen": np.log(2)}
    assert found == pytest.approx(expected, abs=1e-6)
    assert "seen" not in losses(Said(logits, raw, seen=nothing, around=nothing), batch)
    torch.autograd.backward(sum(parts.values(), torch.zeros(())))
    assert raw.grad is not None
    assert torch.isfinite(raw.grad).all()
    assert (raw.grad[0, [0, 1, 5]] == 0).all()
