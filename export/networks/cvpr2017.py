"""The baseline: the network of "Deep Outdoor Illumination Estimation".

References: Hold-Geoffroy et al., CVPR 2017.
"""

import math

from torch import Tensor, nn

from export.networks.backbone import NetworkOutput, empty_output
from lighting.model import PARAMETERS
from lighting.records import ModelSpec

_CONVOLUTIONS = (  # kernel, channels, stride
    (7, 64, 2),
    (5, 128, 2),
    (3, 256, 2),
    (3, 256, 1),
    (3, 256, 2),
    (3, 256, 1),
    (3, 256, 2),
)


class DeepOutdoor(nn.Module):
    """The network of table 1 in the paper; it predicts no light."""

    light: nn.Module | None = None

    def __init__(self, spec: ModelSpec, cells: int) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        inside = 3
        for kernel, outside, stride in _CONVOLUTIONS:
            convolved = nn.Conv2d(inside, outside, kernel, stride, kernel // 2, bias=False)
            layers += [convolved, nn.BatchNorm2d(outside), nn.ELU()]
            inside = outside
        self.convolutions = nn.Sequential(*layers, nn.Flatten())
        features = 256 * math.ceil(spec.height / 32) * math.ceil(spec.width / 32)
        self.shared = nn.Sequential(nn.Linear(features, 2048, bias=False), nn.BatchNorm1d(2048), nn.ELU())
        self.sun = nn.Linear(2048, cells)
        self.values = nn.Linear(2048, len(PARAMETERS))

    def forward(self, photo: Tensor) -> NetworkOutput:
        shared = self.shared(self.convolutions(photo))
        return NetworkOutput(self.sun(shared), self.values(shared), *[empty_output(photo)] * 5)
