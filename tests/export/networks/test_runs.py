"""Records of runs."""

import json
from pathlib import Path
from typing import Any

import pytest

from export.data import DataError
from export.networks.runs import RECORD, describe_data, differ, history, read_record, read_spec
from export.networks.specs import specs


def record(crops: int, **more: Any) -> dict[str, Any]:
    config = {"crops": crops, "licensed_only": False, "pretrained": True, "data": "here", "labels": "l", "out": "o"}
    spec = json.loads(specs("1.0.0")["outdoor"].to_json())
    made = {"config": config, "spec": spec, "commit": "c", "torch": "2", "panoramas": {"train": ["a", "b"], "tune": []}}
    return made | more


def write(folder: Path, content: dict[str, Any]) -> Path:
    folder.mkdir()
    (folder / RECORD).write_text(json.dumps(content))
    return folder


def test_history_lists_each_run_once_and_no_paths() -> None:
    first = history(record(10))
    assert first == [{"crops": 10, "licensed_only": False, "pretrained": True, "commit": "c", "torch": "2"}]
    later = record(20, before=first)
    assert [run["crops"] for run in history(later, record(10))] == [10, 20]
    assert [run["crops"] for run in history(record(30, merged=history(later)))] == [10, 20]


def test_of_the_runs_and_places_that_a_run_learnt_from_the_names_alone_are_listed() -> None:
    one = record(10)
    one["config"] |= {"start": "/home/me/runs/first", "synthetic": "runs/towns/", "teachers": ["/a/b", "c"]}
    (told,) = history(one)
    assert (told["start"], told["synthetic"], told["teachers"]) == ("first", "towns", ["b", "c"])
    older = {**told, "start": "/work/first", "synthetic": "", "teachers": []}  # as runs listed them before
    assert [run["start"] for run in history(record(20, before=[older]))[:1]] == ["first"]
    assert len(history(one, record(30, merged=[{**told, "start": "/home/me/runs/first"}]))) == 1


def test_the_training_data_are_one_sentence() -> None:
    assert describe_data(record(10, before=history(record(5)))) == (
        "from ImageNet weights, 15 crops of 2 outdoor panoramas, most with no stated licence"
    )
    mixed = record(10)
    mixed["config"] |= {"photos_share": 0.2, "licensed_only": True, "pretrained": False}
    assert describe_data(mixed) == (
        "10 crops of 2 outdoor permissively licensed panoramas, a share of them of ordinary photos"
    )
    mixed["config"]["synthetic"] = "towns"
    assert describe_data(mixed).endswith(", a share of them of rendered places and ordinary photos")
    baseline = record(10)
    baseline["spec"]["name"] = "cvpr2017"
    assert describe_data(baseline) == "10 crops of 2 outdoor panoramas, most with no stated licence"


def test_versions_alone_make_no_difference(tmp_path: Path) -> None:
    one = write(tmp_path / "one", record(1))
    newer = record(1)
    newer["spec"] = newer["spec"] | {"version": "2.0.0"}
    other = record(1)
    other["spec"] = json.loads(specs("1.0.0")["cvpr2017"].to_json())
    assert not differ([one, write(tmp_path / "newer", newer)])
    assert differ([one, write(tmp_path / "other", other)])
    assert read_spec(one) == specs("1.0.0")["outdoor"]


def test_a_folder_without_a_record_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="is not the folder of a training run"):
        read_record(tmp_path)
    with pytest.raises(DataError) as refused:
        read_record(tmp_path)
    assert str(refused.value).count(str(tmp_path)) == 1
    for other in ("[1]", '{"minutes": 70}'):  # the second as of a run of `stereo train`
        (tmp_path / RECORD).write_text(other)
        with pytest.raises(DataError, match=r"config\.json is of another kind\.$"):
            read_spec(tmp_path)
