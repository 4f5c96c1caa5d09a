"""What a run leaves to reproduce it."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import read_index
from export.data.tables import DataError
from export.networks.runs import RECORD
from export.training.config import TrainConfig
from export.training.train import train


def test_a_run_leaves_what_reproduces_it(trained: Path, config: TrainConfig) -> None:
    record = json.loads((trained / "config.json").read_text())
    assert record["config"]["crops"] == config.crops
    assert set(record["panoramas"]["train"]).isdisjoint(record["panoramas"]["tune"])
    assert not {p.name for p in read_index(config.data, "val")} & set(record["panoramas"]["train"])
    last = json.loads((trained / "log.jsonl").read_text().splitlines()[-1])
    assert last["step"] == 4
    assert np.isfinite(last["sun"])


def test_a_run_is_resumed_with_its_own_settings_alone(config: TrainConfig, tmp_path: Path) -> None:
    own = replace(config, out=str(tmp_path), crops=8, batch=4)
    train(own)
    record = json.loads((tmp_path / RECORD).read_text())
    with pytest.raises(DataError, match=r"holds a run with another crops and licensed_only; choose another --out"):
        train(replace(own, crops=4, licensed_only=True))
    train(replace(own, workers=0, checkpoint_minutes=9.0))
    again = json.loads((tmp_path / RECORD).read_text())
    assert again["commit"] == record["commit"]
    assert again["config"] == {**record["config"], "workers": 0, "checkpoint_minutes": 9.0}
    moved = shutil.copytree(tmp_path, tmp_path / "moved")
    train(replace(own, out=str(moved)))
    assert json.loads((moved / RECORD).read_text())["commit"] == record["commit"]
