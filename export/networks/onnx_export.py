"""ONNX files as users get them: several networks answer together, in final units, checked against torch.

The graph holds all networks and averages their probabilities and values; their weights lie in a file beside it.

onnxruntime widens the weights, so it computes in single precision. It maps the file that holds them into memory.
"""

import copy
import json
import logging
import math
import sys
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import NodeProto, TensorProto, helper, numpy_helper
from torch import Tensor, nn

from export.crops.targets import CELL, COLUMNS, MIN_RADIANCE, ROWS
from export.data.panoramas import DataError
from export.networks.backbone import Backbone, NetworkOutput
from export.networks.outdoor import ROLL_SCALE, decode_parameters, mean_of_camera_bins, roll_bins_std
from export.networks.outdoor_transformer import OutdoorTransformer
from export.networks.segmentation import SegmentationBranch
from export.networks.weights import (
    describe_data,
    have_different_specs,
    read_network,
    read_record,
    read_spec,
    training_history,
)
from lighting.errors import ModelError
from lighting.geometry import angles
from lighting.model import OUTPUTS, Model
from lighting.onnx_session import OMITTED_CHANGES, import_onnxruntime, weights_path
from lighting.prediction import ModelSpec
from lighting.sun_grid import grid_directions

MIN_BYTES = 40_000  # elements of a tensor that is stored as bytes with scales
_MIN_BLOCKED_BYTES = 200_000  # of one that a convolution over rows and columns takes: late ones bear the rounding best
_MIN_HALF = 8192  # elements of a tensor that is stored in half precision
_MIN_FLAT = 70_000  # elements of the weights of a convolution that sees its pixels in one row
_MIN_PRODUCT = 100_000  # elements of the weights of a matrix product of whole numbers
_SEVEN_BITS = 63  # largest of their values
_BLOCKED_AXES = 4  # of the weights of a convolution over rows and columns
_MIN_EXTERNAL = 1024  # bytes of a tensor that lies in the file beside the graph
_OPSET = 20
_ERRORS_ONLY = 3  # onnxruntime's scale of log severities
_TOLERANCE = 1e-3  # largest difference between torch and onnxruntime, relative to each output's largest value
ROUNDED_TOLERANCE = 3e-2  # the same once weights are stored small: that shifts the camera, and a sun in view with it
_WHOLE_TOLERANCE = 0.25  # the same where products are of whole numbers: of noise, a doubtful sun moves


# Changes to the graph: nothing is computed twice, and weights are stored small.


def _flatten_pointwise(model: Any) -> None:
    """Let large pointwise convolutions see their pixels in one row.

    onnxruntime blocks the channels of two-dimensional convolutions whose weights are constant, and then adds in another
    order. Weights stored as bytes are constant only once they are widened, which takes a single run too long. A
    convolution along one axis has one order of sums, so that every session gives the same answer to the last bit. With
    fewer outputs than pixels the order would depend on the number of threads: such convolutions stay.

    Args:
        model: the ONNX model with weights of single precision, changed in place; its pictures have one size.
    """
    graph, shapes = model.graph, _inferred_shapes(model)
    others = {name for node in graph.node if not _is_pointwise(node) for name in node.input}
    tensors = [t for t in graph.initializer if len(t.dims) == 4 and t.name not in others]
    weights = {t.name: t for t in tensors if math.prod(t.dims) >= _MIN_FLAT}
    pointwise = [node for node in graph.node if _is_pointwise(node) and node.input[1] in weights]
    large = [n for n in pointwise if weights[n.input[1]].dims[0] >= math.prod(shapes[n.output[0]])]
    _replace(graph.node, _flattened_nodes(graph, {node.output[0] for node in large}, shapes))
    for name in {node.input[1] for node in large}:
        weights[name].CopyFrom(numpy_helper.from_array(numpy_helper.to_array(weights[name])[..., 0], name))


def _flattened_nodes(graph: Any, outputs: set[str], shapes: dict[str, tuple[int, ...]]) -> list[Any]:
    """Nodes of a graph in which convolutions, by their outputs, and Clips after them have one axis of pixels."""
    rows = {name: f"{name}.row" for name in outputs & _sole_clips(graph)}
    nodes: list[Any] = []
    for node in graph.node:
        source, target = node.input[0] if node.input else "", node.output[0]
        if target in outputs:
            nodes.append(_reshape(graph, source, f"{target}.flat", (0, 0, -1)))
            inputs = [f"{target}.flat", *node.input[1:]]
        elif source in rows and node.op_type == "Clip":
            inputs = [rows[source], *node.input[1:]]
        else:
            nodes.append(node)
            continue
        row = helper.make_node(node.op_type, inputs, [f"{target}.row"])
        if node.op_type == "Conv":
            row.attribute.append(helper.make_attribute("kernel_shape", [1]))
        nodes.append(row)
        if target not in rows:
            nodes.append(_reshape(graph, f"{target}.row", target, (0, 0, *shapes[target])))
    return nodes


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
    return {name: tuple(shape[2:]) for name, shape in shapes.items() if len(shape) == 4}


def _sole_clips(graph: Any) -> set[str]:
    """Names of the values that one Clip takes and nothing else does."""
    users: dict[str, list[str]] = {}
    for node in graph.node:
        for name in node.input:
            users.setdefault(name, []).append(node.op_type)
    return {name for name, kinds in users.items() if kinds == ["Clip"]} - {output.name for output in graph.output}


def _reshape(graph: Any, source: str, target: str, shape: tuple[int, ...]) -> Any:
    """A node that gives a value another shape, which is added to the graph's tensors unless it is there."""
    name = "shape." + ".".join(map(str, shape))
    if all(tensor.name != name for tensor in graph.initializer):
        graph.initializer.append(numpy_helper.from_array(np.array(shape, np.int64), name))
    return helper.make_node("Reshape", [source, name], [target])


def _merge_equal_nodes(model: Any) -> None:
    """Merge equal tensors and equal nodes: what several networks begin with alike is then computed once."""
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
        path: the ONNX file to write; its weights go to `weights_path(path)`.
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


# How a sun in the picture enters the answer.

# nats; the sun is rarer in photos than in the crops that teach to see it; 0.5 to 1 on crops of `train`
SUN_IN_VIEW_PRIOR = 1.0
_DIRECTION_STD = 5.0  # deg per axis, of the directions that a cell stands for: the error of the estimated camera


def _sun_in_view_probability(logits: Tensor) -> Tensor:
    """Probabilities (B, 1 + cells) that the sun is nowhere in the picture, and in each cell.

    Args:
        logits: (B, 1 + cells) of the network.
    """
    return (logits - SUN_IN_VIEW_PRIOR * (torch.arange(logits.shape[1], device=logits.device) > 0)).softmax(dim=1)


def _cell_directions(photo: Tensor, elevation: Tensor, roll: Tensor, vertical_fov: Tensor) -> Tensor:
    """Unit vectors (B, cells, 3) through the centers of a canvas's cells; signs are those of `lighting.geometry`.

    Args:
        photo: (B, 3, H, W) canvases; a photo's height is that of its canvas without the zero rows around it.
        elevation: (B,) deg, of the camera, positive looks up.
        roll: (B,) deg.
        vertical_fov: (B,) deg, of the photo.
    """
    height, width = photo.shape[2:]
    photo_height = (photo.abs().amax(dim=(1, 3)) > 0).sum(dim=1).clamp_min(1).to(photo.dtype)
    focal = (0.5 * photo_height / torch.tan(torch.deg2rad(vertical_fov) / 2))[:, None]
    y = (0.5 * height - (torch.arange(height // CELL, device=photo.device) + 0.5) * CELL).to(photo.dtype)
    x = ((torch.arange(width // CELL, device=photo.device) + 0.5) * CELL - 0.5 * width).to(photo.dtype)
    lateral = x.repeat(len(y))[None] / focal
    vertical = y.repeat_interleave(len(x))[None] / focal
    rotation, tilt = torch.deg2rad(roll)[:, None], torch.deg2rad(elevation)[:, None]
    right = torch.cos(rotation) * lateral + torch.sin(rotation) * vertical
    up = torch.cos(rotation) * vertical - torch.sin(rotation) * lateral
    rays = torch.stack([right, torch.sin(tilt) + torch.cos(tilt) * up, torch.sin(tilt) * up - torch.cos(tilt)], dim=2)
    return nn.functional.normalize(rays, dim=2)


def _fuse_sun_in_view(sun: Tensor, sun_in_view: Tensor, rays: Tensor, cells: Tensor) -> Tensor:
    """Probabilities (B, G) over the grid, with those of a sun in the picture mixed in.

    Args:
        sun: (B, G) probabilities without the picture's cells.
        sun_in_view: (B, 1 + cells) probabilities of nowhere and of each cell.
        rays: (B, cells, 3) unit vectors where the cells look.
        cells: (G, 3) unit vectors of the grid.
    """
    concentration = float(np.radians(_DIRECTION_STD) ** -2)
    lobes = (rays @ (concentration * cells).T).softmax(dim=2)
    return sun_in_view[:, :1] * sun + (sun_in_view[:, None, 1:] @ lobes)[:, 0]


# How level photographs are, and the camera's roll that follows from it and from the networks' answers.
#
# Photographs are level far more often than training crops, half of which are rolled by up to 10 deg: people hold
# cameras level, and straighten what is not. Hold-Geoffroy et al. ("A perceptual measure for deep single image camera
# calibration", CVPR 2018) draw a third of their photos level and the others from a Cauchy distribution of 0.1 rad. Of
# the ordinary photos that training sees, the networks tell that nearly all are within 4 deg. Here a fifth is level, so
# that a camera which is rolled on purpose is not made level.

_SHARES = torch.tensor([0.20, 0.24, 0.36, 0.20])  # of photographs, by how far they are rolled:
_ROLL_STD = torch.tensor([0.06, 2.0, 6.0, 25.0])  # deg
_TRUST = 0.65  # errors over the bins' deviation, less that of their targets; 0.6 and 0.7 on crops of `train`
_MIN_ERROR = 0.3  # deg, of a network


def _expected_roll(roll: Tensor, roll_std: Tensor) -> Tensor:
    """The expected roll (B, 1) [deg] of photographs.

    Args:
        roll: (B, 1) deg, that a network predicts.
        roll_std: (B, 1) deg, of its bins.
    """
    error = (_TRUST * roll_std).clamp_min(_MIN_ERROR) ** 2
    prior = _ROLL_STD.to(roll) ** 2
    total = prior + error
    likelihood = _SHARES.to(roll) * torch.exp(-0.5 * roll**2 / total) / total.sqrt()
    share = likelihood / likelihood.sum(dim=1, keepdim=True)
    return roll * (share * prior / total).sum(dim=1, keepdim=True)


# The networks in one.


class _Ensemble(nn.Module):
    """Networks whose averaged answers are sun probabilities (B, G) and parameters (B, 6).

    Further networks, `cameras`, answer for the camera instead of the others. With an `elevation_scale` [deg], the sun's
    probabilities are multiplied by exp(-elevation / scale): suns are lower in photographs than in the training crops.
    In the same way the camera is taken to be level, as photographs are, by networks with bins.
    A sun that the networks see in the picture enters the probabilities. Networks that learnt it also predict the light
    (B, 8) and the radiance around the camera (B, ROWS, COLUMNS, 3). With `segmentation`, a branch of the first network
    tells what the canvas shows.
    """

    cells: Tensor
    prior: Tensor

    def __init__(
        self,
        networks: Sequence[nn.Module],
        sun_grid: str,
        temperature: float = 1.0,
        cameras: Sequence[nn.Module] = (),
        elevation_scale: float = math.inf,
        segmentation: SegmentationBranch | None = None,
        suns: Sequence[nn.Module] = (),
    ) -> None:
        super().__init__()
        self.segmentation = segmentation
        # A copy, for weights of one layer that is used twice are not folded; equal nodes are merged later.
        self.beginning = copy.deepcopy(_with_backbone([*networks, *suns]).backbone) if segmentation else None
        self.cameras = nn.ModuleList(cameras)
        self.networks = nn.ModuleList(networks)
        self.suns = nn.ModuleList(suns)
        self.temperature = temperature
        cells = grid_directions(sun_grid)
        self.register_buffer("cells", torch.tensor(cells, dtype=torch.float32))
        self.register_buffer("prior", torch.tensor(np.exp(-angles(cells)[1] / elevation_scale), dtype=torch.float32))

    @property
    def outputs(self) -> list[str]:
        """Names of what `forward` returns."""
        of_light = ["light", "around"] if any(n.light is not None for n in self.networks) else []
        return [*OUTPUTS, *of_light, *(["segments"] if self.segmentation else [])]

    def forward(self, photo: Tensor) -> tuple[Tensor, ...]:
        predicted: list[NetworkOutput] = [network(photo) for network in self.networks]
        of_suns = [*predicted, *(network(photo) for network in self.suns)]
        sun = torch.stack([(one.sun.float() / self.temperature).softmax(dim=1) for one in of_suns]).mean(dim=0)
        sun = nn.functional.normalize(sun * self.prior, p=1.0, dim=1)
        raw = torch.stack([one.raw.float() for one in predicted]).mean(dim=0)
        of_cameras = [network(photo) for network in self.cameras] or predicted
        camera = torch.stack([_camera_values(one) for one in of_cameras]).mean(dim=0)
        parameters = decode_parameters(torch.cat([raw[:, :2], camera, raw[:, 5:]], dim=1))
        in_view = [_sun_in_view_probability(p.sun_in_view.float()) for p in of_suns if p.sun_in_view.shape[1]]
        if in_view:
            rays = _cell_directions(photo, parameters[:, 2], parameters[:, 3], parameters[:, 4])
            sun = _fuse_sun_in_view(sun, torch.stack(in_view).mean(dim=0), rays, self.cells)
        return sun, parameters, *_light_values(predicted), *self._segments(photo)

    def _segments(self, photo: Tensor) -> tuple[Tensor, ...]:
        """Probabilities (B, H/8, W/8, classes) of what the canvas shows; nothing without a branch for it."""
        if self.segmentation is None or not isinstance(self.beginning, Backbone):
            return ()
        logits = self.segmentation(self.beginning.frozen_features(photo))
        return (logits.softmax(dim=1).permute(0, 2, 3, 1),)


def _with_backbone(networks: Sequence[nn.Module]) -> Any:
    """The first network that has a convolutional backbone, else the first."""
    return next((one for one in networks if isinstance(getattr(one, "backbone", None), Backbone)), networks[0])


def _camera_values(predicted: NetworkOutput) -> Tensor:
    """The camera's raw values (B, 3): the mean of those of its bins and of the head of values, where both are.

    The bins also tell how sure they are of the roll, which is then that of photographs.
    """
    values = predicted.raw[:, 2:5].float()
    if not predicted.camera.shape[1]:
        return values
    camera = 0.5 * (values + mean_of_camera_bins(predicted.camera))
    roll = _expected_roll(camera[:, 1:2] * ROLL_SCALE, roll_bins_std(predicted.camera) * ROLL_SCALE) / ROLL_SCALE
    return torch.cat([camera[:, :1], roll, camera[:, 2:]], dim=1)


def _light_values(predicted: Sequence[NetworkOutput]) -> tuple[Tensor, ...]:
    """The light (B, 8) and the surroundings (B, ROWS, COLUMNS, 3) by networks that predict them; nothing if none."""
    lit = [one for one in predicted if one.light.shape[1]]
    if not lit:
        return ()
    light = torch.stack([one.light.float() for one in lit]).mean(dim=0)
    suitable = torch.stack([one.suitable.float() for one in lit]).mean(dim=0)
    surroundings = torch.stack([one.surroundings.float() for one in lit]).mean(dim=0)
    shares = torch.cat([light[:, 6:], suitable], dim=1).sigmoid()
    radiance = (surroundings.exp() - MIN_RADIANCE).clamp_min(0.0).reshape(-1, ROWS, COLUMNS, 3)
    return torch.cat([light[:, :6].exp(), shares], dim=1), radiance


# The file.


def write_onnx(
    folders: Sequence[Path],
    target: Path,
    *,
    temperature: float = 1.0,
    version: str | None = None,
    cameras: Sequence[Path] = (),
    elevation_scale: float = math.inf,
    segments: Path | None = None,
    suns: Sequence[Path] = (),
) -> float:
    """Write a graph and its weights beside it; returns the largest difference to torch, relative to each output.

    Args:
        folders: of the runs whose networks answer together.
        target: the ONNX file; the weights lie in `weights_path(target)`.
        temperature: divides the suns' logits [1], above 0.
        version: of the network; None for the first run's.
        cameras: folders of the runs whose networks answer for the camera instead; empty for those of `folders`.
        elevation_scale: deg; probabilities are multiplied by exp(-elevation / scale), with inf by 1.
        segments: folder of the run whose branch tells what photos show; None: nothing tells it.
        suns: folders of further runs whose networks answer for the sun alone, with those of `folders`.

    Raises:
        DataError: if the runs' networks expect different photos, or the branch does not fit the first of them.
        ModelError: the answers differ from torch's by more than _TOLERANCE; with weights in half precision by more than
            ROUNDED_TOLERANCE, with products of whole numbers by more than _WHOLE_TOLERANCE.
    """
    if have_different_specs([*folders, *suns, *cameras]):
        raise DataError("The runs' networks expect different photos, so they cannot answer together.")
    spec, metadata = _describe(folders, version)
    others = {"suns": suns, "cameras": cameras}
    metadata |= {name: json.dumps([training_history(read_record(f)) for f in some]) for name, some in others.items()}
    networks, of_suns, of_cameras = ([_read_folded(f) for f in some] for some in (folders, suns, cameras))
    branch = None
    if segments is not None:
        branch = SegmentationBranch.read(segments)
        branch.check_beginning(_with_backbone([*networks, *of_suns]), spec.height, spec.width)
        metadata["segments"] = str(read_record(segments)["training_data"])
    parts = (temperature, of_cameras, elevation_scale, branch, of_suns)
    ensemble = _Ensemble(networks, spec.sun_grid, *parts).eval()
    metadata["networks"] = str(len(folders) + len(suns) + len(cameras))
    metadata |= {"temperature": f"{temperature:.3f}", "elevation_scale": f"{elevation_scale:g}"}
    target.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=target.parent) as folder:
        path = Path(folder, target.name)
        example = torch.zeros(2, 3, spec.height, spec.width)
        model = trace_onnx(ensemble, example, ensemble.outputs, {0: torch.export.Dim("batch", min=1)})
        add_metadata(model, {"spec": spec.to_json(), **_readable(spec), **metadata})
        save_graph(model, path)
        _check(_parity(ensemble, path), _TOLERANCE)
        strip_origin(model)
        _merge_equal_nodes(model)
        _flatten_pointwise(model)
        tolerance = _WHOLE_TOLERANCE if quantize_products(model) else ROUNDED_TOLERANCE
        model, difference = _store_as_small_as_agrees(model, ensemble, path, tolerance)
        add_metadata(model, {"parity": f"{difference:.2e}"})
        save_graph(model, path)
        fuse_nodes(path)
        weights_path(path).replace(weights_path(target))
        path.replace(target)
    return difference


def _read_folded(folder: Path) -> nn.Module:
    """The network of a run, with constants multiplied out where it can do that."""
    network = read_network(folder)
    return network.fold() if isinstance(network, OutdoorTransformer) else network


def _store_as_small_as_agrees(model: Any, ensemble: _Ensemble, path: Path, tolerance: float) -> tuple[Any, float]:
    """The model with large weights as bytes, or else all in half precision, on disk; and its difference to torch."""
    for min_bytes in (MIN_BYTES, sys.maxsize):
        small = copy.deepcopy(model)
        store_small(small, min_bytes)
        save_graph(small, path)
        difference = _parity(ensemble, path)
        if difference <= tolerance:
            break
    return small, _check(difference, tolerance)


def _describe(folders: Sequence[Path], version: str | None) -> tuple[ModelSpec, dict[str, str]]:
    """The spec of the file and the metadata that tell where its networks come from."""
    records, spec = [read_record(f) for f in folders], read_spec(folders[0])
    data = "; ".join(dict.fromkeys(describe_data(r) for r in records))
    commits = ", ".join(dict.fromkeys(run["commit"] for run in training_history(*records)))
    training = json.dumps([training_history(r) for r in records])
    metadata = {"commit": commits, "training": training}
    return replace(spec, training_data=data, version=version or spec.version), metadata


def _check(difference: float, allowed: float) -> float:
    if not difference <= allowed:  # nor is NaN agreement
        raise ModelError(f"torch and onnxruntime differ by {difference:.2e}, more than {allowed:.0e}.")
    return difference


def trace_onnx(network: nn.Module, example: Tensor, outputs: Sequence[str], dynamic: dict[int, Any]) -> Any:
    """A network as an ONNX model.

    Args:
        network: of one input, which the model calls "photo".
        example: of the input.
        outputs: their names.
        dynamic: the input's axes of any size, each a torch.export.Dim.
    """
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it reports that torchvision's operators are missing
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of the exporter's own use of torch
        program = torch.onnx.export(
            network,
            (example,),
            input_names=["photo"],
            output_names=list(outputs),
            dynamic_shapes={"photo": dynamic},
            opset_version=_OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    return program.model_proto


def add_metadata(model: Any, metadata: dict[str, str]) -> None:
    """Add metadata to the model: `spec` is for programs, the others are for people.

    Args:
        model: the ONNX model, changed in place.
        metadata: by key.
    """
    for key, value in metadata.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value


def _readable(spec: ModelSpec) -> dict[str, str]:
    return {
        "name": spec.name,
        "version": spec.version,
        "license": spec.licence,
        "sun_grid": spec.sun_grid,
        "training_data": spec.training_data,
        "preprocessing": "sRGB / 255, resized to fit, less mean, over std, centred on a canvas of zeros",
    }


def _parity(ensemble: _Ensemble, path: Path) -> float:
    """Largest difference between torch and onnxruntime on fixed inputs, relative to each output's largest value."""
    model = Model.load(path)
    rng = np.random.default_rng(0)
    batch = rng.normal(0, 1, (5, 3, model.spec.height, model.spec.width)).astype(np.float32)
    with torch.inference_mode():
        expected = [output.numpy() for output in ensemble(torch.from_numpy(batch))]
    answers = model.session.run(ensemble.outputs, {"photo": batch})
    return float(np.max([np.abs(a - b).max() / np.abs(a).max() for a, b in zip(expected, answers, strict=True)]))
