"""Read a network's weights back from an ONNX file, to train it further.

The file has batch normalisation folded into the convolutions. The networks read back compute the same; `recalibrate`
gives them statistics again, so that they can train on.
"""

import json
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from export.data.panoramas import DataError
from export.networks.outdoor import HEADS, Outdoor, build_network
from export.networks.weights import CHECKPOINT, RECORD, check_new
from lighting.files.atomic import atomic_write
from lighting.records import ModelSpec

GROUPS = ("networks", "cameras")  # those of `Served`, in the order in which a file's networks are numbered


def read_onnx_network(file: Path, number: int) -> tuple[Outdoor, dict[str, str]]:
    """Network `number` (from 0) of a file, and the file's metadata; heads that did not ship have random weights.

    DataError if the file is none of `write_onnx`, or holds no such network.
    """
    import onnx

    model = _loaded(file)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    if "spec" not in metadata:
        raise DataError(f"{file} is not a lighting network: its metadata has no 'spec'.")
    spec = ModelSpec.from_json(metadata["spec"])
    if spec.name != "outdoor":
        raise DataError(f"{file} holds the network {spec.name}; only the network outdoor can be read back.")
    tensors = {t.name: onnx.numpy_helper.to_array(t) for t in model.graph.initializer}
    prefixes = _prefixes(tensors)
    if number >= len(prefixes):
        raise DataError(f"{file} holds no network number {number}.")
    prefix = prefixes[number]
    bins, around = (any(t.startswith(f"{prefix}{head}.") for t in tensors) for head in ("camera", "around"))
    network = build_network(spec, bins=bins, around=around)
    assert isinstance(network, Outdoor)
    missing, _ = network.load_state_dict(_weights(network, tensors, prefix), strict=False)
    if lost := [name for name in missing if not name.startswith((*HEADS, "sun.", "values."))]:
        raise DataError(f"{file} does not hold all weights of network number {number}: {lost[0]} is missing.")
    return network, metadata


def _loaded(file: Path) -> Any:
    """The ONNX model in a file; DataError if it is of another kind or damaged."""
    import onnx
    from google.protobuf.message import DecodeError

    try:
        return onnx.load(str(file))
    except DecodeError as error:
        raise DataError(f"{file} is not an ONNX file, or damaged.") from error


def _prefixes(tensors: Iterable[str]) -> list[str]:
    """What the tensors of each network are called, by the network's number."""
    known = {tuple(name.split(".", 2)[:2]) for name in tensors if name.startswith(GROUPS)}
    return [f"{group}.{number}." for group, number in sorted(known, key=lambda k: (GROUPS.index(k[0]), int(k[1])))]


def _weights(network: nn.Module, tensors: dict[str, Any], prefix: str) -> dict[str, Tensor]:
    """State of a network from a file's tensors; batch normalisation is left to change nothing but to add the bias."""
    found: dict[str, Tensor] = {}
    folded: dict[str, Tensor] = {}
    for name, module in network.named_modules():
        if isinstance(module, (nn.Conv2d, nn.Linear)):
            for key in ("weight", "bias"):
                value = _tensor(tensors, f"{prefix}{name}.{key}")
                if value is not None and getattr(module, key) is not None:
                    found[f"{name}.{key}"] = value
            bias = _tensor(tensors, f"{prefix}{name}.weight_bias")
            if bias is not None:
                folded[name] = bias
        elif isinstance(module, nn.BatchNorm2d) and (bias := folded.get(_before(name))) is not None:
            found |= {
                f"{name}.weight": torch.full_like(bias, (1 + module.eps) ** 0.5),
                f"{name}.bias": bias,
                f"{name}.running_mean": torch.zeros_like(bias),
                f"{name}.running_var": torch.ones_like(bias),
                f"{name}.num_batches_tracked": torch.tensor(0),
            }
    return found


def _before(name: str) -> str:
    """The name of the layer before one in a sequence."""
    parent, _, place = name.rpartition(".")
    return f"{parent}.{int(place) - 1}"


def _tensor(tensors: dict[str, Any], name: str) -> Tensor | None:
    """A tensor of the file in single precision, stored as it is, in half precision, or as bytes with a scale.

    Networks that share first layers, which training leaves as they are, have them under the name of one of them.
    """
    layer = name.split(".", 2)[2]
    others = [f"{group}.0.{layer}" for group in GROUPS] if _shared(name) else []
    for known in (name, *others):
        if known in tensors:
            return torch.from_numpy(np.array(tensors[known], dtype=np.float32))
        if f"{known}.half" in tensors:
            return torch.from_numpy(tensors[f"{known}.half"].astype(np.float32))
        if f"{known}.bytes" in tensors:
            values = tensors[f"{known}.bytes"].astype(np.float32)
            return torch.from_numpy(values * tensors[f"{known}.scale"].reshape(-1, *[1] * (values.ndim - 1)))
    return None


def _shared(name: str) -> bool:
    return any(f".backbone.{part}." in name for part in ("stem", "blocks.0", "blocks.1", "blocks.2"))


def recalibrate_batch_norm(network: nn.Module, photos: Iterable[Tensor]) -> None:
    """Give batch normalisations that change nothing the statistics of photos (B, 3, H, W), at the same answers."""
    sums: dict[nn.BatchNorm2d, list[Tensor]] = {}

    def look(module: nn.Module, inputs: tuple[Tensor, ...]) -> None:
        assert isinstance(module, nn.BatchNorm2d)
        x = inputs[0]
        new = torch.stack([x.mean(dim=(0, 2, 3)), (x * x).mean(dim=(0, 2, 3))])
        sums.setdefault(module, []).append(new)

    trained = [m for m in network.modules() if isinstance(m, nn.BatchNorm2d) and m.weight.requires_grad]
    hooks = [module.register_forward_pre_hook(look) for module in trained]
    network.eval()
    with torch.inference_mode():
        for batch in photos:
            network(batch)
    for hook in hooks:
        hook.remove()
    for module, seen in sums.items():
        mean, square = torch.stack(seen).mean(dim=0).clone()
        _restate(module, mean, (square - mean**2).clamp_min(1e-6))


def _restate(module: nn.BatchNorm2d, mean: Tensor, variance: Tensor) -> None:
    """Give a batch normalisation these statistics at the same answers."""
    before, spread = module.running_mean, module.running_var
    assert before is not None
    assert spread is not None
    with torch.no_grad():
        slope = module.weight / (spread + module.eps).sqrt()
        shift = module.bias - before * slope
        module.weight.copy_(slope * (variance + module.eps).sqrt())
        module.bias.copy_(shift + slope * mean)
        before.copy_(mean)
        spread.copy_(variance)


def write_run(network: Outdoor, metadata: dict[str, str], file: Path, number: int, out: Path) -> None:
    """Write a network that was read back as the folder of a run, to start from; DataError if `out` holds a run."""
    check_new(out)
    before = [run for group in ("training", *GROUPS[1:]) for run in json.loads(metadata.get(group, "[]"))]
    spec = ModelSpec.from_json(metadata["spec"])
    record = {
        "spec": asdict(replace(spec, training_data="")),
        "merged": before[number],
        "panoramas": {"train": [], "tune": []},
        "file": file.name,
        "training_data": spec.training_data,
    }
    out.mkdir(parents=True, exist_ok=True)
    with atomic_write(out / RECORD) as path:
        path.write_text(json.dumps(record, indent=1))
    with atomic_write(out / CHECKPOINT) as path:
        torch.save({"average": {f"module.{name}": value for name, value in network.state_dict().items()}}, path)
