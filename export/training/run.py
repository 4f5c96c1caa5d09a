"""The state of a training run: saved and resumed as a whole."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn
from torch.utils.data import DataLoader

from export.data import DataError
from export.networks import CHECKPOINT, averaged_weights, build, load_weights, read_checkpoint, specs
from export.training.batches import Batch, TrainingCrops
from export.training.config import TrainConfig
from export.training.losses import losses
from export.training.teaching import Teachers, blended
from lighting.files import leftovers, replacing

CLIPPED = 5.0  # largest norm of the gradient
CAMERA = ("parameters", "camera")  # losses that the camera's angles enter


def learning_rate(step: int, steps: int, warmup: float) -> float:
    """Factor on the learning rate: a linear rise, then half a cosine down to zero."""
    rise = max(1, int(warmup * steps))
    if step < rise:
        return (step + 1) / rise
    return 0.5 * (1 + math.cos(math.pi * (step - rise) / max(1, steps - rise)))


class Run:
    """Network, averaged weights, optimiser and position."""

    def __init__(self, config: TrainConfig) -> None:
        self.config = config
        self.spec = specs(config.version)[config.network]
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self.halves = self.device.type == "cuda" or torch.cpu._is_avx512_bf16_supported()  # else emulated, slowly
        torch.manual_seed(0)
        network = build(self.spec, pretrained=config.pretrained and not config.start, around=config.surroundings)
        if config.start:
            load_weights(network, averaged_weights(Path(config.start)))
        if config.only_seen:
            network.requires_grad_(False)
            network.get_submodule("seen").requires_grad_(True)
        self.network = network.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        ema: Any = get_ema_multi_avg_fn  # not annotated by torch
        self.average = AveragedModel(self.network, multi_avg_fn=ema(config.ema), use_buffers=True)
        trained = [p for p in self.network.parameters() if p.requires_grad]
        self.optimizer = torch.optim.AdamW(trained, config.learning_rate, weight_decay=config.weight_decay)
        teachers = [Path(folder) for folder in config.teachers]
        around = config.surroundings
        self.teachers = Teachers(teachers, self.spec, self.device, around=around) if teachers else None
        self.steps = config.crops // config.batch
        self.step = 0
        self.checkpoint = Path(config.out) / CHECKPOINT

    def train_mode(self) -> None:
        """Put the layers that learn into training mode, the others into evaluation mode."""
        self.network.train(not self.config.only_seen)
        if self.config.only_seen:
            self.network.get_submodule("seen").train()

    def resume(self) -> None:
        """Continue from the folder's checkpoint if it has one; DataError if that is damaged or of another network.

        What killed processes left of checkpoints is deleted.
        """
        for path in leftovers(self.checkpoint):
            path.unlink(missing_ok=True)
        if self.checkpoint.exists():
            state = read_checkpoint(self.checkpoint.parent, self.device)
            try:
                self.network.load_state_dict(state["network"])
                self.average.load_state_dict(state["average"])
                self.optimizer.load_state_dict(state["optimizer"])
                self.step = state["step"]
            except (KeyError, RuntimeError, ValueError) as error:
                raise DataError(f"{self.checkpoint} is of another network than the run's.") from error

    def save(self) -> None:
        """Write the whole state; if the run is killed meanwhile, the previous one stays."""
        parts = {"network": self.network, "average": self.average, "optimizer": self.optimizer}
        with replacing(self.checkpoint) as path:
            torch.save({**{k: v.state_dict() for k, v in parts.items()}, "step": self.step}, path)

    def forward(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        """Losses of a batch on the device, in bfloat16 where that is safe and the processor has it."""
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.halves):
            said = network(batch.photo)
        return losses(said, batch)

    def taught(self, teachers: Teachers, batch: Batch) -> dict[str, Tensor]:
        """Losses of a batch against what is known of its crops and against what the teachers answer."""
        batch = blended(batch, self.config.blended)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.halves):
            answers = teachers.targets(batch.photo)
            said = self.network(batch.photo)
        return losses(said, batch) | {f"taught {name}": loss for name, loss in losses(said, answers).items()}

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """One step of the optimiser; what it leaves out by chance depends on the step, so runs resume as they were."""
        torch.manual_seed(self.step)
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.learning_rate * learning_rate(self.step, self.steps, self.config.warmup)
        learnt = self.taught(self.teachers, batch) if self.teachers else self.forward(self.network, batch)
        parts = self._chosen(learnt)
        torch.autograd.backward(torch.stack(list(parts.values())).sum())
        nn.utils.clip_grad_norm_(self.network.parameters(), CLIPPED)
        self.optimizer.step()
        self.optimizer.zero_grad(set_to_none=True)
        self.average.update_parameters(self.network)
        self.step += 1
        return {name: value.detach() for name, value in parts.items()}

    def _chosen(self, parts: dict[str, Tensor]) -> dict[str, Tensor]:
        """The losses that the run minimises."""
        if self.config.only_seen:
            return {"seen": parts["seen"]}
        return {name: parts[name] for name in CAMERA} if self.config.only_camera else parts

    def batches(self, dataset: TrainingCrops, first: int = 0) -> Iterator[Batch]:
        """Batches on the device, beginning with crop number `first`."""
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

    def tune_losses(self, dataset: TrainingCrops) -> dict[str, float]:
        """Losses of the averaged weights over the held-out training places."""
        self.average.eval()
        with torch.inference_mode():
            parts = [self.forward(self.average, batch) for batch in self.batches(dataset)]
        return {name: float(torch.stack([p[name] for p in parts]).mean()) for name in parts[0]} if parts else {}


def _one_thread(_worker: int) -> None:
    torch.set_num_threads(1)
