"""Tests of weights."""

import json
from pathlib import Path
from typing import Any

import pytest
import torch

from export.data.panoramas import DataError
from export.networks.outdoor import Outdoor, load_weights, network_specs
from export.networks.weights import (
    CHECKPOINT,
    RUN_RECORD,
    averaged_weights,
    describe_data,
    have_different_specs,
    read_network,
    read_record,
    read_spec,
    training_history,
)


def test_averaged_weights_have_the_network_s_own_names(trained: Path) -> None:
    weights = averaged_weights(trained)
    network = Outdoor(read_spec(trained))
    assert set(weights) == set(network.state_dict())
    state = torch.load(trained / CHECKPOINT, weights_only=True)
    assert {"network", "average", "optimizer", "step"} <= set(state)


def test_the_network_that_is_read_is_ready_to_answer(trained: Path) -> None:
    network, expected = read_network(trained), Outdoor(read_spec(trained))
    load_weights(expected, averaged_weights(trained))
    assert not network.training
    photo = torch.randn(1, 3, 224, 224)
    with torch.inference_mode():
        torch.testing.assert_close(network(photo).sun, expected.eval()(photo).sun)


def test_a_network_that_tells_nothing_of_a_sun_in_view_is_refused(
    trained: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    weights = {name: value for name, value in averaged_weights(trained).items() if not name.startswith("seen.")}
    monkeypatch.setattr("export.networks.weights.averaged_weights", lambda _: weights)
    with pytest.raises(DataError, match=r"before version 1\.3"):
        read_network(trained)


def record(crops: int, **more: Any) -> dict[str, Any]:
    config = {"crops": crops, "licensed_only": False, "pretrained": True, "data": "here", "labels": "l", "out": "o"}
    spec = json.loads(network_specs("1.0.0")["outdoor"].to_json())
    made = {"config": config, "spec": spec, "commit": "c", "torch": "2", "panoramas": {"train": ["a", "b"], "tune": []}}
    return made | more


def write(folder: Path, content: dict[str, Any]) -> Path:
    folder.mkdir()
    (folder / RUN_RECORD).write_text(json.dumps(content))
    return folder


def test_history_lists_each_run_once_and_no_paths() -> None:
    first = training_history(record(10))
    assert first == [{"crops": 10, "licensed_only": False, "pretrained": True, "commit": "c", "torch": "2"}]
    later = record(20, before=first)
    assert [run["crops"] for run in training_history(later, record(10))] == [10, 20]
    assert [run["crops"] for run in training_history(record(30, merged=training_history(later)))] == [10, 20]


def test_of_the_runs_and_places_that_a_run_learnt_from_the_names_alone_are_listed() -> None:
    one = record(10)
    one["config"] |= {"start": "/home/me/runs/first", "synthetic": "runs/towns/", "teachers": ["/a/b", "c"]}
    (run,) = training_history(one)
    assert (run["start"], run["synthetic"], run["teachers"]) == ("first", "towns", ["b", "c"])
    older = {**run, "start": "/work/first", "synthetic": "", "teachers": []}  # as runs listed them before
    assert [run["start"] for run in training_history(record(20, before=[older]))[:1]] == ["first"]
    assert len(training_history(one, record(30, merged=[{**run, "start": "/home/me/runs/first"}]))) == 1


def test_the_training_data_are_one_sentence() -> None:
    assert describe_data(record(10, before=training_history(record(5)))) == (
        "from ImageNet weights, 15 crops of 2 outdoor panoramas, most with no stated licence"
    )
    mixed = record(10)
    mixed["config"] |= {"photos_share": 0.2, "licensed_only": True, "pretrained": False}
    assert describe_data(mixed) == (
        "10 crops of 2 outdoor permissively licensed panoramas, a share of them of ordinary photos"
    )
    mixed["config"]["synthetic"] = "towns"  # of runs up to 2.5.0
    assert describe_data(mixed).endswith(", a share of them of rendered places and ordinary photos")


def test_versions_alone_make_no_difference(tmp_path: Path) -> None:
    one = write(tmp_path / "one", record(1))
    newer = record(1)
    newer["spec"] = newer["spec"] | {"version": "2.0.0"}
    other = record(1)
    other["spec"] = other["spec"] | {"sun_grid": "rings:5x32"}
    assert not have_different_specs([one, write(tmp_path / "newer", newer)])
    assert have_different_specs([one, write(tmp_path / "other", other)])
    assert read_spec(one) == network_specs("1.0.0")["outdoor"]


def test_a_folder_without_a_record_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="is not the folder of a training run"):
        read_record(tmp_path)
    with pytest.raises(DataError) as refused:
        read_record(tmp_path)
    assert str(refused.value).count(str(tmp_path)) == 1
    for other in ("[1]", '{"minutes": 70}'):  # the second as of a run of `stereo train`
        (tmp_path / RUN_RECORD).write_text(other)
        with pytest.raises(DataError, match=r"config\.json is of another kind\.$"):
            read_spec(tmp_path)
