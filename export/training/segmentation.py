"""The segmentation network, which says what each cell of a photo shows, and its training on `ground.csv`.

It has EfficientNet-Lite0's first stages, and their context. The maps at a sixteenth of the picture's resolution see a
cell and what is near; those at half of that, and their mean, see the whole scene. The stages keep their ImageNet
weights, for the labelled pictures are few: only the head learns.

`ground.csv` lists pictures with a grid of what their cells show. Each is varied, and the frozen stages are computed
once for each variant. `cross_validate` tells what a network is worth on groups that it has not seen; choices are made
by it alone.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor, nn

from export.crops.augmentation import recompress
from export.data.panoramas import DataError, read_table
from export.networks.backbone import Backbone, conv_batch_norm, load_imagenet
from export.networks.onnx_export import add_metadata, store_small, strip_origin, trace_onnx
from lighting.errors import ModelError
from lighting.files import atomic_write
from lighting.geometry import Floats
from lighting.photo.reader import read_photo
from lighting.segmentation import CELL_PIXELS, INPUT_SIZE, Segmenter, SurfaceClass

# The network.

MEAN, STD = 127.0, 128.0  # of the input's sRGB values, as the ImageNet weights expect them

_MIDDLE, _DEEP = Backbone.MIDDLE_BLOCKS, 13  # blocks after which maps are 1/16 and 1/32 of the picture
_WIDTH = 128  # channels of a head
_CHANNELS = {"middle": 112, "deep": 192}
_MIN_BYTES = 20_000  # elements of a tensor that is stored as bytes with scales
_TOLERANCE = 0.1  # of a probability, largest difference between torch and onnxruntime: weights are stored small
_MIN_CELLS = 4  # of the input, each way
_FEATURES_DROP = 0.3  # share of the frozen stages' features that training leaves out
_DROP = 0.2  # share of the head's channels that training leaves out


class _SegmentationNetwork(nn.Module):
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

    def train(self, mode: bool = True) -> "_SegmentationNetwork":
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


def _join_heads(networks: Sequence[_SegmentationNetwork], shares: Sequence[float]) -> _SegmentationNetwork:
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
    network = _SegmentationNetwork(pretrained=False, width=joined["whole.bias"].numel())
    network.load_state_dict(joined)
    return network.eval()


def _raise_odds(network: _SegmentationNetwork, kind: SurfaceClass, factor: float) -> None:
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

    def __init__(self, network: _SegmentationNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, photo: Tensor) -> Tensor:
        logits: Tensor = self.network(photo)
        return logits.softmax(dim=1).permute(0, 2, 3, 1)


def _write_segmentation_onnx(network: _SegmentationNetwork, path: Path, metadata: dict[str, str]) -> float:
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


# Its training.

TABLE = "ground.csv"
_MORE = Path(__file__).parents[1] / "data" / "ground_more.csv"  # grids of photos of `train`
LETTERS = "GUWTBVPOMS"  # of the grid, in the order of SurfaceClass

_COLUMNS = ("file", "split", "columns", "rows", "grid", "weak", "panorama")
_VARIANTS = 6  # of each picture
_EPOCHS = 2.5  # over all variants
_BATCH = 16
_LEARNING_RATE = 2e-3
_WEIGHT_DECAY = 0.3
_WARM_UP = 0.1  # of the steps
_MIN_CROP = 0.55  # share of a picture's sides
_TURNED = 0.15  # share of the variants of the other orientation
_NOISY, _NOISE = 0.3, np.float32(0.03)  # share of the variants with noise, and its standard deviation
_SAMPLES = 4  # of a grid, each way in a cell of the network
_BLUR = 0.2  # of a cell's label that it has from its neighbours: edges are uncertain by one class
_RARITY_POWER = 0.15  # of a class's share by which its cells count more
_GROUND_WEIGHT = 1.0  # of the loss of ground against the rest
_MORE_SHARE = 0.65  # of the head that more pictures taught; the other learned from the table alone
_GROUND_ODDS = 1.7  # by which ground is likelier than trained: the further pictures show less of it than photos do
_FOLDS = 4


@dataclass(frozen=True, eq=False)
class LabelledPicture:
    """A picture of `ground.csv`."""

    group: str  # a photographer or a place: pictures of one group are alike
    weak: bool  # whether its grid is uncertain
    pixels: NDArray[np.uint8]  # (h, w, 3) sRGB
    grid: NDArray[np.intp]  # (R, C) numbers of SurfaceClass


def read_labelled_pictures(folder: Path, split: str) -> list[LabelledPicture]:
    """The pictures of a split with their grids.

    Args:
        folder: with `ground.csv`, the tables of photos and panoramas, and the pictures.
        split: "train" or "val".

    Raises:
        DataError: a table is missing, or a grid cannot be read.
    """
    groups = _groups(folder)
    rows = [row for row in read_table(folder / TABLE, _COLUMNS) if row["split"] == split]
    return [_picture(folder, row, groups) for row in rows]


def _read_more_pictures(folder: Path) -> list[LabelledPicture]:
    """The pictures of the folder whose grids lie beside this program; they may train, and judge nothing.

    Args:
        folder: with the tables of photos, and the pictures.
    """
    groups = _groups(folder)
    rows = [row for row in read_table(_MORE, ("file", "columns", "rows", "grid")) if (folder / row["file"]).exists()]
    return [_picture(folder, row | {"weak": "", "panorama": ""}, groups) for row in rows]


def _groups(folder: Path) -> dict[str, str]:
    """The photographer of each photo by its file, and the place of each panorama by its name."""
    groups: dict[str, str] = {}
    for table in ("photos.csv", "photos_train.csv"):
        if (folder / table).exists():
            groups |= {row["file"]: row["group"].partition("_")[0] for row in read_table(folder / table)}
    if (folder / "panoramas.csv").exists():
        groups |= {row["name"]: row["place"] for row in read_table(folder / "panoramas.csv")}
    return groups


def _picture(folder: Path, row: dict[str, str], groups: dict[str, str]) -> LabelledPicture:
    lines = row["grid"].split("/")
    shape = (int(row["rows"]), int(row["columns"]))
    if (len(lines), *{len(line) for line in lines}) != shape or set(row["grid"]) - set(LETTERS + "/"):
        raise DataError(
            f"{folder / TABLE}: the grid of {row['file']} is not {shape[1]} x {shape[0]} letters of {LETTERS}."
        )
    grid = np.array([[LETTERS.index(letter) for letter in line] for line in lines], dtype=np.intp)
    group = groups.get(row["file"]) or groups.get(row["panorama"]) or row["panorama"] or row["file"]
    return LabelledPicture(group, row["weak"] == "yes", read_photo(folder / row["file"]).pixels, grid)


@dataclass(frozen=True, eq=False)
class _Variant:
    """A varied picture as the trained layers get it."""

    middle: Tensor  # the first of `_SegmentationNetwork.frozen_features`, in half precision
    deep: Tensor  # the second
    target: Tensor  # (classes, H / 16, W / 16) shares


def _vary_picture(picture: LabelledPicture, rng: np.random.Generator) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """A random part of a picture in other light (H, W, 3), and the shares of classes in its cells (h, w, classes).

    Args:
        picture: with its grid.
        rng: draws all that varies.
    """
    height, width = picture.pixels.shape[:2]
    landscape = (width >= height) != (rng.random() < _TURNED)
    size = INPUT_SIZE if landscape else INPUT_SIZE[::-1]
    share, stretch = rng.uniform(_MIN_CROP, 1.0), np.exp(rng.normal(0, 0.1))
    shares = np.minimum(share * np.array([stretch, 1 / stretch]), 1.0)
    if landscape != (width >= height):
        shares[int(landscape)] *= 0.6
    first = rng.uniform(0, 1 - shares)
    (left, top), (right, bottom) = first * (width, height), (first + shares) * (width, height)
    part = Image.fromarray(picture.pixels).resize(size, Image.Resampling.BOX, box=(left, top, right, bottom))
    target = _cell_shares(picture.grid, first, shares, (size[1] // CELL_PIXELS, size[0] // CELL_PIXELS))
    pixels = _vary_light(np.asarray(part), rng)
    return _mirror(pixels, target) if rng.random() < 0.5 else (pixels, target)


def _mirror(pixels: NDArray[np.uint8], target: NDArray[np.float32]) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """The mirror images of a picture (H, W, 3) and of the shares in its cells (h, w, classes)."""
    return np.ascontiguousarray(pixels[:, ::-1]), np.ascontiguousarray(target[:, ::-1])


def _whole_picture(picture: LabelledPicture) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """The same as `_vary_picture` returns it, of the picture as it is."""
    size = INPUT_SIZE if picture.pixels.shape[1] >= picture.pixels.shape[0] else INPUT_SIZE[::-1]
    pixels = np.array(Image.fromarray(picture.pixels).resize(size, Image.Resampling.BOX))
    cells = size[1] // CELL_PIXELS, size[0] // CELL_PIXELS
    return pixels, _cell_shares(picture.grid, np.zeros(2), np.ones(2), cells)


def _cell_shares(grid: NDArray[np.intp], first: Floats, shares: Floats, size: tuple[int, int]) -> NDArray[np.float32]:
    """The shares (h, w, classes) of classes in the cells of a part of a grid, which begins at `first` (x, y)."""
    rows, columns = (
        np.minimum(((begin + share * (np.arange(_SAMPLES * count) + 0.5) / (_SAMPLES * count)) * cells), cells - 1)
        for begin, share, count, cells in zip(first[::-1], shares[::-1], size, grid.shape, strict=True)
    )
    labels = grid[rows.astype(np.intp)[:, None], columns.astype(np.intp)]
    ones = np.eye(len(SurfaceClass), dtype=np.float32)[labels]
    return np.asarray(ones.reshape(size[0], _SAMPLES, size[1], _SAMPLES, -1).mean(axis=(1, 3)))


def _vary_light(pixels: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Pixels (h, w, 3) of another exposure, contrast and color, softer or noisier, perhaps as JPEG."""
    x = (pixels.astype(np.float32) / 255) ** np.float32(np.exp(rng.normal(0, 0.3)))
    x *= np.exp(rng.normal(0, 0.07, 3) + rng.normal(0, 0.15)).astype(np.float32)
    gray = x.mean(axis=2, keepdims=True)
    x = gray + np.float32(rng.choice([0.0, rng.uniform(0.3, 1.0), rng.uniform(0.8, 1.4)], p=[0.07, 0.4, 0.53])) * (
        x - gray
    )
    x = 0.5 + np.float32(rng.uniform(0.75, 1.25)) * (x - 0.5)
    if rng.random() < _NOISY:
        x += _NOISE * rng.standard_normal(x.shape, dtype=np.float32)
    picture = np.round(255 * x.clip(0, 1)).astype(np.uint8)
    if rng.random() < 0.3:
        small = Image.fromarray(picture).reduce(2)
        picture = np.asarray(small.resize((pixels.shape[1], pixels.shape[0]), Image.Resampling.BICUBIC))
    return recompress(picture, rng) if rng.random() < 0.5 else picture


def _make_variants(network: _SegmentationNetwork, pictures: Sequence[LabelledPicture], seed: int) -> list[_Variant]:
    """_VARIANTS of each picture but the weak ones, the picture as it is, and its mirror image."""
    rng = np.random.default_rng(seed)
    sure = [picture for picture in pictures if not picture.weak]
    varied = [_vary_picture(picture, rng) for picture in sure for _ in range(_VARIANTS)]
    whole = [_whole_picture(picture) for picture in sure]
    varied += whole + [_mirror(*picture) for picture in whole]
    made: dict[int, _Variant] = {}
    for shape in {pixels.shape for pixels, _ in varied}:
        numbers = [number for number, (pixels, _) in enumerate(varied) if pixels.shape == shape]
        for first in range(0, len(numbers), _BATCH):
            some = numbers[first : first + _BATCH]
            made |= zip(some, _with_features(network, [varied[number] for number in some]), strict=True)
    return [made[number] for number in range(len(varied))]


def _with_features(
    network: _SegmentationNetwork, varied: Sequence[tuple[NDArray[np.uint8], NDArray[np.float32]]]
) -> list[_Variant]:
    """Varied pictures of one size as the trained layers get them."""
    pictures, shares = (np.stack(some) for some in zip(*varied, strict=True))
    target = torch.from_numpy(shares).permute(0, 3, 1, 2)
    near = nn.functional.avg_pool2d(nn.functional.pad(target, (1, 1, 1, 1), mode="replicate"), 3, 1)
    blurred = (1 - _BLUR) * target + _BLUR * near
    with torch.inference_mode():
        middle, deep = (maps.half().contiguous() for maps in network.frozen_features(torch.from_numpy(pictures)))
    return [_Variant(*parts) for parts in zip(middle, deep, blurred, strict=True)]


def _fit(network: _SegmentationNetwork, variants: Sequence[_Variant], epochs: float = _EPOCHS, seed: int = 0) -> None:
    """Train the head on variants."""
    rng = np.random.default_rng(seed)
    share = torch.stack([v.target.mean(dim=(1, 2)) for v in variants]).mean(dim=0)
    weight = (share + 0.005) ** -_RARITY_POWER
    weight = weight / (weight * share).sum()
    learning = [p for p in network.parameters() if p.requires_grad]
    optimizer = torch.optim.AdamW(learning, _LEARNING_RATE, weight_decay=_WEIGHT_DECAY)
    steps = max(1, round(epochs * len(variants) / _BATCH))
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, _LEARNING_RATE, total_steps=steps + 1, pct_start=_WARM_UP, cycle_momentum=False
    )
    upright = [v for v in variants if v.target.shape[1] > v.target.shape[2]]
    lying = [v for v in variants if v.target.shape[1] <= v.target.shape[2]]
    network.train()
    for _ in range(steps):
        pool = upright if rng.random() < len(upright) / len(variants) else lying
        batch = [pool[i] for i in rng.choice(len(pool), _BATCH)]
        middle, deep = torch.stack([v.middle for v in batch]), torch.stack([v.deep for v in batch])
        loss = _loss(network.classify(middle.float(), deep.float()), torch.stack([v.target for v in batch]), weight)
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
        schedule.step()
    network.eval()


def _loss(logits: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    """Cross entropy with shares, and that of ground against the rest."""
    log = logits.log_softmax(dim=1)
    classes = -(weight[:, None, None] * target * log).sum(dim=1).mean()
    ground = log[:, SurfaceClass.GROUND].exp().clamp(1e-4, 1 - 1e-4)
    return classes + _GROUND_WEIGHT * nn.functional.binary_cross_entropy(ground, target[:, SurfaceClass.GROUND])


def _predict_grid(network: nn.Module, pixels: NDArray[np.uint8], shape: tuple[int, int]) -> NDArray[np.float32]:
    """Probabilities (R, C, classes) of a picture on a grid.

    Args:
        network: that gives logits.
        pixels: (h, w, 3) sRGB.
        shape: (R, C) of the grid.
    """
    size = INPUT_SIZE if shape[1] > shape[0] else INPUT_SIZE[::-1]
    small = np.array(Image.fromarray(pixels).resize(size, Image.Resampling.BOX))
    with torch.inference_mode():
        shares = network(torch.from_numpy(small)[None]).softmax(dim=1)
        cells: NDArray[np.float32] = nn.functional.adaptive_avg_pool2d(shares, shape)[0].permute(1, 2, 0).numpy()
    return cells


def train_segmentation(data: Path, out: Path) -> str:
    """Train the network on the `train` rows and write it as ONNX; returns what was written, in words.

    Args:
        data: folder with `ground.csv`.
        out: the ONNX file.

    Raises:
        DataError: a table is missing, or a grid cannot be read.
    """
    pictures, more = read_labelled_pictures(data, "train"), _read_more_pictures(data)
    network = _train(pictures, more)
    version = out.stem.rpartition("-")[2]
    source = "pictures with grids of what they show, most with no stated licence"
    described = f"from ImageNet weights, {len(pictures) + len(more)} {source}"
    metadata = {"name": "segments", "version": version, "license": "Apache-2.0", "training_data": described}
    difference = _write_segmentation_onnx(network, out, metadata)
    return f"{out}: {out.stat().st_size / 1e6:.2f} MB, largest difference to torch {difference:.2f}"


def _train(pictures: Sequence[LabelledPicture], more: Sequence[LabelledPicture]) -> _SegmentationNetwork:
    """A network whose head joins two: one learned from the table's pictures, one from all."""
    stages = _SegmentationNetwork().eval()
    variants, further = _make_variants(stages, pictures, seed=1), _make_variants(stages, more, seed=2)
    heads = [_train_head(variants)] + ([_train_head([*variants, *further])] if more else [])
    network = _join_heads(heads, (1 - _MORE_SHARE, _MORE_SHARE) if more else (1.0,))
    _raise_odds(network, SurfaceClass.GROUND, _GROUND_ODDS if more else 1.0)
    return network


def _train_head(variants: Sequence[_Variant]) -> _SegmentationNetwork:
    torch.manual_seed(1)
    network = _SegmentationNetwork().eval()
    _fit(network, variants)
    return network


def cross_validate(data: Path) -> str:
    """What networks are worth on groups of the `train` rows that they have not seen, in words.

    Args:
        data: folder with `ground.csv`.
    """
    pictures = [picture for picture in read_labelled_pictures(data, "train") if not picture.weak]
    more, folds = _read_more_pictures(data), _folds(pictures)
    ground, right, cells = np.zeros(2), 0, 0
    for fold in range(_FOLDS):
        unseen = {picture.group for picture, number in zip(pictures, folds, strict=True) if number == fold}
        network = _train(*([p for p in some if p.group not in unseen] for some in (pictures, more)))
        for picture in (p for p, number in zip(pictures, folds, strict=True) if number == fold):
            shares = _predict_grid(network, picture.pixels, (len(picture.grid), picture.grid.shape[1]))
            found, true = shares[..., SurfaceClass.GROUND] > 0.5, picture.grid == SurfaceClass.GROUND
            ground += [(found & true).sum(), (found | true).sum()]
            right, cells = right + int((shares.argmax(axis=-1) == picture.grid).sum()), cells + picture.grid.size
    return f"Of {cells} cells {100 * right / cells:.1f} % are right; ground has an IoU of {ground[0] / ground[1]:.3f}."


def _folds(pictures: Sequence[LabelledPicture]) -> list[int]:
    """The fold of each picture; those of one group are in one."""
    groups = sorted({picture.group for picture in pictures})
    np.random.default_rng(0).shuffle(groups)
    return [groups.index(picture.group) % _FOLDS for picture in pictures]
