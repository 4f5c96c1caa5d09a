"""The weights that a training folder holds."""

from pathlib import Path

import torch
from torch import Tensor, nn

from export.data import DataError
from export.networks.network import build, load_weights
from export.networks.runs import read_spec

CHECKPOINT = "checkpoint.pt"
LEARNT = {"sees": "seen.", "bins": "camera.", "around": "light."}  # parts of a network, and a head of each


def averaged_weights(folder: Path) -> dict[str, Tensor]:
    """The averaged weights of a run, by the network's own names; DataError if the folder holds none."""
    if not (folder / CHECKPOINT).is_file():
        raise DataError(f"{folder} is not the folder of a training run: it holds no {CHECKPOINT}.")
    average = torch.load(folder / CHECKPOINT, map_location="cpu", weights_only=True)["average"]
    return {name.removeprefix("module."): value for name, value in average.items() if name.startswith("module.")}


def read_network(folder: Path) -> nn.Module:
    """The averaged network of a training folder, ready to answer."""
    weights = averaged_weights(folder)
    has = {part: any(name.startswith(head) for name in weights) for part, head in LEARNT.items()}
    network = build(read_spec(folder), **has)
    load_weights(network, weights)
    return network.eval()
