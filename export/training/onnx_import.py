"""A shipped network, read back from its ONNX file as the folder of a run that training can start from.

The file has batch normalisation folded into the convolutions. The network read back computes the same;
`_recalibrate_batch_norm` gives it statistics again, so that it can train on.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.utils.data import DataLoader

from export.crops.crops import load_sources
from export.data.panoramas import DataError
from export.networks.outdoor import HEADS
from export.networks.outdoor_transformer import OutdoorTransformer
from export.networks.weights import check_new, make_network, write_run
from export.training.dataset import TrainConfig, TrainingCrops, training_panoramas
from lighting.fields import Json
from lighting.prediction import ModelSpec

_GROUPS = ("networks", "suns", "cameras")  # in the order in which a file's networks are numbered
_CROPS = 768  # that the statistics are taken from
_BATCH = 32


def unpack_network(file: Path, number: int, config: TrainConfig) -> None:
    """Write a network of an ONNX file into `config.out`, with statistics of training crops.

    Args:
        file: the graph; its weights lie beside it.
        number: of the network, from 0.
        config: names the data, their labels and the folder to write.

    Raises:
        DataError: if the file holds no such network or if the folder holds a run.
    """
    check_new(Path(config.out))
    network, metadata = _read_onnx_network(file, number)
    _recalibrate_batch_norm(network, _training_photos(config, ModelSpec.from_json(metadata["spec"])))
    write_run(Path(config.out), _make_record(metadata, file, number), network.state_dict())


def _training_photos(config: TrainConfig, spec: ModelSpec) -> Iterator[Tensor]:
    kept, _ = training_panoramas(config)
    crops = TrainingCrops(load_sources(kept, config.labels), spec, config)
    with torch.inference_mode():
        for batch in DataLoader(crops, _BATCH, sampler=range(_CROPS), num_workers=config.workers):
            yield batch.photo.to(memory_format=torch.channels_last)


def _read_onnx_network(file: Path, number: int) -> tuple[nn.Module, dict[str, str]]:
    """Network `number` (from 0) of a file, and the file's metadata; heads that did not ship have random weights.

    DataError if the file is none of `write_onnx`, or holds no such network.
    """
    import onnx
    from google.protobuf.message import DecodeError

    try:
        model = onnx.load(str(file))
    except DecodeError as error:
        raise DataError(f"{file} is not an ONNX file, or damaged.") from error
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
    names = (name.removeprefix(prefix) for name in tensors if name.startswith(prefix))
    network = make_network(spec, names, pretrained=True)
    if isinstance(network, OutdoorTransformer):
        state = network.state_dict() | _transformer_weights(network, model.graph, tensors, prefix)
    else:
        state = _weights(network, tensors, prefix)
    missing, _ = network.load_state_dict(state, strict=False)
    if lost := [name for name in missing if not name.startswith((*HEADS, "sun.", "values."))]:
        raise DataError(f"{file} does not hold all weights of network number {number}: {lost[0]} is missing.")
    if isinstance(network, OutdoorTransformer):
        network.trunk.unfold()
    return network, metadata


def _prefixes(tensors: Iterable[str]) -> list[str]:
    """What the tensors of each network are called, by the network's number."""
    groups = {tuple(name.split(".", 2)[:2]) for name in tensors if name.startswith(_GROUPS)}
    return [f"{group}.{number}." for group, number in sorted(groups, key=lambda k: (_GROUPS.index(k[0]), int(k[1])))]


def _weights(network: nn.Module, tensors: dict[str, NDArray[Any]], prefix: str) -> dict[str, Tensor]:
    """State of a network from a file's tensors; batch normalisation is left to change nothing but to add the bias."""
    state: dict[str, Tensor] = {}
    folded: dict[str, Tensor] = {}
    for name, module in network.named_modules():
        if isinstance(module, (nn.Conv2d, nn.Linear)):
            for key in ("weight", "bias"):
                value = _find_tensor(tensors, f"{prefix}{name}.{key}")
                value = _of_reduced(tensors, f"{prefix}{name}", key) if value is None else value
                if value is not None and (own := getattr(module, key)) is not None:
                    state[f"{name}.{key}"] = value.reshape(own.shape)  # some convolutions are written with one axis
            bias = _find_tensor(tensors, f"{prefix}{name}.weight_bias")
            if bias is not None:
                folded[name] = bias
        elif isinstance(module, nn.BatchNorm2d) and (bias := folded.get(_before(name))) is not None:
            state |= {
                f"{name}.weight": torch.full_like(bias, (1 + module.eps) ** 0.5),
                f"{name}.bias": bias,
                f"{name}.running_mean": torch.zeros_like(bias),
                f"{name}.running_var": torch.ones_like(bias),
                f"{name}.num_batches_tracked": torch.tensor(0),
            }
    return state


def _of_reduced(tensors: dict[str, NDArray[Any]], layer: str, key: str) -> Tensor | None:
    """Weights or bias of a layer that `reduce_light_heads` split in two; None if the file has no such layer."""
    narrow, wide = (_find_tensor(tensors, f"{layer}.{part}.weight") for part in (0, 1))
    if narrow is None or wide is None:
        return None
    return wide @ narrow if key == "weight" else _find_tensor(tensors, f"{layer}.1.bias")


def _transformer_weights(
    network: nn.Module, graph: Any, tensors: dict[str, NDArray[Any]], prefix: str
) -> dict[str, Tensor]:
    """State of a transformer from a file's graph and tensors, its constants multiplied out.

    What embeds the patches is the wheel's, for it never learns.
    """
    users = {name: node for node in graph.node for name in node.input}
    makers = {name: node for node in graph.node for name in node.output}
    state: dict[str, Tensor] = {}
    for name, module in network.named_modules():
        bias = _find_tensor(tensors, f"{prefix}{name}.bias")
        if bias is None or not isinstance(module, (nn.Linear, nn.LayerNorm)) or name == "suitable":
            continue
        weight = _find_tensor(tensors, f"{prefix}{name}.weight")
        if weight is None:  # of a product, which is known by the bias that is added
            node = users[f"{prefix}{name}.bias"]
            product = node if "MatMul" in node.op_type else makers[node.input[0]]
            weight = _find_tensor(tensors, product.input[1])
            assert weight is not None
            if f"{product.input[1]}.scale" not in tensors:  # those of whole numbers are turned already
                weight = weight.T.contiguous()
        state |= {f"{name}.weight": weight, f"{name}.bias": bias}
    return state


def _before(name: str) -> str:
    """The name of the layer before one in a sequence."""
    parent, _, index = name.rpartition(".")
    return f"{parent}.{int(index) - 1}"


def _find_tensor(tensors: dict[str, NDArray[Any]], name: str) -> Tensor | None:
    """A tensor of the file in single precision, stored as it is, in half precision, or as bytes with a scale.

    Weights of whole-number products come out as (outputs, inputs).
    Networks that share first layers, which training leaves as they are, have them under the name of one of them.
    """
    layer = name.split(".", 2)[-1]
    shared = any(f".backbone.{part}." in name for part in ("stem", "blocks.0", "blocks.1", "blocks.2"))
    beginning = f"beginning.{layer.removeprefix('backbone.')}"
    others = [*(f"{group}.0.{layer}" for group in _GROUPS), beginning] if shared else []
    for key in (name, *others):
        if key in tensors and f"{key}.scale" in tensors:
            return torch.from_numpy((tensors[key].astype(np.float32) * tensors[f"{key}.scale"]).T.copy())
        if key in tensors:
            return torch.from_numpy(np.array(tensors[key], dtype=np.float32))
        if f"{key}.half" in tensors:
            return torch.from_numpy(tensors[f"{key}.half"].astype(np.float32))
        if f"{key}.bytes" in tensors:
            values = tensors[f"{key}.bytes"].astype(np.float32)
            return torch.from_numpy(values * tensors[f"{key}.scale"].reshape(-1, *[1] * (values.ndim - 1)))
    return None


def _recalibrate_batch_norm(network: nn.Module, photos: Iterable[Tensor]) -> None:
    """Give batch normalisations that change nothing the statistics of photos (B, 3, H, W), at the same answers."""
    sums: dict[nn.BatchNorm2d, list[Tensor]] = {}

    def add_sums(module: nn.Module, inputs: tuple[Tensor, ...]) -> None:
        assert isinstance(module, nn.BatchNorm2d)
        x = inputs[0]
        new = torch.stack([x.mean(dim=(0, 2, 3)), (x * x).mean(dim=(0, 2, 3))])
        sums.setdefault(module, []).append(new)

    trained = [m for m in network.modules() if isinstance(m, nn.BatchNorm2d) and m.weight.requires_grad]
    if not trained:  # as in a transformer
        return
    hooks = [module.register_forward_pre_hook(add_sums) for module in trained]
    network.eval()
    with torch.inference_mode():
        for batch in photos:
            network(batch)
    for hook in hooks:
        hook.remove()
    for module, moments in sums.items():
        mean, square = torch.stack(moments).mean(dim=0).clone()
        _set_statistics(module, mean, (square - mean**2).clamp_min(1e-6))


def _set_statistics(module: nn.BatchNorm2d, mean: Tensor, variance: Tensor) -> None:
    """Give a batch normalisation these statistics at the same answers."""
    old_mean, old_variance = module.running_mean, module.running_var
    assert old_mean is not None
    assert old_variance is not None
    with torch.no_grad():
        slope = module.weight / (old_variance + module.eps).sqrt()
        shift = module.bias - old_mean * slope
        module.weight.copy_(slope * (variance + module.eps).sqrt())
        module.bias.copy_(shift + slope * mean)
        old_mean.copy_(mean)
        old_variance.copy_(variance)


def _make_record(metadata: dict[str, str], file: Path, number: int) -> Json:
    """The record of a run for a network that was read back."""
    before = [run for group in ("training", *_GROUPS[1:]) for run in json.loads(metadata.get(group, "[]"))]
    spec = ModelSpec.from_json(metadata["spec"])
    return {
        "spec": asdict(replace(spec, training_data="")),
        "merged": before[number],
        "panoramas": {"train": [], "tune": []},
        "file": file.name,
        "training_data": spec.training_data,
    }
