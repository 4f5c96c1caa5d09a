"""Tests of onnx export."""

import json
import shutil
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from numpy.typing import NDArray
from onnx import GraphProto, ModelProto, TensorProto, checker, helper, numpy_helper

from export.crops.targets import COLUMNS, MIN_RADIANCE, ROWS
from export.networks import outdoor_transformer
from export.networks.ensemble import NetworkEnsemble
from export.networks.onnx_export import ROUNDED_TOLERANCE, write_onnx
from export.networks.onnx_graph import (
    MIN_BYTES,
    fuse_nodes,
    merge_equal_nodes,
    multiply_pointwise,
    quantize_products,
    save_graph,
    store_small,
)
from export.networks.outdoor import Outdoor, network_specs, reduce_light_heads
from export.networks.vision_transformer import WHEEL
from export.networks.weights import read_network, read_record, read_spec, write_run
from lighting.errors import LightingError
from lighting.model import Model
from lighting.onnx_session import create_session, weights_path
from lighting.sun_grid import grid_directions

RNG = np.random.default_rng(5)
LONG, WIDE = 800, 251  # of weights that are stored as bytes, whatever takes them
FIRST, SECOND, THIRD = (RNG.normal(size=(100, 100)).astype(np.float32) for _ in range(3))


def model(*branches: tuple[NDArray[np.float32], ...]) -> ModelProto:
    """The sum of branches, each a chain of matrix products of the input (B, N)."""
    nodes, tensors = [], []
    for b, weights in enumerate(branches):
        x = "x"
        for i, w in enumerate(weights):
            tensors.append(numpy_helper.from_array(w, f"w{b}.{i}"))
            nodes.append(helper.make_node("MatMul", [x, f"w{b}.{i}"], [f"y{b}.{i}"]))
            nodes.append(helper.make_node("LeakyRelu", [f"y{b}.{i}"], [f"z{b}.{i}"], alpha=0.1 + 0.1 * b * (i > 0)))
            x = f"z{b}.{i}"
    nodes.append(helper.make_node("Sum", [f"z{b}.{len(w) - 1}" for b, w in enumerate(branches)], ["out"]))
    return _model(nodes, tensors, ["B", "N"])


def _model(nodes: list[Any], tensors: list[TensorProto], shape: list[Any], out: list[Any] | None = None) -> ModelProto:
    ends = [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in (("x", shape), ("out", out or shape))]
    graph: GraphProto = helper.make_graph(nodes, "g", ends[:1], ends[1:], tensors)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)


def answer(network: ModelProto, x: NDArray[np.float32]) -> NDArray[np.float32]:
    checker.check_model(network, full_check=True)
    options = onnxruntime.SessionOptions()
    options.add_session_config_entry("session.disable_quant_qdq", "1")  # as lighting.onnx has it
    session = onnxruntime.InferenceSession(network.SerializeToString(), options, providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, {"x": x})[0])


def test_products_of_whole_numbers_are_near_and_the_same_for_each_row_count() -> None:
    wide = RNG.normal(size=(400, 300)).astype(np.float32)
    network = model((wide,))
    x = RNG.normal(size=(5, 400)).astype(np.float32)
    before = answer(network, x)
    quantize_products(network)
    after = answer(network, x)
    assert TensorProto.INT8 in kinds(network)
    assert np.abs(after - before).max() < 0.02 * np.abs(before).max()
    np.testing.assert_array_equal(answer(network, x[::-1]), after[::-1])


def kinds(network: ModelProto) -> set[int]:
    return {t.data_type for t in network.graph.initializer}


def test_what_begins_alike_begins_once_and_answers_the_same() -> None:
    network = model((FIRST, SECOND), (FIRST, THIRD), (FIRST, SECOND))
    x = RNG.normal(size=(3, 100)).astype(np.float32)
    before = answer(network, x)
    merge_equal_nodes(network)
    np.testing.assert_array_equal(answer(network, x), before)
    assert len(network.graph.initializer) == 3
    assert [n.op_type for n in network.graph.node].count("MatMul") == 3
    assert [n.op_type for n in network.graph.node].count("LeakyRelu") == 4  # the third branch has another slope


def test_the_models_own_outputs_keep_their_names() -> None:
    nodes = [helper.make_node("Abs", ["x"], [name]) for name in ("y", "out")]
    network = _model(nodes, [], ["B", 100])
    merge_equal_nodes(network)
    assert answer(network, np.full((1, 100), -2.0, np.float32)).max() == 2.0


def test_weights_are_stored_in_bytes_with_a_scale_for_each_output() -> None:
    """Outputs of very different size keep their precision: a scale for all of them would round the small ones to 0."""
    uneven = RNG.normal(size=(LONG, WIDE)) * np.geomspace(1e-4, 1e3, WIDE)
    network = model((uneven.astype(np.float32),))
    x = RNG.normal(size=(200, LONG)).astype(np.float32)
    before, size = answer(network, x), network.ByteSize()
    store_small(network)
    error = np.abs(answer(network, x) - before).max(axis=0) / np.abs(before).max(axis=0)
    assert error.max() < 0.02
    assert kinds(network) == {TensorProto.INT8, TensorProto.FLOAT}
    assert network.ByteSize() < 0.35 * size


def test_smaller_filters_are_stored_as_halves_and_small_tensors_as_they_are() -> None:
    depthwise = numpy_helper.from_array(RNG.normal(size=(LONG, 1, 5, 5)).astype(np.float32), "w")
    pointwise = numpy_helper.from_array(RNG.normal(size=(WIDE, LONG, 1, 1)).astype(np.float32), "v")
    bias = numpy_helper.from_array(RNG.normal(size=WIDE).astype(np.float32), "b")
    nodes = [
        helper.make_node("Conv", ["x", "w"], ["y"], group=LONG, kernel_shape=[5, 5], pads=[2, 2, 2, 2]),
        helper.make_node("Conv", ["y", "v", "b"], ["out"], kernel_shape=[1, 1]),
    ]
    network = _model(nodes, [depthwise, pointwise, bias], ["B", "C", 5, 5])
    x = RNG.normal(size=(2, LONG, 5, 5)).astype(np.float32)
    before = answer(network, x)
    store_small(network)
    stored = {t.name: t.data_type for t in network.graph.initializer}
    assert stored["w.half"] == TensorProto.FLOAT16
    assert stored["v.bytes"] == TensorProto.INT8
    assert stored["b"] == TensorProto.FLOAT
    np.testing.assert_allclose(answer(network, x), before, atol=0.02 * np.abs(before).max())


def test_large_pointwise_convolutions_become_products_and_answer_alike_in_every_session(tmp_path: Path) -> None:
    """A block of the network: the depthwise convolution stays one, as does a pointwise one that skips pixels."""
    shapes = {"expand": (WIDE, LONG, 1, 1), "depthwise": (WIDE, 1, 3, 3), "project": (LONG, WIDE, 1, 1)}
    values = {"low": np.array(0.0), "high": np.array(6.0)} | {name: RNG.normal(size=s) for name, s in shapes.items()}
    values |= {"bias": 50 * RNG.normal(size=WIDE), "last": RNG.normal(size=(100, LONG, 1, 1))}
    nodes = [
        helper.make_node("Conv", ["x", "expand", "bias"], ["a"], kernel_shape=[1, 1]),
        helper.make_node("Clip", ["a", "low", "high"], ["b"]),
        helper.make_node("Conv", ["b", "depthwise"], ["c"], group=WIDE, kernel_shape=[3, 3], pads=[1, 1, 1, 1]),
        helper.make_node("Conv", ["c", "project"], ["d"], kernel_shape=[1, 1]),
        helper.make_node("Conv", ["d", "last"], ["out"], kernel_shape=[1, 1], strides=[2, 2]),
    ]
    tensors = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in values.items()]
    network = _model(nodes, tensors, ["B", LONG, 7, 7], ["B", 100, 4, 4])
    x = RNG.normal(size=(2, LONG, 7, 7)).astype(np.float32)
    before = answer(network, x)
    multiply_pointwise(network)
    kinds_left = [node.op_type for node in network.graph.node if node.op_type in ("Conv", "MatMul", "Add", "Clip")]
    assert kinds_left == ["MatMul", "Add", "Clip", "Conv", "MatMul", "Conv"]
    sides = {t.name: list(t.dims) for t in network.graph.initializer}
    assert [sides[name] for name in shapes] == [[LONG, WIDE], [WIDE, 1, 3, 3], [WIDE, LONG]]
    np.testing.assert_allclose(answer(network, x), before, rtol=1e-4, atol=1e-4 * np.abs(before).max())
    assert quantize_products(network)
    assert np.linalg.norm(answer(network, x) - before) < 0.04 * np.linalg.norm(before)
    store_small(network)
    file = tmp_path / "n.onnx"
    save_graph(network, file)
    sessions = [create_session(file, threads, for_one_run=one) for threads, one in ((1, False), (1, True), (3, True))]
    answers = [session.run(None, {"x": x})[0] for session in sessions]
    np.testing.assert_array_equal(answers[1], answers[0])
    np.testing.assert_array_equal(answers[2], answers[0])


def test_fused_nodes_give_the_same_bits_by_the_same_weights(tmp_path: Path) -> None:
    values = {"low": np.array(0.0), "high": np.array(6.0), "weights": RNG.normal(size=(64, 64, 3, 3))}
    nodes = [
        helper.make_node("Conv", ["x", "weights"], ["a"], kernel_shape=[3, 3], pads=[1, 1, 1, 1]),
        helper.make_node("Clip", ["a", "low", "high"], ["out"]),
    ]
    tensors = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in values.items()]
    network = _model(nodes, tensors, ["B", 64, 7, 7])
    store_small(network)
    file, x = tmp_path / "n.onnx", RNG.normal(size=(2, 64, 7, 7)).astype(np.float32)
    save_graph(network, file)
    before, weights = (create_session(file, 1).run(None, {"x": x})[0], weights_path(file).read_bytes())
    fuse_nodes(file)
    assert [node.op_type for node in onnx.load(file).graph.node] == ["Cast", "FusedConv"]
    assert weights_path(file).read_bytes() == weights
    for one in (False, True):
        np.testing.assert_array_equal(create_session(file, 1, for_one_run=one).run(None, {"x": x})[0], before)


def test_an_exported_network_gives_the_same_bits_in_every_session(trained_network: Path) -> None:
    loaded = [Model.load(trained_network, threads, for_one_photo=one) for threads, one in ((1, False), (3, True))]
    photo = RNG.normal(size=(1, 3, loaded[0].spec.height, loaded[0].spec.width)).astype(np.float32)
    answers = [model.session.run(list(model.outputs), {"photo": photo}) for model in loaded]
    for one, other in zip(*answers, strict=True):
        np.testing.assert_array_equal(one, other)


def test_an_output_without_weights_stays_zero() -> None:
    network = model((np.zeros((LONG, WIDE), np.float32),))
    store_small(network)
    assert not answer(network, np.ones((1, LONG), np.float32)).any()


def test_weights_lie_beside_the_graph_and_answer_the_same(tmp_path: Path) -> None:
    """Writing twice leaves what writing once does, and the model keeps its weights."""
    network = model((FIRST, SECOND))
    store_small(network)
    x = RNG.normal(size=(3, 100)).astype(np.float32)
    before, file = answer(network, x), tmp_path / "n.onnx"
    for _ in range(2):
        save_graph(network, file)
        assert weights_path(file).stat().st_size < 2 * (FIRST.size + SECOND.size) + 8192
    np.testing.assert_array_equal(answer(network, x), before)
    session = create_session(file, 1)
    np.testing.assert_array_equal(session.run(None, {"x": x})[0], before)


SPECS = network_specs("0")
GRID = SPECS["outdoor"].sun_grid


def test_onnx_and_torch_agree(trained: Path, trained_network: Path) -> None:
    model = Model.load(trained_network)
    metadata = model.session.get_modelmeta().custom_metadata_map
    photos = np.random.default_rng(0).normal(size=(2, 3, 224, 224)).astype(np.float32)
    ensemble = NetworkEnsemble([read_network(trained)], read_spec(trained).sun_grid, 1.3).eval()
    with torch.inference_mode():
        expected = ensemble(torch.from_numpy(photos))[0].numpy()
    found = np.array([answer.sun_probability for answer in model.predict(photos)])
    assert np.abs(found - expected).max() < ROUNDED_TOLERANCE * expected.max()
    assert float(metadata["parity"]) < ROUNDED_TOLERANCE
    assert metadata["license"] == "Apache-2.0"
    graph = onnx.load(trained_network).graph
    assert {TensorProto.INT8, TensorProto.FLOAT16} <= {tensor.data_type for tensor in graph.initializer}
    assert "16 crops" in model.spec.training_data
    (settings,) = json.loads(metadata["training"])
    assert [(run["crops"], run["learning_rate"], run["commit"]) for run in settings] == [(16, 8e-4, metadata["commit"])]
    assert str(trained) not in metadata["training"]
    for count in (1, 3):
        answers = model.predict(np.zeros((count, 3, model.spec.height, model.spec.width), np.float32))
        assert [a.sun_probability.sum() for a in answers] == pytest.approx([1.0] * count, rel=1e-5)


def test_two_runs_answer_together_in_one_file(trained: Path, tmp_path: Path) -> None:
    """The same run twice says what it says alone, and nothing is computed or stored twice."""
    run, alone, together = (tmp_path / name for name in ("run", "one.onnx", "two.onnx"))
    torch.manual_seed(6)
    spec = replace(SPECS["outdoor"], width=96, height=64)  # a small graph of few weights
    write_run(run, {**read_record(trained), "spec": asdict(spec)}, Outdoor(spec).state_dict())
    write_onnx([run], alone, temperature=1.3)
    write_onnx([run, run], together, temperature=1.3, version="2.0.0")
    one, two = Model.load(alone), Model.load(together)
    photo = np.random.default_rng(0).normal(size=(2, 3, spec.height, spec.width)).astype(np.float32)
    for a, b in zip(one.predict(photo), two.predict(photo), strict=True):
        np.testing.assert_allclose(a.sun_probability, b.sun_probability, rtol=1e-3)
    assert two.spec.version == "2.0.0"
    assert weights_path(together).stat().st_size < 1.05 * weights_path(alone).stat().st_size
    files = [onnx.load(path).graph for path in (alone, together)]
    assert len(files[1].initializer) == len(files[0].initializer)
    assert [tensor.data_type for tensor in files[1].initializer].count(TensorProto.INT8) > 1
    assert not any(node.metadata_props for node in files[1].node)
    assert any(node.op_type == "DequantizeLinear" for node in files[1].node)
    assert sorted(path.name for path in tmp_path.glob("two*")) == ["two.onnx", "two.onnx.data"]
    assert together.stat().st_size < weights_path(together).stat().st_size / 5


def test_runs_of_different_networks_do_not_answer_together(trained: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(trained, other)
    record = json.loads((other / "config.json").read_text())
    record["spec"]["mean"] = [0.1, 0.2, 0.3]
    (other / "config.json").write_text(json.dumps(record))
    with pytest.raises(LightingError, match="expect different photos"):
        write_onnx([trained, other], tmp_path / "x.onnx", temperature=1.0)
    assert not (tmp_path / "x.onnx").exists()


def test_a_wrong_export_is_refused(
    trained: Path, trained_network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file on disk is traced at another temperature than the network that it is compared with."""
    model = onnx.load(trained_network)
    model.ClearField("metadata_props")
    monkeypatch.setattr("export.networks.onnx_export.trace_onnx", lambda *_: model)
    with pytest.raises(LightingError, match="differ"):
        write_onnx([trained], tmp_path / "x.onnx", temperature=3.0)
    assert list(tmp_path.iterdir()) == []


def test_weights_are_halves_where_bytes_change_the_answers(
    trained: Path, trained_network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, differences = onnx.load(trained_network), iter((1e-4, 2 * ROUNDED_TOLERANCE, 1e-2))
    tried: list[int] = []
    model.ClearField("metadata_props")
    monkeypatch.setattr("export.networks.onnx_export.trace_onnx", lambda *_: model)
    monkeypatch.setattr("export.networks.onnx_export.store_small", lambda _, min_bytes: tried.append(min_bytes))
    monkeypatch.setattr("export.networks.onnx_export._parity", lambda *_: next(differences))
    assert write_onnx([trained], tmp_path / "x.onnx") == 1e-2
    assert tried == [MIN_BYTES, sys.maxsize]


def test_outputs_fit_the_grid_and_the_parameters() -> None:
    spec = SPECS["outdoor"]
    ensemble = NetworkEnsemble([Outdoor(spec)], spec.sun_grid).eval()
    with torch.inference_mode():
        probability, parameters = ensemble(torch.zeros(2, 3, spec.height, spec.width))
    assert probability.shape == (2, len(grid_directions(spec.sun_grid)))
    np.testing.assert_allclose(probability.sum(dim=1), 1.0, rtol=1e-5)
    assert parameters.shape == (2, 6)
    assert ensemble.outputs == ["sun_probability", "parameters"]
    assert torch.isfinite(parameters).all()


def test_networks_that_learnt_the_light_say_it_in_final_units() -> None:
    network = Outdoor(SPECS["outdoor"], has_surroundings=True).eval()
    ensemble = NetworkEnsemble([network, Outdoor(SPECS["outdoor"]).eval()], GRID)
    with torch.inference_mode():
        _, _, light, around = ensemble(torch.randn(2, 3, 224, 224))
    assert ensemble.outputs == ["sun_probability", "parameters", "light", "around"]
    assert light.shape == (2, 8)
    assert around.shape == (2, ROWS, COLUMNS, 3)
    assert (light > 0).all()
    assert (light[:, 6:] < 1).all()
    assert (around >= 0).all()


def test_networks_for_the_sun_tell_the_powers_of_light_too_but_no_share() -> None:
    torch.manual_seed(4)
    first, second = (Outdoor(SPECS["outdoor"], has_surroundings=True).eval() for _ in range(2))
    photo = torch.randn(2, 3, 224, 224)
    with torch.inference_mode():
        alone = [NetworkEnsemble([network], GRID)(photo) for network in (first, second)]
        both = NetworkEnsemble([first], GRID, suns=[second])(photo)
    torch.testing.assert_close(both[1], alone[0][1])
    torch.testing.assert_close(both[2][:, :6], (alone[0][2] * alone[1][2])[:, :6].sqrt())
    torch.testing.assert_close(both[2][:, 6:], alone[0][2][:, 6:])
    around = [answer[3] + MIN_RADIANCE for answer in alone]
    torch.testing.assert_close(both[3] + MIN_RADIANCE, (around[0] * around[1]).sqrt())


def test_heads_of_the_light_are_reduced_to_the_nearest_product() -> None:
    torch.manual_seed(6)
    network: Any = Outdoor(SPECS["outdoor"], has_surroundings=True).eval()
    for head in (network.around, network.light):
        head[1].weight.data = torch.randn(384, 20) @ torch.randn(20, head[1].in_features) / 1000
    photo = torch.randn(2, 3, 224, 224)
    with torch.inference_mode():
        before = network(photo)
    reduce_light_heads(network)
    with torch.inference_mode():
        after = network(photo)
    torch.testing.assert_close(after.light, before.light, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(after.surroundings, before.surroundings, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(after.sun, before.sun)
    assert sum(value.numel() for value in network.light[1].parameters()) < 200_000


def seeing_no_sun() -> Outdoor:
    """A network that is sure that no picture shows the sun."""
    network = Outdoor(SPECS["outdoor"]).eval()
    torch.nn.init.constant_(network.seen.nowhere.bias, 100.0)
    return network


def test_temperature_widens_the_distribution() -> None:
    network = seeing_no_sun()
    photo = torch.randn(1, 3, 224, 224)
    with torch.inference_mode():
        sharp, soft = NetworkEnsemble([network], GRID, 0.5)(photo)[0], NetworkEnsemble([network], GRID, 2.0)(photo)[0]
    assert sharp.max() > soft.max()
    assert sharp.argmax() == soft.argmax()


def test_networks_together_answer_their_mean() -> None:
    torch.manual_seed(3)
    networks = [Outdoor(SPECS["outdoor"]).eval() for _ in range(2)]
    photo = torch.randn(2, 3, 224, 224)
    with torch.inference_mode():
        alone = [NetworkEnsemble([network], GRID, 1.4)(photo) for network in networks]
        both = NetworkEnsemble(networks, GRID, 1.4)(photo)
    torch.testing.assert_close(both[0], (alone[0][0] + alone[1][0]) / 2)
    torch.testing.assert_close(both[1][:, 2:5], (alone[0][1] + alone[1][1])[:, 2:5] / 2)
    torch.testing.assert_close(both[1][:, :2], (alone[0][1] * alone[1][1])[:, :2].sqrt())  # turbidity and exposure


def test_a_network_for_the_sun_says_nothing_else() -> None:
    torch.manual_seed(5)
    first, second = (seeing_no_sun() for _ in range(2))
    photo = torch.randn(2, 3, 224, 224)
    with torch.inference_mode():
        alone = [NetworkEnsemble([network], GRID)(photo) for network in (first, second)]
        both = NetworkEnsemble([first], GRID, suns=[second])(photo)
    torch.testing.assert_close(both[0], (alone[0][0] + alone[1][0]) / 2)
    torch.testing.assert_close(both[1], alone[0][1])


def test_a_transformer_gives_the_same_bits_in_every_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"DEPTH": 2, "_READ": (1, 2), "_FROZEN": 1}.items():
        monkeypatch.setattr(outdoor_transformer, name, value)
    spec, file = SPECS["transformer"], tmp_path / "small.onnx"
    torch.manual_seed(7)
    network = outdoor_transformer.OutdoorTransformer(spec, has_surroundings=True)
    for block in network.trunk.blocks:
        torch.nn.init.constant_(block.get_parameter("scale1"), 0.3)
    settings = {"network": "transformer", "pretrained": True, "licensed_only": False, "crops": 3}
    record = {"spec": asdict(spec), "config": settings, "commit": "", "torch": "", "panoramas": {"train": []}}
    write_run(tmp_path / "run", record, network.state_dict())
    write_onnx([tmp_path / "run"], file)
    fused = {"MatMulInteger", "MatMulIntegerToFloat", "DynamicQuantizeMatMul"}  # whichever onnxruntime makes of them
    assert any(node.op_type in fused for node in onnx.load(file).graph.node)
    assert Model.load(file).spec.training_data.startswith(f"from the weights of {WHEEL}, 3 crops")
    photo = np.random.default_rng(0).normal(size=(1, 3, spec.height, spec.width)).astype(np.float32)
    sessions = [Model.load(file, threads, for_one_photo=once) for threads in (1, 2) for once in (False, True)]
    answers = [session.predict(photo)[0].sun_probability for session in sessions]
    for other in answers[1:]:
        np.testing.assert_array_equal(other, answers[0])


def test_a_network_for_the_camera_answers_for_it_instead_of_the_others() -> None:
    torch.manual_seed(4)
    first, camera = (seeing_no_sun() for _ in range(2))
    photo = torch.randn(2, 3, 224, 224)
    with torch.inference_mode():
        sun, parameters = NetworkEnsemble([first], GRID, cameras=[camera])(photo)
        alone, instead = NetworkEnsemble([first], GRID)(photo), NetworkEnsemble([camera], GRID)(photo)
    torch.testing.assert_close(sun, alone[0])
    torch.testing.assert_close(parameters[:, 2:5], instead[1][:, 2:5])
    torch.testing.assert_close(parameters[:, [0, 1, 5]], alone[1][:, [0, 1, 5]])
    assert (parameters[:, 2:5] - alone[1][:, 2:5]).abs().max() > 0
