"""The five raw values of a network and the parameters they stand for."""

import math

import torch
from torch import Tensor

_LOGARITHMIC = torch.tensor([True, True, False, False, False])
_CENTRE = torch.tensor([math.log(4.0), math.log(5.0), 0.0, 0.0, 55.0])
_SCALE = torch.tensor([0.5, 0.6, 15.0, 5.0, 15.0])


def encode(parameters: Tensor) -> Tensor:
    """Targets of the first five raw values (B, 5) from parameters (B, 5) in their units."""
    value = torch.where(_LOGARITHMIC.to(parameters.device), parameters.clamp_min(1e-6).log(), parameters)
    return (value - _CENTRE.to(value)) / _SCALE.to(value)


def decode(raw: Tensor) -> Tensor:
    """Parameters (B, 6) in their units, in the order of lighting.model.PARAMETERS, from raw values (B, 6)."""
    value = raw[:, :5] * _SCALE.to(raw) + _CENTRE.to(raw)
    value = torch.where(_LOGARITHMIC.to(raw.device), value.exp(), value)
    return torch.cat([value, raw[:, 5:].sigmoid()], dim=1)
