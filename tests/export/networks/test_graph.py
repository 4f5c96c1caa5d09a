"""The ONNX graph before it ships: what is computed twice, how weights are stored, and that answers stay the same."""

from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from numpy.typing import NDArray
from onnx import GraphProto, ModelProto, TensorProto, checker, helper, numpy_helper

from export.networks.graph import BYTES, save_graph, share, store_small
from lighting.model import weights_path
from lighting.onnx import session_of

RNG = np.random.default_rng(5)
LONG, WIDE = 800, BYTES // 800 + 1
FIRST, SECOND, THIRD = (RNG.normal(size=(80, 80)).astype(np.float32) for _ in range(3))


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


def _model(nodes: list[Any], tensors: list[TensorProto], shape: list[Any]) -> ModelProto:
    ends = (helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name in ("x", "out"))
    graph: GraphProto = helper.make_graph(nodes, "g", [next(ends)], [next(ends)], tensors)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)


def answer(network: ModelProto, x: NDArray[np.float32]) -> NDArray[np.float32]:
    checker.check_model(network, full_check=True)
    options = onnxruntime.SessionOptions()
    options.add_session_config_entry("session.disable_quant_qdq", "1")  # as lighting.onnx has it
    session = onnxruntime.InferenceSession(network.SerializeToString(), options, providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, {"x": x})[0])


def kinds(network: ModelProto) -> set[int]:
    return {t.data_type for t in network.graph.initializer}


def test_what_begins_alike_begins_once_and_answers_the_same() -> None:
    network = model((FIRST, SECOND), (FIRST, THIRD), (FIRST, SECOND))
    x = RNG.normal(size=(3, 80)).astype(np.float32)
    before = answer(network, x)
    share(network)
    np.testing.assert_array_equal(answer(network, x), before)
    assert len(network.graph.initializer) == 3
    assert [n.op_type for n in network.graph.node].count("MatMul") == 3
    assert [n.op_type for n in network.graph.node].count("LeakyRelu") == 4  # the third branch has another slope


def test_the_models_own_outputs_keep_their_names() -> None:
    nodes = [helper.make_node("Abs", ["x"], [name]) for name in ("y", "out")]
    network = _model(nodes, [], ["B", 80])
    share(network)
    assert answer(network, np.full((1, 80), -2.0, np.float32)).max() == 2.0


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
    depthwise = numpy_helper.from_array(RNG.normal(size=(LONG, 1, 3, 3)).astype(np.float32), "w")
    pointwise = numpy_helper.from_array(RNG.normal(size=(WIDE, LONG, 1, 1)).astype(np.float32), "v")
    bias = numpy_helper.from_array(RNG.normal(size=WIDE).astype(np.float32), "b")
    nodes = [
        helper.make_node("Conv", ["x", "w"], ["y"], group=LONG, kernel_shape=[3, 3], pads=[1, 1, 1, 1]),
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


def test_an_output_without_weights_stays_zero() -> None:
    network = model((np.zeros((LONG, WIDE), np.float32),))
    store_small(network)
    assert not answer(network, np.ones((1, LONG), np.float32)).any()


def test_weights_lie_beside_the_graph_and_answer_the_same(tmp_path: Path) -> None:
    """Writing twice leaves what writing once does, and the model keeps its weights."""
    network = model((FIRST, SECOND))
    store_small(network)
    x = RNG.normal(size=(3, 80)).astype(np.float32)
    before, file = answer(network, x), tmp_path / "n.onnx"
    for _ in range(2):
        save_graph(network, file)
        assert weights_path(file).stat().st_size < 2 * (FIRST.size + SECOND.size) + 8192
    np.testing.assert_array_equal(answer(network, x), before)
    session = session_of(file, 1)
    np.testing.assert_array_equal(session.run(None, {"x": x})[0], before)
