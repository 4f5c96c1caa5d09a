"""The training loop: crops drawn on the fly, either network; stops and resumes at any time.

The folder it writes holds config.json (everything the run depends on, with the commit), log.jsonl and checkpoint.pt.
"""

import json
import time
from pathlib import Path

import torch
from torch import Tensor

from export.crops import load_sources
from export.data import DataError
from export.networks import CHECKPOINT
from export.training.batches import TrainingCrops
from export.training.config import TrainConfig
from export.training.record import commit, earlier_commits, write_record
from export.training.run import Run
from export.training.sources import synthetic_sources, training_panoramas, training_photos


def train(config: TrainConfig) -> Path:
    """Train, or resume what the folder holds; returns the path of the checkpoint.

    Raises DataError if the folder holds a run with other settings or no run that can go on, if there is nothing to
    train on, or if no step would be trained; the folder is then as before.
    """
    if config.crops < config.batch:
        raise DataError(f"{config.crops} crops do not fill one step of {config.batch}, so nothing would be trained.")
    before = earlier_commits(config) if (Path(config.out) / CHECKPOINT).exists() else []
    kept, held_out = training_panoramas(config)
    photos = training_photos(config)
    run = Run(config)
    run.resume()
    dataset = TrainingCrops(
        load_sources(kept, config.labels),
        run.spec,
        config,
        synthetic=synthetic_sources(config),
        photos=photos,
    )
    tune = TrainingCrops(load_sources(held_out, config.labels), run.spec, config, tune=True) if held_out else None
    Path(config.out).mkdir(parents=True, exist_ok=True)
    write_record(run, [*before, commit()] if run.step < run.steps else before, kept, held_out)
    print(
        f"{len(dataset.sources)} panoramas to train on ({len(kept)} real), {len(held_out)} held out, "
        f"from step {run.step} of {run.steps}",
        flush=True,
    )
    _loop(run, dataset, tune)
    return run.checkpoint


def _loop(run: Run, dataset: TrainingCrops, tune: TrainingCrops | None) -> None:
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
