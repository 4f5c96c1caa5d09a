"""Layers that the networks share, and what a network returns."""

from typing import NamedTuple

import torch
from torch import Tensor, nn


class Said(NamedTuple):
    """A network's answers for B photos; shape (B, 0) for heads that it lacks."""

    sun: Tensor  # (B, G) logits over the cells of its grid
    raw: Tensor  # (B, 6) values that `decode` turns into the columns of lighting.model.PARAMETERS
    seen: Tensor  # (B, 1 + cells) logits of where in the picture the sun is seen, the first for nowhere
    around: Tensor  # (B, 3 * crops.CELLS) log radiance around the camera, RGB cell by cell
    camera: Tensor  # (B, 3, BINS) logits of the camera's elevation, roll and field of view; (B, 0) as others
    light: Tensor  # (B, 7) log irradiance of the sun (3) and the sky (3), logit of the cloud cover
    suitable: Tensor  # (B, 1) logit that this is an ordinary photo of outdoors by daylight


def convolution(inside: int, outside: int, kernel: int, stride: int = 1, groups: int = 1) -> nn.Sequential:
    """Convolution and batch normalisation, without activation.

    Strided ones pad as TensorFlow's SAME does on even inputs, right and bottom first: the pretrained weights expect it.
    """
    before, after = (kernel - stride) // 2, (kernel - stride + 1) // 2
    uneven = stride > 1
    layers: list[nn.Module] = [nn.ZeroPad2d((before, after, before, after))] if uneven else []
    padding = 0 if uneven else kernel // 2
    layers.append(nn.Conv2d(inside, outside, kernel, stride, padding, groups=groups, bias=False))
    return nn.Sequential(*layers, nn.BatchNorm2d(outside, eps=1e-3, momentum=0.01))


class InvertedResidual(nn.Module):
    """EfficientNet's block: expand, filter by depth, project, and add the input where shapes agree."""

    def __init__(self, inside: int, outside: int, kernel: int, stride: int, expansion: int, drop: float) -> None:
        super().__init__()
        wide = inside * expansion
        self.expand = convolution(inside, wide, 1) if expansion > 1 else None
        self.depthwise = convolution(wide, wide, kernel, stride, groups=wide)
        self.project = convolution(wide, outside, 1)
        self.residual = stride == 1 and inside == outside
        self.drop = drop

    def forward(self, x: Tensor) -> Tensor:
        wide: Tensor = x if self.expand is None else nn.functional.relu6(self.expand(x), inplace=True)
        with torch.autocast(x.device.type, enabled=False):  # bfloat16 depthwise gradients are several times slower
            wide = self.depthwise(wide.float())
        y: Tensor = self.project(nn.functional.relu6(wide, inplace=True))
        if not self.residual:
            return y
        if self.training and self.drop:
            keep = (torch.rand(len(y), 1, 1, 1, device=y.device) >= self.drop).to(y.dtype) / (1 - self.drop)
            y = y * keep
        return x + y


def nothing(photo: Tensor) -> Tensor:
    """The answer (B, 0) of a head that the network lacks."""
    return photo[:, 0, 0, :0]
