"""Whole runs on tiny rendered panoramas."""

import json
from dataclasses import replace
from pathlib import Path

import onnx
import pytest
import torch

from export.crops.sources import load_sources
from export.crops.surroundings import CELLS
from export.data.panoramas import read_index
from export.data.tables import DataError
from export.networks.checkpoints import averaged_weights
from export.networks.onnx import write_onnx
from export.networks.runs import history, read_record
from export.networks.specs import specs
from export.training.batches import TrainingCrops
from export.training.config import TrainConfig
from export.training.run import Run
from export.training.train import train


def test_where_the_sun_is_seen_can_be_learnt_alone(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    train(replace(config, out=str(tmp_path), start=str(trained), only_seen=True, aimed=1.0, crops=8))
    before, after = averaged_weights(trained), averaged_weights(tmp_path)
    changed = {name for name, value in before.items() if not torch.equal(value, after[name])}
    assert changed
    assert all(name.startswith("seen.") for name in changed)
    assert [run["crops"] for run in history(read_record(tmp_path))] == [16, 8]


def test_the_camera_can_be_learnt_alone(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    train(replace(config, out=str(tmp_path), start=str(trained), only_camera=True, crops=8))
    before, after = averaged_weights(trained), averaged_weights(tmp_path)
    changed = {name.split(".")[0] for name, value in before.items() if not torch.equal(value, after[name])}
    assert {"backbone", "values", "camera"} <= changed
    assert "sun" not in changed


def test_two_places_may_share_a_crop_and_the_light_around_is_learnt(config: TrainConfig, tmp_path: Path) -> None:
    both = replace(config, out=str(tmp_path / "run"), crops=8, joined=1.0, surroundings=True)
    sources = load_sources(read_index(config.data, "train"), config.labels)
    run = Run(both)
    alone, joined = (TrainingCrops(sources, run.spec, c) for c in (config, both))
    assert {len(joined._drawn(index)) for index in range(8)} == {2}
    assert all(joined._drawn(index)[0] == alone._drawn(index)[0] for index in range(8))
    assert [tuple(part.shape) for part in (alone[0].around, joined[0].around)] == [(0,), (3 * CELLS,)]
    assert not torch.equal(alone[0].photo, joined[0].photo)
    train(both)
    assert json.loads((Path(both.out) / "log.jsonl").read_text())["around"] > 0
    write_onnx([Path(both.out)], tmp_path / "x.onnx")
    assert {"light", "around"} < {output.name for output in onnx.load(tmp_path / "x.onnx").graph.output}
    train(replace(both, out=str(tmp_path / "next"), start=both.out, joined=0.0, surroundings=False, only_seen=True))


def test_crops_of_a_stretched_world_have_other_pictures_and_suns(config: TrainConfig, tmp_path: Path) -> None:
    stretched = replace(config, out=str(tmp_path / "run"), crops=8, stretched=1.0, joined=0.5, surroundings=True)
    sources = load_sources(read_index(config.data, "train"), config.labels)
    spec = specs("1.0.0")["outdoor"]
    as_it_is, other = (TrainingCrops(sources, spec, replace(stretched, stretched=share)) for share in (0.0, 1.0))
    assert all(as_it_is._drawn(index) == other._drawn(index) for index in range(8))
    for part in ("photo", "sun", "around"):
        assert not any(torch.equal(getattr(as_it_is[i], part), getattr(other[i], part)) for i in range(4))
    train(stretched)
    assert history(read_record(Path(stretched.out)))[0]["stretched"] == 1.0


def test_a_run_that_would_train_nothing_is_refused_and_leaves_no_folder(config: TrainConfig, tmp_path: Path) -> None:
    asked = replace(config, out=str(tmp_path / "run"), crops=8)
    with pytest.raises(DataError, match=r"8 crops do not fill one step of 32, so nothing would be trained\.$"):
        train(replace(asked, batch=32))
    with pytest.raises(DataError, match="no photo to learn from"):
        train(replace(asked, photos_share=0.5))
    with pytest.raises(DataError, match="cannot be read"):
        train(replace(asked, labels=str(tmp_path / "none.csv")))
    assert not (tmp_path / "run").exists()


def test_a_run_s_crops_depend_on_the_name_of_its_start_and_not_on_where_that_lies(config: TrainConfig) -> None:
    sources = load_sources(read_index(config.data, "train"), config.labels)
    spec = specs("1.0.0")["outdoor"]
    photos = [
        TrainingCrops(sources, spec, replace(config, start=start))[0].photo
        for start in ("/home/me/runs/first", "runs/first/", "runs/second")
    ]
    assert torch.equal(photos[0], photos[1])
    assert not torch.equal(photos[0], photos[2])
