"""The network of normals as an ONNX file for any number of images and any size, compared with torch by number."""

import json
import logging
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from export.stereo.train import NormalsNetwork, averaged_network
from lighting.errors import ModelError
from lighting.files import atomic_write
from lighting.stereo.solver import BY_IMAGE, SHARED, Network, NormalFeatures

OPSET = 18
TOLERANCE = 2e-3  # largest difference between torch and onnxruntime, of normals and of errors [rad]


class _Served(nn.Module):
    """The network where every image is present."""

    def __init__(self, network: NormalsNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, by_image: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        """Normals and errors of planes (1, T, BY_IMAGE, H, W) and (1, SHARED, H, W)."""
        normal, error = self.network(by_image, torch.ones_like(by_image[:, :, 0, 0, 0]), shared)
        return normal, error


def export_normals(run: Path, target: Path, version: str) -> float:
    """Write the averaged network of a run; returns the largest difference to torch.

    Args:
        run: folder of the run.
        target: ONNX file to write.
        version: of the network.

    Raises:
        ModelError: where torch and onnxruntime differ by more than TOLERANCE.
    """
    import onnx

    network = averaged_network(run)
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(target) as path:
        model = _trace(_Served(network).eval())
        known = {"name": "normals", "version": version, "license": "Apache-2.0"}
        known["training"] = json.dumps(json.loads((run / "config.json").read_text()) | {"out": "", "meshes": ""})
        for key, value in known.items():
            entry = model.metadata_props.add()
            entry.key, entry.value = key, value
        onnx.checker.check_model(model)
        onnx.save_model(model, str(path), save_as_external_data=False)
        difference = _parity(network, path)
    if not difference <= TOLERANCE:
        raise ModelError(f"torch and onnxruntime differ by {difference:.2e}, more than {TOLERANCE:.0e}.")
    return difference


def _trace(served: _Served) -> Any:
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    side, moments = torch.export.Dim("side", min=2, max=4096), torch.export.Dim("moments", min=2, max=512)
    tall = torch.export.Dim("tall", min=2, max=4096)
    shapes = {"by_image": {1: moments, 3: 8 * tall, 4: 8 * side}, "shared": {2: 8 * tall, 3: 8 * side}}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the exporter's own use of torch
        program = torch.onnx.export(
            served,
            (torch.zeros(1, 8, BY_IMAGE, 32, 48), torch.ones(1, SHARED, 32, 48)),
            input_names=["by_image", "shared"],
            output_names=["normal", "error"],
            dynamic_shapes=shapes,
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    return program.model_proto


def _parity(network: NormalsNetwork, path: Path) -> float:
    """Largest difference between torch and onnxruntime on fixed inputs of another size and number of images."""
    rng = np.random.default_rng(0)
    by_image = rng.normal(0, 0.5, (5, BY_IMAGE, 56, 72)).astype(np.float32)
    shared = rng.normal(0, 0.5, (SHARED, 56, 72)).astype(np.float32)
    shared[-1] = 1
    with torch.inference_mode():
        expected = _Served(network)(torch.from_numpy(by_image)[None], torch.from_numpy(shared)[None])
    normal, error = Network.load(path, threads=1).predict(NormalFeatures(by_image, shared))
    answer = (np.moveaxis(normal, -1, 0), np.radians(error))
    return float(max(np.abs(a[0].numpy() - b).max() for a, b in zip(expected, answer, strict=True)))
