"""The mean of the weights of runs with a common beginning: one network, often better than each of them.

Wortsman et al., Model soups (ICML 2022).
"""

import json
from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor

from export.data import DataError
from export.networks.checkpoints import CHECKPOINT, averaged_weights, check_new
from export.networks.runs import RECORD, differ, history, read_record
from lighting.files import replacing


def merge(folders: Sequence[Path], out: Path) -> None:
    """Write `out` as the folder of a run whose weights are the mean of those of `folders`.

    The runs must share their beginning (`train --start`), or the mean is no useful network. Weights that only some runs
    have, such as those of the head `seen`, are averaged over these. DataError if the networks differ or if `out`
    already holds a run.
    """
    if differ(folders):
        raise DataError("The runs' networks differ, so their weights have no mean.")
    check_new(out)
    records = [read_record(f) for f in folders]
    weights = [averaged_weights(f) for f in folders]
    mean = {f"module.{name}": _mean([w[name] for w in weights if name in w]) for w in weights for name in w}
    names = dict.fromkeys(name for r in records for name in r["panoramas"]["train"])
    held_out = [name for name in records[0]["panoramas"]["tune"] if name not in names]
    record = {**records[0], "panoramas": {"train": list(names), "tune": held_out}, "merged": history(*records)}
    out.mkdir(parents=True, exist_ok=True)
    with replacing(out / RECORD) as path:
        path.write_text(json.dumps(record, indent=1))
    with replacing(out / CHECKPOINT) as path:
        torch.save({"average": mean}, path)


def _mean(values: Sequence[Tensor]) -> Tensor:
    return torch.stack(list(values)).mean(dim=0) if values[0].is_floating_point() else values[0]
