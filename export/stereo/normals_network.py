"""The network of normals: images of a day with their suns, and what the search says, to normals.

One encoder looks at each image alone. The largest and the mean of what it finds over the images go on. So their number
and order are free (as in PS-FCN, Chen et al., ECCV 2018). A U-Net (Ronneberger et al., MICCAI 2015) weighs the search's
candidates by what is around a pixel and adds a correction. Before any training it repeats the search.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from lighting.stereo.normal_network import BY_IMAGE, SHARED

_CODE = 24  # planes of an image's code
_WIDTHS = (24, 48, 64, 96)  # planes at each scale
_TRUST = 3.0  # how much the search's best normal weighs at first, as a logit
_CANDIDATES = 3  # best, mean and other normal, the first planes of the shared ones
_SPREAD = 11  # the shared plane with the search's spread, in units of 30 deg


class NormalsNetwork(nn.Module):
    """Planes to unit normals (N, 3, H, W) and their expected error (N, 1, H, W) [rad]; H and W are multiples of 8."""

    def __init__(self) -> None:
        super().__init__()
        first, second = nn.Conv2d(BY_IMAGE, 12, 3, padding=1), nn.Conv2d(12, _CODE, 1)
        self.encoder = nn.Sequential(first, nn.ReLU(inplace=True), second, nn.ReLU(inplace=True))
        inputs = 2 * _CODE + SHARED
        self.down = nn.ModuleList()
        for scale, width in enumerate(_WIDTHS):
            self.down.append(_pair(inputs, width, stride=1 if scale == 0 else 2, deep=scale > 0))
            inputs = width
        self.up = nn.ModuleList()
        for width in reversed(_WIDTHS[:-1]):
            self.up.append(_pair(inputs + width, width))
            inputs = width
        self.head = nn.Conv2d(inputs, _CANDIDATES + 3 + 1, 1)
        nn.init.zeros_(self.head.weight)
        self.head.bias.data.zero_() if self.head.bias is not None else None

    def forward(self, by_image: Tensor, shared: Tensor, present: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """From planes (N, T, BY_IMAGE, H, W) and (N, SHARED, H, W); of (N, T) images 1 is present, 0 not. None: all."""
        code = self._pooled(by_image, torch.ones_like(by_image[:, :, 0, 0, 0]) if present is None else present)
        x = torch.cat([code, shared], dim=1)
        kept = []
        for block in self.down:
            x = block(x)
            kept.append(x)
        for block, skip in zip(self.up, reversed(kept[:-1]), strict=True):
            x = block(torch.cat([F.interpolate(x, scale_factor=2.0, mode="nearest"), skip], dim=1))
        return self._answer(self.head(x).float(), shared)

    def _pooled(self, by_image: Tensor, present: Tensor) -> Tensor:
        n, t, planes, height, width = by_image.shape
        code = self.encoder(by_image.reshape(n * t, planes, height, width)).reshape(n, t, _CODE, height, width)
        there = code * present[:, :, None, None, None]  # codes are not negative, so that 0 never is the largest
        mean = there.sum(dim=1) / present.sum(dim=1)[:, None, None, None]
        return torch.cat([there.amax(dim=1), mean], dim=1)

    def _answer(self, head: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        trust = torch.tensor([_TRUST, 0.0, 0.0]).view(1, _CANDIDATES, 1, 1)
        weight = torch.softmax(head[:, :_CANDIDATES] + trust, dim=1)
        candidates = torch.unflatten(shared[:, : 3 * _CANDIDATES], 1, (_CANDIDATES, 3))
        normal = (candidates * weight[:, :, None]).sum(dim=1) + head[:, _CANDIDATES : _CANDIDATES + 3]
        start = torch.log(shared[:, _SPREAD : _SPREAD + 1] * (torch.pi / 6) + 0.02)
        error = torch.exp((start + head[:, -1:]).clamp(-5, 1))
        return F.normalize(normal, dim=1, eps=1e-6), error


def _pair(inputs: int, width: int, *, stride: int = 1, deep: bool = False) -> nn.Sequential:
    layers: list[nn.Module] = [nn.Conv2d(inputs, width, 3, stride=stride, padding=1), nn.LeakyReLU(0.1, inplace=True)]
    if deep:
        layers += [nn.Conv2d(width, width, 3, padding=1), nn.LeakyReLU(0.1, inplace=True)]
    return nn.Sequential(*layers)
