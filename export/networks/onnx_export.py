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
import torch
from torch import Tensor, nn

from export.data.panoramas import DataError
from export.networks.ensemble import NetworkEnsemble, find_backbone
from export.networks.onnx_graph import (
    MIN_BYTES,
    fuse_nodes,
    merge_equal_nodes,
    multiply_pointwise,
    quantize_products,
    save_graph,
    store_small,
    strip_origin,
)
from export.networks.outdoor import reduce_light_heads
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
from lighting.model import Model
from lighting.onnx_session import weights_path
from lighting.prediction import ModelSpec

_OPSET = 20
_TOLERANCE = 1e-3  # largest difference between torch and onnxruntime, relative to each output's largest value
ROUNDED_TOLERANCE = 3e-2  # the same once weights are stored small: that shifts the camera, and a sun in view with it
_WHOLE_TOLERANCE = 0.25  # the same where products are of whole numbers: of noise, a doubtful sun moves


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
        suns: folders of further runs whose networks answer for the sun and the light, with those of `folders`.

    Raises:
        DataError: if the runs' networks expect different photos, or the branch does not fit the first of them.
        ModelError: the answers differ from torch's by more than _TOLERANCE; with weights in half precision by more than
            ROUNDED_TOLERANCE, with products of whole numbers by more than _WHOLE_TOLERANCE.
    """
    if have_different_specs([*folders, *suns, *cameras]):
        raise DataError("The runs' networks expect different photos, so they cannot answer together.")
    spec, metadata = _describe({"training": folders, "suns": suns, "cameras": cameras}, version)
    networks, of_suns, of_cameras = ([_read_folded(f) for f in some] for some in (folders, suns, cameras))
    for network in of_suns:
        reduce_light_heads(network)
    branch = None
    if segments is not None:
        branch = SegmentationBranch.read(segments)
        branch.check_beginning(find_backbone([*networks, *of_suns]), spec.height, spec.width)
        metadata["segments"] = str(read_record(segments)["training_data"])
    parts = (temperature, of_cameras, elevation_scale, branch, of_suns)
    ensemble = NetworkEnsemble(networks, spec.sun_grid, *parts).eval()
    metadata["networks"] = str(len(folders) + len(suns) + len(cameras))
    metadata |= {"temperature": f"{temperature:.3f}", "elevation_scale": f"{elevation_scale:g}"}
    target.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=target.parent) as folder:
        path = Path(folder, target.name)
        examples = {"photo": torch.zeros(2, 3, spec.height, spec.width)}
        model = trace_onnx(ensemble, examples, ensemble.outputs, {"photo": {0: torch.export.Dim("batch", min=1)}})
        add_metadata(model, {"spec": spec.to_json(), **_readable(spec), **metadata})
        save_graph(model, path)
        check_parity(_parity(ensemble, path), _TOLERANCE)
        strip_origin(model)
        merge_equal_nodes(model)
        multiply_pointwise(model)
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


def _store_as_small_as_agrees(model: Any, ensemble: NetworkEnsemble, path: Path, tolerance: float) -> tuple[Any, float]:
    """The model with large weights as bytes, or else all in half precision, on disk; and its difference to torch."""
    for min_bytes in (MIN_BYTES, sys.maxsize):
        small = copy.deepcopy(model)
        store_small(small, min_bytes)
        save_graph(small, path)
        difference = _parity(ensemble, path)
        if difference <= tolerance:
            break
    return small, check_parity(difference, tolerance)


def _describe(groups: dict[str, Sequence[Path]], version: str | None) -> tuple[ModelSpec, dict[str, str]]:
    """The spec of the file and the metadata that tell where its networks come from."""
    records = {name: [read_record(f) for f in folders] for name, folders in groups.items()}
    ours, spec = records["training"], read_spec(groups["training"][0])
    data = "; ".join(dict.fromkeys(map(describe_data, ours)))
    commits = ", ".join(dict.fromkeys(run["commit"] for run in training_history(*ours)))
    histories = {name: json.dumps(list(map(training_history, some))) for name, some in records.items()}
    return replace(spec, training_data=data, version=version or spec.version), {"commit": commits, **histories}


def check_parity(difference: float, allowed: float) -> float:
    """Return by how much torch and onnxruntime differ; ModelError where that is too much.

    Args:
        difference: of their answers.
        allowed: the most.
    """
    if not difference <= allowed:  # nor is NaN agreement
        raise ModelError(f"torch and onnxruntime differ by {difference:.2e}, more than {allowed:.0e}.")
    return difference


def trace_onnx(
    network: nn.Module, examples: dict[str, Tensor], outputs: Sequence[str], axes: dict[str, Any], opset: int = _OPSET
) -> Any:
    """A network as an ONNX model.

    Args:
        network: to trace.
        examples: of its inputs, by their names, in order.
        outputs: their names.
        axes: of each input, by its name, the axes of any size, each a torch.export.Dim.
        opset: version of ONNX's operators.
    """
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it reports that torchvision's operators are missing
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the exporter's own use of torch
        program = torch.onnx.export(
            network,
            tuple(examples.values()),
            input_names=list(examples),
            output_names=list(outputs),
            dynamic_shapes=axes,
            opset_version=opset,
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


def _parity(ensemble: NetworkEnsemble, path: Path) -> float:
    """Largest difference between torch and onnxruntime on fixed inputs, relative to each output's largest value."""
    model = Model.load(path)
    rng = np.random.default_rng(0)
    batch = rng.normal(0, 1, (5, 3, model.spec.height, model.spec.width)).astype(np.float32)
    with torch.inference_mode():
        expected = [output.numpy() for output in ensemble(torch.from_numpy(batch))]
    answers = model.session.run(ensemble.outputs, {"photo": batch})
    return float(np.max([np.abs(a - b).max() / np.abs(a).max() for a, b in zip(expected, answers, strict=True)]))
