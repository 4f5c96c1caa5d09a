"""Learning from what earlier runs answer."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from export.crops.sources import load_sources
from export.data.panoramas import read_index
from export.data.tables import DataError
from export.networks.checkpoints import read_network
from export.networks.layers import Said
from export.networks.parameters import decode, expected
from export.networks.runs import history, read_record
from export.training.batches import Batch, TrainingCrops
from export.training.config import TrainConfig
from export.training.losses import losses
from export.training.run import Run
from export.training.teaching import Teachers, blended
from export.training.train import train
from lighting.errors import LightingError


@pytest.fixture
def batch(config: TrainConfig) -> Batch:
    run = Run(config)
    sources = load_sources(read_index(config.data, "train"), config.labels)
    return next(run.batches(TrainingCrops(sources, run.spec, replace(config, surroundings=True))))


def test_the_target_is_the_mean_of_the_teachers_answers(trained: Path, batch: Batch) -> None:
    network = read_network(trained)
    spec = Run(TrainConfig("", "", "")).spec
    alone = Teachers([trained], spec, batch.photo.device, around=False).targets(batch.photo)
    with torch.inference_mode():
        said = network(batch.photo)
    torch.testing.assert_close(alone.sun, said.sun.softmax(dim=1))
    torch.testing.assert_close(alone.parameters[:, 2:5], _camera(said))
    assert alone.around.shape == alone.light.shape == (len(batch.photo), 0)
    twice = Teachers([trained, trained], spec, batch.photo.device, around=False).targets(batch.photo)
    torch.testing.assert_close(twice.sun, alone.sun)


def _camera(said: Said) -> torch.Tensor:
    return decode(torch.cat([said.raw[:, :2], expected(said.camera), said.raw[:, 5:]], dim=1))[:, 2:5]


def test_of_blended_pictures_nothing_is_known_and_of_the_others_all(batch: Batch) -> None:
    torch.manual_seed(0)
    mixed = blended(batch, 0.5)
    same = (mixed.photo == batch.photo).flatten(1).all(dim=1)
    assert 0 < int(same.sum()) < len(same)
    for name in ("sun", "parameters", "seen", "around", "light"):
        torch.testing.assert_close(getattr(mixed, name)[same], getattr(batch, name)[same], equal_nan=True)
    assert (mixed.sun[~same] == 0).all()
    assert (mixed.seen[~same] == 0).all()
    assert mixed.parameters[~same].isnan().all()
    assert mixed.light[~same].isnan().all()
    torch.testing.assert_close(blended(batch, 0.0).photo, batch.photo)


def test_a_network_that_answers_as_its_teacher_has_nothing_to_learn_from_it(trained: Path, batch: Batch) -> None:
    network = read_network(trained)
    taught = Teachers([trained], Run(TrainConfig("", "", "")).spec, batch.photo.device, around=False)
    answers = taught.targets(batch.photo)
    said = network(batch.photo)
    loss = losses(said, answers)["sun"]
    entropy = -(answers.sun * answers.sun.log()).sum(dim=1).mean()
    assert loss.item() == pytest.approx(entropy.item(), rel=1e-3)
    (slope,) = torch.autograd.grad(loss, said.sun)
    assert slope.abs().max() < 1e-6


def test_a_run_is_taught_and_says_by_whom(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    own = replace(config, out=str(tmp_path), teachers=(str(trained),), crops=8, batch=4, tune_share=0.0)
    train(own)
    logged = json.loads((tmp_path / "log.jsonl").read_text())
    assert logged["taught sun"] > 0
    assert [run["crops"] for run in history(read_record(tmp_path))] == [16, 8]
    train(replace(own, workers=0))  # a finished run is taken up again with the same teachers
    with pytest.raises(DataError, match="another teachers"):
        train(replace(own, teachers=()))


def test_who_has_not_learnt_it_cannot_teach_it(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    own = replace(config, out=str(tmp_path), teachers=(str(trained),))
    with pytest.raises(LightingError, match="cannot teach --surroundings"):
        train(replace(own, surroundings=True))
    for given in ({"teachers": (str(tmp_path / "none"),)}, {"start": str(tmp_path / "none"), "teachers": ()}):
        with pytest.raises(LightingError, match="not the folder of a training run"):
            train(replace(own, **given))
