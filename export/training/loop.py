"""The training loop: crops drawn on the fly, either network; stops and resumes at any time.

The folder that it writes holds config.json (everything the run depends on, with the commit), log.jsonl and
checkpoint.pt, the state of the run as a whole.

A run may learn by distillation [1]: what earlier runs answer together is a second target of every crop. Pictures are
blended (_mixup), so that answers are compared where no place is remembered [2].

References:
    [1] Hinton et al., Distilling the knowledge in a neural network, 2015.
    [2] Beyer et al., Knowledge distillation: a good teacher is patient and consistent, CVPR 2022.
"""

import json
import math
import subprocess
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn
from torch.utils.data import DataLoader

from export.crops.crops import Source, load_sources
from export.data.panoramas import DataError, Panorama, read_index
from export.data.rendered_towns import LABELS
from export.networks.backbone import NetworkOutput
from export.networks.outdoor import (
    build_network,
    camera_bin_targets,
    decode_parameters,
    encode_parameters,
    load_weights,
    mean_of_camera_bins,
    network_specs,
)
from export.networks.outdoor_transformer import OutdoorTransformer
from export.networks.weights import (
    CHECKPOINT,
    RUN_RECORD,
    averaged_weights,
    read_checkpoint,
    read_network,
    read_record,
    read_spec,
    training_history,
)
from export.training.dataset import (
    MAY_CHANGE,
    PATH_SETTINGS,
    Batch,
    TrainConfig,
    TrainingCrops,
    training_panoramas,
    training_photos,
)
from lighting.fields import Json
from lighting.files import atomic_write, stale_temporaries
from lighting.prediction import ModelSpec

# What training minimizes.

_MIN_LIKELIHOOD = 1e-9
_PARAMETER_WEIGHTS = (0.5, 0.5, 1.5, 1.0, 1.0)  # turbidity, exposure, camera elevation, roll, field of view
_SURROUNDINGS_WEIGHT = 3.0  # of the light around the camera
_CAMERA_WEIGHT = 0.25  # of each angle's bins
_LIGHT_WEIGHT = 0.5


def _training_losses(predicted: NetworkOutput, batch: Batch) -> dict[str, Tensor]:
    """Mean losses of one batch by name, each over the crops that have the target.

    Args:
        predicted: what the network predicts of the batch.
        batch: the targets.
    """
    target = torch.cat([encode_parameters(batch.parameters[:, :5]), batch.parameters[:, 5:]], dim=1)
    finite = torch.isfinite(target)
    target = torch.where(finite, target, torch.zeros_like(target))
    fit = F.smooth_l1_loss(predicted.raw[:, :5].float(), target[:, :5], reduction="none", beta=0.3)
    shining = F.binary_cross_entropy_with_logits(predicted.raw[:, 5].float(), target[:, 5], reduction="none")
    by_parameter = _masked_mean(fit, finite[:, :5])
    parts = {
        "sun": _sun(predicted.sun, batch),
        "parameters": (by_parameter * by_parameter.new_tensor(_PARAMETER_WEIGHTS)).sum(),
        "visibility": _masked_mean(shining, finite[:, 5]),
    }
    if predicted.sun_in_view.shape[1]:
        parts["seen"] = _cross_entropy(predicted.sun_in_view, batch.sun_in_view)
    if predicted.surroundings.shape[1]:
        parts["around"] = _SURROUNDINGS_WEIGHT * _surroundings(predicted.surroundings.float(), batch.surroundings)
    if predicted.camera.shape[1]:
        parts["camera"] = _CAMERA_WEIGHT * _camera(predicted.camera, target[:, 2:5], finite[:, 2:5])
    if predicted.light.shape[1]:
        parts["light"] = _LIGHT_WEIGHT * _light(predicted.light.float(), batch.light)
    return parts


def _sun(logits: Tensor, batch: Batch) -> Tensor:
    """Cross entropy with a target; where the target is a likelihood, the logarithm of the mean likelihood instead."""
    log_chance = F.log_softmax(logits.float(), dim=1)
    cross = -(batch.sun * log_chance).sum(dim=1)
    mean = -torch.logsumexp(log_chance + batch.sun.clamp_min(_MIN_LIKELIHOOD).log(), dim=1)
    return _masked_mean(torch.where(batch.is_likelihood, mean, cross), batch.sun.sum(dim=1) > 0.5)


def _surroundings(predicted: Tensor, target: Tensor) -> Tensor:
    error = F.smooth_l1_loss(predicted, target.nan_to_num(), reduction="none", beta=0.3).mean(dim=1)
    return _masked_mean(error, torch.isfinite(target).all(dim=1))


def _camera(logits: Tensor, target: Tensor, known: Tensor) -> Tensor:
    cross = -(camera_bin_targets(target) * F.log_softmax(logits.float(), dim=2)).sum(dim=2)
    return _masked_mean(cross, known).sum()


def _light(predicted: Tensor, target: Tensor) -> Tensor:
    """The median in the logarithm of the powers, and the cloud cover."""
    finite = torch.isfinite(target)
    target = target.nan_to_num()
    error = F.smooth_l1_loss(predicted[:, :6], target[:, :6], reduction="none", beta=0.1)
    covered = F.binary_cross_entropy_with_logits(predicted[:, 6], target[:, 6], reduction="none")
    return _masked_mean(error, finite[:, :6]).sum() / 3 + _masked_mean(covered, finite[:, 6])


def _cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    cost = -(target * F.log_softmax(logits.float(), dim=1)).sum(dim=1)
    return _masked_mean(cost, target.sum(dim=1) > 0.5)


def _masked_mean(value: Tensor, mask: Tensor) -> Tensor:
    return (value * mask).sum(dim=0) / mask.sum(dim=0).clamp_min(1)


# Distillation.

_MIN_SHARE = 0.5  # of a blended crop in its picture
_TEMPERATURE = 0.9  # divides the teachers' logits of the sun; their mean is broader than each of them
_ROLL = 3  # column of Batch.parameters


class _TeacherEnsemble:
    """The averaged networks of finished runs, whose mean answer is a target.

    Args:
        folders: of the runs.
        spec: of the network that learns.
        device: to which the networks go.
        surroundings: whether the light around the camera is a target too.

    Raises:
        DataError: if a run has other outputs than `spec` or none for the light around.
    """

    def __init__(self, folders: Sequence[Path], spec: ModelSpec, device: torch.device, *, surroundings: bool) -> None:
        read = {folder: read_network(folder).requires_grad_(False) for folder in folders}
        for folder, network in read.items():
            if replace(read_spec(folder), version="") != replace(spec, version=""):
                raise DataError(f"{folder} cannot teach this run: its network has another form.")
            if surroundings and network.light is None:
                raise DataError(f"{folder} cannot teach --surroundings: it has not learnt them.")
        self.surroundings = surroundings
        self.networks = [
            network.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
            for network in read.values()
        ]

    @torch.no_grad()
    def targets(self, photo: Tensor) -> Batch:
        """The batch with the teachers' mean answers as its targets.

        Args:
            photo: (B, 3, H, W).
        """
        predicted = [NetworkOutput(*(part.float() for part in network(photo))) for network in self.networks]
        raw = _mean([one.raw for one in predicted])
        if camera := [mean_of_camera_bins(one.camera) for one in predicted if one.camera.shape[1]]:
            raw = torch.cat([raw[:, :2], _mean(camera), raw[:, 5:]], dim=1)
        light = _mean([one.light for one in predicted]) if self.surroundings else photo[:, 0, 0, :0]
        return Batch(
            photo=photo,
            sun=_mean([(one.sun / _TEMPERATURE).softmax(dim=1) for one in predicted]),
            parameters=decode_parameters(raw),
            sun_in_view=_mean([one.sun_in_view.softmax(dim=1) for one in predicted]),
            surroundings=_mean([one.surroundings for one in predicted]) if self.surroundings else light,
            light=torch.cat([light[:, :6], light[:, 6:].sigmoid()], dim=1),
            is_likelihood=torch.zeros(len(photo), dtype=torch.bool, device=photo.device),
        )


def _mean(values: Sequence[Tensor]) -> Tensor:
    return torch.stack(list(values)).mean(dim=0)


def _with_mirror_images(batch: Batch) -> Batch:
    """The batch, and after it its mirror images, of which the parameters alone are known: the roll changes its sign.

    Args:
        batch: of B crops.
    """
    signs = torch.ones_like(batch.parameters)
    signs[:, _ROLL] = -1
    mirrored = _without_targets(batch, torch.ones(len(batch.photo), dtype=torch.bool, device=batch.photo.device))
    mirrored = mirrored._replace(photo=batch.photo.flip(3), parameters=signs * batch.parameters)
    return Batch(*(torch.cat([one, other]) for one, other in zip(batch, mirrored, strict=True)))


def _blended_shares(count: int, share: float, *, mirrored: bool) -> Tensor:
    """Chances (count,) that a picture is blended: of mirror images, the second half, twice those of crops.

    Args:
        count: pictures in the batch.
        share: of the crops, 0 to 1.
        mirrored: whether mirror images follow the crops.
    """
    shares = torch.full((count,), share)
    if mirrored:
        shares[count // 2 :] = min(1.0, 2 * share)
    return shares


def _mixup(batch: Batch, shares: Tensor) -> Batch:
    """The batch with some of its pictures blended with their neighbors, which then have no targets.

    Args:
        batch: of B pictures.
        shares: (B,) chances of each to be blended, 0 to 1.
    """
    chosen = torch.rand(len(batch.photo), device=batch.photo.device) < shares.to(batch.photo.device)
    weight = torch.where(chosen, _MIN_SHARE + (1 - _MIN_SHARE) * torch.rand_like(chosen, dtype=torch.float32), 1.0)
    weight = weight[:, None, None, None].to(batch.photo)
    photo = weight * batch.photo + (1 - weight) * batch.photo.roll(1, dims=0)
    return _without_targets(batch, chosen)._replace(photo=photo.contiguous(memory_format=torch.channels_last))


def _without_targets(batch: Batch, chosen: Tensor) -> Batch:
    unknown = {"sun": 0.0, "parameters": math.nan, "sun_in_view": 0.0, "surroundings": math.nan, "light": math.nan}
    hidden = {name: torch.where(chosen[:, None], value, getattr(batch, name)) for name, value in unknown.items()}
    return batch._replace(**hidden)


# The run.

_MAX_GRADIENT = 5.0  # norm
_KNOWN_SUN = 0.5  # weight of the sun's own target beside what teachers answer
_CAMERA_LOSSES = ("parameters", "camera")  # losses that the camera's angles enter


def _learning_rate(step: int, steps: int, warmup: float) -> float:
    """Factor on the learning rate: a linear rise, then half a cosine down to zero."""
    rise = max(1, int(warmup * steps))
    if step < rise:
        return (step + 1) / rise
    return 0.5 * (1 + math.cos(math.pi * (step - rise) / max(1, steps - rise)))


def _new_network(config: TrainConfig, spec: ModelSpec, *, pretrained: bool) -> nn.Module:
    if config.network == "transformer":
        return OutdoorTransformer(spec, pretrained=pretrained, has_surroundings=config.surroundings)
    return build_network(spec, pretrained=pretrained, has_surroundings=config.surroundings)


def _rate_groups(network: nn.Module) -> list[dict[str, Any]]:
    """What learns, each group with its scale of the learning rate."""
    if isinstance(network, OutdoorTransformer):
        return network.rate_groups()
    return [{"params": [p for p in network.parameters() if p.requires_grad], "scale": 1.0}]


class _Run:
    """Network, averaged weights, optimizer and position."""

    def __init__(self, config: TrainConfig) -> None:
        self.config = config
        self.spec = network_specs(config.version)[config.network]
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self.bfloat16 = self.device.type == "cuda" or torch.cpu._is_avx512_bf16_supported()  # else emulated, slowly
        torch.manual_seed(0)
        pretrained = config.pretrained and not config.start
        network = _new_network(config, self.spec, pretrained=pretrained)
        if config.start:
            load_weights(network, averaged_weights(Path(config.start)))
        if config.only_seen:
            network.requires_grad_(False)
            network.get_submodule("seen").requires_grad_(True)
        self.network = network.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        ema: Any = get_ema_multi_avg_fn  # not annotated by torch
        self.average = AveragedModel(self.network, multi_avg_fn=ema(config.ema), use_buffers=True)
        self.optimizer = torch.optim.AdamW(
            _rate_groups(network), config.learning_rate, weight_decay=config.weight_decay
        )
        folders = [Path(folder) for folder in config.teachers]
        taught = {"surroundings": config.surroundings}
        self.teachers = _TeacherEnsemble(folders, self.spec, self.device, **taught) if folders else None
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
        for path in stale_temporaries(self.checkpoint):
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
        with atomic_write(self.checkpoint) as path:
            torch.save({**{k: v.state_dict() for k, v in parts.items()}, "step": self.step}, path)

    def losses(self, network: nn.Module, batch: Batch, teachers: _TeacherEnsemble | None = None) -> dict[str, Tensor]:
        """Losses of a batch on the device, in bfloat16 where that is safe and the processor has it.

        With teachers, a share of the crops is blended, and what the teachers answer is a second target of all.
        """
        if teachers:
            shares = _blended_shares(len(batch.photo), self.config.blended, mirrored=self.config.mirrored)
            batch = _mixup(batch, shares)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.bfloat16):
            answers = teachers.targets(batch.photo) if teachers else None
            predicted = network(batch.photo)
        parts = _training_losses(predicted, batch)
        if answers is not None:
            parts["sun"] = _KNOWN_SUN * parts["sun"]
            parts |= {f"taught {name}": loss for name, loss in _training_losses(predicted, answers).items()}
        return parts

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """One step of the optimizer; what it leaves out by chance depends on the step, so runs resume as they were."""
        torch.manual_seed(self.step)
        for group in self.optimizer.param_groups:
            group["lr"] = (
                group["scale"] * self.config.learning_rate * _learning_rate(self.step, self.steps, self.config.warmup)
            )
        if self.config.mirrored:
            batch = _with_mirror_images(batch)
        parts = self._choose_losses(self.losses(self.network, batch, self.teachers))
        torch.autograd.backward(torch.stack(list(parts.values())).sum())
        nn.utils.clip_grad_norm_(self.network.parameters(), _MAX_GRADIENT)
        self.optimizer.step()
        self.optimizer.zero_grad(set_to_none=True)
        self.average.update_parameters(self.network)
        self.step += 1
        return {name: value.detach() for name, value in parts.items()}

    def _choose_losses(self, parts: dict[str, Tensor]) -> dict[str, Tensor]:
        """The losses that the run minimizes."""
        if self.config.only_seen:
            return {"seen": parts["seen"]}
        return {name: parts[name] for name in _CAMERA_LOSSES} if self.config.only_camera else parts

    def batches(self, dataset: TrainingCrops, first: int = 0) -> Iterator[Batch]:
        """Batches on the device, beginning with crop number `first`."""
        loader = DataLoader(
            dataset,
            batch_size=self.config.batch,
            sampler=range(first, len(dataset)),
            num_workers=self.config.workers,
            drop_last=not dataset.tune,
            worker_init_fn=_one_thread,
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


def _one_thread(_worker: int) -> None:
    torch.set_num_threads(1)


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
        made = "was read back from a file" if "file" in record else "is the mean of several runs"
        raise DataError(f"{config.out} holds a network that {made}; give it as --start and choose another --out.")
    now = _settings(config)
    if unknown := record["config"].keys() - now.keys():
        what = f"a setting that is unknown here, {min(unknown)}"
        raise DataError(f"{config.out} holds a run with {what}; choose another --out.")
    then = _settings(TrainConfig(**record["config"]))
    changed = [name for name in now if name not in MAY_CHANGE and then[name] != now[name]]
    if changed:
        raise DataError(f"{config.out} holds a run with another {' and '.join(changed)}; choose another --out.")
    return str(record["commit"]).split(", ")


def _settings(config: TrainConfig) -> Json:
    """A run's settings by name, its paths absolute."""
    settings = asdict(config)
    for name in PATH_SETTINGS:
        value = settings[name]
        settings[name] = _absolute(value) if isinstance(value, str) else [_absolute(path) for path in value]
    return settings


def _absolute(path: str) -> str:
    return str(Path(path).resolve()) if path else ""


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
    sources, synthetic = load_sources(kept, config.labels), _synthetic_sources(config)
    dataset = TrainingCrops(sources, run.spec, config, synthetic=synthetic, photos=photos)
    tune = TrainingCrops(load_sources(held_out, config.labels), run.spec, config, tune=True) if held_out else None
    Path(config.out).mkdir(parents=True, exist_ok=True)
    _write_record(run, [*before, _commit()] if run.step < run.steps else before, kept, held_out)
    panoramas = f"{len(dataset.sources)} panoramas to train on ({len(kept)} real), {len(held_out)} held out"
    print(f"{panoramas}, from step {run.step} of {run.steps}", flush=True)
    _loop(run, dataset, tune)
    return run.checkpoint


def _loop(run: _Run, dataset: TrainingCrops, tune: TrainingCrops | None) -> None:
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


def _log(run: _Run, values: dict[str, float]) -> None:
    line = json.dumps({"step": run.step, **{name: round(value, 4) for name, value in values.items()}})
    print(line, flush=True)
    with (Path(run.config.out) / "log.jsonl").open("a") as file:
        file.write(line + "\n")


def _synthetic_sources(config: TrainConfig) -> list[Source]:
    """The rendered places that the run mixes in, if any."""
    if not config.synthetic:
        return []
    return load_sources(read_index(config.synthetic, "train"), Path(config.synthetic) / LABELS)
