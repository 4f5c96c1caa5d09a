"""Heads, parameters, specs.

The network says in which cell of the picture the sun or its glare is seen, if in any. The estimated camera turns the
cell into a direction. That direction gets the probability that the sun is seen; the head that says where the sun is
keeps the rest.

All take the normalised canvas (B, 3, H, W) of `lighting.photo` and return `Said`.

Photographs are level far more often than training crops, half of which are rolled by up to 10 deg: people hold
cameras level, and straighten what is not. Hold-Geoffroy et al. (CVPR 2018) draw a third of their photos level and the
others from a Cauchy distribution of 0.1 rad; of the ordinary photos that training sees, the networks say that nearly
all are within 4 deg. Here a fifth is level, so that a camera which is rolled on purpose is not made level.
"""

import math

import numpy as np
import torch
from torch import Tensor, nn

from export.crops.targets import CELL, CELLS
from export.data.panoramas import DataError
from export.networks.backbone import Backbone, NetworkOutput, conv_batch_norm, empty_output, load_imagenet
from export.networks.cvpr2017 import DeepOutdoor
from lighting.model import PARAMETERS
from lighting.records import ModelSpec
from lighting.sun_grid import grid_directions

# The six raw values of a network, the last a logit, and the parameters they stand for.

ROLL_SCALE = 5.0  # deg that one raw value of the roll stands for

_LOGARITHMIC = torch.tensor([True, True, False, False, False])
_CENTRE = torch.tensor([math.log(4.0), math.log(5.0), 0.0, 0.0, 55.0])
_SCALE = torch.tensor([0.5, 0.6, 15.0, ROLL_SCALE, 15.0])


def encode_parameters(parameters: Tensor) -> Tensor:
    """Targets of the first five raw values (B, 5) from parameters (B, 5) in their units."""
    value = torch.where(_LOGARITHMIC.to(parameters.device), parameters.clamp_min(1e-6).log(), parameters)
    return (value - _CENTRE.to(value)) / _SCALE.to(value)


def decode_parameters(raw: Tensor) -> Tensor:
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


def mean_of_camera_bins(logits: Tensor) -> Tensor:
    """Raw values (B, 3) of the camera: the means of its bins' probabilities, from logits (B, 3, BINS)."""
    chances = logits.float().softmax(dim=2)
    return (chances * _bins(chances)).sum(dim=2)


def roll_bins_std(logits: Tensor) -> Tensor:
    """Standard deviation (B, 1) of the roll's raw value by its bins, less their targets', from logits (B, 3, BINS)."""
    chances, centres = logits[:, 1].float().softmax(dim=1), _bins(logits)[1].float()
    mean = (chances * centres).sum(dim=1, keepdim=True)
    variance = (chances * (centres - mean) ** 2).sum(dim=1, keepdim=True)
    return (variance - (_SPREAD * (centres[1] - centres[0])) ** 2).clamp_min(0.0).sqrt()


def camera_bin_targets(raw: Tensor) -> Tensor:
    """Target probabilities (B, 3, BINS) of raw values (B, 3) of the camera."""
    centres = _bins(raw)
    width = (centres[:, 1] - centres[:, 0])[:, None]
    return (-0.5 * ((raw[:, :, None] - centres) / (_SPREAD * width)) ** 2).softmax(dim=2)


# Our network: an ImageNet-pretrained backbone, one head for each answer.

HIDDEN = 384  # features of each head's hidden layer
DROP = 0.3  # share of the features that training leaves out


class _SeenSun(nn.Module):
    """Where in the picture the sun is seen: a value for each cell of a map, and one for nowhere."""

    def __init__(self, channels: int, features: int, hidden: int = 48) -> None:
        super().__init__()
        self.where = nn.Sequential(
            conv_batch_norm(channels, hidden, 1),
            nn.ReLU6(),
            conv_batch_norm(hidden, hidden, 5, groups=hidden),
            nn.ReLU6(),
            nn.Conv2d(hidden, 1, 1),
        )
        self.nowhere = nn.Linear(features, 1)
        nn.init.constant_(self.nowhere.bias, 6.0)  # most pictures show no sun

    def forward(self, layout: Tensor, pooled: Tensor) -> Tensor:
        return torch.cat([self.nowhere(pooled), self.where(layout).flatten(1)], dim=1)


class _CameraBins(nn.Module):
    """The camera's elevation, roll and field of view, each as logits over BINS: from where lines and horizon lie."""

    def __init__(self, channels: int, features: int, cells: int, reduced: int = 24, hidden: int = 320) -> None:
        super().__init__()
        self.where = nn.Sequential(conv_batch_norm(channels, reduced, 1), nn.ReLU6(), nn.Flatten())
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
        self.seen = _SeenSun(112, 1280) if sees else None
        cells_of_layout = math.ceil(spec.height / 16) * math.ceil(spec.width / 16)
        self.camera = _CameraBins(112, 1280, cells_of_layout) if bins else None
        self.around = _head(features, 3 * CELLS) if around else None
        self.light = _head(features, LIGHT) if around else None
        self.suitable = nn.Linear(1280, 1) if around else None

    def forward(self, photo: Tensor) -> NetworkOutput:
        middle, last, pooled = self.backbone(photo)
        features = torch.cat([pooled, self.where(last)], dim=1)
        seen = self.seen(middle, pooled) if self.seen else empty_output(photo)
        around = self.around(features) if self.around else empty_output(photo)
        light = self.light(features) if self.light else empty_output(photo)
        camera = self.camera(middle, pooled) if self.camera else empty_output(photo)
        suitable = self.suitable(pooled) if self.suitable else empty_output(photo)
        return NetworkOutput(self.sun(features), self.values(features), seen, around, camera, light, suitable)


def _head(features: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Dropout(DROP), nn.Linear(features, HIDDEN), nn.SiLU(), nn.Dropout(DROP), nn.Linear(HIDDEN, outputs)
    )


# How a sun seen in the picture enters the answer.

RARER = 1.0  # nats; the sun is rarer in photos than in the crops that teach to see it; 0.5 to 1 on crops of `train`
DIRECTION_SPREAD = 5.0  # deg per axis of the directions that a cell stands for: the error of the estimated camera


def sun_in_view_probability(logits: Tensor) -> Tensor:
    """Probabilities (B, 1 + cells) that the sun is seen nowhere, and in each cell, from the network's logits."""
    return (logits - RARER * (torch.arange(logits.shape[1], device=logits.device) > 0)).softmax(dim=1)


def cell_directions(photo: Tensor, elevation: Tensor, roll: Tensor, fov: Tensor) -> Tensor:
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


def fuse_sun_in_view(sun: Tensor, seen: Tensor, towards: Tensor, cells: Tensor) -> Tensor:
    """Probabilities (B, G) over directions (G, 3), with those of a sun seen in the picture mixed in.

    `seen` (B, 1 + cells) are the probabilities of nowhere and of each cell, `towards` (B, cells, 3) where cells look.
    """
    concentration = float(np.radians(DIRECTION_SPREAD) ** -2)
    lobes = (concentration * (towards @ cells.T - 1)).softmax(dim=2)
    spread = (seen[:, 1:, None] * lobes).sum(dim=1)
    return seen[:, :1] * sun + spread


# A network by its spec, with random, ImageNet or earlier weights.

HEADS = ("seen.", "around.", "camera.", "light.", "suitable.")  # that not every run has


def build_network(
    spec: ModelSpec, *, pretrained: bool = False, sees: bool = True, bins: bool = True, around: bool = False
) -> nn.Module:
    """The network of `spec.name`; `pretrained` loads the ImageNet weights of the backbone if it has one.

    Our network before version 1.3 did not say where in the picture the sun is: it lacks `sees`. Before 2.0 it had no
    `bins` of the camera's angles. With `around` it also says the light around the camera and its power.
    """
    cells = len(grid_directions(spec.sun_grid))
    if spec.name == "cvpr2017":
        return DeepOutdoor(spec, cells)
    network = Outdoor(spec, cells, sees=sees, bins=bins, around=around)
    if pretrained:
        load_imagenet(network.backbone)
    return network


def load_weights(network: nn.Module, weights: dict[str, Tensor]) -> None:
    """Load the weights of a run into a network; DataError if they are of another one.

    Heads of HEADS keep their own weights if the run has none for them. Weights of heads that the network lacks are
    ignored.
    """
    missing, unknown = network.load_state_dict(weights, strict=False)
    unknown = [name for name in unknown if not name.startswith(HEADS)]
    if unknown or not all(name.startswith(HEADS) for name in missing):
        name = [*missing, *unknown][0]
        raise DataError(f"The weights of the run are of another network than this one, which shows in {name}.")


# How level photographs are held, and the camera's roll that follows from it and from what the networks say.

_SHARES = torch.tensor([0.20, 0.24, 0.36, 0.20])  # of photographs, by how far they are rolled:
_SPREADS = torch.tensor([0.06, 2.0, 6.0, 25.0])  # deg, standard deviations
_TRUST = 0.65  # errors over the bins' spread, less that of their targets; 0.6 and 0.7 on crops of `train`
_LEAST = 0.3  # deg, the smallest error of a network


def expected_roll(roll: Tensor, spread: Tensor) -> Tensor:
    """The expected roll (B, 1) [deg] of photographs of which a network says a roll (B, 1) with a spread (B, 1)."""
    error = (_TRUST * spread).clamp_min(_LEAST) ** 2
    prior = _SPREADS.to(roll) ** 2
    total = prior + error
    likely = _SHARES.to(roll) * torch.exp(-0.5 * roll**2 / total) / total.sqrt()
    share = likely / likely.sum(dim=1, keepdim=True)
    return roll * (share * prior / total).sum(dim=1, keepdim=True)


# What the networks expect: the photo's size, its normalisation, the grid of sun directions.

TARGET_WIDTH = {"outdoor": 4.0, "cvpr2017": 6.4}  # deg per axis; CVPR 2017 has a kappa of 80
BACKBONE_MEAN = (127 / 255,) * 3  # what the pretrained weights were trained with
BACKBONE_STD = (128 / 255,) * 3


def network_specs(version: str) -> dict[str, ModelSpec]:
    """The spec of each network by its name, for a version of it."""
    return {
        "outdoor": ModelSpec("outdoor", version, 224, 224, BACKBONE_MEAN, BACKBONE_STD, "fibonacci:1024"),
        "cvpr2017": ModelSpec("cvpr2017", version, 320, 240, BACKBONE_MEAN, BACKBONE_STD, "rings:5x32"),
    }
