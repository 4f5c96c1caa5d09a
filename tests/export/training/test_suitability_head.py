"""The head that says whether a photo suits."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from export.data.panoramas import DataError, Panorama
from export.networks.onnx_export import write_onnx
from export.networks.outdoor import Outdoor, network_specs
from export.networks.weights import CHECKPOINT
from export.training.suitability_head import SuitabilityFile, _caught, _fit, _folds, _one_a_place, _weigh_kinds
from lighting.model import Model, packaged_model, pad_to_input


def network_with_light() -> Outdoor:
    return Outdoor(network_specs("0")["outdoor"], has_surroundings=True)


def test_good_and_bad_features_are_told_apart_at_the_stated_rate() -> None:
    rng = torch.Generator().manual_seed(0)
    good, other = (torch.randn(n, 20, generator=rng) for n in (400, 2000))
    bad = torch.randn(300, 20, generator=rng) - 1.5
    head = _fit(good, bad, torch.ones(300), other)
    assert (head.logits(bad) < 0).float().mean() > 0.9
    assert (head.logits(other) < 0).float().mean() == pytest.approx(0.005, abs=0.002)


def test_pictures_are_judged_by_heads_that_saw_none_of_their_owner() -> None:
    """Two owners, whose pictures a head catches only if it knows them; the third's are as those that are made."""
    rng = torch.Generator().manual_seed(1)
    good, other, made = (torch.randn(n, 40, generator=rng) for n in (400, 400, 60))
    made[:, 0] -= 8
    owners = torch.randn(60, 40, generator=rng)
    for owner in range(3):
        owners[20 * owner : 20 * owner + 20, owner] -= 8
    fold = _folds([name for name in ("c", "a", "b") for _ in range(20)], 60 + len(made))
    assert fold.tolist() == [*[0] * 20, *[1] * 20, *[2] * 20, *[-1] * 60]
    caught = _caught(good, other, torch.cat([owners, made]), torch.ones(120), fold)
    assert list(caught) == [0.005, 0.01]
    rare, more = (values.reshape(6, 20).mean(axis=1) for values in caught.values())
    assert rare[0] > 0.9
    assert rare[3:].min() > 0.9
    assert max(rare[1], rare[2]) < 0.3
    assert (more >= rare).all()


def pictures() -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    return [rng.integers(0, 256, shape, dtype=np.uint8) for shape in ((168, 224, 3), (224, 126, 3))]


def test_the_head_is_written_and_all_else_stays_to_the_bit(tmp_path: Path) -> None:
    network = SuitabilityFile(packaged_model())
    features = network.features(pictures())
    weight = 0.1 * torch.randn(features.shape[1], generator=torch.Generator().manual_seed(0))
    network.write(tmp_path / "new.onnx", weight, 0.5, "9.9.9")
    old, new = (Model.load(path, threads=1) for path in (packaged_model(), tmp_path / "new.onnx"))
    assert new.spec == replace(old.spec, version="9.9.9")
    expected = (features @ weight + 0.5).sigmoid()
    for picture, suitable in zip(pictures(), expected.tolist(), strict=True):
        photo = pad_to_input(picture, old.spec)[None]
        before, after = (model.session.run(list(model.outputs), {"photo": photo}) for model in (old, new))
        light = list(old.outputs).index("light")
        assert after[light][0, -1] == pytest.approx(suitable, abs=1e-5)
        before[light][:, -1] = after[light][:, -1]
        for one, other in zip(before, after, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_networks_that_answer_together_share_the_head(trained: Path, tmp_path: Path) -> None:
    runs = [tmp_path / name for name in ("a", "b")]
    for run in runs:
        shutil.copytree(trained, run)
        state = torch.load(run / CHECKPOINT, weights_only=True)
        more = {
            n: v for n, v in network_with_light().state_dict().items() if n.startswith(("around.", "light.", "suit"))
        }
        state["average"] |= {f"module.{name}": value for name, value in more.items()}
        torch.save(state, run / CHECKPOINT)
    write_onnx(runs, tmp_path / "both.onnx")
    network = SuitabilityFile(tmp_path / "both.onnx")
    features = network.features(pictures())
    assert features.shape == (2, 2560)
    weight = torch.linspace(-0.1, 0.1, 2560)
    network.write(tmp_path / "both.onnx", weight, -0.2)
    model = Model.load(tmp_path / "both.onnx", threads=1)
    for picture, logit in zip(pictures(), (features @ weight - 0.2).tolist(), strict=True):
        (answer,) = model.predict(pad_to_input(picture, model.spec)[None])
        assert answer.light is not None
        assert answer.light.suitable == pytest.approx(1 / (1 + np.exp(-logit)), abs=1e-4)


def test_networks_without_light_are_refused(trained_network: Path) -> None:
    with pytest.raises(
        DataError, match="cannot say whether a photo suits: its networks have not learnt --surroundings"
    ):
        SuitabilityFile(trained_network)


def test_a_place_has_one_panorama() -> None:
    rows = [Panorama(name, Path(name), "ldr", place, "train") for name, place in (("a", "x"), ("b", "x"), ("c", "y"))]
    assert [panorama.name for panorama in _one_a_place(rows)] == ["a", "c"]


def test_a_kind_counts_by_the_root_of_its_pictures() -> None:
    share = _weigh_kinds(np.array(["night", "indoor", "night", "night", "night"]))
    assert share.tolist() == pytest.approx([0.5, 1.0, 0.5, 0.5, 0.5])
