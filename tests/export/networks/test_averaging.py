"""The mean of several runs."""

import json
import shutil
from pathlib import Path

import pytest
import torch

from export.networks.averaging import merge
from export.networks.checkpoints import averaged_weights
from export.networks.runs import describe_data, history, read_record
from lighting.errors import LightingError


def test_merged_runs_have_the_mean_of_their_weights(trained: Path, tmp_path: Path) -> None:
    other, merged = tmp_path / "other", tmp_path / "merged"
    shutil.copytree(trained, other)
    state = torch.load(other / "checkpoint.pt", weights_only=True)
    for name, value in state["average"].items():
        if value.is_floating_point():
            state["average"][name] = value + 2.0
    torch.save(state, other / "checkpoint.pt")
    record = read_record(other)
    record["config"]["crops"] = 32
    (other / "config.json").write_text(json.dumps(record))
    merge([trained, other], merged)
    one, mean = averaged_weights(trained), averaged_weights(merged)
    assert one.keys() == mean.keys()
    for name, value in one.items():
        torch.testing.assert_close(mean[name], value + 1.0 if value.is_floating_point() else value)
    assert [run["crops"] for run in history(read_record(merged))] == [16, 32]
    assert [run["crops"] for run in history(read_record(merged), read_record(other))] == [16, 32]
    assert "48 crops" in describe_data(read_record(merged))
    with pytest.raises(LightingError, match="already holds a run"):
        merge([trained, other], merged)
