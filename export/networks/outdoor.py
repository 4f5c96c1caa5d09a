"""Our network: an ImageNet-pretrained backbone, one head for each answer."""

import math

import torch
from torch import Tensor, nn

from export.crops import CELLS
from export.networks.backbone import Backbone
from export.networks.layers import Said, convolution, nothing
from export.networks.parameters import BINS, LIGHT
from lighting.model import PARAMETERS
from lighting.records import ModelSpec

HIDDEN = 384  # features of each head's hidden layer
DROP = 0.3  # share of the features that training leaves out


class SeenSun(nn.Module):
    """Where in the picture the sun is seen: a value for each cell of a map, and one for nowhere."""

    def __init__(self, channels: int, features: int, hidden: int = 48) -> None:
        super().__init__()
        self.where = nn.Sequential(
            convolution(channels, hidden, 1),
            nn.ReLU6(),
            convolution(hidden, hidden, 5, groups=hidden),
            nn.ReLU6(),
            nn.Conv2d(hidden, 1, 1),
        )
        self.nowhere = nn.Linear(features, 1)
        nn.init.constant_(self.nowhere.bias, 6.0)  # most pictures show no sun

    def forward(self, layout: Tensor, pooled: Tensor) -> Tensor:
        return torch.cat([self.nowhere(pooled), self.where(layout).flatten(1)], dim=1)


class CameraBins(nn.Module):
    """The camera's elevation, roll and field of view, each as logits over BINS: from where lines and horizon lie."""

    def __init__(self, channels: int, features: int, cells: int, reduced: int = 24, hidden: int = 320) -> None:
        super().__init__()
        self.where = nn.Sequential(convolution(channels, reduced, 1), nn.ReLU6(), nn.Flatten())
        self.bins = nn.Sequential(
            nn.Dropout(DROP / 2),
            nn.Linear(features + reduced * cells, hidden),
            nn.SiLU(),
            nn.Dropout(DROP / 2),
            nn.Linear(hidden, 3 * BINS),
        )

    def forward(self, layout: Tensor, pooled: Tensor) -> Tensor:
        logits: Tensor = self.bins(torch.cat([self.where(layout), pooled], dim=1))
        return logits.reshape(-1, 3, BINS)


class Outdoor(nn.Module):
    """Pooled features say what is in the picture, a small flattened map says where; each head has one hidden layer.

    With `sees` it also says where in the picture the sun is, with `bins` the camera's angles as distributions, with
    `around` the light around the camera, its power, and whether the photo suits.
    """

    def __init__(
        self, spec: ModelSpec, cells: int, *, sees: bool = True, bins: bool = True, around: bool = False
    ) -> None:
        super().__init__()
        self.backbone = Backbone()
        self.where = nn.Sequential(nn.Conv2d(320, 48, 1, bias=False), nn.BatchNorm2d(48), nn.ReLU6(), nn.Flatten())
        features = 1280 + 48 * math.ceil(spec.height / 32) * math.ceil(spec.width / 32)
        self.sun = _head(features, cells)
        self.values = _head(features, len(PARAMETERS))
        self.seen = SeenSun(112, 1280) if sees else None
        cells_of_layout = math.ceil(spec.height / 16) * math.ceil(spec.width / 16)
        self.camera = CameraBins(112, 1280, cells_of_layout) if bins else None
        self.around = _head(features, 3 * CELLS) if around else None
        self.light = _head(features, LIGHT) if around else None
        self.suitable = nn.Linear(1280, 1) if around else None

    def forward(self, photo: Tensor) -> Said:
        middle, last, pooled = self.backbone(photo)
        features = torch.cat([pooled, self.where(last)], dim=1)
        seen = self.seen(middle, pooled) if self.seen else nothing(photo)
        around = self.around(features) if self.around else nothing(photo)
        light = self.light(features) if self.light else nothing(photo)
        camera = self.camera(middle, pooled) if self.camera else nothing(photo)
        suitable = self.suitable(pooled) if self.suitable else nothing(photo)
        return Said(self.sun(features), self.values(features), seen, around, camera, light, suitable)


def _head(features: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Dropout(DROP), nn.Linear(features, HIDDEN), nn.SiLU(), nn.Dropout(DROP), nn.Linear(HIDDEN, outputs)
    )
