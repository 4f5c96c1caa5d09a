"""The suitability head: a linear classifier on what a finished file computes of a picture.

It separates crops of panoramas and ordinary photos, shade and cloud included, from other pictures. Those are indoors,
night, screens, drawings, pictures on their side or upside down, whole panoramas, black and blown-out frames, and those
of further folders. The bias is set so that a probability of one half raises a false alarm for _FALSE_ALARMS of the
photos of held-out training places.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import helper, numpy_helper
from PIL import Image, ImageDraw
from torch import Tensor, nn

from export.crops.augmentation import JPEG_SHARE, augment, recompress
from export.crops.crops import crop_panorama, crop_rng, load_source, training_camera
from export.crops.photos import crop_photo, load_photos, photo_weights, read_photo_rows
from export.data.labels import Label
from export.data.panoramas import DataError, Panorama, read_index, read_table
from export.networks.onnx_graph import save_graph
from export.networks.outdoor_transformer import TOKENS
from export.training.dataset import split_places
from lighting.color import tone_map
from lighting.geometry import Floats
from lighting.model import Model, fit_size, pad_to_input, resize_to_input
from lighting.onnx_session import create_session, import_onnxruntime, weights_path
from lighting.photo.reader import read_photo
from lighting.prediction import ModelSpec

# Pictures that the estimate is not for: those of `unsuitable.csv`, and synthetic ones.

Picture = NDArray[np.uint8]

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


def _synthesize(kind: str, crop: Picture, panorama: NDArray[Any], rng: np.random.Generator, spec: ModelSpec) -> Picture:
    """A picture of a kind of SYNTHETIC_KINDS, from a crop (h, w, 3) of a panorama or from the small panorama itself."""
    match kind:
        case "on its side":
            return np.ascontiguousarray(np.rot90(crop, rng.choice([1, 3])))
        case "upside down":
            return np.ascontiguousarray(crop[::-1, ::-1])
        case "whole panorama":
            picture = panorama if panorama.dtype == np.uint8 else tone_map(panorama * rng.uniform(0.5, 1.0))
            rolled = np.roll(picture, int(rng.integers(picture.shape[1])), axis=1)
            return np.asarray(Image.fromarray(rolled).resize(fit_size(2, 1, spec), Image.Resampling.HAMMING))
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


def _made_pictures(crops: Iterable[tuple[Picture, NDArray[Any]]], spec: ModelSpec) -> Iterator[tuple[str, Picture]]:
    """Kinds and pictures made of crops (h, w, 3) sRGB, kind by kind in turn.

    Args:
        crops: each with the panorama that it shows, small.
        spec: of the network that the pictures are for.
    """
    rng = np.random.default_rng(0)
    for number, (crop, panorama) in enumerate(crops):
        kind = SYNTHETIC_KINDS[number % len(SYNTHETIC_KINDS)]
        yield kind, _synthesize(kind, crop, panorama, rng, spec)


# The head in a finished file: what it sees, and new weights for it. Of a transformer it sees class tokens and means,
# which tell what is in the picture, and not the layout of what other heads see. Of other networks it sees the pooled
# features. All else that the file computes stays as it is, to the bit.

_WEIGHT, _REDUCE = "suitable.weight", "reduce.weight"  # of each network that answers


class SuitabilityFile:
    """A finished file with a head for `suitable`.

    Attributes:
        spec: of its networks.
    """

    def __init__(self, file: Path) -> None:
        """Read the file.

        Args:
            file: of `write_onnx`; its weights lie beside it.

        Raises:
            DataError: its networks have no such head.
            ModelError: it is missing or damaged, or no network.
        """
        self.spec = Model.load(file, threads=1).spec
        self._model = onnx.load(str(file))
        products = {node.input[1]: node for node in self._model.graph.node if node.op_type == "Gemm"}
        self._heads = [node for name, node in products.items() if name.endswith(_WEIGHT)]
        if not self._heads:
            raise DataError(f"{file} cannot say whether a photo suits: its networks have not learnt --surroundings.")
        shared = [products.get(node.input[1].replace(_WEIGHT, _REDUCE), node) for node in self._heads]
        self._sources = [node.input[0] for node in shared]
        self._session = _open_session(self._model, self._sources)

    def features(self, pictures: Iterable[NDArray[np.uint8]]) -> Tensor:
        """What the heads see (N, F) of pictures (h, w, 3), as the file computes it for each alone.

        Args:
            pictures: no larger than the canvas.
        """
        canvases = (pad_to_input(np.ascontiguousarray(picture), self.spec)[None] for picture in pictures)
        rows = [np.concatenate([seen[:, :TOKENS] for seen in self._run(canvas)], axis=1) for canvas in canvases]
        return torch.from_numpy(np.concatenate(rows))

    def _run(self, canvas: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        options = import_onnxruntime().RunOptions()
        options.only_execute_path_to_fetches = True
        seen: list[NDArray[np.float32]] = self._session.run(self._sources, {"photo": canvas}, options)
        return seen

    def write(self, out: Path, weight: Tensor, bias: float, version: str | None = None) -> None:
        """Write the file with another head; the mean of its networks' logits is the head's.

        Args:
            out: ONNX file to write; its weights lie beside it.
            weight: (F,) of the features.
            bias: of the logit that a photo suits.
            version: of the network; None keeps it.
        """
        model = onnx.ModelProto()
        model.CopyFrom(self._model)
        nodes = {node.output[0]: node for node in model.graph.node}
        tensors = {tensor.name: tensor for tensor in model.graph.initializer}
        seen = self._run(np.zeros((1, 3, self.spec.height, self.spec.width), np.float32))
        parts = weight.chunk(len(self._heads))
        for head, source, values_seen, part in zip(self._heads, self._sources, seen, parts, strict=True):
            nodes[head.output[0]].input[0] = source
            _, name, name_of_bias = head.input
            padded = np.zeros((1, values_seen.shape[1]))
            padded[:, : len(part)] = len(parts) * part.numpy()
            for key, values in ((name, padded), (name_of_bias, np.array([bias]))):
                tensors[key].CopyFrom(numpy_helper.from_array(values.astype(np.float32), key))
        spec = replace(self.spec, version=version or self.spec.version)
        for entry in model.metadata_props:
            entry.value = {"version": spec.version, "spec": spec.to_json()}.get(entry.key, entry.value)
        out.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=out.parent) as folder:
            path = Path(folder, out.name)
            save_graph(model, path)
            weights_path(path).replace(weights_path(out))
            path.replace(out)


def _open_session(model: Any, outputs: list[str]) -> Any:
    """A session of a model that also returns these values."""
    more = onnx.ModelProto()
    more.CopyFrom(model)
    kind, shape = onnx.TensorProto.FLOAT, ("n", "features")
    more.graph.output.extend(helper.make_tensor_value_info(name, kind, shape) for name in outputs)
    with TemporaryDirectory() as folder:
        path = Path(folder, "features.onnx")
        save_graph(more, path)
        return create_session(path, threads=1)


# The head.

_FALSE_ALARMS = 0.005
_RATES = (0.005, 0.01)  # of false alarms, at which the report tells what is caught
_FOLDS = 5
_CROPS, _HELD_OUT_CROPS = 4, 6  # of a panorama of each place; of half of the first, other pictures are made
_PHOTOS = 300
_EACH = 6  # variants of each picture of `unsuitable.csv`; further folders give one
_HELD_OUT = 0.25  # of the places
_WEIGHT_DECAY = 1e-2
_STEPS = 100
_ROTATED_KINDS = ("photo turned left", "photo upside down", "photo turned right")
_PHOTOS_TABLE = "photos.csv"

Names = NDArray[np.str_]


@dataclass(frozen=True)
class _Head:
    """Weight (F,) of the features and bias of the logit that a photo suits."""

    weight: Tensor
    bias: float

    def logits(self, features: Tensor) -> Tensor:
        """Logits (N,) that photos suit.

        Args:
            features: (N, F).
        """
        return features @ self.weight + self.bias


def fit_suitability_head(file: Path, data: Path, more: Sequence[Path], out: Path, version: str | None = None) -> str:
    """Fit the head, write the file with it, and return in words what it achieves.

    Args:
        file: of `write_onnx`.
        data: folder of panoramas, and of the tables `photos_train.csv`, `photos.csv` and `unsuitable.csv`.
        more: further folders with `unsuitable.csv`, whose pictures are learnt from.
        out: ONNX file to write; its weights lie beside it.
        version: of the network; None keeps the file's.

    Raises:
        DataError: a table is missing, or the file's networks have no such head.
        ModelError: the file is missing or damaged.
    """
    network = SuitabilityFile(file)
    spec = network.spec
    kept, held_out = (_one_a_place(part) for part in split_places(read_index(data, "train"), _HELD_OUT))
    photos = _photo_crops(data, spec)
    crops = list(_panorama_crops(kept, _CROPS, spec))
    good = network.features([*photos, *(crop for crop, _ in crops[::2])])
    other = network.features(crop for crop, _ in _panorama_crops(held_out, _HELD_OUT_CROPS, spec))
    rng = np.random.default_rng(1)
    listed = [picture for picture in _read_unsuitable(data) for _ in range(_EACH)]
    added = [replace(p, kind=f"{p.kind}, further") for folder in more for p in _read_unsuitable(folder)]
    bad = [(picture.kind, _vary(picture.pixels, rng, spec)) for picture in (*listed, *added)]
    bad += _made_pictures(crops[1::2], spec)
    bad += ((_ROTATED_KINDS[n % 3], np.rot90(p, 1 + n % 3)) for n, p in enumerate(photos))
    wrong = network.features(picture for _, picture in bad)
    fold = _folds([picture.group for picture in (*listed, *added)], len(wrong))
    kinds = np.array([kind for kind, _ in bad])
    share = _weigh_kinds(kinds)
    head = _fit(good, wrong, share, other)
    network.write(out, head.weight, head.bias, version)
    caught = _describe_kinds(_caught(good, other, wrong, share, fold), kinds)
    if not (table := data / _PHOTOS_TABLE).exists():  # of which nothing learnt
        return caught
    pictures = [resize_to_input(read_photo(data / row["file"]), spec) for row in read_table(table, ("file",))]
    doubted = 100 * float((head.logits(network.features(pictures)) < 0).float().mean())
    return f"{caught}\nOf {len(pictures)} photos {doubted:.1f} % are doubted."


def _one_a_place(panoramas: Sequence[Panorama]) -> list[Panorama]:
    """The first panorama of each place."""
    return list({panorama.place: panorama for panorama in reversed(panoramas)}.values())[::-1]


def _photo_crops(data: Path, spec: ModelSpec) -> list[Picture]:
    """Ordinary photos to learn from, as pictures."""
    photos = load_photos(read_photo_rows(data))
    rng = np.random.default_rng(1)
    drawn: list[int] = rng.choice(len(photos), _PHOTOS, p=photo_weights(photos)).tolist() if photos else []
    return [augment(crop_photo(photos[i], rng, spec), rng)[0] for i in drawn]


def _panorama_crops(
    panoramas: Iterable[Panorama], each: int, spec: ModelSpec
) -> Iterator[tuple[Picture, NDArray[Any]]]:
    """Training crops as pictures, the same number of each panorama, and this at its lowest resolution."""
    for panorama in panoramas:
        source = load_source(panorama, Label(panorama.name))
        for number in range(each):
            rng = crop_rng(panorama.name, number, "suitable")
            yield augment(crop_panorama(source, training_camera(rng), spec), rng)[0], source.levels[-1]


def _weigh_kinds(kinds: Names) -> Tensor:
    """What each picture counts (N,): kinds count by the root of how many pictures they have."""
    _, kind, counts = np.unique(kinds, return_inverse=True, return_counts=True)
    return torch.from_numpy((counts[kind] ** -0.5).astype(np.float32))


def _fit(good: Tensor, bad: Tensor, share: Tensor, calibrating: Tensor) -> _Head:
    """The head that separates good from bad features, which count by their share (N,); its bias is set on others."""
    x = torch.cat([good, bad])
    y = torch.cat([torch.ones(len(good)), torch.zeros(len(bad))])
    mean, std = x.mean(dim=0), x.std(dim=0) + 1e-3
    x = (x - mean) / std
    weight, bias = nn.Parameter(torch.zeros(x.shape[1])), nn.Parameter(torch.zeros(()))
    balance = torch.cat([torch.full((len(good),), 0.5 / len(good)), 0.5 * share / share.sum()])
    optimizer: Any = torch.optim.LBFGS([weight, bias], max_iter=_STEPS, line_search_fn="strong_wolfe")

    def cost() -> Tensor:
        optimizer.zero_grad()
        loss = nn.functional.binary_cross_entropy_with_logits(x @ weight + bias, y, balance, reduction="sum")
        total = loss + _WEIGHT_DECAY * (weight**2).sum()
        torch.autograd.backward(total)
        return total

    optimizer.step(cost)
    slope = (weight / std).detach()
    return _Head(slope, -float(np.quantile((calibrating @ slope).numpy(), _FALSE_ALARMS)))


def _caught(good: Tensor, other: Tensor, wrong: Tensor, share: Tensor, fold: NDArray[np.intp]) -> dict[float, Floats]:
    """For each of _RATES how often each picture is caught (N,) by heads that did not learn from its fold (N,).

    Pictures of fold -1 are learnt from by all heads and judged by all.
    """
    caught: dict[float, Floats] = {rate: np.zeros(len(fold)) for rate in _RATES}
    folds = [number for number in range(_FOLDS) if np.any(fold == number)]
    for number in folds:
        seen = torch.from_numpy(fold != number)
        head = _fit(good, wrong[seen], share[seen], other)
        scores, usual = head.logits(wrong).numpy(), head.logits(other).numpy()
        for rate, values in caught.items():
            low = scores < np.quantile(usual, rate)
            values[fold == number] = low[fold == number]
            values[fold == -1] += low[fold == -1] / len(folds)
    return caught


def _folds(groups: Sequence[str], count: int) -> NDArray[np.intp]:
    """The fold of each picture (count,) by its group, a group in one, and -1 for those after them, which have none."""
    names = {name: number % _FOLDS for number, name in enumerate(dict.fromkeys(groups))}
    return np.array([*(names[group] for group in groups), *[-1] * (count - len(groups))], dtype=np.intp)


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
