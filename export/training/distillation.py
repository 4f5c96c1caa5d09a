"""Distillation [1]: what earlier runs answer together is a second target of every crop.

Pictures are blended, so that answers are compared where no place is remembered [2].

References:
    [1] Hinton et al., Distilling the knowledge in a neural network, 2015.
    [2] Beyer et al., Knowledge distillation: a good teacher is patient and consistent, CVPR 2022.
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
from lighting.prediction import ModelSpec

_MIN_SHARE = 0.5  # of a blended crop in its picture
_TEMPERATURE = 0.9  # divides the teachers' logits of the sun; their mean is broader than each of them
_ROLL = 3  # column of Batch.parameters


class TeacherEnsemble:
    """The averaged networks of finished runs, whose mean answer is a target.

    Args:
        folders: of the runs.
        spec: of the network that learns.
        device: to which the networks go.
        surroundings: whether the light around the camera is a target too.

    Raises:
        DataError: if a run has other outputs than `spec` or none for the light around.
    """

    def __init__(self, folders: Sequence[Path], spec: ModelSpec, device: torch.device, *, surroundings: bool) -> None:
        read = {folder: read_network(folder).requires_grad_(False) for folder in folders}
        for folder, network in read.items():
            if replace(read_spec(folder), version="") != replace(spec, version=""):
                raise DataError(f"{folder} cannot teach this run: its network has another form.")
            if surroundings and network.light is None:
                raise DataError(f"{folder} cannot teach --surroundings: it has not learnt them.")
        self.surroundings = surroundings
        self.networks = [
            network.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
            for network in read.values()
        ]

    @torch.no_grad()
    def targets(self, photo: Tensor) -> Batch:
        """The batch with the teachers' mean answers as its targets.

        Args:
            photo: (B, 3, H, W).
        """
        predicted = [NetworkOutput(*(part.float() for part in network(photo))) for network in self.networks]
        raw = _mean([one.raw for one in predicted])
        if camera := [mean_of_camera_bins(one.camera) for one in predicted if one.camera.shape[1]]:
            raw = torch.cat([raw[:, :2], _mean(camera), raw[:, 5:]], dim=1)
        light = _mean([one.light for one in predicted]) if self.surroundings else photo[:, 0, 0, :0]
        return Batch(
            photo=photo,
            sun=_mean([(one.sun / _TEMPERATURE).softmax(dim=1) for one in predicted]),
            parameters=decode_parameters(raw),
            sun_in_view=_mean([one.sun_in_view.softmax(dim=1) for one in predicted]),
            surroundings=_mean([one.surroundings for one in predicted]) if self.surroundings else light,
            light=torch.cat([light[:, :6], light[:, 6:].sigmoid()], dim=1),
            is_likelihood=torch.zeros(len(photo), dtype=torch.bool, device=photo.device),
        )


def _mean(values: Sequence[Tensor]) -> Tensor:
    return torch.stack(list(values)).mean(dim=0)


def add_mirror_images(batch: Batch) -> Batch:
    """The batch, and after it its mirror images, of which the parameters alone are known: the roll changes its sign.

    Args:
        batch: of B crops.
    """
    signs = torch.ones_like(batch.parameters)
    signs[:, _ROLL] = -1
    mirrored = _without_targets(batch, torch.ones(len(batch.photo), dtype=torch.bool, device=batch.photo.device))
    mirrored = mirrored._replace(photo=batch.photo.flip(3), parameters=signs * batch.parameters)
    return Batch(*(torch.cat([one, other]) for one, other in zip(batch, mirrored, strict=True)))


def blended_shares(count: int, share: float, *, mirrored: bool) -> Tensor:
    """Chances (count,) that a picture is blended: of mirror images, the second half, twice those of crops.

    Args:
        count: pictures in the batch.
        share: of the crops, 0 to 1.
        mirrored: whether mirror images follow the crops.
    """
    shares = torch.full((count,), share)
    if mirrored:
        shares[count // 2 :] = min(1.0, 2 * share)
    return shares


def blend_pictures(batch: Batch, shares: Tensor) -> Batch:
    """The batch with some of its pictures blended with their neighbors, which then have no targets.

    Args:
        batch: of B pictures.
        shares: (B,) chances of each to be blended, 0 to 1.
    """
    chosen = torch.rand(len(batch.photo), device=batch.photo.device) < shares.to(batch.photo.device)
    weight = torch.where(chosen, _MIN_SHARE + (1 - _MIN_SHARE) * torch.rand_like(chosen, dtype=torch.float32), 1.0)
    weight = weight[:, None, None, None].to(batch.photo)
    photo = weight * batch.photo + (1 - weight) * batch.photo.roll(1, dims=0)
    return _without_targets(batch, chosen)._replace(photo=photo.contiguous(memory_format=torch.channels_last))


def _without_targets(batch: Batch, chosen: Tensor) -> Batch:
    unknown = {"sun": 0.0, "parameters": math.nan, "sun_in_view": 0.0, "surroundings": math.nan, "light": math.nan}
    hidden = {name: torch.where(chosen[:, None], value, getattr(batch, name)) for name, value in unknown.items()}
    return batch._replace(**hidden)
