"""The branch of a network that says what each cell of the canvas shows.

It goes on from the maps that all networks share, by further blocks of the same backbone. These keep their ImageNet
weights, too, for the labeled pictures are few: only the head learns. The maps at an eighth and a sixteenth of the
picture's resolution see a cell and what is near. Those at half of that, and their mean, see the whole scene.

The maps of the branches that learned sun and camera tell less of what things are.
"""

from pathlib import Path

import torch
from torch import Tensor, nn

from export.data.panoramas import DataError
from export.networks.backbone import Backbone, conv_batch_norm
from export.networks.weights import averaged_weights
from lighting.prediction import SurfaceClass

# The backbone's blocks after whose last the maps are 1/8, 1/16 and 1/32 of the picture. Blocks 7, 10 and 12 add to what
# they get: without them a third of the time is saved, and little is lost.
_STAGES = ((3, 4), (5, 6, 8, 9), (11,))
_CHANNELS = (40, 112, 192)
_WIDTH = 128  # channels of a head
_FEATURES_DROP = 0.2  # share of the frozen blocks' features that training leaves out
_DROP = 0.2  # share of the head's channels that training leaves out
_TOLERANCE = 0.01  # of the shared maps' largest value: a network that was read back has weights of half precision

Features = tuple[Tensor, Tensor, Tensor]


class SegmentationHead(nn.Module):
    """Logits (B, classes, H/8, W/8) of a branch's features."""

    def __init__(self, width: int = _WIDTH) -> None:
        super().__init__()
        self.features_drop = nn.Dropout(_FEATURES_DROP)
        self.fine, self.near, self.far = (conv_batch_norm(channels, width, 1) for channels in _CHANNELS)
        self.whole = nn.Conv2d(_CHANNELS[2], width, 1)  # of one cell: a product's order of sums is that of the threads
        self.drop = nn.Dropout2d(_DROP)
        self.classes = nn.Conv2d(width, len(SurfaceClass), 1)

    def forward(self, fine: Tensor, near: Tensor, far: Tensor) -> Tensor:
        fine, near, far = (self.features_drop(maps) for maps in (fine, near, far))
        whole = self.whole(far.mean(dim=(2, 3), keepdim=True))
        x = self.near(near) + _enlarge(self.far(far), near) + whole
        x = nn.functional.relu6(self.fine(fine) + _enlarge(x, fine))
        logits: Tensor = self.classes(self.drop(x))
        return logits


def _enlarge(maps: Tensor, like: Tensor) -> Tensor:
    return nn.functional.interpolate(maps, size=like.shape[2:], mode="bilinear", align_corners=False)


class SegmentationBranch(nn.Module):
    """Logits (B, classes, H/8, W/8) of maps that `Backbone.frozen_features` returns."""

    def __init__(self, head: SegmentationHead, *, pretrained: bool = True) -> None:
        """Make a branch.

        Args:
            head: that learns, or has learned.
            pretrained: whether the blocks have their ImageNet weights.
        """
        super().__init__()
        backbone = Backbone.pretrained() if pretrained else Backbone()
        self.stages = nn.ModuleList(nn.Sequential(*(backbone.blocks[i] for i in stage)) for stage in _STAGES)
        self.stages.requires_grad_(False)
        self.head = head

    @classmethod
    def read(cls, folder: Path) -> "SegmentationBranch":
        """Read the branch of a folder that `python -m export segments` wrote, ready to answer.

        Args:
            folder: of the run.

        Raises:
            DataError: the folder holds no such run.
        """
        weights = averaged_weights(folder)
        if "head.whole.bias" not in weights:
            raise DataError(f"{folder} is not a run of `segments`.")
        branch = cls(SegmentationHead(len(weights["head.whole.bias"])), pretrained=False)
        branch.load_state_dict(weights)
        return branch.eval()

    @staticmethod
    def check_beginning(network: nn.Module, height: int, width: int) -> None:
        """Raise DataError where a network's first maps are not those that a branch goes on from.

        Args:
            network: whose maps it would go on from.
            height: of the network's canvas, pixels.
            width: of the network's canvas, pixels.
        """
        backbone = getattr(network, "backbone", None)
        photo = torch.linspace(-1, 1, 3 * height * width).sin().reshape(1, 3, height, width)
        if isinstance(backbone, Backbone):
            with torch.inference_mode():
                maps, expected = (some.frozen_features(photo) for some in (backbone.eval(), Backbone.pretrained()))
            if (maps - expected).abs().max() <= _TOLERANCE * expected.abs().max():
                return
        raise DataError("The first network does not begin with ImageNet's weights, so `segments` has no head for it.")

    def features(self, maps: Tensor) -> Features:
        """Maps (B, 40, H/8, W/8), (B, 112, H/16, W/16) and (B, 192, H/32, W/32), which training leaves as they are.

        Args:
            maps: (B, 24, H/4, W/4), as `Backbone.frozen_features` returns them.
        """
        fine = self.stages[0](maps)
        near = self.stages[1](fine)
        return fine, near, self.stages[2](near)

    def forward(self, maps: Tensor) -> Tensor:
        logits: Tensor = self.head(*self.features(maps))
        return logits
