"""What a training folder says of its run: its settings, its spec, the panoramas it saw and the runs before it."""

import json
from pathlib import Path
from typing import Any

from export.data.panoramas import DataError
from lighting.records import ModelSpec

RECORD = "config.json"


def read_record(folder: Path) -> dict[str, Any]:
    """What a training folder says of its run; DataError if it holds none."""
    try:
        record: dict[str, Any] = json.loads((folder / RECORD).read_text())
    except (OSError, ValueError) as error:
        raise DataError(f"{folder} is not the folder of a training run: {error}.") from error
    return record


def read_spec(folder: Path) -> ModelSpec:
    """What the network of a training folder expects."""
    return ModelSpec.from_json(json.dumps(read_record(folder)["spec"]))


def history(*records: dict[str, Any]) -> list[dict[str, Any]]:
    """What reproduces runs, those before them and those they were merged from, each once, but for where files lay."""
    runs: list[dict[str, Any]] = []
    for record in records:
        known = record["merged"] if "merged" in record else [*record.get("before", []), _own(record)]
        runs += [run for run in known if run not in runs]
    return runs


def _own(record: dict[str, Any]) -> dict[str, Any]:
    config = {k: v for k, v in record["config"].items() if k not in ("data", "labels", "out")}
    return {**config, "commit": record["commit"], "torch": record["torch"]}


def describe_data(record: dict[str, Any]) -> str:
    """One sentence on what the network saw."""
    runs, names = history(record), record["panoramas"]["train"]
    which = "permissively licensed panoramas" if runs[0]["licensed_only"] else "panoramas, most with no stated licence"
    start = "from ImageNet weights, " if runs[0]["pretrained"] else ""
    rendered = ", a share of them of rendered places" if any(run.get("synthetic") for run in runs) else ""
    return f"{start}{sum(run['crops'] for run in runs)} crops of {len(names)} outdoor {which}{rendered}"
