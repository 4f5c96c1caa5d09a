"""Tests of the network of normals, its training and its ONNX file."""

from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import torch

from export.data.panoramas import DataError
from export.stereo.normals_network import NormalsNetwork
from export.stereo.renders import CaptureDay, utc_times
from export.stereo.samples import CROP, HELD_OUT_LATITUDES, batch_samples, believed_day, generate_samples, random_day
from export.stereo.train import EXPORT_TOLERANCE, Config, _parity, averaged_normals_network, train_normals
from lighting.checksum import DATA_FOLDER
from lighting.onnx_session import packaged_network
from lighting.stereo.normal_network import BY_IMAGE, SHARED


def test_a_fresh_network_repeats_the_search_and_mirrors_with_its_input() -> None:
    chosen = list(islice(generate_samples([], seed=3), 2))
    by_image, present, shared, _ = batch_samples(chosen)
    network = NormalsNetwork().eval()
    with torch.inference_mode():
        normal, error = network(by_image, shared, present)
    inside = shared[:, -1] > 0
    cosine = (normal * shared[:, :3]).sum(dim=1)[inside]
    assert float(cosine.median()) > 0.98
    assert (error > 0).all()
    mirrored = batch_samples(chosen, mirrored=True)
    np.testing.assert_allclose(mirrored[2][:, 0].flip(-1), -shared[:, 0])
    np.testing.assert_allclose(mirrored[3][:, 1].flip(-1), batch_samples(chosen)[3][:, 1])


def test_a_run_resumes(tmp_path: Path) -> None:
    file = train_normals(Config(out=str(tmp_path), minutes=0.005, batch=2, first=2))
    before = torch.load(file, weights_only=True)
    assert before["step"] > 0
    longer = before["seconds"] / 60 + 0.005
    after = torch.load(train_normals(Config(out=str(tmp_path), minutes=longer, batch=2, first=2)), weights_only=True)
    assert after["step"] > before["step"]
    assert after["seconds"] > before["seconds"]
    assert isinstance(averaged_normals_network(tmp_path), NormalsNetwork)


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
    for work in (
        lambda: train_normals(Config(out=str(tmp_path), minutes=0.001)),
        lambda: averaged_normals_network(tmp_path),
    ):
        with pytest.raises(DataError, match=r"is cut short or damaged|is not of the network of normals"):
            work()
    assert [path.name for path in tmp_path.iterdir()] == ["checkpoint.pt"]
    assert file.read_bytes() == before


def test_a_folder_without_meshes_to_learn_from_is_refused(tmp_path: Path) -> None:
    (tmp_path / "spot.obj").write_text("v 0 0 0\n")  # held out
    run = tmp_path / "run"
    with pytest.raises(DataError, match=r"holds no OBJ files to learn from\.$"):
        train_normals(Config(out=str(run), meshes=str(tmp_path), minutes=0.001))
    assert not run.exists()


def test_a_file_of_another_network_differs() -> None:
    assert _parity(NormalsNetwork().eval(), packaged_network(DATA_FOLDER, "normals")) > 10 * EXPORT_TOLERANCE


def test_what_is_served_has_every_image() -> None:
    torch.manual_seed(0)
    network = NormalsNetwork().eval()
    by_image, shared = torch.randn(1, 4, BY_IMAGE, 16, 16), torch.rand(1, SHARED, 16, 16)
    with torch.inference_mode():
        served, whole = network(by_image, shared), network(by_image, shared, torch.ones(1, 4))
    assert torch.equal(served[0], whole[0])
    assert torch.equal(served[1], whole[1])


def test_training_days_keep_off_the_latitudes_that_are_held_out() -> None:
    rng = np.random.default_rng(0)
    for day in (random_day(rng) for _ in range(60)):
        assert not any(low <= abs(day.latitude) <= high for low, high in HELD_OUT_LATITUDES)
        assert 3 <= len(day.times) <= 8
        assert np.degrees(np.arcsin(day.suns()[:, 1])).min() > 5
    day = CaptureDay(utc_times("2024-03-21", np.array([9.0, 12.0])), 47.0)
    assert day.times[1] - day.times[0] == np.timedelta64(3, "h")
    assert believed_day(day, rng).latitude == 47.0


def test_samples_are_the_same_for_the_same_seed() -> None:
    first, second = (next(generate_samples([], seed=5)) for _ in range(2))
    assert first.truth.shape == (3, CROP, CROP)
    np.testing.assert_array_equal(first.by_image, second.by_image)
    inside = first.shared[-1] > 0
    np.testing.assert_allclose(np.linalg.norm(first.truth[:, inside].astype(float), axis=0), 1, atol=2e-3)
