"""What a run leaves to reproduce it."""

import json
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import read_index
from export.data.tables import DataError
from export.networks.averaging import merge
from export.networks.checkpoints import CHECKPOINT
from export.networks.runs import RECORD
from export.networks.unpack import read_shipped, write_run
from export.training.config import TrainConfig
from export.training.record import earlier_commits
from export.training.train import train


def test_a_run_leaves_what_reproduces_it(trained: Path, config: TrainConfig) -> None:
    record = json.loads((trained / "config.json").read_text())
    assert record["config"]["crops"] == config.crops
    assert set(record["panoramas"]["train"]).isdisjoint(record["panoramas"]["tune"])
    assert not {p.name for p in read_index(config.data, "val")} & set(record["panoramas"]["train"])
    last = json.loads((trained / "log.jsonl").read_text().splitlines()[-1])
    assert last["step"] == 4
    assert np.isfinite(last["sun"])


def test_a_run_is_resumed_with_its_own_settings_alone(
    config: TrainConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = replace(config, out=str(tmp_path), crops=8, batch=4)
    train(own)
    record = json.loads((tmp_path / RECORD).read_text())
    with pytest.raises(DataError, match=r"holds a run with another crops and licensed_only; choose another --out"):
        train(replace(own, crops=4, licensed_only=True))
    train(replace(own, workers=0, checkpoint_minutes=9.0))
    again = json.loads((tmp_path / RECORD).read_text())
    assert again["commit"] == record["commit"]
    assert again["config"] == {**record["config"], "workers": 0, "checkpoint_minutes": 9.0}
    monkeypatch.setitem(train.__globals__, "commit", lambda: "one that trained nothing")
    moved = shutil.copytree(tmp_path, tmp_path / "moved")
    train(replace(own, out=str(moved)))
    assert json.loads((moved / RECORD).read_text())["commit"] == record["commit"]


def test_networks_that_are_no_runs_are_to_be_started_from(
    config: TrainConfig, trained: Path, trained_network: Path, tmp_path: Path
) -> None:
    mean, read = tmp_path / "mean", tmp_path / "read"
    merge([trained, trained], mean)
    write_run(*read_shipped(trained_network, 0), trained_network, 0, read)
    for folder, made in ((mean, "is the mean of several runs"), (read, "was read back from a file")):
        before = (folder / RECORD).read_bytes()
        with pytest.raises(DataError, match=f"{made}; give it as --start and choose another --out"):
            train(replace(config, out=str(folder)))
        assert (folder / RECORD).read_bytes() == before


def test_a_damaged_checkpoint_is_one_sentence(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    for share in (0.0, 0.01, 0.6):
        run = tmp_path / f"run {share}"
        shutil.copytree(trained, run)
        whole = (trained / CHECKPOINT).read_bytes()
        (run / CHECKPOINT).write_bytes(whole[: int(share * len(whole))])
        again = replace(config, out=str(run))
        for work in (partial(train, again), partial(merge, [run, trained], tmp_path / "mean")):
            with pytest.raises(DataError, match=r"checkpoint\.pt is cut short or damaged\.$"):
                work()


def test_what_belongs_to_another_network_or_time_is_one_sentence(
    config: TrainConfig, trained: Path, tmp_path: Path
) -> None:
    train(replace(config, out=str(tmp_path / "cvpr2017"), network="cvpr2017", crops=4))
    with pytest.raises(DataError, match="are of another network than this one"):
        train(replace(config, out=str(tmp_path / "later"), start=str(tmp_path / "cvpr2017")))
    assert not (tmp_path / "later").exists()
    mixed = shutil.copytree(trained, tmp_path / "mixed")
    shutil.copy(tmp_path / "cvpr2017" / CHECKPOINT, mixed / CHECKPOINT)
    with pytest.raises(DataError, match=r"checkpoint\.pt is of another network than the run's\.$"):
        train(replace(config, out=str(mixed)))
    record = json.loads((mixed / RECORD).read_text())
    (mixed / RECORD).write_text(json.dumps({**record, "config": {**record["config"], "older": 1}}))
    with pytest.raises(DataError, match="holds a run with a setting that is unknown here, older; choose another --out"):
        train(replace(config, out=str(mixed)))


def test_a_path_may_be_written_another_way_when_a_run_is_resumed(
    config: TrainConfig, trained: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = replace(config, out=str(trained))
    folder = Path(config.data)
    monkeypatch.chdir(folder.parent)
    relative = replace(own, data=folder.name, labels=f"{folder.name}/../{folder.name}/labels.csv")
    assert earlier_commits(relative) == earlier_commits(own)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DataError, match="another data and labels"):
        earlier_commits(relative)
    with pytest.raises(DataError, match="another teachers and start and synthetic"):
        earlier_commits(replace(own, start=".", synthetic=".", teachers=(".",)))
