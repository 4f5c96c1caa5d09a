"""Our network: an ImageNet-pretrained backbone and one head for each answer; what the raw values stand for.

The network tells in which cell of the picture the sun or its glare is, if in any. The estimated camera turns the
cell into a direction. That direction gets the probability that the sun is in view; the head of the sun's direction
keeps the rest.

All networks take the normalised canvas (B, 3, H, W) of `lighting.model` and return `NetworkOutput`. The names of layers
are the names of weights in checkpoints and ONNX files: they stay.
"""

import math
from typing import Any

import torch
from torch import Tensor, nn

from export.crops.targets import CELLS
from export.data.panoramas import DataError
from export.networks.backbone import Backbone, NetworkOutput, conv_batch_norm, load_imagenet
from lighting.model import PARAMETERS
from lighting.prediction import ModelSpec
from lighting.sun_grid import grid_directions

ROLL_SCALE = 5.0  # deg that one raw value of the roll stands for

_LOGARITHMIC = torch.tensor([True, True, False, False, False])
_CENTER = torch.tensor([math.log(4.0), math.log(5.0), 0.0, 0.0, 55.0])
_SCALE = torch.tensor([0.5, 0.6, 15.0, ROLL_SCALE, 15.0])


def encode_parameters(parameters: Tensor) -> Tensor:
    """Targets of the first five raw values (B, 5).

    Args:
        parameters: (B, 5) turbidity, exposure, camera elevation, roll and vertical field of view; angles in deg.
    """
    value = torch.where(_LOGARITHMIC.to(parameters.device), parameters.clamp_min(1e-6).log(), parameters)
    return (value - _CENTER.to(value)) / _SCALE.to(value)


def decode_parameters(raw: Tensor) -> Tensor:
    """Parameters (B, 6) in their units, in the order of lighting.model.PARAMETERS.

    Args:
        raw: (B, 6) values of a network, the last a logit.
    """
    value = raw[:, :5] * _SCALE.to(raw) + _CENTER.to(raw)
    value = torch.where(_LOGARITHMIC.to(raw.device), value.exp(), value)
    return torch.cat([value, raw[:, 5:].sigmoid()], dim=1)


BINS = 128  # of each angle of the camera
LIGHT = 7  # log irradiance of the sun (3) and of the sky (3), logit of the cloud cover
_MIN_ANGLES = torch.tensor([-50.0, -50.0, 12.0])  # deg: elevation, roll, vertical field of view
_MAX_ANGLES = torch.tensor([50.0, 50.0, 112.0])
_TARGET_STD = 1.5  # bins, of a target around the true angle


def _bins(like: Tensor) -> Tensor:
    """Raw values (3, BINS) at the bins' centers."""
    low = (_MIN_ANGLES - _CENTER[2:]) / _SCALE[2:]
    high = (_MAX_ANGLES - _CENTER[2:]) / _SCALE[2:]
    steps = (torch.arange(BINS) + 0.5) / BINS
    return (low[:, None] + (high - low)[:, None] * steps).to(like)


def mean_of_camera_bins(logits: Tensor) -> Tensor:
    """Raw values (B, 3) of the camera: the means of its bins' probabilities.

    Args:
        logits: (B, 3, BINS) of elevation, roll and field of view.
    """
    chances = logits.float().softmax(dim=2)
    return (chances * _bins(chances)).sum(dim=2)


def roll_bins_std(logits: Tensor) -> Tensor:
    """Standard deviation (B, 1) of the roll's raw value by its bins, less that of their targets.

    Args:
        logits: (B, 3, BINS) of elevation, roll and field of view.
    """
    chances, centers = logits[:, 1].float().softmax(dim=1), _bins(logits)[1].float()
    mean = (chances * centers).sum(dim=1, keepdim=True)
    variance = (chances * (centers - mean) ** 2).sum(dim=1, keepdim=True)
    return (variance - (_TARGET_STD * (centers[1] - centers[0])) ** 2).clamp_min(0.0).sqrt()


def camera_bin_targets(raw: Tensor) -> Tensor:
    """Target probabilities (B, 3, BINS).

    Args:
        raw: (B, 3) values of elevation, roll and field of view.
    """
    centers = _bins(raw)
    width = (centers[:, 1] - centers[:, 0])[:, None]
    return (-0.5 * ((raw[:, :, None] - centers) / (_TARGET_STD * width)) ** 2).softmax(dim=2)


_HIDDEN = 384  # features of each head's hidden layer
_DROP = 0.3  # share of the features that training leaves out


class _SunInView(nn.Module):
    """Where in the picture the sun is: a value for each cell of a map, and one for nowhere."""

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
        self.bins = mlp_head(features + reduced * cells, 3 * BINS, hidden, _DROP / 2)

    def forward(self, layout: Tensor, pooled: Tensor) -> Tensor:
        logits: Tensor = self.bins(torch.cat([self.where(layout), pooled], dim=1))
        return logits.reshape(-1, 3, BINS)


class Outdoor(nn.Module):
    """Our network of convolutions.

    Pooled features tell what is in the picture, a small flattened map tells where; each head has one hidden layer.

    Args:
        spec: of the network.
        pretrained: load the ImageNet weights of the backbone in place of random ones.
        has_camera_bins: predict the camera's angles as distributions; beside a network for the camera it need not.
        has_surroundings: predict the light around the camera, its power, and whether the photo suits.
    """

    def __init__(
        self,
        spec: ModelSpec,
        *,
        pretrained: bool = False,
        has_camera_bins: bool = True,
        has_surroundings: bool = False,
    ) -> None:
        super().__init__()
        self.backbone = Backbone()
        self.where = nn.Sequential(nn.Conv2d(320, 48, 1, bias=False), nn.BatchNorm2d(48), nn.ReLU6(), nn.Flatten())
        features = 1280 + 48 * math.ceil(spec.height / 32) * math.ceil(spec.width / 32)
        self.sun = mlp_head(features, len(grid_directions(spec.sun_grid)))
        self.values = mlp_head(features, len(PARAMETERS))
        self.seen = _SunInView(112, 1280)
        cells_of_layout = math.ceil(spec.height / 16) * math.ceil(spec.width / 16)
        self.camera = _CameraBins(112, 1280, cells_of_layout) if has_camera_bins else None
        self.around = mlp_head(features, 3 * CELLS) if has_surroundings else None
        self.light = mlp_head(features, LIGHT) if has_surroundings else None
        self.suitable = nn.Linear(1280, 1) if has_surroundings else None
        if pretrained:
            load_imagenet(self.backbone)

    def forward(self, photo: Tensor) -> NetworkOutput:
        middle, last, pooled = self.backbone(photo)
        features = torch.cat([pooled, self.where(last)], dim=1)
        sun_in_view = self.seen(middle, pooled)
        surroundings = self.around(features) if self.around else _empty_output(photo)
        light = self.light(features) if self.light else _empty_output(photo)
        camera = self.camera(middle, pooled) if self.camera else _empty_output(photo)
        suitable = self.suitable(pooled) if self.suitable else _empty_output(photo)
        sun, raw = self.sun(features), self.values(features)
        return NetworkOutput(sun, raw, sun_in_view, surroundings, camera, light, suitable)

    def rate_groups(self) -> list[dict[str, Any]]:
        """What learns, with its scale of the learning rate."""
        return [{"params": [p for p in self.parameters() if p.requires_grad], "scale": 1.0}]


def mlp_head(features: int, outputs: int, hidden: int = _HIDDEN, drop: float = _DROP) -> nn.Sequential:
    """Two layers that take features (B, features) to an answer (B, outputs).

    Args:
        features: numbers that it sees.
        outputs: numbers of the answer.
        hidden: numbers between both layers.
        drop: share of the features, and of the numbers between, that training leaves out.
    """
    first, last = nn.Linear(features, hidden), nn.Linear(hidden, outputs)
    return nn.Sequential(nn.Dropout(drop), first, nn.SiLU(), nn.Dropout(drop), last)


_LIGHT_RANK = 32  # of the first layers of what tells the light: the answers stay, the file is 2.5 MB smaller


def reduce_light_heads(network: nn.Module) -> None:
    """Let the first layer of each head of the light be a product of two small ones, the nearest to it.

    Args:
        network: changed in place, where it has such heads; `export.training.onnx_import` joins the layers again.
    """
    for head in (getattr(network, "around", None), getattr(network, "light", None)):
        if isinstance(head, nn.Sequential) and isinstance(first := head[1], nn.Linear):
            left, sizes, right = torch.linalg.svd(first.weight.detach(), full_matrices=False)
            root = sizes[:_LIGHT_RANK].sqrt()
            narrow, wide = nn.Linear(first.in_features, len(root)), nn.Linear(len(root), first.out_features)
            narrow.weight.data, wide.weight.data = root[:, None] * right[: len(root)], left[:, : len(root)] * root
            wide.bias.data = first.bias.detach()
            narrow.bias.data = torch.zeros(len(root))  # a product without a bias would be of whole numbers in a file
            head[1] = nn.Sequential(narrow, wide)


HEADS = ("seen.", "around.", "camera.", "light.", "suitable.")  # that not every run has


def load_weights(network: nn.Module, weights: dict[str, Tensor]) -> None:
    """Load the weights of a run into a network; DataError if they are of another one.

    Heads of HEADS keep what they have if the run has no weights for them. Weights of heads that the network lacks are
    ignored.

    Args:
        network: changed in place.
        weights: by their names in the network.
    """
    missing, unknown = network.load_state_dict(weights, strict=False)
    unknown = [name for name in unknown if not name.startswith(HEADS)]
    if unknown or not all(name.startswith(HEADS) for name in missing):
        name = [*missing, *unknown][0]
        raise DataError(f"The weights of the run are of another network than this one, which shows in {name}.")


# What the networks expect.

BACKBONE_MEAN = (127 / 255,) * 3  # what the pretrained weights were trained with
BACKBONE_STD = (128 / 255,) * 3


def network_specs(version: str) -> dict[str, ModelSpec]:
    """The spec of each network by its name: the photo's size, its normalisation, the grid of sun directions.

    Args:
        version: of the network, such as "2.5.0".
    """
    spec = ModelSpec("outdoor", version, 224, 224, BACKBONE_MEAN, BACKBONE_STD, "fibonacci:1024")
    return {"outdoor": spec, "transformer": spec}  # one, so that both may answer in one file


def _empty_output(photo: Tensor) -> Tensor:
    """The answer (B, 0) of a head that the network lacks, to photos (B, 3, H, W)."""
    return photo[:, 0, 0, :0]
