"""Learning from earlier runs: what they answer together is a second target of every crop.

Hinton et al., Distilling the knowledge in a neural network (2015). Pictures are blended, so that answers are compared
where no place is remembered: Beyer et al., Knowledge distillation: a good teacher is patient and consistent (CVPR
2022).
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor

from export.data.panoramas import DataError
from export.networks.backbone import NetworkOutput
from export.networks.outdoor import decode_parameters, mean_of_camera_bins
from export.networks.weights import read_network, read_spec
from export.training.dataset import Batch
from lighting.records import ModelSpec

LEAST_SHARE = 0.5  # of a blended crop in its picture


class TeacherEnsemble:
    """The averaged networks of finished runs, whose mean answer is a target; with `around`, of the light around, too.

    DataError if a run has other outputs than `spec` or none for the light around.
    """

    def __init__(self, folders: Sequence[Path], spec: ModelSpec, device: torch.device, *, around: bool) -> None:
        read = {folder: read_network(folder).requires_grad_(False) for folder in folders}
        for folder, network in read.items():
            if replace(read_spec(folder), version="") != replace(spec, version=""):
                raise DataError(f"{folder} cannot teach this run: its network has another form.")
            if around and network.light is None:
                raise DataError(f"{folder} cannot teach --surroundings: it has not learnt them.")
        self.around = around
        self.networks = [
            network.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
            for network in read.values()
        ]

    @torch.no_grad()
    def targets(self, photo: Tensor) -> Batch:
        """The batch (B, 3, H, W) with the teachers' mean answers in place of what is known of its crops."""
        said = [NetworkOutput(*(part.float() for part in network(photo))) for network in self.networks]
        raw = _mean([one.raw for one in said])
        if camera := [mean_of_camera_bins(one.camera) for one in said if one.camera.shape[1]]:
            raw = torch.cat([raw[:, :2], _mean(camera), raw[:, 5:]], dim=1)
        light = _mean([one.light for one in said]) if self.around else photo[:, 0, 0, :0]
        return Batch(
            photo=photo,
            sun=_mean([one.sun.softmax(dim=1) for one in said]),
            parameters=decode_parameters(raw),
            seen=_mean([one.seen.softmax(dim=1) for one in said]),
            around=_mean([one.around for one in said]) if self.around else light,
            light=torch.cat([light[:, :6], light[:, 6:].sigmoid()], dim=1),
            likely=torch.zeros(len(photo), dtype=torch.bool, device=photo.device),
        )


def _mean(values: Sequence[Tensor]) -> Tensor:
    return torch.stack(list(values)).mean(dim=0)


def mixup(batch: Batch, share: float) -> Batch:
    """The batch with a share of its pictures blended with their neighbours; of these, nothing is known any more."""
    count = len(batch.photo)
    chosen = torch.rand(count, device=batch.photo.device) < share
    own = torch.where(chosen, LEAST_SHARE + (1 - LEAST_SHARE) * torch.rand_like(chosen, dtype=torch.float32), 1.0)
    own = own[:, None, None, None].to(batch.photo)
    photo = own * batch.photo + (1 - own) * batch.photo.roll(1, dims=0)
    unknown = {"sun": 0.0, "parameters": math.nan, "seen": 0.0, "around": math.nan, "light": math.nan}
    hidden = {name: torch.where(chosen[:, None], value, getattr(batch, name)) for name, value in unknown.items()}
    return batch._replace(photo=photo.contiguous(memory_format=torch.channels_last), **hidden)
