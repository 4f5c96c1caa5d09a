"""Changes to a network's ONNX graph before it ships: nothing is computed twice, and weights are stored small.

onnxruntime widens the weights, so it computes in single precision. It maps the file that holds them into memory.
"""

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from lighting.model import weights_path

HALVED = 256  # least elements of a tensor that is stored in half precision
BYTES = 200_000  # least elements of a tensor that is stored as bytes with scales: late layers bear the rounding best
BESIDE = 1024  # least bytes of a tensor that lies in the file beside the graph


def share(model: Any) -> None:
    """Merge equal tensors and equal nodes: what several networks begin with alike is then computed once."""
    names = _unify_tensors(model.graph)
    outputs = {output.name for output in model.graph.output}
    known: dict[tuple[Any, ...], list[str]] = {}
    kept = []
    for node in model.graph.node:
        inputs = [names.get(name, name) for name in node.input]
        node.input[:] = inputs
        attributes = sorted(a.SerializeToString() for a in node.attribute)
        alike = (node.op_type, node.domain, len(node.output), *inputs, *attributes)
        earlier = known.setdefault(alike, list(node.output))
        if earlier != list(node.output) and outputs.isdisjoint(node.output):
            names.update(zip(node.output, earlier, strict=True))
        else:
            kept.append(node)
    _replace(model.graph.node, kept)


def _unify_tensors(graph: Any) -> dict[str, str]:
    """Keep one of each set of equal tensors; returns the name of the kept tensor for each removed one."""
    first: dict[tuple[Any, ...], str] = {}
    names, kept = {}, []
    for tensor in graph.initializer:
        values = numpy_helper.to_array(tensor)
        name = first.setdefault((values.dtype.str, values.shape, values.tobytes()), tensor.name)
        if name == tensor.name:
            kept.append(tensor)
        else:
            names[tensor.name] = name
    _replace(graph.initializer, kept)
    return names


def forget_origin(model: Any) -> None:
    """Remove each node's origin in the code and the shapes between nodes: nothing reads them."""
    del model.graph.value_info[:]
    for node in model.graph.node:
        del node.metadata_props[:]


def store_small(model: Any) -> None:
    """Store large tensors of weights as bytes with a scale for each output, others in half precision.

    Small tensors stay as they are.
    """
    columns = {node.input[1] for node in model.graph.node if node.op_type == "MatMul"}  # an output is a column there
    tensors, nodes = [], []
    for tensor in model.graph.initializer:
        weights = numpy_helper.to_array(tensor)
        if weights.dtype != np.float32 or weights.size < HALVED:
            tensors.append(tensor)
            continue
        stored, widening = _stored(tensor.name, weights, axis=int(tensor.name in columns))
        tensors += stored
        nodes += widening
    _replace(model.graph.initializer, tensors)
    _replace(model.graph.node, [*nodes, *model.graph.node])


def _stored(name: str, weights: NDArray[np.float32], axis: int) -> tuple[list[Any], list[Any]]:
    """Small tensors that replace a large one, whose outputs lie along `axis`, and the nodes that widen them."""
    if weights.size < BYTES:
        half = numpy_helper.from_array(weights.astype(np.float16), f"{name}.half")
        return [half], [helper.make_node("Cast", [half.name], [name], to=TensorProto.FLOAT)]
    others = tuple(i for i in range(weights.ndim) if i != axis)
    scale = np.maximum(np.abs(weights).max(axis=others, keepdims=True) / 127, np.float32(1e-20)).astype(np.float32)
    bytes_ = numpy_helper.from_array(np.round(weights / scale).astype(np.int8), f"{name}.bytes")
    scales = numpy_helper.from_array(scale.reshape(-1), f"{name}.scale")
    return [bytes_, scales], [helper.make_node("DequantizeLinear", [bytes_.name, scales.name], [name], axis=axis)]


def save_graph(model: Any, path: Path) -> None:
    """Write a checked model as a graph and, beside it, its weights; the model in memory keeps them."""
    weights = weights_path(path)
    weights.unlink(missing_ok=True)  # otherwise they are appended to what it holds
    saved = onnx.ModelProto()
    saved.CopyFrom(model)
    onnx.save_model(saved, str(path), save_as_external_data=True, location=weights.name, size_threshold=BESIDE)
    onnx.checker.check_model(str(path))
    for file in (path, weights):
        file.chmod(0o644)


def _replace(field: Any, values: list[Any]) -> None:
    del field[:]
    field.extend(values)
