"""One readable loop that trains either network on crops drawn on the fly; stops and resumes at any time.

The folder it writes holds config.json (everything the run depends on, with the commit), log.jsonl and checkpoint.pt.
"""

import hashlib
import json
import math
import subprocess
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn
from torch.utils.data import DataLoader, Dataset

from export.crops.augment import augment
from export.crops.crops import (
    Camera,
    Crop,
    Floats,
    Source,
    aimed_camera,
    generator,
    is_resolved,
    load_source,
    paper_camera,
    sampling_weights,
    take,
    training_camera,
)
from export.crops.glare import where_seen
from export.crops.mosaic import companions, joined, same_view
from export.crops.surroundings import light_around, seen_from
from export.data.labels import Label, read_labels
from export.data.panoramas import DataError, Panorama, read_index
from export.networks.network import TARGET_WIDTH, Said, build, encode, load_weights, specs
from export.networks.runs import RECORD, history, read_record
from export.towns.dataset import LABELS
from lighting.files import replacing
from lighting.photo import place
from lighting.records import ModelSpec
from lighting.sun_grid import grid_directions, soft_label

MAY_CHANGE = ("out", "workers", "checkpoint_minutes")  # settings that a run may be resumed with: its folder may move
PARAMETER_WEIGHTS = (0.5, 0.5, 1.5, 1.0, 1.0)  # turbidity, exposure, camera elevation, roll, field of view
AROUND_WEIGHT = 5.0  # of the light around the camera


@dataclass(frozen=True)
class TrainConfig:
    """Everything a training run depends on besides the data."""

    data: str  # folder of panoramas
    labels: str  # CSV of `python -m export label`
    out: str  # folder for config.json, log.jsonl and checkpoint.pt
    network: str = "outdoor"  # or "cvpr2017"
    version: str = "1.0.0"
    crops: int = 100_000  # drawn in all
    batch: int = 32
    learning_rate: float = 8e-4
    weight_decay: float = 0.05
    warmup: float = 0.03  # share of the run
    ema: float = 0.998  # per step, of the averaged weights that are kept in the end
    target_width: float = TARGET_WIDTH["outdoor"]  # deg per axis, in quadrature with each label's own uncertainty
    tune_share: float = 0.08  # of the training places, held out for the log
    aimed: float = 0.2  # of the crops of panoramas that show the sun, turned until they hold it
    joined: float = 0.0  # of the crops, with a second place under the same sun beyond a line
    surroundings: bool = False  # learn also to say the light all around the camera
    sharpness: float = 0.45  # lowest share of the canvas's resolution that a crop keeps
    licensed_only: bool = False  # train on permissively licensed panoramas alone
    pretrained: bool = True
    only_seen: bool = False  # train what says where in the picture the sun is seen, and leave the rest as it is
    start: str = ""  # folder of an earlier run, whose averaged weights this one starts from; its crops are others
    synthetic: str = ""  # folder of `python -m export synthesize`, mixed in
    synthetic_share: float = 0.3  # of the crops, where there is such a folder
    workers: int = 2
    checkpoint_minutes: float = 4.0


class Batch(NamedTuple):
    """Tensors of B crops; NaN parameters are unknown, sun targets without a sun are all zero."""

    photo: Tensor  # (B, 3, H, W)
    sun: Tensor  # (B, G)
    parameters: Tensor  # (B, 6)
    seen: Tensor  # (B, 1 + cells) where in the picture the sun is seen, all zero where that is not known
    around: Tensor  # (B, 2 * surroundings.CELLS) the light around the camera; (B, 0) where nothing asks for it


class Crops(Dataset[Batch]):
    """Training crops by number: number i is the same crop in every run over the same panoramas."""

    def __init__(
        self,
        sources: Sequence[Source],
        spec: ModelSpec,
        config: TrainConfig,
        *,
        synthetic: Sequence[Source] = (),
        tune: bool = False,
    ) -> None:
        self.sources, self.spec, self.config, self.tune = [*sources, *synthetic], spec, config, tune
        share = config.synthetic_share if synthetic else 0.0
        parts = [(1 - share) * sampling_weights(sources), share * sampling_weights(synthetic)]
        chances = np.concatenate(parts)
        self.chances = np.cumsum(chances)
        self.companions = companions(self.sources, chances) if config.joined and not tune else []
        self.around = {s.panorama.path: light_around(s) for s in self.sources} if config.surroundings else {}
        self.purpose = f"train from {config.start}" if config.start else "train"

    def __len__(self) -> int:
        return 8 * len(self.sources) if self.tune else self.config.crops

    def __getitem__(self, index: int) -> Batch:
        if index >= len(self):
            raise IndexError(index)
        if self.tune:
            return self._batch([self.sources[index % len(self.sources)]], index, "tune")
        return self._batch([self.sources[number] for number in self._drawn(index)], index, self.purpose)

    def _drawn(self, index: int) -> list[int]:
        """The number of the source that a crop shows, and at times of a second one."""
        number = _draw(self.chances, generator("panorama", index, self.purpose))
        rng = generator("joined", index, self.purpose)
        if rng.random() >= self.config.joined:
            return [number]
        numbers, chances = self.companions[number]
        return [number, int(numbers[_draw(chances, rng)])]

    def _batch(self, shown: Sequence[Source], index: int, purpose: str) -> Batch:
        source = shown[0]
        rng = generator(source.panorama.name, index, purpose)
        camera = paper_camera(rng) if self.tune else self._camera(source, rng)
        sharpness = rng.uniform(self.config.sharpness, 1.0)
        crop = take(source, camera, self.spec, sharpness)
        cameras = [camera]
        for other in shown[1:]:
            cameras.append(same_view(camera, source, other, rng))
            crop = joined(crop, take(other, cameras[-1], self.spec, sharpness), rng)
        pixels, gain, hidden = augment(crop, rng)
        parameters = crop.parameters
        parameters[1] *= gain
        if not all(is_resolved(s, camera, sharpness * pixels.shape[0]) for s in shown):
            parameters[4] = math.nan  # the blur would tell it
        visible = {"unknown": None, "visible": not hidden}.get(source.panorama.sun, False)
        seen = torch.from_numpy(where_seen(crop, self.spec, visible)).float()
        photo = torch.from_numpy(place(pixels, self.spec))
        around = torch.from_numpy(self._around(shown, cameras))
        return Batch(photo, self._sun(crop), torch.from_numpy(parameters), seen, around)

    def _sun(self, crop: Crop) -> Tensor:
        cells = torch.zeros(len(grid_directions(self.spec.sun_grid)))
        if math.isfinite(crop.sun_elevation):
            width = math.hypot(crop.sun_uncertainty, self.config.target_width)
            label = soft_label(crop.sun_direction, math.radians(width) ** -2, self.spec.sun_grid)
            cells[:] = torch.from_numpy(label)
        return cells

    def _around(self, shown: Sequence[Source], cameras: Sequence[Camera]) -> Floats:
        """The light around the camera; the mean of it where two places share the picture."""
        if not self.around:
            return np.zeros(0, np.float32)
        maps = [seen_from(self.around[s.panorama.path], c) for s, c in zip(shown, cameras, strict=True)]
        return np.asarray(np.mean(maps, axis=0))

    def _camera(self, source: Source, rng: np.random.Generator) -> Camera:
        label = source.label
        if source.panorama.sun == "visible" and rng.random() < self.config.aimed:
            return aimed_camera(rng, label.sun_azimuth, label.sun_elevation)
        return training_camera(rng)


def _draw(chances: Floats, rng: np.random.Generator) -> int:
    """A number drawn by summed chances."""
    return min(int(np.searchsorted(chances, rng.random())), len(chances) - 1)


def split_places(panoramas: Sequence[Panorama], share: float) -> tuple[list[Panorama], list[Panorama]]:
    """Panoramas to train on and panoramas of held-out places; a place's side depends on its name alone."""

    def held_out(panorama: Panorama) -> bool:
        return int(hashlib.sha256(panorama.place.encode()).hexdigest(), 16) % 1000 < 1000 * share

    return [p for p in panoramas if not held_out(p)], [p for p in panoramas if held_out(p)]


def load_sources(panoramas: Sequence[Panorama], labels: str | Path) -> list[Source]:
    """Panoramas in memory with their labels."""
    known = labels_of(panoramas, labels)
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(load_source, panoramas, known))


def labels_of(panoramas: Sequence[Panorama], labels: str | Path) -> list[Label]:
    """Each panorama's label; DataError if one has none."""
    known = {label.name: label for label in read_labels(labels)}
    missing = [p.name for p in panoramas if p.name not in known]
    if missing:
        raise DataError(f"{labels} has no label for {missing[0]}; run `python -m export label` again.")
    return [known[p.name] for p in panoramas]


def synthetic_sources(config: TrainConfig) -> list[Source]:
    """The rendered places that are mixed in, if any."""
    if not config.synthetic:
        return []
    return load_sources(read_index(config.synthetic, "train"), Path(config.synthetic) / LABELS)


def losses(said: Said, batch: Batch) -> dict[str, Tensor]:
    """Mean losses of one batch by name, each over the crops that have the target."""
    target = torch.cat([encode(batch.parameters[:, :5]), batch.parameters[:, 5:]], dim=1)
    known = torch.isfinite(target)
    target = torch.where(known, target, torch.zeros_like(target))
    fit = F.smooth_l1_loss(said.raw[:, :5].float(), target[:, :5], reduction="none", beta=0.3)
    shining = F.binary_cross_entropy_with_logits(said.raw[:, 5].float(), target[:, 5], reduction="none")
    by_parameter = _masked_mean(fit, known[:, :5])
    parts = {
        "sun": _cross_entropy(said.sun, batch.sun),
        "parameters": (by_parameter * by_parameter.new_tensor(PARAMETER_WEIGHTS)).sum(),
        "visibility": _masked_mean(shining, known[:, 5]),
    }
    if said.seen.shape[1]:
        parts["seen"] = _cross_entropy(said.seen, batch.seen)
    if said.around.shape[1]:
        parts["around"] = AROUND_WEIGHT * F.smooth_l1_loss(said.around.float(), batch.around, beta=0.3)
    return parts


def _cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    cost = -(target * F.log_softmax(logits.float(), dim=1)).sum(dim=1)
    return _masked_mean(cost, target.sum(dim=1) > 0.5)


def _masked_mean(value: Tensor, mask: Tensor) -> Tensor:
    return (value * mask).sum(dim=0) / mask.sum(dim=0).clamp_min(1)


def learning_rate(step: int, steps: int, warmup: float) -> float:
    """Factor on the learning rate: a linear rise, then half a cosine down to zero."""
    rise = max(1, int(warmup * steps))
    if step < rise:
        return (step + 1) / rise
    return 0.5 * (1 + math.cos(math.pi * (step - rise) / max(1, steps - rise)))


class Run:
    """The state of one training run: network, averaged weights, optimiser, position; saved and resumed as a whole."""

    def __init__(self, config: TrainConfig) -> None:
        self.config = config
        self.spec = specs(config.version)[config.network]
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        torch.manual_seed(0)
        network = build(self.spec, pretrained=config.pretrained and not config.start, around=config.surroundings)
        if config.start:
            load_weights(network, averaged_weights(config.start))
        if config.only_seen:
            network.requires_grad_(False)
            network.get_submodule("seen").requires_grad_(True)
        self.network = network.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        ema: Any = get_ema_multi_avg_fn  # not annotated by torch
        self.average = AveragedModel(self.network, multi_avg_fn=ema(config.ema), use_buffers=True)
        trained = [p for p in self.network.parameters() if p.requires_grad]
        self.optimizer = torch.optim.AdamW(trained, config.learning_rate, weight_decay=config.weight_decay)
        self.steps = config.crops // config.batch
        self.step = 0
        self.checkpoint = Path(config.out) / "checkpoint.pt"

    def train_mode(self) -> None:
        """Set the layers that learn to training, the others to what they do when they answer."""
        self.network.train(not self.config.only_seen)
        if self.config.only_seen:
            self.network.get_submodule("seen").train()

    def resume(self) -> None:
        """Continue from the folder's checkpoint if it has one."""
        if self.checkpoint.exists():
            state = torch.load(self.checkpoint, map_location=self.device, weights_only=True)
            self.network.load_state_dict(state["network"])
            self.average.load_state_dict(state["average"])
            self.optimizer.load_state_dict(state["optimizer"])
            self.step = state["step"]

    def save(self) -> None:
        """Write the whole state; a run that is killed meanwhile keeps the last one."""
        parts = {"network": self.network, "average": self.average, "optimizer": self.optimizer}
        with replacing(self.checkpoint) as path:
            torch.save({**{k: v.state_dict() for k, v in parts.items()}, "step": self.step}, path)

    def forward(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        """Losses of a batch that lies on the device, in bfloat16 where that is safe."""
        with torch.autocast(self.device.type, torch.bfloat16):
            said = network(batch.photo)
        return losses(said, batch)

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """One step of the optimiser."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.learning_rate * learning_rate(self.step, self.steps, self.config.warmup)
        parts = self.forward(self.network, batch)
        if self.config.only_seen:
            parts = {"seen": parts["seen"]}
        torch.autograd.backward(torch.stack(list(parts.values())).sum())
        nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
        self.optimizer.step()
        self.optimizer.zero_grad(set_to_none=True)
        self.average.update_parameters(self.network)
        self.step += 1
        return {name: value.detach() for name, value in parts.items()}

    def batches(self, dataset: Crops, first: int = 0) -> Iterator[Batch]:
        """Batches on the device, from crop number `first` on."""
        loader = DataLoader(
            dataset,
            batch_size=self.config.batch,
            sampler=range(first, len(dataset)),
            num_workers=self.config.workers,
            drop_last=not dataset.tune,
            worker_init_fn=_one_thread,
        )
        for batch in loader:
            photo = batch.photo.to(self.device, memory_format=torch.channels_last)
            yield Batch(photo, *(part.to(self.device) for part in batch[1:]))

    def tune_losses(self, dataset: Crops) -> dict[str, float]:
        """Losses of the averaged weights over the held-out training places."""
        self.average.eval()
        with torch.inference_mode():
            parts = [self.forward(self.average, batch) for batch in self.batches(dataset)]
        return {name: float(torch.stack([p[name] for p in parts]).mean()) for name in parts[0]} if parts else {}


def averaged_weights(folder: str | Path) -> dict[str, Tensor]:
    """The averaged weights of a run, named as the network names them."""
    average = torch.load(Path(folder) / "checkpoint.pt", map_location="cpu", weights_only=True)["average"]
    return {name.removeprefix("module."): value for name, value in average.items() if name.startswith("module.")}


def _one_thread(_worker: int) -> None:
    torch.set_num_threads(1)


def train(config: TrainConfig) -> Path:
    """Train, resuming what the folder already holds; returns the checkpoint's path."""
    out = Path(config.out)
    out.mkdir(parents=True, exist_ok=True)
    panoramas = read_index(config.data, "train", licensed_only=config.licensed_only)
    kept, held_out = split_places(panoramas, config.tune_share)
    if not kept:
        raise DataError(f"There is no panorama to train on in {config.data}.")
    run = Run(config)
    before = _same_run(out, config) if run.checkpoint.exists() else []
    run.resume()
    record: dict[str, Any] = {
        "config": asdict(config),
        "spec": asdict(run.spec),
        "commit": ", ".join(dict.fromkeys([*before, commit()])),
        "torch": torch.__version__,
    }
    record["before"] = history(read_record(Path(config.start))) if config.start else []
    record["panoramas"] = {"train": [p.name for p in kept], "tune": [p.name for p in held_out]}
    with replacing(out / RECORD) as path:
        path.write_text(json.dumps(record, indent=1))
    dataset = Crops(load_sources(kept, config.labels), run.spec, config, synthetic=synthetic_sources(config))
    tune = Crops(load_sources(held_out, config.labels), run.spec, config, tune=True) if held_out else None
    print(
        f"{len(dataset.sources)} panoramas to train on ({len(kept)} real), {len(held_out)} held out, "
        f"from step {run.step} of {run.steps}",
        flush=True,
    )
    _loop(run, dataset, tune)
    return run.checkpoint


def _same_run(out: Path, config: TrainConfig) -> list[str]:
    """The commits that the run in a folder was made with so far; DataError where its settings were others."""
    record = read_record(out)
    now = asdict(config)
    changed = [name for name in now if name not in MAY_CHANGE and record["config"].get(name) != now[name]]
    if changed:
        raise DataError(f"{out} holds a run with another {' and '.join(changed)}; choose another --out.")
    return str(record["commit"]).split(", ")


def _loop(run: Run, dataset: Crops, tune: Crops | None) -> None:
    started = saved = time.monotonic()
    window: list[dict[str, Tensor]] = []
    run.train_mode()
    for batch in run.batches(dataset, run.step * run.config.batch):
        window.append(run.update(batch))
        last = run.step == run.steps
        if last or time.monotonic() - saved > 60 * run.config.checkpoint_minutes:
            run.save()
            saved = time.monotonic()
            means = {name: float(torch.stack([w[name] for w in window]).mean()) for name in window[0]}
            window.clear()
            held_out = {f"tune_{k}": v for k, v in run.tune_losses(tune).items()} if tune is not None and last else {}
            _log(run, {"minutes": (saved - started) / 60, **means, **held_out})


def _log(run: Run, values: dict[str, float]) -> None:
    line = json.dumps({"step": run.step, **{name: round(value, 4) for name, value in values.items()}})
    print(line, flush=True)
    with (Path(run.config.out) / "log.jsonl").open("a") as file:
        file.write(line + "\n")


def commit() -> str:
    """The checkout's commit, or "unknown" outside one."""
    done = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, cwd=Path(__file__).parent)
    return done.stdout.strip() or "unknown"
