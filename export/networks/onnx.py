"""The averaged weights of one or several runs as one self-describing ONNX graph, compared numerically with torch.

The graph holds all networks and averages their probabilities and values; their weights lie in a file beside it.
"""

import json
import logging
import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch

from export.data import DataError
from export.networks.checkpoints import read_network
from export.networks.graph import forget_origin, save_graph, share, store_small
from export.networks.runs import describe_data, differ, history, read_record, read_spec
from export.networks.served import Served
from lighting.errors import ModelError
from lighting.model import Model, weights_path
from lighting.records import ModelSpec

OPSET = 18
TOLERANCE = 1e-3  # largest difference between torch and onnxruntime, relative to each output's largest value
ROUNDED = 3e-2  # the same once weights are stored small: that shifts the camera, and a seen sun with it


def write_onnx(
    folders: Sequence[Path],
    target: Path,
    *,
    temperature: float = 1.0,
    version: str | None = None,
    cameras: Sequence[Path] = (),
    elevation_scale: float = math.inf,
) -> float:
    """Write `target` and its weights from training folders; returns its difference to torch (see `parity`).

    `temperature` divides the suns' logits (Guo et al., ICML 2017); `cameras` and `elevation_scale` are those of
    `Served`. The version is the first run's unless another is given. DataError if the runs' networks expect different
    photos; ModelError if the file's answers differ from torch's by more than TOLERANCE, or by more than ROUNDED once
    its weights are stored small.
    """
    if differ([*folders, *cameras]):
        raise DataError("The runs' networks expect different photos, so they cannot answer together.")
    spec, known = _described(folders, version)
    known["cameras"] = json.dumps([history(read_record(f)) for f in cameras])
    networks, seeing = ([read_network(f) for f in some] for some in (folders, cameras))
    served = Served(networks, spec.sun_grid, temperature, seeing, elevation_scale).eval()
    known["networks"] = str(len(folders) + len(cameras))
    known |= {"temperature": f"{temperature:.3f}", "elevation_scale": f"{elevation_scale:g}"}
    target.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=target.parent) as folder:
        path = Path(folder, target.name)
        model = trace(served, spec)
        _add_metadata(model, {"spec": spec.to_json(), **_plain(spec), **known})
        save_graph(model, path)
        _check(parity(served, path), TOLERANCE)
        forget_origin(model)
        share(model)
        store_small(model)
        save_graph(model, path)
        difference = _check(parity(served, path), ROUNDED)
        _add_metadata(model, {"parity": f"{difference:.2e}"})
        save_graph(model, path)
        weights_path(path).replace(weights_path(target))
        path.replace(target)
    return difference


def _described(folders: Sequence[Path], version: str | None) -> tuple[ModelSpec, dict[str, str]]:
    """The spec of the file and the metadata that tell where its networks come from."""
    records, spec = [read_record(f) for f in folders], read_spec(folders[0])
    data = "; ".join(dict.fromkeys(describe_data(r) for r in records))
    commits = ", ".join(dict.fromkeys(run["commit"] for run in history(*records)))
    training = json.dumps([history(r) for r in records])
    known = {"commit": commits, "training": training}
    return replace(spec, training_data=data, version=version or spec.version), known


def _check(difference: float, allowed: float) -> float:
    if not difference <= allowed:  # nor is NaN agreement
        raise ModelError(f"torch and onnxruntime differ by {difference:.2e}, more than {allowed:.0e}.")
    return difference


def trace(served: Served, spec: ModelSpec) -> Any:
    """The network as an ONNX model whose batch may have any size."""
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it reports that torchvision's operators are missing
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of the exporter's own use of torch
        program = torch.onnx.export(
            served,
            (torch.zeros(2, 3, spec.height, spec.width),),
            input_names=["photo"],
            output_names=served.outputs,
            dynamic_shapes={"photo": {0: torch.export.Dim("batch", min=1)}},
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    return program.model_proto


def _add_metadata(model: Any, metadata: dict[str, str]) -> None:
    """Add what is known of the model: `spec` is for programs, the others are for people."""
    for key, value in metadata.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value


def _plain(spec: ModelSpec) -> dict[str, str]:
    return {
        "name": spec.name,
        "version": spec.version,
        "license": spec.licence,
        "sun_grid": spec.sun_grid,
        "training_data": spec.training_data,
        "preprocessing": "sRGB / 255, resized to fit, less mean, over std, centred on a canvas of zeros",
    }


def parity(served: Served, path: Path) -> float:
    """Largest difference between torch and onnxruntime on fixed inputs, relative to each output's largest value."""
    model = Model.load(path)
    rng = np.random.default_rng(0)
    batch = rng.normal(0, 1, (5, 3, model.spec.height, model.spec.width)).astype(np.float32)
    with torch.inference_mode():
        expected = [output.numpy() for output in served(torch.from_numpy(batch))]
    found = model.session.run(served.outputs, {"photo": batch})
    return float(np.max([np.abs(a - b).max() / np.abs(a).max() for a, b in zip(expected, found, strict=True)]))
