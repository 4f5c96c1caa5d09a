"""config.json in a run's folder: everything the run depends on."""

import json
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from export.data import DataError, Panorama
from export.networks import RECORD, history, read_record
from export.training.config import MAY_CHANGE, PLACES, TrainConfig
from export.training.run import Run
from lighting.files import replacing


def write_record(run: Run, commits: Iterable[str], kept: Sequence[Panorama], held_out: Sequence[Panorama]) -> None:
    """Write the run's settings, spec, commits, panoramas and the runs it continues or learns from."""
    config = run.config
    sources = [config.start, *config.teachers] if config.start else config.teachers
    record = {
        "config": asdict(config),
        "spec": asdict(run.spec),
        "commit": ", ".join(dict.fromkeys(commits)),
        "torch": torch.__version__,
        "before": history(*(read_record(Path(folder)) for folder in sources)),
        "panoramas": {"train": [p.name for p in kept], "tune": [p.name for p in held_out]},
    }
    with replacing(Path(config.out) / RECORD) as path:
        path.write_text(json.dumps(record, indent=1))


def earlier_commits(config: TrainConfig) -> list[str]:
    """The commits that trained the run in `config.out` so far; DataError if it has other settings or cannot go on.

    Settings that the run's record is too old to have count as their defaults.
    """
    record = read_record(Path(config.out))
    if "merged" in record:
        made = "was read back from a file" if "file" in record else "is the mean of several runs"
        raise DataError(f"{config.out} holds a network that {made}; give it as --start and choose another --out.")
    now = _settings(config)
    if unknown := record["config"].keys() - now.keys():
        raise DataError(
            f"{config.out} holds a run with a setting that is unknown here, {min(unknown)}; choose another --out."
        )
    then = _settings(TrainConfig(**record["config"]))
    changed = [name for name in now if name not in MAY_CHANGE and then[name] != now[name]]
    if changed:
        raise DataError(f"{config.out} holds a run with another {' and '.join(changed)}; choose another --out.")
    return str(record["commit"]).split(", ")


def _settings(config: TrainConfig) -> dict[str, Any]:
    """A run's settings by name, its paths absolute."""
    settings = asdict(config)
    for name in PLACES:
        value = settings[name]
        settings[name] = _absolute(value) if isinstance(value, str) else [_absolute(path) for path in value]
    return settings


def _absolute(path: str) -> str:
    return str(Path(path).resolve()) if path else ""


def commit() -> str:
    """The checkout's commit, or "unknown" outside one."""
    done = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, cwd=Path(__file__).parent)
    return done.stdout.strip() or "unknown"
