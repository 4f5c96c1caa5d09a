"""The state of a run: it learns, stops, resumes, starts from another."""

from dataclasses import replace
from pathlib import Path

import torch

from export.crops.sources import load_sources
from export.data.panoramas import read_index
from export.training.batches import TrainingCrops
from export.training.config import TrainConfig
from export.training.run import Run, learning_rate


def test_a_batch_can_be_learnt_by_heart(config: TrainConfig) -> None:
    run = Run(replace(config, learning_rate=2e-3, warmup=0.0, crops=1000))
    sources = load_sources(read_index(config.data, "train"), config.labels)
    batch = next(run.batches(TrainingCrops(sources, run.spec, run.config)))
    run.network.train()
    history = [run.update(batch) for _ in range(18)]
    for name in ("sun", "parameters"):
        assert float(history[-1][name]) < 0.8 * float(history[0][name])


def test_a_killed_run_goes_on_where_it_stopped(config: TrainConfig, tmp_path: Path) -> None:
    first = Run(replace(config, out=str(tmp_path)))
    sources = load_sources(read_index(config.data, "train"), config.labels)
    crops = TrainingCrops(sources, first.spec, replace(config, crops=12))
    first.train_mode()
    for batch in first.batches(crops):
        first.update(batch)
        if first.step == 2:
            first.save()
    second = Run(first.config)
    second.resume()
    assert second.step == 2
    second.train_mode()
    for batch in second.batches(crops, first=8):
        second.update(batch)
    assert second.step == first.step == 3
    torch.testing.assert_close(second.network.state_dict(), first.network.state_dict(), rtol=0, atol=1e-6)
    torch.testing.assert_close(second.average.state_dict(), first.average.state_dict(), rtol=0, atol=1e-6)


def test_a_run_starts_from_the_averaged_weights_of_another_and_sees_other_crops(
    config: TrainConfig, tmp_path: Path
) -> None:
    first = Run(replace(config, out=str(tmp_path)))
    sources = load_sources(read_index(config.data, "train"), config.labels)
    first.update(next(first.batches(TrainingCrops(sources, first.spec, config))))
    first.save()
    later = replace(config, out=str(tmp_path / "later"), start=str(tmp_path))
    second = Run(later)
    torch.testing.assert_close(second.network.state_dict(), first.average.module.state_dict())
    photos = [TrainingCrops(sources, first.spec, c)[0].photo for c in (config, later)]
    assert not torch.equal(*photos)


def test_the_learning_rate_rises_and_falls_to_zero() -> None:
    factors = [learning_rate(step, 100, 0.1) for step in range(100)]
    assert factors[9] == 1.0
    assert factors == sorted(factors[:10]) + sorted(factors[10:], reverse=True)
    assert factors[-1] < 1e-3


def test_what_a_killed_save_left_is_deleted(config: TrainConfig, tmp_path: Path) -> None:
    left, other = tmp_path / ".0123456789abcdef.pt", tmp_path / "other.pt"
    left.write_bytes(b"half")
    other.write_bytes(b"whole")
    Run(replace(config, out=str(tmp_path))).resume()
    assert [*tmp_path.iterdir()] == [other]
