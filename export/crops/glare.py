"""The sun that can be seen in the picture: what training asks of the network, and what it adds to the answer.

The network says in which cell of the picture the sun or its glare stands, if in any. Its own idea of the camera turns
the cell into a direction, which then counts as much as the network is sure that it sees a sun at all.
"""

import numpy as np
import torch
from torch import Tensor, nn

from export.crops.crops import Crop
from lighting.geometry import Floats
from lighting.records import ModelSpec

CELL = 16  # pixels of the canvas along one side of a cell
TARGET_SPREAD = 0.7  # cells, standard deviation of the target around the sun
RARER = 1.5  # nats; suns are rarer in photos than in the crops, most turned towards one, that teach to see them
DIRECTION_SPREAD = 5.0  # deg per axis of the directions that a cell stands for; what the camera's estimate errs by


def where_seen(crop: Crop, spec: ModelSpec, visible: bool | None) -> Floats:
    """Probabilities (1 + cells,): no sun in the picture, then each cell row by row; zeros where that is not known.

    `visible` says whether the panorama shows the sun, None if unknown; a crop that looks elsewhere shows none.
    """
    rows, columns = spec.height // CELL, spec.width // CELL
    probability: Floats = np.zeros(1 + rows * columns)
    if visible is None:
        return probability
    place = crop.sun_pixel if visible else None
    if place is None:
        probability[0] = 1.0
        return probability
    height, width = crop.linear.shape[:2]
    margin = np.array([(spec.width - width) // 2, (spec.height - height) // 2])
    x, y = (np.array(place) + margin) / CELL - 0.5
    distance = (np.arange(columns)[None, :] - x) ** 2 + (np.arange(rows)[:, None] - y) ** 2
    bell = np.exp(-distance / (2 * TARGET_SPREAD**2)).ravel()
    probability[1:] = bell / bell.sum()
    return probability


def seen_probability(logits: Tensor) -> Tensor:
    """Probabilities (B, 1 + cells) that the sun is seen nowhere, or in each cell, of the network's logits."""
    return (logits - RARER * (torch.arange(logits.shape[1], device=logits.device) > 0)).softmax(dim=1)


def towards(photo: Tensor, elevation: Tensor, roll: Tensor, fov: Tensor) -> Tensor:
    """Unit vectors (B, cells, 3) through the cells' centres of canvases (B, 3, H, W); angles (B,) in deg.

    As lighting.geometry has them. The photo's height is that of the canvas less the rows around it, which are zero.
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
    """Probabilities (B, G) over directions (G, 3): those of a sun in the picture take their share of the sun's.

    `seen` (B, 1 + cells) are the probabilities of nowhere and of each cell, `towards` (B, cells, 3) where cells look.
    """
    concentration = float(np.radians(DIRECTION_SPREAD) ** -2)
    lobes = (concentration * (towards @ cells.T - 1)).softmax(dim=2)
    spread = (seen[:, 1:, None] * lobes).sum(dim=1)
    return seen[:, :1] * sun + spread
