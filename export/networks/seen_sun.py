"""How a sun seen in the picture enters the answer.

The network says in which cell of the picture the sun or its glare is seen, if in any. The estimated camera turns the
cell into a direction. That direction gets the probability that the sun is seen; the head that says where the sun is
keeps the rest.
"""

import numpy as np
import torch
from torch import Tensor, nn

from export.crops import CELL

RARER = 1.0  # nats; the sun is rarer in photos than in the crops that teach to see it; 0.5 to 1 on crops of `train`
DIRECTION_SPREAD = 5.0  # deg per axis of the directions that a cell stands for: the error of the estimated camera


def seen_probability(logits: Tensor) -> Tensor:
    """Probabilities (B, 1 + cells) that the sun is seen nowhere, and in each cell, from the network's logits."""
    return (logits - RARER * (torch.arange(logits.shape[1], device=logits.device) > 0)).softmax(dim=1)


def towards(photo: Tensor, elevation: Tensor, roll: Tensor, fov: Tensor) -> Tensor:
    """Unit vectors (B, cells, 3) through the cells' centres of canvases (B, 3, H, W); angles (B,) in deg.

    Signs are those of `lighting.geometry`. The photo's height is that of the canvas without the zero rows around it.
    """
    height, width = photo.shape[2:]
    tall = (photo.abs().amax(dim=(1, 3)) > 0).sum(dim=1).clamp_min(1).to(photo.dtype)
    focal = (0.5 * tall / torch.tan(torch.deg2rad(fov) / 2))[:, None]
    y = (0.5 * height - (torch.arange(height // CELL, device=photo.device) + 0.5) * CELL).to(photo.dtype)
    x = ((torch.arange(width // CELL, device=photo.device) + 0.5) * CELL - 0.5 * width).to(photo.dtype)
    across = x.repeat(len(y))[None] / focal
    above = y.repeat_interleave(len(x))[None] / focal
    turn, tilt = torch.deg2rad(roll)[:, None], torch.deg2rad(elevation)[:, None]
    right = torch.cos(turn) * across + torch.sin(turn) * above
    up = torch.cos(turn) * above - torch.sin(turn) * across
    rays = torch.stack([right, torch.sin(tilt) + torch.cos(tilt) * up, torch.sin(tilt) * up - torch.cos(tilt)], dim=2)
    return nn.functional.normalize(rays, dim=2)


def with_the_seen(sun: Tensor, seen: Tensor, towards: Tensor, cells: Tensor) -> Tensor:
    """Probabilities (B, G) over directions (G, 3), with those of a sun seen in the picture mixed in.

    `seen` (B, 1 + cells) are the probabilities of nowhere and of each cell, `towards` (B, cells, 3) where cells look.
    """
    concentration = float(np.radians(DIRECTION_SPREAD) ** -2)
    lobes = (concentration * (towards @ cells.T - 1)).softmax(dim=2)
    spread = (seen[:, 1:, None] * lobes).sum(dim=1)
    return seen[:, :1] * sun + spread
