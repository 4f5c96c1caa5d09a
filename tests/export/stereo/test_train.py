"""A run of a few steps, and one that goes on."""

from pathlib import Path

import pytest
import torch

from export.data import DataError
from export.stereo.network import NormalsNetwork
from export.stereo.train import Config, average, train


def test_a_run_resumes(tmp_path: Path) -> None:
    file = train(Config(out=str(tmp_path), minutes=0.005, batch=2, first=2))
    before = torch.load(file, weights_only=True)
    assert before["step"] > 0
    longer = before["seconds"] / 60 + 0.005
    after = torch.load(train(Config(out=str(tmp_path), minutes=longer, batch=2, first=2)), weights_only=True)
    assert after["step"] > before["step"]
    assert after["seconds"] > before["seconds"]
    assert isinstance(average(tmp_path), NormalsNetwork)


@pytest.mark.parametrize("saved", [None, {"average": {"module.features.0.weight": torch.zeros(1)}}, {"step": 3}])
def test_a_checkpoint_that_is_none_of_normals_is_refused_and_stays(
    tmp_path: Path, saved: dict[str, object] | None
) -> None:
    file = tmp_path / "checkpoint.pt"
    if saved is None:
        file.write_bytes(b"PK\3\4 cut short")
    else:
        torch.save(saved, file)
    before = file.read_bytes()
    for work in (lambda: train(Config(out=str(tmp_path), minutes=0.001)), lambda: average(tmp_path)):
        with pytest.raises(DataError, match=r"is cut short or damaged|is not of the network of normals"):
            work()
    assert [path.name for path in tmp_path.iterdir()] == ["checkpoint.pt"]
    assert file.read_bytes() == before


def test_a_folder_without_meshes_to_learn_from_is_refused(tmp_path: Path) -> None:
    (tmp_path / "spot.obj").write_text("v 0 0 0\n")  # held out
    run = tmp_path / "run"
    with pytest.raises(DataError, match=r"holds no OBJ files to learn from\.$"):
        train(Config(out=str(run), meshes=str(tmp_path), minutes=0.001))
    assert not run.exists()
