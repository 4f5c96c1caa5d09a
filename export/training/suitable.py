"""The head that says whether a photo suits: a linear classifier on a finished network's pooled features.

What it separates: crops of panoramas and ordinary photos, shade and cloud included, from indoors, night, screens,
drawings, pictures on their side, whole panoramas, black and blown-out frames. The bias is set so that a probability of
one half raises a false alarm for FALSE_ALARMS of the photos of held-out training places.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from export.crops import (
    Source,
    augment,
    generator,
    load_photos,
    load_sources,
    photo_weights,
    take,
    take_photo,
    training_camera,
)
from export.crops.unsuitable import Picture, pictures, read_unsuitable
from export.data import read_index, read_photo_rows
from export.networks import CHECKPOINT, read_network, read_spec
from export.networks.outdoor import Outdoor
from export.training.sources import split_places
from lighting.files import replacing
from lighting.geometry import Floats
from lighting.photo import place
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
BATCH = 32

Names = NDArray[np.str_]


@dataclass(frozen=True)
class Head:
    """Weight (1280,) and bias of the logit that a photo suits."""

    weight: Tensor
    bias: float

    def suits(self, features: Tensor) -> Tensor:
        """Logits (N,)."""
        return features @ self.weight + self.bias


def learn_suitable(run: Path, data: Path, labels: Path) -> str:
    """Fit the head, write it into the run's averaged weights, and return what it achieves in words."""
    network, spec = read_network(run), read_spec(run)
    assert isinstance(network, Outdoor)
    kept, held_out = (load_sources(part, labels) for part in split_places(read_index(data, "train"), HELD_OUT))
    photos = load_photos(read_photo_rows(data))
    known = read_unsuitable(data)
    rng = np.random.default_rng(1)
    drawn: list[int] = rng.choice(len(photos), PHOTOS, p=photo_weights(photos)).tolist() if photos else []
    ours = [augment(take_photo(photos[i], rng, spec), rng)[0] for i in drawn]
    good = features(network, spec, [*ours, *(p for p, _ in crops(kept, CROPS, spec))])
    other = features(network, spec, (p for p, _ in crops(held_out, CROPS // 2, spec)))
    bad = list(pictures(known, crops(kept, CROPS, spec), EACH, spec))
    kinds = np.array([kind for kind, _ in bad])
    wrong = features(network, spec, (picture for _, picture in bad))
    fold = _folds([picture.group for picture in known], EACH, len(bad) - EACH * len(known))
    report = _report(caught(good, other, wrong, fold), kinds)
    head = fit(good, wrong, other)
    write(run, head)
    return report


def crops(sources: Sequence[Source], count: int, spec: ModelSpec) -> Iterator[tuple[Picture, Source]]:
    """Training crops as pictures, of one source after the other."""
    for number in range(count):
        source = sources[number * 7919 % len(sources)]
        rng = generator(source.panorama.name, number, "suitable")
        yield augment(take(source, training_camera(rng), spec), rng)[0], source


def features(network: Outdoor, spec: ModelSpec, shown: Iterable[Picture]) -> Tensor:
    """Pooled features (N, 1280) of pictures (h, w, 3)."""
    found, waiting = [], []
    for picture in shown:
        waiting.append(torch.from_numpy(place(picture, spec)))
        if len(waiting) == BATCH:
            found.append(_pooled(network, waiting))
            waiting = []
    return torch.cat([*found, _pooled(network, waiting)] if waiting else found)


def _pooled(network: Outdoor, photos: list[Tensor]) -> Tensor:
    with torch.inference_mode():
        pooled: Tensor = network.backbone(torch.stack(photos).to(memory_format=torch.channels_last))[2]
        return pooled.clone()


def fit(good: Tensor, bad: Tensor, calibrating: Tensor) -> Head:
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
    return Head(slope, -float(np.quantile((calibrating @ slope).numpy(), FALSE_ALARMS)))


def caught(good: Tensor, other: Tensor, wrong: Tensor, fold: NDArray[np.intp]) -> dict[float, Floats]:
    """For each of RATES how often each picture is caught (N,) by heads that did not see its fold (N,).

    Pictures of fold -1 are seen by all heads and judged by all.
    """
    found: dict[float, Floats] = {rate: np.zeros(len(fold)) for rate in RATES}
    folds = [number for number in range(FOLDS) if np.any(fold == number)]
    for number in folds:
        head = fit(good, wrong[torch.from_numpy(fold != number)], other)
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
        f"Caught [%], at {rates} false alarms on held-out training places, by heads that saw no picture of its owner:"
    ]
    for kind in dict.fromkeys(kinds.tolist()):
        of = kinds == kind
        shares = ", ".join(f"{100 * values[of].mean():.0f}" for values in seen.values())
        lines.append(f"{kind}: {shares} of {np.count_nonzero(of)}")
    return "\n".join(lines)


def write(run: Path, head: Head) -> None:
    """Put the head into a run's averaged weights."""
    state = torch.load(run / CHECKPOINT, map_location="cpu", weights_only=True)
    state["average"]["module.suitable.weight"] = head.weight[None]
    state["average"]["module.suitable.bias"] = torch.tensor([head.bias])
    with replacing(run / CHECKPOINT) as path:
        torch.save(state, path)
