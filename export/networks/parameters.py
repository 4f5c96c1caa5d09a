"""The six raw values of a network, the last a logit, and the parameters they stand for."""

import math

import torch
from torch import Tensor

ROLL_SCALE = 5.0  # deg that one raw value of the roll stands for

_LOGARITHMIC = torch.tensor([True, True, False, False, False])
_CENTRE = torch.tensor([math.log(4.0), math.log(5.0), 0.0, 0.0, 55.0])
_SCALE = torch.tensor([0.5, 0.6, 15.0, ROLL_SCALE, 15.0])


def encode(parameters: Tensor) -> Tensor:
    """Targets of the first five raw values (B, 5) from parameters (B, 5) in their units."""
    value = torch.where(_LOGARITHMIC.to(parameters.device), parameters.clamp_min(1e-6).log(), parameters)
    return (value - _CENTRE.to(value)) / _SCALE.to(value)


def decode(raw: Tensor) -> Tensor:
    """Parameters (B, 6) in their units, in the order of lighting.model.PARAMETERS, from raw values (B, 6)."""
    value = raw[:, :5] * _SCALE.to(raw) + _CENTRE.to(raw)
    value = torch.where(_LOGARITHMIC.to(raw.device), value.exp(), value)
    return torch.cat([value, raw[:, 5:].sigmoid()], dim=1)


BINS = 128  # of each angle of the camera
LIGHT = 7  # log irradiance of the sun (3) and of the sky (3), logit of the cloud cover
_LOWEST = torch.tensor([-50.0, -50.0, 12.0])  # deg: elevation, roll, vertical field of view
_HIGHEST = torch.tensor([50.0, 50.0, 112.0])
_SPREAD = 1.5  # bins, standard deviation of a target around the true angle


def _bins(like: Tensor) -> Tensor:
    """Raw values (3, BINS) at the bins' centres."""
    low = (_LOWEST - _CENTRE[2:]) / _SCALE[2:]
    high = (_HIGHEST - _CENTRE[2:]) / _SCALE[2:]
    steps = (torch.arange(BINS) + 0.5) / BINS
    return (low[:, None] + (high - low)[:, None] * steps).to(like)


def expected(logits: Tensor) -> Tensor:
    """Raw values (B, 3) of the camera: the means of its bins' probabilities, from logits (B, 3, BINS)."""
    chances = logits.float().softmax(dim=2)
    return (chances * _bins(chances)).sum(dim=2)


def roll_spread(logits: Tensor) -> Tensor:
    """Standard deviation (B, 1) of the roll's raw value by its bins, less their targets', from logits (B, 3, BINS)."""
    chances, centres = logits[:, 1].float().softmax(dim=1), _bins(logits)[1].float()
    mean = (chances * centres).sum(dim=1, keepdim=True)
    variance = (chances * (centres - mean) ** 2).sum(dim=1, keepdim=True)
    return (variance - (_SPREAD * (centres[1] - centres[0])) ** 2).clamp_min(0.0).sqrt()


def binned(raw: Tensor) -> Tensor:
    """Target probabilities (B, 3, BINS) of raw values (B, 3) of the camera."""
    centres = _bins(raw)
    width = (centres[:, 1] - centres[:, 0])[:, None]
    return (-0.5 * ((raw[:, :, None] - centres) / (_SPREAD * width)) ** 2).softmax(dim=2)
