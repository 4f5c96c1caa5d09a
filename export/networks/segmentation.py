"""A small network that says what each cell of a photo shows: EfficientNet-Lite0's first stages, and their context.

The maps at a sixteenth of the picture's resolution see a cell and what is near; those at half of that, and their
mean, see the whole scene. The stages keep their ImageNet weights, for the labelled pictures are few: only the head
learns.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from export.networks.backbone import Backbone, conv_batch_norm, load_imagenet
from export.networks.onnx_export import add_metadata, store_small, strip_origin, trace_onnx
from lighting.errors import ModelError
from lighting.files import atomic_write
from lighting.segmentation import CELL_PIXELS, INPUT_SIZE, Segmenter, SurfaceClass

MEAN, STD = 127.0, 128.0  # of the input's sRGB values, as the ImageNet weights expect them

_MIDDLE, _DEEP = Backbone.MIDDLE_BLOCKS, 13  # blocks after which maps are 1/16 and 1/32 of the picture
_WIDTH = 128  # channels of a head
_CHANNELS = {"middle": 112, "deep": 192}
_MIN_BYTES = 20_000  # elements of a tensor that is stored as bytes with scales
_TOLERANCE = 0.1  # of a probability, largest difference between torch and onnxruntime: weights are stored small
_MIN_CELLS = 4  # of the input, each way
_FEATURES_DROP = 0.3  # share of the frozen stages' features that training leaves out
_DROP = 0.2  # share of the head's channels that training leaves out


class SegmentationNetwork(nn.Module):
    """Logits (B, classes, H / 16, W / 16) of pictures (B, H, W, 3) in 8-bit sRGB."""

    def __init__(self, *, pretrained: bool = True, width: int = _WIDTH) -> None:
        """Make a network to train.

        Args:
            pretrained: whether its stages have their ImageNet weights.
            width: channels of the head.
        """
        super().__init__()
        backbone = Backbone(drop_path=0.0)
        if pretrained:
            load_imagenet(backbone)
        blocks = list(backbone.blocks)
        self.stem = backbone.stem
        self.middle = nn.Sequential(*blocks[:_MIDDLE])
        self.deep = nn.Sequential(*blocks[_MIDDLE:_DEEP])
        self.features_drop = nn.Dropout(_FEATURES_DROP)
        self.near = conv_batch_norm(_CHANNELS["middle"], width, 1)
        self.far = conv_batch_norm(_CHANNELS["deep"], width, 1)
        self.whole = nn.Linear(_CHANNELS["deep"], width)
        self.drop = nn.Dropout2d(_DROP)
        self.classes = nn.Conv2d(width, len(SurfaceClass), 1)
        for part in self._frozen():
            part.requires_grad_(False)

    def _frozen(self) -> list[nn.Module]:
        return [self.stem, self.middle, self.deep]

    def train(self, mode: bool = True) -> "SegmentationNetwork":
        """Set the mode; the pretrained layers keep their statistics."""
        super().train(mode)
        for part in self._frozen():
            part.eval()
        return self

    def frozen_features(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Maps (B, 112, H / 16, W / 16) and (B, 192, H / 32, W / 32), which training leaves as they are.

        Args:
            pictures: (B, H, W, 3) sRGB values from 0 to 255.
        """
        x = (pictures.permute(0, 3, 1, 2).float() - MEAN) / STD  # channels last, as the pictures are
        middle = self.middle(nn.functional.relu6(self.stem(x)))
        return middle, self.deep(middle)

    def classify(self, middle: Tensor, deep: Tensor) -> Tensor:
        """Logits (B, classes, H / 16, W / 16) of `frozen_features`.

        Args:
            middle: the first of them.
            deep: the second.
        """
        middle, deep = self.features_drop(middle), self.features_drop(deep)
        far = nn.functional.interpolate(self.far(deep), size=middle.shape[2:], mode="bilinear", align_corners=False)
        x = nn.functional.relu6(self.near(middle) + far + self.whole(deep.mean(dim=(2, 3)))[..., None, None])
        logits: Tensor = self.classes(self.drop(x))
        return logits

    def forward(self, pictures: Tensor) -> Tensor:
        return self.classify(*self.frozen_features(pictures))


def join_heads(networks: Sequence[SegmentationNetwork], shares: Sequence[float]) -> SegmentationNetwork:
    """Return one network whose logits are a weighted mean of those of networks with the same frozen stages.

    Args:
        networks: trained.
        shares: of the networks, which sum to 1.
    """
    states = [network.state_dict() for network in networks]
    joined = dict(states[0])
    for name, value in states[0].items():
        if name.startswith(("near.", "far.", "whole.")) and value.ndim:
            joined[name] = torch.cat([state[name] for state in states])
    joined["classes.weight"] = torch.cat(
        [share * state["classes.weight"] for share, state in zip(shares, states, strict=True)], dim=1
    )
    joined["classes.bias"] = torch.stack(
        [share * state["classes.bias"] for share, state in zip(shares, states, strict=True)]
    ).sum(dim=0)
    network = SegmentationNetwork(pretrained=False, width=joined["whole.bias"].numel())
    network.load_state_dict(joined)
    return network.eval()


def raise_odds(network: SegmentationNetwork, kind: SurfaceClass, factor: float) -> None:
    """Make a class likelier everywhere.

    Args:
        network: changed in place.
        kind: the class.
        factor: by which its odds against each other class grow.
    """
    bias = network.classes.bias
    assert bias is not None
    with torch.no_grad():
        bias[kind] += math.log(factor)


class _Probabilities(nn.Module):
    """What the ONNX file computes: probabilities (B, R, C, classes) of pictures (B, H, W, 3)."""

    def __init__(self, network: SegmentationNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, photo: Tensor) -> Tensor:
        logits: Tensor = self.network(photo)
        return logits.softmax(dim=1).permute(0, 2, 3, 1)


def write_segmentation_onnx(network: SegmentationNetwork, path: Path, metadata: dict[str, str]) -> float:
    """Write the network for `lighting.segmentation.Segmenter`; returns the largest difference to torch.

    Args:
        network: trained.
        path: the ONNX file, which holds its weights.
        metadata: for people.

    Raises:
        ModelError: if the probabilities differ from torch's by more than _TOLERANCE.
    """
    answer = _Probabilities(network).eval()
    size = {axis: torch.export.Dim(name, min=_MIN_CELLS) * CELL_PIXELS for axis, name in ((1, "rows"), (2, "columns"))}
    model = trace_onnx(answer, torch.zeros(1, *INPUT_SIZE[::-1], 3, dtype=torch.uint8), ["segments"], size)
    strip_origin(model)
    store_small(model, _MIN_BYTES)
    add_metadata(model, metadata)
    with atomic_write(path) as temporary:
        temporary.write_bytes(model.SerializeToString())
        difference = _difference(answer, temporary)
        if not difference <= _TOLERANCE:
            raise ModelError(f"torch and onnxruntime differ by {difference:.2e}, more than {_TOLERANCE:.0e}.")
    return difference


def _difference(answer: nn.Module, file: Path) -> float:
    """The largest difference of the file's probabilities from torch's, over pictures of both orientations."""
    segmenter, rng = Segmenter(file), np.random.default_rng(1)
    worst = 0.0
    for size in (INPUT_SIZE, INPUT_SIZE[::-1]):
        blocks = rng.integers(0, 256, (size[1] // 32, size[0] // 32, 3), dtype=np.uint8)
        picture = blocks.repeat(32, axis=0).repeat(32, axis=1)
        with torch.inference_mode():
            expected = answer(torch.from_numpy(picture)[None])[0].numpy()
        worst = max(worst, float(np.abs(segmenter(picture) - expected).max()))
    return worst
