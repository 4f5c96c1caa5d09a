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
from torch.utils.data import DataLoader

from export.network import Served, build
from export.panoramas import DataError, read_index
from export.train import Crops, TrainConfig, averaged_weights, load_sources
from lighting.atomic import replacing
from lighting.errors import ModelError
from lighting.model import OUTPUTS, Model
from lighting.parameters import ModelSpec

OPSET = 18
TEMPERATURES = [round(0.5 * 1.02**i, 3) for i in range(90)]  # 0.5 to 3
TOLERANCE = 1e-3  # largest difference between torch and onnxruntime, relative to each output's largest value


def read_record(folder: Path) -> dict[str, Any]:
    """What a training folder says of its run; DataError if it holds none."""
    try:
        record: dict[str, Any] = json.loads((folder / "config.json").read_text())
    except (OSError, ValueError) as error:
        raise DataError(f"{folder} is not the folder of a training run: {error}.") from error
    return record


def read_spec(folder: Path) -> ModelSpec:
    """What the network of a training folder expects."""
    return ModelSpec.from_json(json.dumps(read_record(folder)["spec"]))


def read_network(folder: Path) -> nn.Module:
    """The averaged network of a training folder, ready to answer."""
    network = build(read_spec(folder))
    network.load_state_dict(averaged_weights(folder))
    return network.eval()


def fit_temperature(network: nn.Module, crops: Crops, batch: int = 32) -> float:
    """The divisor of the sun's logits that makes held-out crops likeliest (Guo et al., ICML 2017); 1 without any."""
    logits, targets = [], []
    with torch.inference_mode():
        for part in DataLoader(crops, batch_size=batch):
            known = part.sun.sum(dim=1) > 0.5
            logits.append(network(part.photo)[0][known])
            targets.append(part.sun[known])
    if not sum(len(part) for part in targets):
        return 1.0
    sun, target = torch.cat(logits), torch.cat(targets)
    costs = {t: float(-(target * (sun / t).log_softmax(dim=1)).sum(dim=1).mean()) for t in TEMPERATURES}
    return min(costs, key=costs.__getitem__)


def held_out_crops(folder: Path) -> Crops:
    """The crops of the training places that the run held out."""
    record = read_record(folder)
    config = TrainConfig(**record["config"])
    names = set(record["panoramas"]["tune"])
    panoramas = [p for p in read_index(config.data, "train") if p.name in names]
    return Crops(load_sources(panoramas, config.labels), read_spec(folder), config, tune=True)


def export(folder: Path, target: Path, *, temperature: float | None = None, version: str | None = None) -> float:
    """Write `target` from a training folder; returns the parity (see `parity`), ModelError over TOLERANCE.

    Without a temperature it is fitted on the training places that the run held out; the version is the run's unless
    another is given.
    """
    record = read_record(folder)
    network = read_network(folder)
    divisor = fit_temperature(network, held_out_crops(folder)) if temperature is None else temperature
    served = Served(network, divisor).eval()
    spec = replace(read_spec(folder), training_data=describe_data(record))
    spec = replace(spec, version=version or spec.version)
    known = {"commit": record["commit"], "temperature": f"{divisor:.3f}"}
    target.parent.mkdir(parents=True, exist_ok=True)
    with replacing(target) as path:
        model = trace(served, spec)
        save(model, {"spec": spec.to_json(), **_plain(spec), **known}, path)
        difference = parity(served, path)
        if difference > TOLERANCE:
            raise ModelError(f"torch and onnxruntime differ by {difference:.2e}, more than {TOLERANCE:.0e}.")
        save(model, {"parity": f"{difference:.2e}"}, path)
    return difference


def describe_data(record: dict[str, Any]) -> str:
    """One sentence on what the network saw."""
    config, names = record["config"], record["panoramas"]["train"]
    which = "permissively licensed panoramas" if config["licensed_only"] else "panoramas, most with no stated licence"
    start = "from ImageNet weights, " if config["pretrained"] else ""
    return f"{start}{config['crops']} crops of {len(names)} outdoor {which}"


def trace(served: Served, spec: ModelSpec) -> Any:
    """The network as an ONNX model whose batch may have any size."""
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it reports that torchvision's operators are missing
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of the exporter's own use of torch
        program = torch.onnx.export(
            served,
            (torch.zeros(2, 3, spec.height, spec.width),),
            input_names=["photo"],
            output_names=list(OUTPUTS),
            dynamic_shapes={"photo": {0: torch.export.Dim("batch", min=1)}},
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    return program.model_proto


def save(model: Any, metadata: dict[str, str], path: Path) -> None:
    """Add metadata to the model (`spec` is for programs, the others for people) and write it as one checked file."""
    import onnx

    for key, value in metadata.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    onnx.checker.check_model(model)
    onnx.save_model(model, str(path), save_as_external_data=False)


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
