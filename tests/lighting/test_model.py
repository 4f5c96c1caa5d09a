"""The network: its input, what its session accepts, what it refuses, what it says."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from lighting import model as model_module
from lighting.errors import ModelError
from lighting.model import PARAMETERS, Model, fit_size, network_sha256, packaged_model, pad_to_input, preprocess
from lighting.onnx_session import create_session, describe_onnx_error, packaged_network, weights_path
from lighting.photo.reader import Photo, read_photo
from tests.conftest import LIT, TINY, encode, scene, write_network


@pytest.fixture(scope="module")
def model(network: Path) -> Model:
    return Model.load(network)


def batch(count: int, seed: int = 0) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    return np.random.default_rng(seed).normal(0, 1, (count, 3, 32, 48)).astype(np.float32)


def refusal(path: Path) -> str:
    with pytest.raises(ModelError) as caught:
        Model.load(path)
    text = str(caught.value)
    assert text.endswith(".")
    assert "\n" not in text
    return text


def test_the_spec_comes_from_the_file(model: Model) -> None:
    assert model.spec == TINY


def test_a_prediction_holds_a_distribution_and_the_parameters_by_name(model: Model) -> None:
    (prediction,) = model.predict(np.zeros((1, 3, 32, 48), dtype=np.float32))
    assert prediction.spec == TINY
    assert prediction.sun_probability == pytest.approx(np.full(24, 1 / 24))
    expected = dict(zip(PARAMETERS, [3.0, 0.1, 4.0, -1.0, 50.0, 0.8], strict=True))
    assert {name: getattr(prediction, name) for name in PARAMETERS} == pytest.approx(expected)
    assert all(type(getattr(prediction, name)) is float for name in PARAMETERS)


def test_a_batch_gives_what_its_photos_give_alone(model: Model) -> None:
    photos = batch(3)
    together = model.predict(photos)
    alone = [model.predict(photo[None])[0] for photo in photos]
    for a, b in zip(together, alone, strict=True):
        assert a.sun_probability == pytest.approx(b.sun_probability, abs=1e-6)
        assert a.turbidity == pytest.approx(b.turbidity, abs=1e-5)
    assert np.ptp([p.turbidity for p in together]) > 0


def test_no_photos_give_no_predictions(model: Model) -> None:
    assert model.predict(batch(0)) == []


@pytest.mark.parametrize("shape", [(3, 32, 48), (1, 1, 32, 48), (1, 3, 48, 32), (1, 3, 32, 48, 1)])
def test_a_batch_of_another_shape_is_a_value_error(model: Model, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="takes a batch of shape"):
        model.predict(np.zeros(shape, dtype=np.float32))


def test_a_batch_of_another_type_is_a_sentence(model: Model) -> None:
    with pytest.raises(ModelError, match=r"^The network failed: .*\.$"):
        model.predict(np.zeros((1, 3, 32, 48), dtype=np.float64))


def test_an_answer_that_is_not_finite_is_refused(model: Model) -> None:
    with pytest.raises(ModelError, match=r"^The network's answer is not finite\.$"):
        model.predict(np.full((1, 3, 32, 48), np.nan, dtype=np.float32))


@pytest.mark.parametrize(("threads", "expected"), [(0, len(os.sched_getaffinity(0))), (1, 1), (3, 3)])
def test_threads_are_set_explicitly(network: Path, threads: int, expected: int) -> None:
    session: Any = Model.load(network, threads).session
    options = session.get_session_options()
    assert options.intra_op_num_threads == expected
    assert options.inter_op_num_threads == 1


def test_loading_prints_nothing(network: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Model.load(network).predict(batch(1))
    (tmp_path / "bad.onnx").write_bytes(b"\x08\x0a")
    refusal(tmp_path / "bad.onnx")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.98])
def test_a_damaged_file_is_refused(network: Path, tmp_path: Path, share: float) -> None:
    data = network.read_bytes()
    damaged = tmp_path / "damaged.onnx"
    damaged.write_bytes(data[: int(len(data) * share)])
    refusal(damaged)


def test_what_is_no_network_is_refused(photo_path: Path, tmp_path: Path) -> None:
    assert refusal(photo_path) == f"{photo_path} is not an ONNX network that can be read: Protobuf parsing failed."
    assert refusal(tmp_path) == f"There is no network at {tmp_path}."
    assert refusal(tmp_path / "absent.onnx") == f"There is no network at {tmp_path / 'absent.onnx'}."


def test_a_network_without_our_metadata_is_refused(tmp_path: Path) -> None:
    assert "its metadata has no 'spec'" in refusal(write_network(tmp_path / "n.onnx", metadata={"author": "x"}))


@pytest.mark.parametrize(
    "spec", ["", "{}", "[1]", json.dumps({**json.loads(TINY.to_json()), "sun_grid": "cube:6"})], ids=lambda s: s[:8]
)
def test_metadata_of_another_layout_is_refused(tmp_path: Path, spec: str) -> None:
    refusal(write_network(tmp_path / "n.onnx", metadata={"spec": spec}))


def test_outputs_that_do_not_match_the_grid_are_refused(tmp_path: Path) -> None:
    assert "'sun_probability': [10]" in refusal(write_network(tmp_path / "n.onnx", cells=10))


def test_an_input_that_does_not_match_the_spec_is_refused(tmp_path: Path) -> None:
    wider = json.dumps({**json.loads(TINY.to_json()), "width": 64})
    assert "another layout" in refusal(write_network(tmp_path / "n.onnx", metadata={"spec": wider}))


def test_exactly_one_network_is_packaged(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, network: Path) -> None:
    monkeypatch.setattr(model_module, "DATA_FOLDER", tmp_path / "data")
    with pytest.raises(ModelError, match="it holds 0"):
        packaged_model()
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "outdoor-1.onnx").write_bytes(network.read_bytes())
    assert Model.load().spec == TINY
    (tmp_path / "data" / "outdoor-2.onnx").write_bytes(b"")
    with pytest.raises(ModelError, match="it holds 2"):
        Model.load()


@pytest.mark.slow
def test_loading_reports_to_nobody(network: Path, tmp_path: Path) -> None:
    """onnxruntime's own wheels keep a device identifier and a queue of events below the home folder."""
    code = "import sys; from lighting.model import Model; Model.load(sys.argv[1])"
    kept = {name: value for name, value in os.environ.items() if name not in ("ORT_DISABLE_TELEMETRY", "CI")}
    home = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    subprocess.run([sys.executable, "-c", code, str(network)], env=kept | home, check=True, timeout=60)
    assert not list(tmp_path.rglob("*"))


def test_weights_beside_the_graph_count_to_the_network(tmp_path: Path) -> None:
    """A network whose weights are elsewhere is refused; other weights make another network."""
    copy, weights = tmp_path / packaged_model().name, weights_path(packaged_model())
    copy.write_bytes(packaged_model().read_bytes())
    assert "is not an ONNX network that can be read" in refusal(copy)
    weights_path(copy).write_bytes(weights.read_bytes())
    assert network_sha256(copy) == network_sha256(packaged_model())
    weights_path(copy).write_bytes(weights.read_bytes()[:-1] + b"x")
    assert network_sha256(copy) != network_sha256(packaged_model())
    assert sum(file.stat().st_size for file in (packaged_model(), weights)) <= 32e6


def test_a_network_may_say_how_strong_the_light_is(lit_network: Path) -> None:
    first, second = Model.load(lit_network).predict(batch(2))
    assert first.light is not None
    assert second.light is not None
    assert first.light.sun_irradiance == pytest.approx([1.9, 1.5, 0.9])
    assert second.light.sky_irradiance == pytest.approx([0.4, 0.5, 0.8])
    assert (first.light.cover, first.light.suitable) == pytest.approx((0.2, 0.97))
    assert first.light.surroundings == pytest.approx(LIT["around"])


def test_the_strength_of_the_light_stays_in_range(tmp_path: Path) -> None:
    wild = {"light": np.array([-1.0, 0.5, 2.0, 1.0, 1.0, 1.0, 1.5, -0.5])}
    (prediction,) = Model.load(write_network(tmp_path / "n.onnx", more=wild)).predict(batch(1))
    assert prediction.light is not None
    assert prediction.light.sun_irradiance.tolist() == [0.0, 0.5, 2.0]
    assert (prediction.light.cover, prediction.light.suitable, prediction.light.surroundings) == (1.0, 0.0, None)


def test_a_network_without_it_says_nothing_of_it(model: Model) -> None:
    assert model.predict(batch(1))[0].light is None


@pytest.mark.parametrize(
    "more",
    [{"light": np.ones(7)}, {"light": np.ones(8), "around": np.ones((6, 24, 3))}, {"around": LIT["around"]}],
    ids=["light", "around", "around alone"],
)
def test_further_outputs_of_another_shape_are_refused(more: dict[str, NDArray[np.float64]], tmp_path: Path) -> None:
    assert "another layout" in refusal(write_network(tmp_path / "n.onnx", more=more))


def test_a_file_of_a_session_that_is_missing_or_no_network_is_named(tmp_path: Path) -> None:
    file = tmp_path / "x.onnx"
    with pytest.raises(ModelError, match=r"There is no network at .*x\.onnx"):
        create_session(file, 1)
    file.write_bytes(b"no network")
    with pytest.raises(ModelError, match=r"x\.onnx is not an ONNX network"):
        create_session(file, 1)


def test_a_package_holds_one_network_of_a_name(tmp_path: Path) -> None:
    for count in (1, 2):
        (tmp_path / f"a-{count}.onnx").touch()
        (tmp_path / f"b-{count}.onnx").touch()
        if count == 1:
            assert packaged_network(tmp_path, "a").name == "a-1.onnx"
    with pytest.raises(ModelError, match="it holds 2"):
        packaged_network(tmp_path, "a")
    with pytest.raises(ModelError, match="it holds 0"):
        packaged_network(tmp_path, "c")


@pytest.mark.parametrize(
    ("message", "reason"),
    [("[E:1] Load model from x failed:Protobuf parsing failed.\nmore", "Protobuf parsing failed."), ("", "OSError.")],
)
def test_the_reason_is_the_last_clause(message: str, reason: str) -> None:
    assert describe_onnx_error(OSError(message)) == reason


@given(st.integers(1, 20_000), st.integers(1, 20_000))
def test_the_photo_fills_one_side_of_the_canvas(width: int, height: int) -> None:
    w, h = fit_size(width, height, TINY)
    assert 1 <= w <= TINY.width
    assert 1 <= h <= TINY.height
    assert w == TINY.width or h == TINY.height
    assert abs(w - width * h / height) <= 0.5 * width / height + 0.5 or min(w, h) == 1


@pytest.mark.parametrize(
    ("size", "fitted"), [((96, 64), (48, 32)), ((64, 96), (21, 32)), ((480, 10), (48, 1)), ((3, 2), (48, 32))]
)
def test_fit_size_of_known_shapes(size: tuple[int, int], fitted: tuple[int, int]) -> None:
    assert fit_size(*size, TINY) == fitted


@pytest.mark.parametrize(("width", "height", "left", "top"), [(48, 10, 0, 11), (21, 32, 13, 0), (48, 32, 0, 0)])
def test_place_centres_the_normalised_photo_on_the_mean(width: int, height: int, left: int, top: int) -> None:
    pixels = scene(width, height)
    canvas = pad_to_input(pixels, TINY)
    assert canvas.shape == (3, 32, 48)
    assert canvas.dtype == np.float32
    expected = (pixels / 255.0 - TINY.mean) / TINY.std
    inside = canvas[:, top : top + height, left : left + width].transpose(1, 2, 0)
    assert inside == pytest.approx(expected, abs=1e-5)
    assert np.count_nonzero(canvas) <= 3 * width * height


def test_place_refuses_what_does_not_fit() -> None:
    with pytest.raises(ValueError, match="49 x 10 pixels do not fit the canvas of 48 x 32"):
        pad_to_input(scene(49, 10), TINY)


def test_to_tensor_is_place_of_the_resized_photo() -> None:
    tensor = preprocess(read_photo(encode(scene(480, 320), "PNG")), TINY)
    assert tensor.shape == (1, 3, 32, 48)
    assert np.abs(tensor[0] - pad_to_input(scene(48, 32), TINY)).max() < 0.1


def test_to_tensor_does_not_alias() -> None:
    """A one-pixel chequerboard is gray from afar."""
    board = (np.indices((640, 960)).sum(axis=0) % 2 * 255).astype(np.uint8)
    photo = Photo(np.repeat(board[..., None], 3, axis=-1), 960, 640, "PNG")
    grey = (0.5 - np.array(TINY.mean)) / TINY.std
    assert preprocess(photo, TINY)[0].transpose(1, 2, 0) == pytest.approx(np.broadcast_to(grey, (32, 48, 3)), abs=0.05)


@pytest.mark.parametrize("rotate", [False, True])
def test_the_scale_of_decoding_hardly_changes_the_tensor(rotate: bool) -> None:
    pixels = scene(1500, 2000) if rotate else scene(2000, 1500)
    data = encode(pixels, quality=95)
    whole, reduced = (preprocess(read_photo(data, target=target), TINY) for target in (None, 200))
    assert np.abs(whole - reduced).max() < 0.1
