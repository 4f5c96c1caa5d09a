"""Changes to an ONNX graph: nothing is computed twice, and weights are stored small."""

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import NodeProto, TensorProto, helper, numpy_helper

from lighting.onnx_session import OMITTED_CHANGES, import_onnxruntime, weights_path

MIN_BYTES = 40_000  # elements of a tensor that is stored as bytes with scales
_MIN_BLOCKED_BYTES = 200_000  # of one that a convolution over rows and columns takes: late ones bear the rounding best
_MIN_HALF = 8192  # elements of a tensor that is stored in half precision
_MIN_PRODUCT = 70_000  # elements of the weights of a matrix product of whole numbers
_SEVEN_BITS = 63  # largest of their values
_BLOCKED_AXES = 4  # of the weights of a convolution over rows and columns
_ERRORS_ONLY = 3  # onnxruntime's scale of log severities
_MIN_EXTERNAL = 1024  # bytes of a tensor that lies in the file beside the graph


def multiply_pointwise(model: Any) -> None:
    """Let large pointwise convolutions be matrix products, whose rows are pixels, for `quantize_products`.

    Args:
        model: the ONNX model with weights of single precision, changed in place; its pictures have one size.
    """
    graph, shapes = model.graph, _inferred_shapes(model)
    others = {name for node in graph.node if not _is_pointwise(node) for name in node.input}
    weights = {t.name: t for t in graph.initializer if len(t.dims) == _BLOCKED_AXES and t.name not in others}
    large = {name: tensor for name, tensor in weights.items() if math.prod(tensor.dims) >= _MIN_PRODUCT}
    nodes: list[Any] = []
    for node in graph.node:
        multiplied = _is_pointwise(node) and node.input[1] in large
        nodes += _product_nodes(graph, node, shapes[node.output[0]]) if multiplied else [node]
    used = {name for node in nodes if node.op_type == "MatMul" for name in node.input}
    for name in used & set(large):
        values = numpy_helper.to_array(large[name])[..., 0, 0].T
        large[name].CopyFrom(numpy_helper.from_array(np.ascontiguousarray(values), name))
    _replace(graph.node, nodes)


def _product_nodes(graph: Any, node: Any, size: tuple[int, ...]) -> list[Any]:
    """Nodes that compute what a pointwise convolution does, for pictures of `size` rows and columns."""
    source, weights, *bias = node.input
    target = node.output[0]
    row, pixels, product, total, turned = (
        f"{target}.{part}" for part in ("row", "pixels", "product", "total", "turned")
    )
    return [
        _reshape(graph, source, row, (0, 0, -1)),
        helper.make_node("Transpose", [row], [pixels], perm=[0, 2, 1]),
        helper.make_node("MatMul", [pixels, weights], [product]),
        *(helper.make_node("Add", [product, name], [total]) for name in bias),
        helper.make_node("Transpose", [total if bias else product], [turned], perm=[0, 2, 1]),
        _reshape(graph, turned, target, (0, 0, *size)),
    ]


def _is_pointwise(node: Any) -> bool:
    """Whether a node is a convolution that sees one pixel at a time, all of them, and every channel."""
    if node.op_type != "Conv":
        return False
    values = {a.name: helper.get_attribute_value(a) for a in node.attribute}
    ones, zeros = {*values["kernel_shape"], *values.get("strides", [1])}, {*values.get("pads", [0])}
    return ones == {1} and zeros == {0} and values.get("group", 1) == 1


def _inferred_shapes(model: Any) -> dict[str, tuple[int, ...]]:
    """Rows and columns of each value that has four axes."""
    graph = onnx.shape_inference.infer_shapes(model).graph
    values = (*graph.value_info, *graph.output)
    shapes = {value.name: [d.dim_value for d in value.type.tensor_type.shape.dim] for value in values}
    return {name: tuple(shape[2:]) for name, shape in shapes.items() if len(shape) == _BLOCKED_AXES}


def _reshape(graph: Any, source: str, target: str, shape: tuple[int, ...]) -> Any:
    """A node that gives a value another shape, which is added to the graph's tensors unless it is there."""
    name = "shape." + ".".join(map(str, shape))
    if all(tensor.name != name for tensor in graph.initializer):
        graph.initializer.append(numpy_helper.from_array(np.array(shape, np.int64), name))
    return helper.make_node("Reshape", [source, name], [target])


def merge_equal_nodes(model: Any) -> None:
    """Merge equal tensors and equal nodes: what several networks begin with alike is then computed once.

    Args:
        model: the ONNX model, changed in place.
    """
    names = _unify_tensors(model.graph)
    outputs = {output.name for output in model.graph.output}
    outputs_of: dict[tuple[Any, ...], list[str]] = {}
    kept = []
    for node in model.graph.node:
        inputs = [names.get(name, name) for name in node.input]
        node.input[:] = inputs
        attributes = sorted(a.SerializeToString() for a in node.attribute)
        key = (node.op_type, node.domain, len(node.output), *inputs, *attributes)
        earlier = outputs_of.setdefault(key, list(node.output))
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


def strip_origin(model: Any) -> None:
    """Remove each node's origin in the code and the shapes between nodes: nothing reads them.

    Args:
        model: the ONNX model, changed in place.
    """
    del model.graph.value_info[:]
    for node in model.graph.node:
        del node.metadata_props[:]


def store_small(model: Any, min_bytes: int = MIN_BYTES) -> None:
    """Store large tensors of weights as bytes with a scale for each output, others in half precision.

    Small tensors and those of one axis stay as they are. Halves are inputs with a default, too, unless a convolution
    over two axes takes them: onnxruntime widens constants when it opens a file, and keeps them wide. These convolutions
    need constants, for else their channels are not blocked.

    Args:
        model: the ONNX model, changed in place.
        min_bytes: elements of a tensor that is stored as bytes.
    """
    columns = {node.input[1] for node in model.graph.node if node.op_type == "MatMul"}  # an output is a column there
    tensors, nodes = [], []
    for tensor in model.graph.initializer:
        weights = numpy_helper.to_array(tensor)
        if weights.dtype != np.float32 or weights.ndim < 2 or weights.size < _MIN_HALF:
            tensors.append(tensor)
            continue
        stored, widening = _quantize(tensor.name, weights, int(tensor.name in columns), min_bytes)
        tensors += stored
        nodes += widening
        if weights.ndim < _BLOCKED_AXES and widening[0].op_type == "Cast":
            port = helper.make_tensor_value_info(stored[0].name, TensorProto.FLOAT16, weights.shape)
            model.graph.input.append(port)
    _replace(model.graph.initializer, tensors)
    _replace(model.graph.node, [*nodes, *model.graph.node])


def _quantize(name: str, weights: NDArray[np.float32], axis: int, min_bytes: int) -> tuple[list[Any], list[Any]]:
    """Small tensors that replace a large one, whose outputs lie along `axis`, and the nodes that widen them."""
    if weights.size < (max(min_bytes, _MIN_BLOCKED_BYTES) if weights.ndim == _BLOCKED_AXES else min_bytes):
        half = numpy_helper.from_array(weights.astype(np.float16), f"{name}.half")
        return [half], [helper.make_node("Cast", [half.name], [name], to=TensorProto.FLOAT)]
    others = tuple(i for i in range(weights.ndim) if i != axis)
    scale = np.maximum(np.abs(weights).max(axis=others, keepdims=True) / 127, np.float32(1e-20)).astype(np.float32)
    bytes_ = numpy_helper.from_array(np.round(weights / scale).astype(np.int8), f"{name}.bytes")
    scales = numpy_helper.from_array(scale.reshape(-1), f"{name}.scale")
    return [bytes_, scales], [helper.make_node("DequantizeLinear", [bytes_.name, scales.name], [name], axis=axis)]


def save_graph(model: Any, path: Path) -> None:
    """Write a checked model as a graph and, beside it, its weights; the model in memory keeps them.

    Args:
        model: the ONNX model.
        path: of the graph.
    """
    weights = weights_path(path)
    weights.unlink(missing_ok=True)  # otherwise they are appended to what it holds
    saved = onnx.ModelProto()
    saved.CopyFrom(model)
    onnx.save_model(saved, str(path), save_as_external_data=True, location=weights.name, size_threshold=_MIN_EXTERNAL)
    onnx.checker.check_model(str(path))
    for file in (path, weights):
        file.chmod(0o644)


def fuse_nodes(path: Path) -> None:
    """Fuse the nodes of a saved graph as onnxruntime would each time it opens it; the answers stay to the last bit.

    Blocks of channels depend on the processor, and widened constants take more room, so these are left to it.

    Args:
        path: the ONNX file; its weights lie in `weights_path(path)`.
    """
    with TemporaryDirectory(dir=path.parent) as folder:
        fused = Path(folder, path.name)
        onnxruntime = import_onnxruntime()
        options = onnxruntime.SessionOptions()
        options.log_severity_level = _ERRORS_ONLY
        options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_EXTENDED
        options.optimized_model_filepath = str(fused)
        settings = {"file_name": weights_path(fused).name, "min_size_in_bytes": str(_MIN_EXTERNAL)}
        for name, value in settings.items():
            options.add_session_config_entry(f"session.optimized_model_external_initializers_{name}", value)
        omitted = {*OMITTED_CHANGES, "ConstantFolding"}
        onnxruntime.InferenceSession(
            str(path), options, providers=["CPUExecutionProvider"], disabled_optimizers=omitted
        )
        model = onnx.load(str(fused))
    domains = {node.domain for node in model.graph.node}
    _replace(model.opset_import, [entry for entry in model.opset_import if entry.domain in domains])
    save_graph(model, path)


def quantize_products(model: Any) -> bool:
    """Let large matrix products be of whole numbers: weights of seven bits, inputs of eight with a scale for each run.

    Sums of whole numbers are exact, so they are the same in any order and on any processor. Weights have seven bits,
    because older processors add two products in sixteen. Returns whether there are such products.

    Args:
        model: the ONNX model, changed in place.
    """
    graph = model.graph
    weights = {t.name: t for t in graph.initializer if len(t.dims) == 2 and math.prod(t.dims) >= _MIN_PRODUCT}
    nodes: list[NodeProto] = []
    done: set[str] = set()
    for node in graph.node:
        if node.op_type != "MatMul" or node.input[1] not in weights:
            nodes.append(node)
            continue
        (source, name), target = node.input, node.output[0]
        if name not in done:
            values = numpy_helper.to_array(weights[name])
            scale = np.maximum(np.abs(values).max(axis=0) / _SEVEN_BITS, np.float32(1e-20)).astype(np.float32)
            weights[name].CopyFrom(numpy_helper.from_array(np.round(values / scale).astype(np.int8), name))
            graph.initializer.append(numpy_helper.from_array(scale, f"{name}.scale"))
            done.add(name)
        parts = [f"{target}.{part}" for part in ("bytes", "scale", "zero", "sum", "float", "scales")]
        nodes += [
            helper.make_node("DynamicQuantizeLinear", [source], parts[:3]),
            helper.make_node("MatMulInteger", [parts[0], name, parts[2]], [parts[3]]),
            helper.make_node("Cast", [parts[3]], [parts[4]], to=TensorProto.FLOAT),
            helper.make_node("Mul", [parts[1], f"{name}.scale"], [parts[5]]),
            helper.make_node("Mul", [parts[4], parts[5]], [target]),
        ]
    _replace(graph.node, nodes)
    return bool(done)


def _replace(field: Any, values: list[Any]) -> None:
    del field[:]
    field.extend(values)
