"""The record of a training run: its settings, its spec, the panoramas it saw, the runs it continues."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from export.data import DataError
from lighting.records import ModelSpec

RECORD = "config.json"


def read_record(folder: Path) -> dict[str, Any]:
    """The record in a training folder; DataError if there is none or one of another kind."""
    try:
        record: dict[str, Any] = json.loads((folder / RECORD).read_text())
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise DataError(f"{folder} is not the folder of a training run: {RECORD}: {why}.") from error
    if not isinstance(record, dict) or "spec" not in record:
        raise DataError(f"{folder} is not the folder of a training run: {RECORD} is of another kind.")
    return record


def read_spec(folder: Path) -> ModelSpec:
    """The spec of a training folder's network."""
    return ModelSpec.from_json(json.dumps(read_record(folder)["spec"]))


def differ(folders: Sequence[Path]) -> bool:
    """Whether the networks of training folders have different specs, versions aside."""
    return len({replace(read_spec(folder), version="") for folder in folders}) > 1


def history(*records: dict[str, Any]) -> list[dict[str, Any]]:
    """Settings and commits of runs, of those they continue and of those they were merged from, once each.

    Of the runs and places that they learnt from, the folders' last names; no paths.
    """
    runs: list[dict[str, Any]] = []
    for record in records:
        known = record["merged"] if "merged" in record else [*record.get("before", []), _own(record)]
        runs += [run for run in map(_without_folders, known) if run not in runs]
    return runs


def _own(record: dict[str, Any]) -> dict[str, Any]:
    config = {k: v for k, v in record["config"].items() if k not in ("data", "labels", "out")}
    return {**config, "commit": record["commit"], "torch": record["torch"]}


def _without_folders(run: dict[str, Any]) -> dict[str, Any]:
    """Settings with the last names of the paths among them."""
    return {**run, **{name: _last_name(run[name]) for name in ("start", "synthetic", "teachers") if name in run}}


def _last_name(path: Any) -> Any:
    return Path(path).name if isinstance(path, str) else [Path(one).name for one in path]


def describe_data(record: dict[str, Any]) -> str:
    """One sentence about the network's training data; that of the file if it was read back from one."""
    if told := record.get("training_data"):
        return str(told)
    runs, names = history(record), record["panoramas"]["train"]
    free = all(run["licensed_only"] for run in runs)
    which = "permissively licensed panoramas" if free else "panoramas, most with no stated licence"
    pretrained = runs[0]["pretrained"] and record["spec"]["name"] != "cvpr2017"  # which has no such weights
    start = "from ImageNet weights, " if pretrained else ""
    shares = {"rendered places": "synthetic", "ordinary photos": "photos_share"}
    others = " and ".join(words for words, setting in shares.items() if any(run.get(setting) for run in runs))
    mixed_in = f", a share of them of {others}" if others else ""
    return f"{start}{sum(run['crops'] for run in runs)} crops of {len(names)} outdoor {which}{mixed_in}"
