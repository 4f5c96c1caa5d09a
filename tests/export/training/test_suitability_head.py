"""The head that says whether a photo suits."""

import json
import shutil
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import torch

from export.data.panoramas import DataError
from export.networks.outdoor import Outdoor, build_network, network_specs
from export.networks.weights import CHECKPOINT, RUN_RECORD, read_network
from export.training.suitability_head import _FALSE_ALARMS, _RATES, _caught, _fit, _folds, _write, fit_suitability_head


def network_with_light() -> Outdoor:
    return Outdoor(network_specs("0")["outdoor"], 1024, has_surroundings=True)


def test_good_and_bad_features_are_told_apart_at_the_stated_rate() -> None:
    rng = torch.Generator().manual_seed(0)
    good, other = (torch.randn(n, 20, generator=rng) for n in (400, 2000))
    bad = torch.randn(300, 20, generator=rng) - 1.5
    head = _fit(good, bad, other)
    assert (head.logits(bad) < 0).float().mean() > 0.9
    assert (head.logits(other) < 0).float().mean() == pytest.approx(_FALSE_ALARMS, abs=0.002)


def test_pictures_are_judged_by_heads_that_saw_none_of_their_owner() -> None:
    """Two owners, whose pictures a head catches only if it knows them; the third's are as those that are made."""
    rng = torch.Generator().manual_seed(1)
    good, other, made = (torch.randn(n, 40, generator=rng) for n in (400, 400, 60))
    made[:, 0] -= 8
    owners = torch.randn(60, 40, generator=rng)
    for owner in range(3):
        owners[20 * owner : 20 * owner + 20, owner] -= 8
    fold = _folds([name for name in ("c", "a", "b") for _ in range(5)], 4, len(made))
    assert fold.tolist() == [*[0] * 20, *[1] * 20, *[2] * 20, *[-1] * 60]
    caught = _caught(good, other, torch.cat([owners, made]), fold)
    assert list(caught) == [*_RATES]
    rare, more = (values.reshape(6, 20).mean(axis=1) for values in caught.values())
    assert rare[0] > 0.9
    assert rare[3:].min() > 0.9
    assert max(rare[1], rare[2]) < 0.3
    assert (more >= rare).all()


def test_the_head_is_written_where_networks_are_read(trained: Path, tmp_path: Path) -> None:
    runs = [tmp_path / name for name in ("a", "b")]
    for run in runs:
        shutil.copytree(trained, run)
        state = torch.load(run / CHECKPOINT, weights_only=True)
        around = {n: v for n, v in network_with_light().state_dict().items() if n.startswith(("around.", "light."))}
        state["average"] |= {f"module.{name}": value for name, value in around.items()}
        torch.save(state, run / CHECKPOINT)
    pooled = torch.rand(3, 2560)
    for together in (runs[:1], runs):
        count = 1280 * len(together)
        head = _fit(torch.randn(50, count) + 1, torch.randn(50, count), torch.randn(50, count) + 1)
        _write(together, head)
        logits = []
        for run, part in zip(together, pooled.chunk(2, dim=1), strict=False):
            network = read_network(run)
            assert isinstance(network, Outdoor)
            assert network.suitable is not None
            with torch.inference_mode():
                logits.append(network.suitable(part)[:, 0])
        expected = head.logits(pooled[:, :count])
        np.testing.assert_allclose(torch.stack(logits).mean(dim=0), expected, rtol=1e-4, atol=1e-4)


def test_networks_without_light_are_refused_and_left_alone(trained: Path, data: Path) -> None:
    before = (trained / CHECKPOINT).read_bytes()
    with pytest.raises(DataError, match="cannot say whether a photo suits: it has not learnt --surroundings"):
        fit_suitability_head([trained], data, data / "labels.csv")
    assert (trained / CHECKPOINT).read_bytes() == before


def test_the_baseline_has_no_head_for_it(tmp_path: Path, data: Path) -> None:
    spec = network_specs("0")["cvpr2017"]
    (tmp_path / RUN_RECORD).write_text(json.dumps({"spec": asdict(spec)}))
    torch.save(
        {"average": {f"module.{n}": v for n, v in build_network(spec).state_dict().items()}}, tmp_path / CHECKPOINT
    )
    with pytest.raises(DataError, match="cannot say whether a photo suits"):
        fit_suitability_head([tmp_path], data, data / "labels.csv")
