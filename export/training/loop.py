"""The training loop: crops drawn on the fly, either network; stops and resumes at any time.

The folder that it writes holds config.json (everything the run depends on, with the commit), log.jsonl and
checkpoint.pt, the state of the run as a whole.
"""

import json
import math
import subprocess
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn
from torch.utils.data import DataLoader

from export.crops.crops import load_sources
from export.data.panoramas import DataError, Panorama
from export.networks.outdoor import Outdoor, load_weights, network_specs
from export.networks.outdoor_transformer import OutdoorTransformer
from export.networks.weights import (
    CHECKPOINT,
    RUN_RECORD,
    append_log,
    averaged_weights,
    read_checkpoint,
    read_record,
    training_history,
)
from export.training.dataset import (
    MAY_CHANGE,
    Batch,
    TrainConfig,
    TrainingCrops,
    training_panoramas,
    training_photos,
)
from export.training.losses import TeacherEnsemble, add_mirror_images, blend_pictures, blended_shares, training_losses
from lighting.files import atomic_write, stale_temporaries

_MAX_GRADIENT = 5.0  # norm
_KNOWN_SUN = 0.5  # weight of the sun's own target beside what teachers answer
_CAMERA_LOSSES = ("parameters", "camera")  # losses that the camera's angles enter


def _learning_rate(step: int, steps: int, warmup: float) -> float:
    """Factor on the learning rate: a linear rise, then half a cosine down to zero."""
    rise = max(1, int(warmup * steps))
    if step < rise:
        return (step + 1) / rise
    return 0.5 * (1 + math.cos(math.pi * (step - rise) / max(1, steps - rise)))


class _Run:
    """Network, averaged weights, optimizer and position."""

    def __init__(self, config: TrainConfig) -> None:
        self.config = config
        self.spec = network_specs(config.version)[config.network]
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self.bfloat16 = self.device.type == "cuda" or torch.cpu._is_avx512_bf16_supported()  # else emulated, slowly
        torch.manual_seed(0)
        pretrained = config.pretrained and not config.start
        kind = OutdoorTransformer if config.network == "transformer" else Outdoor
        network = kind(self.spec, pretrained=pretrained, has_surroundings=config.surroundings)
        if config.start:
            load_weights(network, averaged_weights(Path(config.start)))
        self.network = network.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        ema: Any = get_ema_multi_avg_fn  # not annotated by torch
        self.average = AveragedModel(self.network, multi_avg_fn=ema(config.ema), use_buffers=True)
        groups = network.rate_groups()
        self.optimizer = torch.optim.AdamW(groups, config.learning_rate, weight_decay=config.weight_decay)
        self.parts: dict[str, Any] = {"network": self.network, "average": self.average, "optimizer": self.optimizer}
        folders = [Path(folder) for folder in config.teachers]
        taught = {"surroundings": config.surroundings}
        self.teachers = TeacherEnsemble(folders, self.spec, self.device, **taught) if folders else None
        self.steps = config.crops // config.batch
        self.step = 0
        self.checkpoint = Path(config.out) / CHECKPOINT

    def resume(self) -> None:
        """Continue from the folder's checkpoint if it has one; DataError if that is damaged or of another network.

        What killed processes left of checkpoints is deleted.
        """
        for path in stale_temporaries(self.checkpoint):
            path.unlink(missing_ok=True)
        if self.checkpoint.exists():
            state = read_checkpoint(self.checkpoint.parent, self.device)
            try:
                for name, part in self.parts.items():
                    part.load_state_dict(state[name])
                self.step = state["step"]
            except (KeyError, RuntimeError, ValueError) as error:
                raise DataError(f"{self.checkpoint} is of another network than the run's.") from error

    def save(self) -> None:
        """Write the whole state; if the run is killed meanwhile, the previous one stays."""
        with atomic_write(self.checkpoint) as path:
            torch.save({**{k: v.state_dict() for k, v in self.parts.items()}, "step": self.step}, path)

    def losses(self, network: nn.Module, batch: Batch, teachers: TeacherEnsemble | None = None) -> dict[str, Tensor]:
        """Losses of a batch on the device, in bfloat16 where that is safe and the processor has it.

        With teachers, a share of the crops is blended, and what the teachers answer is a second target of all.
        """
        if teachers:
            shares = blended_shares(len(batch.photo), self.config.blended, mirrored=self.config.mirrored)
            batch = blend_pictures(batch, shares)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.bfloat16):
            answers = teachers.targets(batch.photo) if teachers else None
            predicted = network(batch.photo)
        parts = training_losses(predicted, batch)
        if answers is not None:
            parts["sun"] = _KNOWN_SUN * parts["sun"]
            parts |= {f"taught {name}": loss for name, loss in training_losses(predicted, answers).items()}
        return parts

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """One step of the optimizer; what it leaves out by chance depends on the step, so runs resume as they were."""
        torch.manual_seed(self.step)
        for group in self.optimizer.param_groups:
            group["lr"] = (
                group["scale"] * self.config.learning_rate * _learning_rate(self.step, self.steps, self.config.warmup)
            )
        if self.config.mirrored:
            batch = add_mirror_images(batch)
        parts = self.losses(self.network, batch, self.teachers)
        if self.config.only_camera:
            parts = {name: parts[name] for name in _CAMERA_LOSSES}
        torch.autograd.backward(torch.stack(list(parts.values())).sum())
        nn.utils.clip_grad_norm_(self.network.parameters(), _MAX_GRADIENT)
        self.optimizer.step()
        self.optimizer.zero_grad(set_to_none=True)
        self.average.update_parameters(self.network)
        self.step += 1
        return {name: value.detach() for name, value in parts.items()}

    def batches(self, dataset: TrainingCrops, first: int = 0) -> Iterator[Batch]:
        """Batches on the device, beginning with crop number `first`."""
        loader = DataLoader(
            dataset,
            batch_size=self.config.batch,
            sampler=range(first, len(dataset)),
            num_workers=self.config.workers,
            drop_last=not dataset.tune,
            pin_memory=self.device.type == "cuda",  # so that copies to a GPU do not wait
        )
        for batch in loader:
            photo = batch.photo.to(self.device, memory_format=torch.channels_last, non_blocking=True)
            yield Batch(photo, *(part.to(self.device, non_blocking=True) for part in batch[1:]))

    def tune_losses(self, dataset: TrainingCrops) -> dict[str, float]:
        """Losses of the averaged weights over the held-out training places."""
        self.average.eval()
        with torch.inference_mode():
            parts = [self.losses(self.average, batch) for batch in self.batches(dataset)]
        return {name: float(torch.stack([p[name] for p in parts]).mean()) for name in parts[0]} if parts else {}


def _write_record(run: _Run, commits: Iterable[str], kept: Sequence[Panorama], held_out: Sequence[Panorama]) -> None:
    """Write the run's settings, spec, commits, panoramas and the runs it continues or learns from."""
    config = run.config
    sources = [config.start, *config.teachers] if config.start else config.teachers
    record = {
        "config": asdict(config),
        "spec": asdict(run.spec),
        "commit": ", ".join(dict.fromkeys(commits)),
        "torch": torch.__version__,
        "before": training_history(*(read_record(Path(folder)) for folder in sources)),
        "panoramas": {"train": [p.name for p in kept], "tune": [p.name for p in held_out]},
    }
    with atomic_write(Path(config.out) / RUN_RECORD) as path:
        path.write_text(json.dumps(record, indent=1))


def _earlier_commits(config: TrainConfig) -> list[str]:
    """The commits that trained the run in `config.out` so far; DataError if it has other settings or cannot go on.

    Settings that the run's record is too old to have count as their defaults.
    """
    record = read_record(Path(config.out))
    if "merged" in record:
        read = f"{config.out} holds a network that was read back from a file"
        raise DataError(f"{read}; give it as --start and choose another --out.")
    now = asdict(config.resolve_paths())
    if unknown := record["config"].keys() - now.keys():
        what = f"a setting that is unknown here, {min(unknown)}"
        raise DataError(f"{config.out} holds a run with {what}; choose another --out.")
    then = asdict(TrainConfig(**record["config"]).resolve_paths())
    changed = [name for name in now if name not in MAY_CHANGE and then[name] != now[name]]
    if changed:
        raise DataError(f"{config.out} holds a run with another {' and '.join(changed)}; choose another --out.")
    return str(record["commit"]).split(", ")


def _commit() -> str:
    """The checkout's commit, or "unknown" outside one."""
    git = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, cwd=Path(__file__).parent)
    return git.stdout.strip() or "unknown"


def train_network(config: TrainConfig) -> Path:
    """Train, or resume what the folder holds; returns the path of the checkpoint.

    Args:
        config: of the run; its `out` is the folder.

    Raises:
        DataError: if the folder holds a run with other settings or no run that can go on. It is raised too if there is
            nothing to train on, or if no step would be trained. The folder is then as before.
    """
    if config.crops < config.batch:
        raise DataError(f"{config.crops} crops do not fill one step of {config.batch}, so nothing would be trained.")
    before = _earlier_commits(config) if (Path(config.out) / CHECKPOINT).exists() else []
    kept, held_out = training_panoramas(config)
    photos = training_photos(config)
    run = _Run(config)
    run.resume()
    dataset = TrainingCrops(load_sources(kept, config.labels), run.spec, config, photos=photos)
    tune = TrainingCrops(load_sources(held_out, config.labels), run.spec, config, tune=True) if held_out else None
    Path(config.out).mkdir(parents=True, exist_ok=True)
    _write_record(run, [*before, _commit()] if run.step < run.steps else before, kept, held_out)
    print(
        f"{len(kept)} panoramas to train on, {len(held_out)} held out, from step {run.step} of {run.steps}", flush=True
    )
    _loop(run, dataset, tune)
    return run.checkpoint


def _loop(run: _Run, dataset: TrainingCrops, tune: TrainingCrops | None) -> None:
    started = saved = time.monotonic()
    window: list[dict[str, Tensor]] = []
    run.network.train()
    for batch in run.batches(dataset, run.step * run.config.batch):
        window.append(run.update(batch))
        last = run.step == run.steps
        if last or time.monotonic() - saved > 60 * run.config.checkpoint_minutes:
            run.save()
            saved = time.monotonic()
            held_out = {f"tune_{k}": v for k, v in run.tune_losses(tune).items()} if tune is not None and last else {}
            minutes = (saved - started) / 60
            print(append_log(Path(run.config.out), run.step, minutes, window, **held_out), flush=True)
            window.clear()
