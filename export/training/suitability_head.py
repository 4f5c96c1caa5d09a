"""The head that says whether a photo suits: a linear classifier on the pooled features of the networks that answer.

What it separates: crops of panoramas and ordinary photos, shade and cloud included, from indoors, night, screens,
drawings, pictures on their side or upside down, whole panoramas, black and blown-out frames. The bias is set so that a
probability of one half raises a false alarm for FALSE_ALARMS of the photos of held-out training places.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from export.crops.augmentation import augment
from export.crops.cameras import training_camera
from export.crops.crops import Source, crop_panorama, crop_rng, load_sources
from export.crops.negatives import Picture, read_unsuitable, unsuitable_pictures
from export.crops.photos import crop_photo, load_photos, photo_weights
from export.data.panoramas import DataError, read_index, read_table
from export.data.photos import read_photo_rows
from export.networks.outdoor import Outdoor
from export.networks.weights import CHECKPOINT, read_checkpoint, read_network, read_spec
from export.training.dataset import split_places
from lighting.files.atomic import atomic_write
from lighting.geometry import Floats
from lighting.photo.preprocess import pad_to_input, resize_to_input
from lighting.photo.reader import read_photo
from lighting.records import ModelSpec

FALSE_ALARMS = 0.005
RATES = (0.005, 0.01)  # of false alarms, at which the report says what is caught
FOLDS = 5
CROPS = 1500  # of training panoramas, half as many of held-out ones, and as many made negatives
PHOTOS = 500
EACH = 12  # variants of each unsuitable picture
HELD_OUT = 0.25  # of the places
DECAY = 1e-3
STEPS = 300
TURNED = ("photo turned left", "photo upside down", "photo turned right")
PHOTOS_TABLE = "photos.csv"
BATCH = 32

Names = NDArray[np.str_]


@dataclass(frozen=True)
class _Head:
    """Weight (F,) and bias of the logit that a photo suits; F is 1280 for each network."""

    weight: Tensor
    bias: float

    def suits(self, features: Tensor) -> Tensor:
        """Logits (N,)."""
        return features @ self.weight + self.bias


def fit_suitability_head(runs: Sequence[Path], data: Path, labels: Path) -> str:
    """Fit the head, write each run's part of it into its averaged weights, and return in words what it achieves.

    The runs answer together: the mean of their logits is the head's. DataError if one has not learnt the light, since
    only such networks say whether a photo suits.
    """
    networks, spec = [_outdoor(run) for run in runs], read_spec(runs[0])
    kept, held_out = (load_sources(part, labels) for part in split_places(read_index(data, "train"), HELD_OUT))
    known = read_unsuitable(data)
    ours = _photos(data, spec)
    good = _features(networks, spec, [*ours, *(p for p, _ in _crops(kept, CROPS, spec))])
    other = _features(networks, spec, (p for p, _ in _crops(held_out, CROPS // 2, spec)))
    bad = list(unsuitable_pictures(known, _crops(kept, CROPS, spec), EACH, spec))
    turned = [np.ascontiguousarray(np.rot90(p, 1 + number % 3)) for number, p in enumerate(ours)]
    kinds = np.array([*(kind for kind, _ in bad), *(TURNED[number % 3] for number in range(len(ours)))])
    wrong = _features(networks, spec, [*(picture for _, picture in bad), *turned])
    fold = _folds([picture.group for picture in known], EACH, len(wrong) - EACH * len(known))
    head = _fit(good, wrong, other)
    report = [_report(_caught(good, other, wrong, fold), kinds), _on_photos(head, networks, data, spec)]
    _write(runs, head)
    return "\n".join(filter(None, report))


def _outdoor(run: Path) -> Outdoor:
    network = read_network(run)
    if not isinstance(network, Outdoor) or network.suitable is None:
        raise DataError(f"{run} cannot say whether a photo suits: it has not learnt --surroundings.")
    return network


def _photos(data: Path, spec: ModelSpec) -> list[Picture]:
    """Ordinary photos to learn from, as pictures."""
    photos = load_photos(read_photo_rows(data))
    rng = np.random.default_rng(1)
    drawn: list[int] = rng.choice(len(photos), PHOTOS, p=photo_weights(photos)).tolist() if photos else []
    return [augment(crop_photo(photos[i], rng, spec), rng)[0] for i in drawn]


def _on_photos(head: _Head, networks: Sequence[Outdoor], data: Path, spec: ModelSpec) -> str:
    """What the head says of the photos of `photos.csv`, which no run learnt from, and of the same photos turned."""
    table = data / PHOTOS_TABLE
    if not table.exists():
        return ""
    photos = [resize_to_input(read_photo(data / row["file"]), spec) for row in read_table(table, ("file",))]
    shares = [
        100 * float((head.suits(_features(networks, spec, (np.rot90(p, turn) for p in photos))) < 0).float().mean())
        for turn in range(4)
    ]
    upright, left, down, right = (f"{share:.1f}" for share in shares)
    return (
        f"Of {len(photos)} photos {upright} % are doubted; turned left, right, upside down: {left}, {right}, {down} %."
    )


def _crops(sources: Sequence[Source], count: int, spec: ModelSpec) -> Iterator[tuple[Picture, Source]]:
    """Training crops as pictures, of one source after the other."""
    for number in range(count):
        source = sources[number * 7919 % len(sources)]
        rng = crop_rng(source.panorama.name, number, "suitable")
        yield augment(crop_panorama(source, training_camera(rng), spec), rng)[0], source


def _features(networks: Sequence[Outdoor], spec: ModelSpec, shown: Iterable[Picture]) -> Tensor:
    """Pooled features (N, 1280 a network) of pictures (h, w, 3)."""
    found, waiting = [], []
    for picture in shown:
        waiting.append(torch.from_numpy(pad_to_input(np.ascontiguousarray(picture), spec)))
        if len(waiting) == BATCH:
            found.append(_pooled(networks, waiting))
            waiting = []
    return torch.cat([*found, _pooled(networks, waiting)] if waiting else found)


def _pooled(networks: Sequence[Outdoor], photos: list[Tensor]) -> Tensor:
    batch = torch.stack(photos).to(memory_format=torch.channels_last)
    with torch.inference_mode():
        return torch.cat([network.backbone(batch)[2] for network in networks], dim=1).clone()


def _fit(good: Tensor, bad: Tensor, calibrating: Tensor) -> _Head:
    """The head that separates good from bad features, its bias set on further good ones."""
    x = torch.cat([good, bad])
    y = torch.cat([torch.ones(len(good)), torch.zeros(len(bad))])
    mean, spread = x.mean(dim=0), x.std(dim=0) + 1e-3
    weight, bias = nn.Parameter(torch.zeros(x.shape[1])), nn.Parameter(torch.zeros(()))
    balance = torch.where(y > 0, 0.5 / len(good), 0.5 / len(bad))
    optimizer: Any = torch.optim.LBFGS([weight, bias], max_iter=STEPS, line_search_fn="strong_wolfe")

    def cost() -> Tensor:
        optimizer.zero_grad()
        loss = nn.functional.binary_cross_entropy_with_logits(
            (x - mean) / spread @ weight + bias, y, balance, reduction="sum"
        )
        total = loss + DECAY * (weight**2).sum()
        torch.autograd.backward(total)
        return total

    optimizer.step(cost)
    slope = (weight / spread).detach()
    return _Head(slope, -float(np.quantile((calibrating @ slope).numpy(), FALSE_ALARMS)))


def _caught(good: Tensor, other: Tensor, wrong: Tensor, fold: NDArray[np.intp]) -> dict[float, Floats]:
    """For each of RATES how often each picture is caught (N,) by heads that did not see its fold (N,).

    Pictures of fold -1 are seen by all heads and judged by all.
    """
    found: dict[float, Floats] = {rate: np.zeros(len(fold)) for rate in RATES}
    folds = [number for number in range(FOLDS) if np.any(fold == number)]
    for number in folds:
        head = _fit(good, wrong[torch.from_numpy(fold != number)], other)
        scores, usual = head.suits(wrong).numpy(), head.suits(other).numpy()
        for rate, seen in found.items():
            low = scores < np.quantile(usual, rate)
            seen[fold == number] = low[fold == number]
            seen[fold == -1] += low[fold == -1] / len(folds)
    return found


def _folds(groups: Sequence[str], each: int, made: int) -> NDArray[np.intp]:
    """The fold of each variant of pictures of these groups, a group in one, and -1 for the made ones after them."""
    names = {name: number % FOLDS for number, name in enumerate(dict.fromkeys(groups))}
    listed = np.repeat([names[group] for group in groups], each).astype(np.intp)
    return np.concatenate([listed, np.full(made, -1, dtype=np.intp)])


def _report(seen: dict[float, Floats], kinds: Names) -> str:
    """What is caught by kind, at each rate of false alarms."""
    rates = " and ".join(f"{100 * rate:g} %" for rate in seen)
    lines = [
        f"Caught [%], at {rates} false alarms on held-out training places; listed pictures by heads that saw none of "
        "their owner's, made ones by heads that saw them:"
    ]
    for kind in dict.fromkeys(kinds.tolist()):
        of = kinds == kind
        shares = ", ".join(f"{100 * values[of].mean():.0f}" for values in seen.values())
        lines.append(f"{kind}: {shares} of {np.count_nonzero(of)}")
    return "\n".join(lines)


def _write(runs: Sequence[Path], head: _Head) -> None:
    """Put each run's part of the head into its averaged weights; the mean of their logits is the head's."""
    for run, weight in zip(runs, head.weight.chunk(len(runs)), strict=True):
        state = read_checkpoint(run)
        state["average"]["module.suitable.weight"] = len(runs) * weight[None]
        state["average"]["module.suitable.bias"] = torch.tensor([head.bias])
        with atomic_write(run / CHECKPOINT) as path:
            torch.save(state, path)
