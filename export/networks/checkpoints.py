"""The weights that a training folder holds."""

from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from torch import Tensor, nn

from export.data import DataError
from export.networks.network import build, load_weights
from export.networks.runs import read_spec

CHECKPOINT = "checkpoint.pt"
LEARNT = {"sees": "seen.", "bins": "camera.", "around": "light."}  # parts of a network, and a head of each


def check_new(folder: Path) -> None:
    """Raise DataError where a folder to be written already holds a run, or is a file."""
    if folder.exists() and not folder.is_dir():
        raise DataError(f"{folder} is a file; a run takes a folder.")
    if (folder / CHECKPOINT).exists():
        raise DataError(f"{folder} already holds a run.")


def read_checkpoint(folder: Path, device: torch.device | str = "cpu") -> dict[str, Any]:
    """What the checkpoint of a run holds: at least `average`, the state of the averaged network.

    DataError if the folder holds no checkpoint or a damaged one.
    """
    path = folder / CHECKPOINT
    if not path.is_file():
        raise DataError(f"{folder} is not the folder of a training run: it holds no {CHECKPOINT}.")
    try:
        state: dict[str, Any] = torch.load(path, map_location=device, weights_only=True)
    except (RuntimeError, ValueError, EOFError, UnpicklingError) as error:
        raise DataError(f"{path} is cut short or damaged.") from error
    return state


def averaged_weights(folder: Path) -> dict[str, Tensor]:
    """The averaged weights of a run, by the network's own names; DataError as of `read_checkpoint`."""
    average = read_checkpoint(folder)["average"]
    return {name.removeprefix("module."): value for name, value in average.items() if name.startswith("module.")}


def read_network(folder: Path) -> nn.Module:
    """The averaged network of a training folder, ready to answer."""
    weights = averaged_weights(folder)
    has = {part: any(name.startswith(head) for name in weights) for part, head in LEARNT.items()}
    network = build(read_spec(folder), **has)
    load_weights(network, weights)
    return network.eval()
