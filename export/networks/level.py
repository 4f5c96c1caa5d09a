"""How level photographs are held, and the camera's roll that follows from it and from what the networks say.

Photographs are level far more often than training crops, half of which are rolled by up to 10 deg: people hold
cameras level, and straighten what is not. Hold-Geoffroy et al. (CVPR 2018) draw a third of their photos level and the
others from a Cauchy distribution of 0.1 rad; of the ordinary photos that training sees, the networks say that nearly
all are within 4 deg. Here a fifth is level, so that a camera which is rolled on purpose is not made level.
"""

import torch
from torch import Tensor

_SHARES = torch.tensor([0.20, 0.24, 0.36, 0.20])  # of photographs, by how far they are rolled:
_SPREADS = torch.tensor([0.06, 2.0, 6.0, 25.0])  # deg, standard deviations
_TRUST = 0.65  # errors over the bins' spread, less that of their targets; 0.6 and 0.7 on crops of `train`
_LEAST = 0.3  # deg, the smallest error of a network


def levelled(roll: Tensor, spread: Tensor) -> Tensor:
    """The expected roll (B, 1) [deg] of photographs of which a network says a roll (B, 1) with a spread (B, 1)."""
    error = (_TRUST * spread).clamp_min(_LEAST) ** 2
    prior = _SPREADS.to(roll) ** 2
    total = prior + error
    likely = _SHARES.to(roll) * torch.exp(-0.5 * roll**2 / total) / total.sqrt()
    share = likely / likely.sum(dim=1, keepdim=True)
    return roll * (share * prior / total).sum(dim=1, keepdim=True)
