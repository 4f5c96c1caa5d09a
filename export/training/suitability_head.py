"""The suitability head: a linear classifier on the pooled features of the networks that answer together.

It separates crops of panoramas and ordinary photos, shade and cloud included, from other pictures. Those are indoors,
night, screens, drawings, pictures on their side or upside down, whole panoramas, black and blown-out frames. The bias
is set so that a probability of one half raises a false alarm for _FALSE_ALARMS of the photos of held-out training
places.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from torch import Tensor, nn

from export.crops.augmentation import JPEG_SHARE, augment, recompress
from export.crops.crops import Source, crop_panorama, crop_rng, load_sources, training_camera
from export.crops.photos import crop_photo, load_photos, photo_weights, read_photo_rows
from export.data.panoramas import DataError, read_index, read_table
from export.networks.outdoor import Outdoor
from export.networks.outdoor_transformer import OutdoorTransformer
from export.networks.weights import CHECKPOINT, read_checkpoint, read_network, read_spec
from export.training.dataset import split_places
from lighting.color import tone_map
from lighting.files import atomic_write
from lighting.geometry import Floats
from lighting.model import fit_size, pad_to_input, resize_to_input
from lighting.photo.reader import read_photo
from lighting.prediction import ModelSpec

# Pictures that the estimate is not for: those of `unsuitable.csv`, and synthetic ones.

Picture = NDArray[np.uint8]
_Suited = Outdoor | OutdoorTransformer

UNSUITABLE_TABLE = "unsuitable.csv"
SYNTHETIC_KINDS = ("on its side", "upside down", "whole panorama", "night", "black", "blown out", "drawing", "plain")


@dataclass(frozen=True, eq=False)
class _Unsuitable:
    """A picture that the estimate is not for."""

    kind: str
    group: str  # owner: pictures of one group are alike
    pixels: Picture


def _read_unsuitable(folder: Path) -> list[_Unsuitable]:
    """The folder's unsuitable pictures; none if it lists none.

    Args:
        folder: with `unsuitable.csv` and the pictures.
    """
    if not (folder / UNSUITABLE_TABLE).exists():
        return []
    rows = read_table(folder / UNSUITABLE_TABLE, ("file", "kind", "source"))
    return [_Unsuitable(r["kind"], r["source"].partition(":")[0], read_photo(folder / r["file"]).pixels) for r in rows]


def _vary(pixels: Picture, rng: np.random.Generator, spec: ModelSpec) -> Picture:
    """A random part of a picture at the canvas's size, mirrored and brightened at random."""
    height, width = pixels.shape[:2]
    share = rng.uniform(0.7, 1.0)
    left, top = rng.uniform(0, 1 - share, 2) * (width, height)
    size = fit_size(width, height, spec)
    box = (left, top, left + share * width, top + share * height)
    part = np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.HAMMING, box=box), dtype=np.float64)
    part = 255 * (part / 255) ** np.exp(rng.normal(0, 0.2)) * np.exp(rng.normal(0, 0.05, 3))
    part = part[:, ::-1] if rng.random() < 0.5 else part
    picture = np.clip(part, 0, 255).astype(np.uint8)
    return recompress(picture, rng) if rng.random() < JPEG_SHARE else picture


def _synthesize(kind: str, crop: Picture, source: Source, rng: np.random.Generator, spec: ModelSpec) -> Picture:
    """A picture of a kind of SYNTHETIC_KINDS, from a crop (h, w, 3) of a panorama or from the panorama itself."""
    match kind:
        case "on its side":
            return np.ascontiguousarray(np.rot90(crop, rng.choice([1, 3])))
        case "upside down":
            return np.ascontiguousarray(crop[::-1, ::-1])
        case "whole panorama":
            return _shrink_panorama(source, rng, spec)
        case "night":
            dark = (crop / 255.0) ** 2.2 * rng.uniform(0.003, 0.03) * np.exp(rng.normal(0, 0.3, 3))
            noisy = np.maximum(dark + rng.normal(0, 0.01, crop.shape), 0.0)
            return np.asarray(np.clip(255 * noisy ** (1 / 2.2), 0, 255), dtype=np.uint8)
        case "black":
            return np.clip(rng.normal(rng.uniform(0, 6), 2, crop.shape), 0, 255).astype(np.uint8)
        case "blown out":
            return np.asarray(np.clip(crop * rng.uniform(0.0, 0.2) + rng.uniform(235, 255), 0, 255), dtype=np.uint8)
        case "drawing":
            return _draw_chart(crop.shape, rng)
        case _:
            color = rng.uniform(0, 255, 3)
            return np.clip(color + rng.normal(0, rng.uniform(0, 8), crop.shape), 0, 255).astype(np.uint8)


def _shrink_panorama(source: Source, rng: np.random.Generator, spec: ModelSpec) -> Picture:
    level = source.levels[-1]
    picture = level if level.dtype == np.uint8 else tone_map(level * rng.uniform(0.5, 1.0))
    rolled = np.roll(picture, int(rng.integers(picture.shape[1])), axis=1)
    return np.asarray(Image.fromarray(rolled).resize(fit_size(2, 1, spec), Image.Resampling.HAMMING))


def _draw_chart(shape: tuple[int, ...], rng: np.random.Generator) -> Picture:
    """Boxes, lines and dots on a plain ground: a chart, a screen, a page."""
    image = Image.new("RGB", (shape[1], shape[0]), tuple(rng.integers(0, 256, 3).tolist()))
    draw = ImageDraw.Draw(image)
    for _ in range(int(rng.integers(5, 80))):
        x0, y0, x1, y1 = (rng.uniform(0, 1, 4) * (*shape[1::-1], *shape[1::-1])).tolist()
        color = tuple(rng.integers(0, 256, 3).tolist())
        box = (min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
        match int(rng.integers(4)):
            case 0:
                draw.rectangle(box, fill=color)
            case 1:
                draw.line((x0, y0, x1, y1), fill=color, width=int(rng.integers(1, 5)))
            case 2:
                draw.ellipse(box, outline=color)
            case _:
                draw.text((x0, y0), "".join(rng.choice(list("abcdefg hijklmno 12345"), 12)), fill=color)
    return np.asarray(image)


def _unsuitable_pictures(
    listed: list[_Unsuitable], crops: Iterator[tuple[Picture, Source]], each: int, spec: ModelSpec
) -> Iterator[tuple[str, Picture]]:
    """Kinds and pictures: variants of the listed ones, and one made of each crop, kind by kind in turn.

    Args:
        listed: those of `_read_unsuitable`.
        crops: (h, w, 3) sRGB, each with the panorama that it shows.
        each: variants of every listed picture.
        spec: of the network that the pictures are for.
    """
    rng = np.random.default_rng(0)
    for picture in listed:
        for _ in range(each):
            yield picture.kind, _vary(picture.pixels, rng, spec)
    for number, (crop, source) in enumerate(crops):
        kind = SYNTHETIC_KINDS[number % len(SYNTHETIC_KINDS)]
        yield kind, _synthesize(kind, crop, source, rng, spec)


# The head.

_FALSE_ALARMS = 0.005
_RATES = (0.005, 0.01)  # of false alarms, at which the report tells what is caught
_FOLDS = 5
_CROPS = 1500  # of training panoramas, half as many of held-out ones, and as many made negatives
_PHOTOS = 500
_EACH = 12  # variants of each unsuitable picture
_HELD_OUT = 0.25  # of the places
_WEIGHT_DECAY = 1e-3
_STEPS = 300
_ROTATED_KINDS = ("photo turned left", "photo upside down", "photo turned right")
PHOTOS_TABLE = "photos.csv"
_BATCH = 32

Names = NDArray[np.str_]


@dataclass(frozen=True)
class _Head:
    """Weight (F,) and bias of the logit that a photo suits; F is 1280 for each network, 768 for a transformer."""

    weight: Tensor
    bias: float

    def logits(self, features: Tensor) -> Tensor:
        """Logits (N,) that photos suit.

        Args:
            features: (N, F).
        """
        return features @ self.weight + self.bias


def fit_suitability_head(runs: Sequence[Path], data: Path, labels: Path) -> str:
    """Fit the head, write each run's part of it into its averaged weights, and return in words what it achieves.

    The runs answer together: the mean of their logits is the head's.

    Args:
        runs: folders of finished runs; their checkpoints are changed.
        data: folder of panoramas, and of the tables `photos_train.csv`, `photos.csv` and `unsuitable.csv`.
        labels: CSV file of `python -m export label`.

    Raises:
        DataError: if a run has not learnt the light, since only such networks have the head.
    """
    networks, spec = [_read_outdoor(run) for run in runs], read_spec(runs[0])
    kept, held_out = (load_sources(part, labels) for part in split_places(read_index(data, "train"), _HELD_OUT))
    listed = _read_unsuitable(data)
    photos = _photo_crops(data, spec)
    good = _features(networks, spec, [*photos, *(p for p, _ in _panorama_crops(kept, _CROPS, spec))])
    other = _features(networks, spec, (p for p, _ in _panorama_crops(held_out, _CROPS // 2, spec)))
    bad = list(_unsuitable_pictures(listed, _panorama_crops(kept, _CROPS, spec), _EACH, spec))
    rotated = [np.ascontiguousarray(np.rot90(p, 1 + number % 3)) for number, p in enumerate(photos)]
    kinds = np.array([*(kind for kind, _ in bad), *(_ROTATED_KINDS[number % 3] for number in range(len(photos)))])
    wrong = _features(networks, spec, [*(picture for _, picture in bad), *rotated])
    fold = _folds([picture.group for picture in listed], _EACH, len(wrong) - _EACH * len(listed))
    head = _fit(good, wrong, other)
    report = [_describe_kinds(_caught(good, other, wrong, fold), kinds), _describe_photos(head, networks, data, spec)]
    _write(runs, head)
    return "\n".join(filter(None, report))


def _read_outdoor(run: Path) -> _Suited:
    network = read_network(run)
    if not isinstance(network, Outdoor | OutdoorTransformer) or network.suitable is None:
        raise DataError(f"{run} cannot say whether a photo suits: it has not learnt --surroundings.")
    return network


def _photo_crops(data: Path, spec: ModelSpec) -> list[Picture]:
    """Ordinary photos to learn from, as pictures."""
    photos = load_photos(read_photo_rows(data))
    rng = np.random.default_rng(1)
    drawn: list[int] = rng.choice(len(photos), _PHOTOS, p=photo_weights(photos)).tolist() if photos else []
    return [augment(crop_photo(photos[i], rng, spec), rng)[0] for i in drawn]


def _describe_photos(head: _Head, networks: Sequence[_Suited], data: Path, spec: ModelSpec) -> str:
    """What the head predicts of the photos of `photos.csv`, which no run learnt from, and of the same photos turned."""
    table = data / PHOTOS_TABLE
    if not table.exists():
        return ""
    photos = [resize_to_input(read_photo(data / row["file"]), spec) for row in read_table(table, ("file",))]
    turned = [[np.rot90(p, quarters) for p in photos] for quarters in range(4)]
    logits = [head.logits(_features(networks, spec, pictures)) for pictures in turned]
    shares = [100 * float((values < 0).float().mean()) for values in logits]
    upright, left, down, right = (f"{share:.1f}" for share in shares)
    rotated = f"turned left, right, upside down: {left}, {right}, {down} %"
    return f"Of {len(photos)} photos {upright} % are doubted; {rotated}."


def _panorama_crops(sources: Sequence[Source], count: int, spec: ModelSpec) -> Iterator[tuple[Picture, Source]]:
    """Training crops as pictures, of one source after the other."""
    for number in range(count):
        source = sources[number * 7919 % len(sources)]
        rng = crop_rng(source.panorama.name, number, "suitable")
        yield augment(crop_panorama(source, training_camera(rng), spec), rng)[0], source


def _features(networks: Sequence[_Suited], spec: ModelSpec, pictures: Iterable[Picture]) -> Tensor:
    """Pooled features (N, F) of pictures (h, w, 3)."""
    photos = (torch.from_numpy(pad_to_input(np.ascontiguousarray(picture), spec)) for picture in pictures)
    return torch.cat([_pooled(networks, batch) for batch in iter(lambda: list(islice(photos, _BATCH)), [])])


def _pooled(networks: Sequence[_Suited], photos: list[Tensor]) -> Tensor:
    batch = torch.stack(photos).to(memory_format=torch.channels_last)
    with torch.inference_mode():
        return torch.cat([network.pooled(batch) for network in networks], dim=1).clone()


def _fit(good: Tensor, bad: Tensor, calibrating: Tensor) -> _Head:
    """The head that separates good from bad features, its bias set on further good ones."""
    x = torch.cat([good, bad])
    y = torch.cat([torch.ones(len(good)), torch.zeros(len(bad))])
    mean, std = x.mean(dim=0), x.std(dim=0) + 1e-3
    weight, bias = nn.Parameter(torch.zeros(x.shape[1])), nn.Parameter(torch.zeros(()))
    balance = torch.where(y > 0, 0.5 / len(good), 0.5 / len(bad))
    optimizer: Any = torch.optim.LBFGS([weight, bias], max_iter=_STEPS, line_search_fn="strong_wolfe")

    def cost() -> Tensor:
        optimizer.zero_grad()
        logits = (x - mean) / std @ weight + bias
        loss = nn.functional.binary_cross_entropy_with_logits(logits, y, balance, reduction="sum")
        total = loss + _WEIGHT_DECAY * (weight**2).sum()
        torch.autograd.backward(total)
        return total

    optimizer.step(cost)
    slope = (weight / std).detach()
    return _Head(slope, -float(np.quantile((calibrating @ slope).numpy(), _FALSE_ALARMS)))


def _caught(good: Tensor, other: Tensor, wrong: Tensor, fold: NDArray[np.intp]) -> dict[float, Floats]:
    """For each of _RATES how often each picture is caught (N,) by heads that did not learn from its fold (N,).

    Pictures of fold -1 are learnt from by all heads and judged by all.
    """
    caught: dict[float, Floats] = {rate: np.zeros(len(fold)) for rate in _RATES}
    folds = [number for number in range(_FOLDS) if np.any(fold == number)]
    for number in folds:
        head = _fit(good, wrong[torch.from_numpy(fold != number)], other)
        scores, usual = head.logits(wrong).numpy(), head.logits(other).numpy()
        for rate, values in caught.items():
            low = scores < np.quantile(usual, rate)
            values[fold == number] = low[fold == number]
            values[fold == -1] += low[fold == -1] / len(folds)
    return caught


def _folds(groups: Sequence[str], each: int, made: int) -> NDArray[np.intp]:
    """The fold of each variant of pictures of these groups, a group in one, and -1 for the made ones after them."""
    names = {name: number % _FOLDS for number, name in enumerate(dict.fromkeys(groups))}
    listed = np.repeat([names[group] for group in groups], each).astype(np.intp)
    return np.concatenate([listed, np.full(made, -1, dtype=np.intp)])


def _describe_kinds(caught: dict[float, Floats], kinds: Names) -> str:
    """What is caught by kind, at each rate of false alarms."""
    rates = " and ".join(f"{100 * rate:g} %" for rate in caught)
    lines = [
        f"Caught [%], at {rates} false alarms on held-out training places; listed pictures by heads that saw none of "
        "their owner's, made ones by heads that saw them:"
    ]
    for kind in dict.fromkeys(kinds.tolist()):
        chosen = kinds == kind
        shares = ", ".join(f"{100 * values[chosen].mean():.0f}" for values in caught.values())
        lines.append(f"{kind}: {shares} of {np.count_nonzero(chosen)}")
    return "\n".join(lines)


def _write(runs: Sequence[Path], head: _Head) -> None:
    """Put each run's part of the head into its averaged weights; the mean of their logits is the head's."""
    for run, weight in zip(runs, head.weight.chunk(len(runs)), strict=True):
        state = read_checkpoint(run)
        state["average"]["module.suitable.weight"] = len(runs) * weight[None]
        state["average"]["module.suitable.bias"] = torch.tensor([head.bias])
        with atomic_write(run / CHECKPOINT) as path:
            torch.save(state, path)
