"""Training of the network of normals, and its ONNX file for any number and size of images.

New samples join a pool from which batches are drawn, for a set time. A run's folder holds config.json, log.jsonl and
checkpoint.pt; a run that was stopped goes on where it was.
"""

import json
import math
import time
from collections import deque
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from export.data.panoramas import DataError
from export.networks.onnx_export import add_metadata, check_parity, trace_onnx
from export.networks.weights import CHECKPOINT, append_log, read_checkpoint
from export.stereo.normals_network import NormalsNetwork
from export.stereo.samples import NormalsSample, batch_samples, generate_samples, read_meshes
from lighting.files import atomic_write
from lighting.stereo.normal_network import BY_IMAGE, SHARED, Network, NormalFeatures

_OPSET = 18
EXPORT_TOLERANCE = 2e-3  # largest difference between torch and onnxruntime, of normals and of errors [rad]
_EVERY = 50  # steps between lines of the log
_SAVE = 200  # steps between checkpoints
_MEMORY = 0.995  # of the averaged weights


@dataclass(frozen=True)
class Config:
    """How a run trains."""

    out: str
    meshes: str = ""  # folder of OBJ files; without one, reliefs alone
    minutes: float = 70.0  # of training in all, over resumptions
    batch: int = 8
    pool: int = 5000  # samples kept; the oldest leave
    first: int = 96  # samples before the first step
    learning_rate: float = 2e-3
    seed: int = 1
    threads: int = 1


@dataclass
class _Run:
    """The state of a run, as a checkpoint holds it."""

    network: NormalsNetwork
    average: dict[str, Tensor]
    optimiser: torch.optim.Optimizer
    step: int = 0
    seconds: float = 0.0


def train_normals(config: Config) -> Path:
    """Train, or go on with, the run in a folder; returns its checkpoint.

    Args:
        config: how it trains and where.

    Raises:
        DataError: for a folder without meshes to learn from, and for a checkpoint of no such run.
    """
    torch.set_num_threads(config.threads)
    meshes = read_meshes(Path(config.meshes)) if config.meshes else []
    folder = Path(config.out)
    folder.mkdir(parents=True, exist_ok=True)
    run = _resumed(folder, config)
    with atomic_write(folder / "config.json") as path:
        path.write_text(json.dumps(asdict(config), indent=2))
    fresh = generate_samples(meshes, config.seed + run.step)
    pool = deque(islice(fresh, config.first), maxlen=config.pool)
    rng = np.random.default_rng(config.seed + run.step)
    last, window = time.monotonic(), []
    while run.seconds < 60 * config.minutes:
        pool.append(next(fresh))
        chosen = [pool[index] for index in rng.integers(len(pool), size=config.batch)]
        window.append(_step(run, chosen, config, mirrored=bool(rng.integers(2))))
        run.seconds, last = run.seconds + time.monotonic() - last, time.monotonic()
        if run.step % _EVERY == 0:
            append_log(folder, run.step, run.seconds / 60, window)
            window.clear()
        if run.step % _SAVE == 0:
            _save(folder, run)
    _save(folder, run)
    return folder / CHECKPOINT


def _step(run: _Run, chosen: list[NormalsSample], config: Config, *, mirrored: bool) -> dict[str, Tensor]:
    share = min(1.0, run.seconds / (60 * config.minutes))
    for group in run.optimiser.param_groups:
        warm = min(1.0, (run.step + 1) / 50)
        group["lr"] = config.learning_rate * warm * (0.51 + 0.5 * math.cos(math.pi * share))
    by_image, present, shared, truth = batch_samples(chosen, mirrored=mirrored)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        normal, error = run.network(by_image, shared, present)
    mask = shared[:, -1]
    chord = torch.sqrt(((normal - truth) ** 2).sum(dim=1) + 1e-6)
    loss = _mean(chord, mask) + 0.1 * _mean(chord.detach() / error[:, 0] + torch.log(error[:, 0]), mask)
    run.optimiser.zero_grad(set_to_none=True)
    loss.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(run.network.parameters(), 1.0)
    run.optimiser.step()
    run.step += 1
    memory = min(_MEMORY, 1 - 1 / (run.step + 1))
    for name, value in run.network.state_dict().items():
        run.average[name].lerp_(value, 1 - memory)
    searched = torch.sqrt(((shared[:, :3] - truth) ** 2).sum(dim=1) + 1e-6)
    return {"loss": loss.detach(), "network": _degrees(chord, mask), "search": _degrees(searched, mask)}


def _mean(value: Tensor, mask: Tensor) -> Tensor:
    return (value * mask).sum() / mask.sum()


def _degrees(chord: Tensor, mask: Tensor) -> Tensor:
    return _mean(torch.rad2deg(2 * torch.asin((chord.detach() / 2).clamp(max=1))), mask)


def _resumed(folder: Path, config: Config) -> _Run:
    torch.manual_seed(config.seed)
    network = NormalsNetwork()
    optimiser = torch.optim.Adam(network.parameters(), lr=config.learning_rate)
    run = _Run(network, {k: v.clone() for k, v in network.state_dict().items()}, optimiser)
    if (folder / CHECKPOINT).exists():
        saved = _saved(folder)
        network.load_state_dict(saved["network"])
        optimiser.load_state_dict(saved["optimiser"])
        run.average, run.step, run.seconds = saved["average"], saved["step"], saved["seconds"]
    return run


def _saved(folder: Path) -> dict[str, Any]:
    """What the checkpoint of a run of this network holds; DataError for a damaged one and for another network's."""
    saved = read_checkpoint(folder)
    if not isinstance(saved.get("average"), dict) or saved["average"].keys() != NormalsNetwork().state_dict().keys():
        raise DataError(f"{folder / CHECKPOINT} is not of the network of normals.")
    return saved


def _save(folder: Path, run: _Run) -> None:
    state = {"network": run.network.state_dict(), "average": run.average, "optimiser": run.optimiser.state_dict()}
    with atomic_write(folder / CHECKPOINT) as path:
        torch.save({**state, "step": run.step, "seconds": run.seconds}, path)


def averaged_normals_network(folder: Path) -> NormalsNetwork:
    """The network with a run's averaged weights, ready to answer.

    Args:
        folder: of the run.

    Raises:
        DataError: for what is no such run.
    """
    network = NormalsNetwork()
    network.load_state_dict(_saved(folder)["average"])
    return network.eval()


def export_normals(run: Path, target: Path, version: str) -> float:
    """Write the averaged network of a run; returns the largest difference to torch.

    Args:
        run: folder of the run.
        target: ONNX file to write.
        version: of the network.

    Raises:
        ModelError: where torch and onnxruntime differ by more than EXPORT_TOLERANCE.
    """
    import onnx

    network = averaged_normals_network(run)
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(target) as path:
        side, moments = torch.export.Dim("side", min=2, max=4096), torch.export.Dim("moments", min=2, max=512)
        tall = torch.export.Dim("tall", min=2, max=4096)
        shapes = {"by_image": {1: moments, 3: 8 * tall, 4: 8 * side}, "shared": {2: 8 * tall, 3: 8 * side}}
        examples = {"by_image": torch.zeros(1, 8, BY_IMAGE, 32, 48), "shared": torch.ones(1, SHARED, 32, 48)}
        model = trace_onnx(network, examples, ["normal", "error"], shapes, _OPSET)
        known = {"name": "normals", "version": version, "license": "Apache-2.0"}
        known["training"] = json.dumps(json.loads((run / "config.json").read_text()) | {"out": "", "meshes": ""})
        add_metadata(model, known)
        onnx.checker.check_model(model)
        onnx.save_model(model, str(path), save_as_external_data=False)
        return check_parity(_parity(network, path), EXPORT_TOLERANCE)


def _parity(network: NormalsNetwork, path: Path) -> float:
    """Largest difference between torch and onnxruntime on fixed inputs of another size and number of images."""
    rng = np.random.default_rng(0)
    by_image = rng.normal(0, 0.5, (5, BY_IMAGE, 56, 72)).astype(np.float32)
    shared = rng.normal(0, 0.5, (SHARED, 56, 72)).astype(np.float32)
    shared[-1] = 1
    with torch.inference_mode():
        expected = network(torch.from_numpy(by_image)[None], torch.from_numpy(shared)[None])
    normal, error = Network.load(path, threads=1).predict(NormalFeatures(by_image, shared))
    answer = (np.moveaxis(normal, -1, 0), np.radians(error))
    return float(max(np.abs(a[0].numpy() - b).max() for a, b in zip(expected, answer, strict=True)))
