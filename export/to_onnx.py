"""A checkpoint's averaged weights as one ONNX file that describes itself, compared number by number with torch."""

import json
import logging
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from export.network import Served, build
from lighting.atomic import replacing
from lighting.model import OUTPUTS, Model
from lighting.parameters import ModelSpec

OPSET = 18
TOLERANCE = 1e-3  # largest difference between torch and onnxruntime, relative to each output's largest value


def read_checkpoint(folder: Path) -> tuple[nn.Module, ModelSpec, dict[str, Any]]:
    """The averaged network of a training folder, what it expects, and the run's record."""
    record = json.loads((folder / "config.json").read_text())
    values = record["spec"]
    spec = ModelSpec(**{**values, "mean": tuple(values["mean"]), "std": tuple(values["std"])})
    network = build(spec)
    state = torch.load(folder / "checkpoint.pt", map_location="cpu", weights_only=True)["average"]
    network.load_state_dict({k.removeprefix("module."): v for k, v in state.items() if k.startswith("module.")})
    return network.eval(), spec, record


def export(folder: Path, target: Path, *, temperature: float = 1.0) -> float:
    """Write `target` from a training folder; returns the parity (see `parity`), RuntimeError over TOLERANCE."""
    network, spec, record = read_checkpoint(folder)
    served = Served(network, temperature).eval()
    spec = replace(spec, training_data=describe_data(record))
    target.parent.mkdir(parents=True, exist_ok=True)
    with replacing(target) as path:
        write(served, spec, path, {"commit": record["commit"], "temperature": f"{temperature:.4f}"})
        difference = parity(served, path)
        if difference > TOLERANCE:
            raise RuntimeError(f"torch and onnxruntime differ by {difference:.2e}, more than {TOLERANCE:.0e}.")
        write(
            served,
            spec,
            path,
            {"commit": record["commit"], "temperature": f"{temperature:.4f}", "parity": f"{difference:.2e}"},
        )
    return difference


def describe_data(record: dict[str, Any]) -> str:
    """One sentence on what the network saw."""
    config, names = record["config"], record["panoramas"]["train"]
    which = "permissively licensed panoramas" if config["licensed_only"] else "panoramas, most with no stated licence"
    start = "from ImageNet weights, " if config["pretrained"] else ""
    return f"{start}{config['crops']} crops of {len(names)} outdoor {which}"


def write(served: Served, spec: ModelSpec, path: Path, extra: dict[str, str]) -> None:
    """Trace the network and attach its description: `spec` for programs, single keys for people."""
    import onnx

    model = _trace(served, torch.zeros(2, 3, spec.height, spec.width))
    for key, value in {"spec": spec.to_json(), **_plain(spec), **extra}.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    onnx.checker.check_model(model)
    onnx.save_model(model, str(path), save_as_external_data=False)


def _trace(served: Served, example: torch.Tensor) -> Any:
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it reports that torchvision's operators are missing
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of the exporter's own use of torch
        program = torch.onnx.export(
            served,
            (example,),
            input_names=["photo"],
            output_names=list(OUTPUTS),
            dynamic_shapes={"photo": {0: torch.export.Dim("batch", min=1)}},
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    return program.model_proto


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
    found = model.session.run(OUTPUTS, {"photo": batch})
    return max(float(np.abs(a - b).max() / np.abs(a).max()) for a, b in zip(expected, found, strict=True))
