"""Learning from what earlier runs answer."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from export.crops.crops import load_sources
from export.data.panoramas import DataError, read_index
from export.networks.backbone import NetworkOutput
from export.networks.outdoor import decode_parameters, mean_of_camera_bins
from export.networks.weights import read_network, read_record, training_history
from export.training.config import TrainConfig
from export.training.dataset import Batch, TrainingCrops
from export.training.distillation import TeacherEnsemble, blended_shares, mixup, with_mirror_images
from export.training.loop import _Run, train_network
from export.training.losses import training_losses
from lighting.errors import LightingError


@pytest.fixture
def batch(config: TrainConfig) -> Batch:
    run = _Run(config)
    sources = load_sources(read_index(config.data, "train"), config.labels)
    return next(run.batches(TrainingCrops(sources, run.spec, replace(config, surroundings=True))))


def test_the_target_is_the_mean_of_the_teachers_answers(trained: Path, batch: Batch) -> None:
    network = read_network(trained)
    spec = _Run(TrainConfig("", "", "")).spec
    alone = TeacherEnsemble([trained], spec, batch.photo.device, surroundings=False).targets(batch.photo)
    with torch.inference_mode():
        predicted = network(batch.photo)
    torch.testing.assert_close(alone.sun, (predicted.sun / 0.9).softmax(dim=1))
    torch.testing.assert_close(alone.parameters[:, 2:5], _camera(predicted))
    assert alone.surroundings.shape == alone.light.shape == (len(batch.photo), 0)
    twice = TeacherEnsemble([trained, trained], spec, batch.photo.device, surroundings=False).targets(batch.photo)
    torch.testing.assert_close(twice.sun, alone.sun)


def _camera(predicted: NetworkOutput) -> torch.Tensor:
    return decode_parameters(
        torch.cat([predicted.raw[:, :2], mean_of_camera_bins(predicted.camera), predicted.raw[:, 5:]], dim=1)
    )[:, 2:5]


def test_of_blended_pictures_nothing_is_known_and_of_the_others_all(batch: Batch) -> None:
    torch.manual_seed(0)
    mixed = mixup(batch, blended_shares(len(batch.photo), 0.5, mirrored=False))
    same = (mixed.photo == batch.photo).flatten(1).all(dim=1)
    assert 0 < int(same.sum()) < len(same)
    for name in ("sun", "parameters", "sun_in_view", "surroundings", "light"):
        torch.testing.assert_close(getattr(mixed, name)[same], getattr(batch, name)[same], equal_nan=True)
    assert (mixed.sun[~same] == 0).all()
    assert (mixed.sun_in_view[~same] == 0).all()
    assert mixed.parameters[~same].isnan().all()
    assert mixed.light[~same].isnan().all()
    torch.testing.assert_close(mixup(batch, torch.zeros(len(batch.photo))).photo, batch.photo)


def test_of_a_mirror_image_the_camera_is_known_and_the_sun_is_not(batch: Batch) -> None:
    count = len(batch.photo)
    both = with_mirror_images(batch)
    for one, doubled in zip(batch, both, strict=True):
        torch.testing.assert_close(doubled[:count], one, equal_nan=True)
    torch.testing.assert_close(both.photo[count:], batch.photo.flip(3))
    signs = torch.tensor([1.0, 1, 1, -1, 1, 1])  # the roll alone turns round
    torch.testing.assert_close(both.parameters[count:], signs * batch.parameters, equal_nan=True)
    assert not both.sun[count:].any()
    assert not both.sun_in_view[count:].any()
    assert both.surroundings[count:].isnan().all()
    assert both.light[count:].isnan().all()
    torch.testing.assert_close(blended_shares(4, 0.4, mirrored=True), torch.tensor([0.4, 0.4, 0.8, 0.8]))


def test_a_network_that_answers_as_its_teacher_has_nothing_to_learn_from_it(trained: Path, batch: Batch) -> None:
    network = read_network(trained)
    taught = TeacherEnsemble([trained], _Run(TrainConfig("", "", "")).spec, batch.photo.device, surroundings=False)
    answers = taught.targets(batch.photo)
    predicted = network(batch.photo)
    cooled = predicted._replace(sun=predicted.sun / 0.9)
    loss = training_losses(cooled, answers)["sun"]
    entropy = -(answers.sun * answers.sun.log()).sum(dim=1).mean()
    assert loss.item() == pytest.approx(entropy.item(), rel=1e-3)
    (slope,) = torch.autograd.grad(loss, predicted.sun)
    assert slope.abs().max() < 1e-6


def test_a_run_is_taught_and_says_by_whom(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    taught_config = replace(
        config, out=str(tmp_path), teachers=(str(trained),), crops=8, batch=4, tune_share=0.0, mirrored=True
    )
    train_network(taught_config)
    logged = json.loads((tmp_path / "log.jsonl").read_text())
    assert logged["taught sun"] > 0
    assert [run["crops"] for run in training_history(read_record(tmp_path))] == [16, 8]
    train_network(replace(taught_config, workers=0))  # a finished run is taken up again with the same teachers
    with pytest.raises(DataError, match="another teachers"):
        train_network(replace(taught_config, teachers=()))


def test_who_has_not_learnt_it_cannot_teach_it(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    taught_config = replace(config, out=str(tmp_path), teachers=(str(trained),))
    with pytest.raises(LightingError, match="cannot teach --surroundings"):
        train_network(replace(taught_config, surroundings=True))
    for settings in ({"teachers": (str(tmp_path / "none"),)}, {"start": str(tmp_path / "none"), "teachers": ()}):
        with pytest.raises(LightingError, match="not the folder of a training run"):
            train_network(replace(taught_config, **settings))
