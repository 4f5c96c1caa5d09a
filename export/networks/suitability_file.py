"""The head of a finished file that says whether a photo suits: what it sees, and new weights for it.

Of a transformer it sees class tokens and means, which tell what is in the picture, and not the layout of what other
heads see. Of other networks it sees the pooled features. All else that the file computes stays as it is, to the bit.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import helper, numpy_helper
from torch import Tensor

from export.data.panoramas import DataError
from export.networks.onnx_graph import save_graph
from export.networks.outdoor_transformer import TOKENS
from lighting.model import Model, pad_to_input
from lighting.onnx_session import create_session, weights_path

_WEIGHT, _REDUCE = "suitable.weight", "reduce.weight"  # of each network that answers
_SHAPE = ("n", "features")  # of what a head sees, by name


class SuitabilityFile:
    """A finished file with a head for `suitable`.

    Attributes:
        spec: of its networks.
    """

    def __init__(self, file: Path) -> None:
        """Read the file.

        Args:
            file: of `write_onnx`; its weights lie beside it.

        Raises:
            DataError: its networks have no such head.
            ModelError: it is missing or damaged, or no network.
        """
        self.spec = Model.load(file, threads=1).spec
        self._model = onnx.load(str(file))
        products = {node.input[1]: node for node in self._model.graph.node if node.op_type == "Gemm"}
        self._heads = [node for name, node in products.items() if name.endswith(_WEIGHT)]
        if not self._heads:
            raise DataError(f"{file} cannot say whether a photo suits: its networks have not learnt --surroundings.")
        shared = [products.get(node.input[1].replace(_WEIGHT, _REDUCE), node) for node in self._heads]
        self._sources = [node.input[0] for node in shared]
        self._session = _open_session(self._model, self._sources)

    def features(self, pictures: Iterable[NDArray[np.uint8]]) -> Tensor:
        """What the heads see (N, F) of pictures (h, w, 3), as the file computes it for each alone.

        Args:
            pictures: no larger than the canvas.
        """
        canvases = (pad_to_input(np.ascontiguousarray(picture), self.spec)[None] for picture in pictures)
        rows = [np.concatenate([seen[:, :TOKENS] for seen in self._run(canvas)], axis=1) for canvas in canvases]
        return torch.from_numpy(np.concatenate(rows))

    def _run(self, canvas: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        seen: list[NDArray[np.float32]] = self._session.run(self._sources, {"photo": canvas})
        return seen

    def write(self, out: Path, weight: Tensor, bias: float, version: str | None = None) -> None:
        """Write the file with another head; the mean of its networks' logits is the head's.

        Args:
            out: ONNX file to write; its weights lie beside it.
            weight: (F,) of the features.
            bias: of the logit that a photo suits.
            version: of the network; None keeps it.
        """
        model = onnx.ModelProto()
        model.CopyFrom(self._model)
        nodes = {node.output[0]: node for node in model.graph.node}
        tensors = {tensor.name: tensor for tensor in model.graph.initializer}
        seen = self._run(np.zeros((1, 3, self.spec.height, self.spec.width), np.float32))
        parts = weight.chunk(len(self._heads))
        for head, source, values_seen, part in zip(self._heads, self._sources, seen, parts, strict=True):
            nodes[head.output[0]].input[0] = source
            _, name, name_of_bias = head.input
            padded = np.zeros((1, values_seen.shape[1]))
            padded[:, : len(part)] = len(parts) * part.numpy()
            for key, values in ((name, padded), (name_of_bias, np.array([bias]))):
                tensors[key].CopyFrom(numpy_helper.from_array(values.astype(np.float32), key))
        spec = replace(self.spec, version=version or self.spec.version)
        for entry in model.metadata_props:
            entry.value = {"version": spec.version, "spec": spec.to_json()}.get(entry.key, entry.value)
        out.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=out.parent) as folder:
            path = Path(folder, out.name)
            save_graph(model, path)
            weights_path(path).replace(weights_path(out))
            path.replace(out)


def _open_session(model: Any, outputs: list[str]) -> Any:
    """A session of the part of a model that these values need."""
    part = onnx.ModelProto()
    part.CopyFrom(model)
    needed, kept = {"photo", *outputs}, []
    for node in reversed(model.graph.node):
        if needed.intersection(node.output):
            kept.append(node)
            needed.update(node.input)
    graph = part.graph
    for field, values in (
        (graph.node, kept[::-1]),
        (graph.initializer, [tensor for tensor in model.graph.initializer if tensor.name in needed]),
        (graph.input, [port for port in model.graph.input if port.name in needed]),
        (
            graph.output,
            [helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, ("n", "features")) for name in outputs],
        ),
    ):
        del field[:]
        field.extend(values)
    with TemporaryDirectory() as folder:
        path = Path(folder, "features.onnx")
        save_graph(part, path)
        return create_session(path, threads=1)
