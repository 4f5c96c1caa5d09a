"""Training of the head that says what each cell of a photo shows, on `ground.csv`.

`ground.csv` lists pictures with a grid of what their cells show. Each is varied, and the frozen blocks are computed
once for each variant. Most of a batch are pictures without labels; what they show is what a teacher says of them as
they are [1]. That network, segments-1.1.0, took pictures of _INPUT_SIZE and answered for 24 x 18 cells.

References: [1] Xie et al., Self-training with Noisy Student improves ImageNet classification, CVPR 2020.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image, ImageOps
from torch import Tensor, nn

from export.crops.augmentation import recompress
from export.crops.photos import PHOTOS
from export.data.panoramas import DataError, read_index, read_picture, read_table
from export.networks.backbone import Backbone
from export.networks.outdoor import network_specs
from export.networks.segmentation import Features, SegmentationBranch, SegmentationHead
from export.networks.weights import check_new, write_run
from lighting.geometry import Floats, Pinhole, camera_directions, fit_in_box, sample_latlong
from lighting.model import pad_to_input, resize_to_input
from lighting.onnx_session import create_session
from lighting.photo.reader import Photo, read_photo
from lighting.prediction import CELL_PIXELS, Segments, SurfaceClass

_TABLE = "ground.csv"
_MORE = Path(__file__).parents[1] / "data" / "ground_more.csv"  # grids of photos of `train`
LETTERS = "GUWTBVPOMS"  # of the grid, in the order of SurfaceClass

_COLUMNS = ("file", "split", "columns", "rows", "grid", "weak", "panorama")
_VARIANTS = 8  # of each picture
_STEPS = 1200
_BATCH, _TAUGHT = 8, 24  # of a step: variants of labeled pictures, and of those without labels
_FEATURE_BATCH = 16  # pictures of which the frozen blocks are computed together
_SPEC = network_specs("")["outdoor"]  # whose canvas a head sees
_CANVAS = np.array([_SPEC.width, _SPEC.height])
_LEARNING_RATE = 2e-3
_WEIGHT_DECAY = 0.3
_WARM_UP = 0.1  # of the steps
_MIN_CROP = 0.55  # share of a picture's sides
_TURNED = 0.15  # share of the variants of the other orientation
_STRETCH_STD = 0.1  # of the logarithm of a part's width over its height
_NOISY, _NOISE = 0.3, np.float32(0.03)  # share of the variants with noise, and its standard deviation
_SAMPLES = 4  # of a grid, each way in a cell of the canvas
_BLUR = 0.2  # of a cell's label that it has from its neighbors: edges are uncertain by one class
_RARITY_POWER = 0.15  # of a class's share by which its cells count more
_GROUND_WEIGHT = 1.0  # of the loss of ground against the rest
_GROUND_ODDS = 1.7  # by which ground is likelier than trained: half of the labeled pictures show none


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
    rows = [row for row in read_table(folder / _TABLE, _COLUMNS) if row["split"] == split]
    return [_picture(folder, row, groups) for row in rows]


def _read_more_pictures(folder: Path) -> list[LabelledPicture]:
    """The pictures of the folder whose grids lie beside this program; they train, and judge only by folds.

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
            f"{folder / _TABLE}: the grid of {row['file']} is not {shape[1]} x {shape[0]} letters of {LETTERS}."
        )
    grid = np.array([[LETTERS.index(letter) for letter in line] for line in lines], dtype=np.intp)
    group = groups.get(row["file"]) or groups.get(row["panorama"]) or row["panorama"] or row["file"]
    return LabelledPicture(group, row["weak"] == "yes", read_photo(folder / row["file"]).pixels, grid)


@dataclass(frozen=True, eq=False)
class _Part:
    """A part of a labeled picture that fills the canvas."""

    pixels: NDArray[np.uint8]  # (h, w, 3) sRGB
    target: NDArray[np.float32]  # (R, C, classes) shares in the cells of the canvas, 0 beside the part


@dataclass(frozen=True, eq=False)
class _Variant:
    """A varied picture as the head gets it."""

    features: Features  # of a branch, in half precision
    target: Tensor  # (classes, R, C) shares, 0 beside the picture


def _vary_picture(picture: LabelledPicture, rng: np.random.Generator) -> _Part:
    """A random part of a picture in other light.

    Args:
        picture: with its grid.
        rng: draws all that varies.
    """
    height, width = picture.pixels.shape[:2]
    landscape = (width >= height) != (rng.random() < _TURNED)
    share, stretch = rng.uniform(_MIN_CROP, 1.0), np.exp(rng.normal(0, _STRETCH_STD))
    shares = np.minimum(share * np.array([stretch, 1 / stretch]), 1.0)
    if landscape != (width >= height):
        shares[int(landscape)] *= 0.6
    part = _cut_part(picture, rng.uniform(0, 1 - shares), shares)
    part = replace(part, pixels=_vary_light(part.pixels, rng))
    return _mirror(part) if rng.random() < 0.5 else part


def _cut_part(picture: LabelledPicture, first: Floats, shares: Floats) -> _Part:
    """The part of a picture that begins at `first` (x, y) and has these shares of its width and height."""
    size = np.array(picture.pixels.shape[1::-1])
    box = (*(first * size), *((first + shares) * size))
    width, height = (max(1, round(side)) for side in shares * size)
    part_size = fit_in_box(width, height, _SPEC.width, _SPEC.height)
    image = Image.fromarray(picture.pixels).resize(part_size, Image.Resampling.HAMMING, box=box, reducing_gap=1.0)
    return _Part(np.asarray(image), _cell_shares(picture.grid, first, shares, part_size))


def _mirror(part: _Part) -> _Part:
    return _Part(np.ascontiguousarray(part.pixels[:, ::-1]), np.ascontiguousarray(part.target[:, ::-1]))


def _cell_shares(grid: NDArray[np.intp], first: Floats, shares: Floats, size: tuple[int, int]) -> NDArray[np.float32]:
    """The shares (R, C, classes) of classes in the cells of the canvas, 0 beside the part.

    The part of the grid begins at `first` (x, y), has these shares of it, and `size` (w, h) in the canvas's middle.
    """
    places, inside = [], []
    for side, begin, share, count, length in zip(_CANVAS, first, shares, grid.shape[::-1], size, strict=True):
        samples = (np.arange(side // CELL_PIXELS * _SAMPLES) + 0.5) * CELL_PIXELS / _SAMPLES
        part = (samples - (side - length) // 2) / length
        places.append(np.clip(((begin + share * part) * count).astype(np.intp), 0, count - 1))
        inside.append((part >= 0) & (part < 1))
    ones = np.eye(len(SurfaceClass), dtype=np.float32)[grid[places[1][:, None], places[0]]]
    ones *= (inside[1][:, None] & inside[0])[..., None]
    rows, columns = (length // _SAMPLES for length in ones.shape[:2])
    return np.asarray(ones.reshape(rows, _SAMPLES, columns, _SAMPLES, -1).mean(axis=(1, 3)))


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


class _FrozenNetwork:
    """The part of the network that does not learn."""

    def __init__(self) -> None:
        self.backbone, self.branch = Backbone.pretrained(), SegmentationBranch(SegmentationHead()).eval()

    def __call__(self, pictures: Sequence[NDArray[np.uint8]]) -> Features:
        """The branch's features of pictures (h, w, 3) that fill the canvas."""
        canvases = torch.from_numpy(np.stack([pad_to_input(pixels, _SPEC) for pixels in pictures]))
        with torch.inference_mode():
            return self.branch.features(self.backbone.frozen_features(canvases))


def _make_variants(frozen: _FrozenNetwork, pictures: Sequence[LabelledPicture], seed: int) -> list[_Variant]:
    """_VARIANTS of each picture but the weak ones, the picture as it is, and its mirror image."""
    rng = np.random.default_rng(seed)
    sure = [picture for picture in pictures if not picture.weak]
    parts = [_vary_picture(picture, rng) for picture in sure for _ in range(_VARIANTS)]
    whole = [_cut_part(picture, np.zeros(2), np.ones(2)) for picture in sure]
    parts += whole + [_mirror(part) for part in whole]
    return _compute_variants(frozen, parts, _BLUR)


def _taught_part(view: NDArray[np.uint8], segments: Segments, rng: np.random.Generator) -> _Part:
    """A view in other light, and what the teacher says of it."""
    small = _fit_canvas(view)
    size = small.shape[1::-1]
    planes = (Image.fromarray(np.ascontiguousarray(plane)) for plane in np.moveaxis(segments, 2, 0))
    pixels = np.stack([np.asarray(plane.resize(size, Image.Resampling.BILINEAR)) for plane in planes], axis=-1)
    part = _Part(_vary_light(small, rng), _average_cells(pixels))
    return _mirror(part) if rng.random() < 0.5 else part


def _fit_canvas(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture (h, w, 3) in the size that fills the canvas."""
    height, width = pixels.shape[:2]
    return resize_to_input(Photo(pixels, width, height, "PIXELS"), _SPEC)


def _average_cells(shares: NDArray[np.float32]) -> NDArray[np.float32]:
    """Shares (R, C, classes) in the canvas's cells, 0 beside the picture, by those of its pixels (h, w, classes)."""
    (height, width), (columns, rows) = shares.shape[:2], _CANVAS // CELL_PIXELS
    canvas = np.zeros((_SPEC.height, _SPEC.width, len(SurfaceClass)), np.float32)
    top, left = (_SPEC.height - height) // 2, (_SPEC.width - width) // 2
    canvas[top : top + height, left : left + width] = shares
    return np.asarray(canvas.reshape(rows, CELL_PIXELS, columns, CELL_PIXELS, -1).mean(axis=(1, 3)))


def _compute_variants(frozen: _FrozenNetwork, parts: Iterable[_Part], blur: float) -> list[_Variant]:
    """Parts of pictures as the head gets them; cells have that share of their labels from their neighbors."""
    variants: list[_Variant] = []
    remaining = iter(parts)
    while some := list(islice(remaining, _FEATURE_BATCH)):
        target = torch.from_numpy(np.stack([part.target for part in some])).permute(0, 3, 1, 2)
        inside = target.sum(dim=1, keepdim=True)
        near = nn.functional.avg_pool2d(nn.functional.pad(target, (1, 1, 1, 1), mode="replicate"), 3, 1)
        near = inside * near / near.sum(dim=1, keepdim=True).clamp_min(1e-6)
        fine, middle, far = (maps.half() for maps in frozen([part.pixels for part in some]))
        shares = (1 - blur) * target + blur * near
        variants += [_Variant((f, m, r), own) for f, m, r, own in zip(fine, middle, far, shares, strict=True)]
    return variants


def _train_head(variants: Sequence[_Variant], taught: Sequence[_Variant]) -> SegmentationHead:
    """A head that learned from labeled variants and from taught ones."""
    torch.manual_seed(1)
    head, rng = SegmentationHead(), np.random.default_rng(0)
    share = torch.stack([v.target.sum(dim=(1, 2)) for v in variants]).mean(dim=0)
    share = share / share.sum()
    weight = (share + 0.005) ** -_RARITY_POWER
    weight = weight / (weight * share).sum()
    optimizer = torch.optim.AdamW(head.parameters(), _LEARNING_RATE, weight_decay=_WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, _LEARNING_RATE, total_steps=_STEPS + 1, pct_start=_WARM_UP, cycle_momentum=False
    )
    head.train()
    for _ in range(_STEPS):
        batch = [variants[i] for i in rng.choice(len(variants), _BATCH)]
        if taught:
            batch += [taught[i] for i in rng.choice(len(taught), _TAUGHT)]
        features = (torch.stack(maps).float() for maps in zip(*(v.features for v in batch), strict=True))
        loss = _loss(head(*features), torch.stack([v.target for v in batch]), weight)
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
        schedule.step()
    _raise_odds(head, SurfaceClass.GROUND, _GROUND_ODDS)
    return head.eval()


def _raise_odds(head: SegmentationHead, kind: SurfaceClass, factor: float) -> None:
    """Make a class likelier everywhere.

    Args:
        head: changed in place.
        kind: the class.
        factor: by which its odds against each other class grow.
    """
    bias = head.classes.bias
    assert bias is not None
    with torch.no_grad():
        bias[kind] += math.log(factor)


def _loss(logits: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    """Cross entropy with shares, and that of ground against the rest, over the cells of pictures."""
    log, inside = logits.log_softmax(dim=1), target.sum(dim=1)
    classes = -(weight[:, None, None] * target * log).sum()
    ground, share = log[:, SurfaceClass.GROUND].exp().clamp(1e-4, 1 - 1e-4), target[:, SurfaceClass.GROUND]
    against_rest = -(share * ground.log() + (inside - share) * (1 - ground).log()).sum()
    return (classes + _GROUND_WEIGHT * against_rest) / inside.sum()


def train_segmentation(data: Path, teacher: Path, out: Path) -> str:
    """Train a head on the `train` rows and write its branch as a run; returns what was written, in words.

    Args:
        data: folder with `ground.csv`, photos and panoramas.
        teacher: ONNX file of segments-1.1.0.
        out: folder to write, for `write_onnx`.

    Raises:
        DataError: a table is missing, a grid cannot be read, or the folder already holds a run.
        ModelError: the teacher is missing or damaged.
    """
    check_new(out)
    frozen, pictures = _FrozenNetwork(), [*read_labelled_pictures(data, "train"), *_read_more_pictures(data)]
    rng = np.random.default_rng(3)
    parts = (_taught_part(*view, rng) for view in teach_views(teacher, data, seed=4))
    taught = _compute_variants(frozen, parts, blur=0.0)  # one variant of each view
    branch = SegmentationBranch(_train_head(_make_variants(frozen, pictures, seed=1), taught))
    grids = f"{len(pictures)} pictures with grids of what they show"
    source = f"{grids} and {len(taught)} that another network answered for, most with no stated licence"
    write_run(out, {"spec": asdict(_SPEC), "training_data": f"from ImageNet weights, {source}"}, branch.state_dict())
    return f"{out}: a branch for `onnx --segments`, of {source}"


def cross_validate_segmentation(data: Path, folds: int) -> Iterator[tuple[LabelledPicture, NDArray[np.float32]]]:
    """All labeled pictures, each with what a head that learned nothing of its photographer or place says of it.

    The heads have no teacher: segments-1.1.0 knew the grids of `train`.

    Args:
        data: folder with `ground.csv`, and its pictures.
        folds: into which photographers and places fall, 2 or more; one head each learns from the other folds.

    Yields:
        a picture, and probabilities (R, C, classes) of its canvas's cells.

    Raises:
        DataError: a table is missing, a grid cannot be read, or there are more folds than photographers and places.
    """
    pictures = [*read_labelled_pictures(data, "train"), *read_labelled_pictures(data, "val")]
    pictures += _read_more_pictures(data)
    frozen, groups = _FrozenNetwork(), _split_groups(pictures, folds)
    parts = [_make_variants(frozen, [p for p in pictures if p.group in some], seed=1) for some in groups]
    for judged, own in zip(groups, parts, strict=True):
        head = _train_head([variant for part in parts if part is not own for variant in part], [])
        for picture in pictures:
            if picture.group in judged:
                yield picture, _predict_canvas(frozen, head, picture)


def _split_groups(pictures: Sequence[LabelledPicture], folds: int) -> list[set[str]]:
    """The groups of each fold: the largest first, each into the fold with the fewest pictures."""
    sizes = Counter(picture.group for picture in pictures)
    if len(sizes) < folds:
        raise DataError(f"{len(sizes)} photographers and places cannot fall into {folds} folds.")
    groups: list[set[str]] = [set() for _ in range(folds)]
    filled = [0] * folds
    for group, count in sizes.most_common():
        fold = filled.index(min(filled))
        groups[fold].add(group)
        filled[fold] += count
    return groups


def _predict_canvas(frozen: _FrozenNetwork, head: SegmentationHead, picture: LabelledPicture) -> NDArray[np.float32]:
    """Probabilities (R, C, classes) of the cells of a picture's canvas."""
    with torch.inference_mode():
        shares = head(*frozen([_fit_canvas(picture.pixels)])).softmax(dim=1)
    return np.asarray(shares[0].permute(1, 2, 0).numpy())


# Pictures without labels, and what an earlier network said that they show.

_INPUT_SIZE = (384, 288)  # pixels of the teacher's input, longer and shorter side
_SIDE = 400  # pixels of a picture's longer side
_VIEWS = 2  # of each photo and of each panorama
_MIN_PART = 0.6  # share of a photo's sides that its second view shows
_ASPECTS, _ASPECT_SHARES = ((400, 300), (300, 400), (400, 266), (400, 225)), (0.4, 0.25, 0.2, 0.15)
_FOV = (35.0, 75.0)  # deg, vertical, of a view of a panorama
_TILT, _TILT_STD, _ROLL_STD = -4.0, 10.0, 3.0  # deg


def teach_views(file: Path, folder: Path, seed: int) -> Iterator[tuple[NDArray[np.uint8], Segments]]:
    """Views (h, w, 3) sRGB of pictures without labels, and what the teacher says of each and of its mirror image.

    Args:
        file: the teacher's ONNX file.
        folder: of the data.
        seed: of what the views show.

    Raises:
        DataError: a table is missing, or a picture cannot be read.
        ModelError: the teacher is missing or damaged.
    """
    session = create_session(file, threads=1)

    def ask(picture: Image.Image) -> Segments:
        size = _INPUT_SIZE if picture.width >= picture.height else _INPUT_SIZE[::-1]
        stretched = np.asarray(picture.resize(size, Image.Resampling.BOX, reducing_gap=2.0))
        segments: Segments = session.run(None, {"photo": stretched[None]})[0][0]
        return segments

    for view in _read_views(folder, seed):
        picture = Image.fromarray(view)
        yield view, np.asarray((ask(picture) + ask(ImageOps.mirror(picture))[:, ::-1]) / 2)


def _read_views(folder: Path, seed: int) -> Iterator[NDArray[np.uint8]]:
    """Views (h, w, 3) sRGB of the photos and of the 8-bit panoramas of `train`."""
    rng = np.random.default_rng(seed)
    for row in read_table(folder / PHOTOS, ("file",)):
        photo = Image.fromarray(read_photo(folder / row["file"]).pixels)
        for number in range(_VIEWS):
            yield _view_photo(photo, rng.uniform(_MIN_PART, 1.0, 2) if number else np.ones(2), rng)
    for panorama in read_index(folder, "train"):
        if panorama.kind == "ldr":
            picture = read_picture(panorama).astype(np.float32)
            for _ in range(_VIEWS):
                directions = camera_directions(_draw_camera(rng)).astype(np.float32)
                yield np.round(sample_latlong(picture, directions)).astype(np.uint8)


def _view_photo(photo: Image.Image, shares: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.uint8]:
    """A part of a photo with these shares of its width and height."""
    first, sides = rng.uniform(0, 1 - shares) * photo.size, shares * photo.size
    size = fit_in_box(max(1, round(sides[0])), max(1, round(sides[1])), _SIDE, _SIDE)
    return np.asarray(photo.resize(size, Image.Resampling.BOX, box=(*first, *(first + sides))))


def _draw_camera(rng: np.random.Generator) -> Pinhole:
    width, height = _ASPECTS[rng.choice(len(_ASPECTS), p=_ASPECT_SHARES)]
    azimuth, elevation, roll = rng.uniform(-180, 180), rng.normal(_TILT, _TILT_STD), rng.normal(0, _ROLL_STD)
    return Pinhole(width, height, rng.uniform(*_FOV), azimuth, elevation, roll)
