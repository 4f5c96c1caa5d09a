"""What training minimizes, and distillation [1]: what earlier runs answer together is a second target of every crop.

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
from torch.nn import functional as F

from export.data.panoramas import DataError
from export.networks.backbone import NetworkOutput
from export.networks.outdoor import camera_bin_targets, decode_parameters, encode_parameters, mean_of_camera_bins
from export.networks.weights import read_network, read_spec
from export.training.dataset import Batch
from lighting.prediction import ModelSpec

_MIN_LIKELIHOOD = 1e-9
_PARAMETER_WEIGHTS = (0.5, 0.5, 1.5, 1.0, 1.0)  # turbidity, exposure, camera elevation, roll, field of view
_SURROUNDINGS_WEIGHT = 3.0  # of the light around the camera
_CAMERA_WEIGHT = 0.25  # of each angle's bins
_LIGHT_WEIGHT = 0.5


def training_losses(predicted: NetworkOutput, batch: Batch) -> dict[str, Tensor]:
    """Mean losses of one batch by name, each over the crops that have the target.

    Args:
        predicted: what the network predicts of the batch.
        batch: the targets.
    """
    target = torch.cat([encode_parameters(batch.parameters[:, :5]), batch.parameters[:, 5:]], dim=1)
    finite = torch.isfinite(target)
    target = torch.where(finite, target, torch.zeros_like(target))
    fit = F.smooth_l1_loss(predicted.raw[:, :5].float(), target[:, :5], reduction="none", beta=0.3)
    shining = F.binary_cross_entropy_with_logits(predicted.raw[:, 5].float(), target[:, 5], reduction="none")
    by_parameter = _masked_mean(fit, finite[:, :5])
    parts = {
        "sun": _sun(predicted.sun, batch),
        "parameters": (by_parameter * by_parameter.new_tensor(_PARAMETER_WEIGHTS)).sum(),
        "visibility": _masked_mean(shining, finite[:, 5]),
    }
    if predicted.sun_in_view.shape[1]:
        parts["seen"] = _cross_entropy(predicted.sun_in_view, batch.sun_in_view)
    if predicted.surroundings.shape[1]:
        parts["around"] = _SURROUNDINGS_WEIGHT * _surroundings(predicted.surroundings.float(), batch.surroundings)
    if predicted.camera.shape[1]:
        parts["camera"] = _CAMERA_WEIGHT * _camera(predicted.camera, target[:, 2:5], finite[:, 2:5])
    if predicted.light.shape[1]:
        parts["light"] = _LIGHT_WEIGHT * _light(predicted.light.float(), batch.light)
    return parts


def _sun(logits: Tensor, batch: Batch) -> Tensor:
    """Cross entropy with a target; where the target is a likelihood, the logarithm of the mean likelihood instead."""
    log_chance = F.log_softmax(logits.float(), dim=1)
    cross = -(batch.sun * log_chance).sum(dim=1)
    mean = -torch.logsumexp(log_chance + batch.sun.clamp_min(_MIN_LIKELIHOOD).log(), dim=1)
    return _masked_mean(torch.where(batch.is_likelihood, mean, cross), batch.sun.sum(dim=1) > 0.5)


def _surroundings(predicted: Tensor, target: Tensor) -> Tensor:
    error = F.smooth_l1_loss(predicted, target.nan_to_num(), reduction="none", beta=0.3).mean(dim=1)
    return _masked_mean(error, torch.isfinite(target).all(dim=1))


def _camera(logits: Tensor, target: Tensor, known: Tensor) -> Tensor:
    cross = -(camera_bin_targets(target) * F.log_softmax(logits.float(), dim=2)).sum(dim=2)
    return _masked_mean(cross, known).sum()


def _light(predicted: Tensor, target: Tensor) -> Tensor:
    """The median in the logarithm of the powers, and the cloud cover."""
    finite = torch.isfinite(target)
    target = target.nan_to_num()
    error = F.smooth_l1_loss(predicted[:, :6], target[:, :6], reduction="none", beta=0.1)
    covered = F.binary_cross_entropy_with_logits(predicted[:, 6], target[:, 6], reduction="none")
    return _masked_mean(error, finite[:, :6]).sum() / 3 + _masked_mean(covered, finite[:, 6])


def _cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    cost = -(target * F.log_softmax(logits.float(), dim=1)).sum(dim=1)
    return _masked_mean(cost, target.sum(dim=1) > 0.5)


def _masked_mean(value: Tensor, mask: Tensor) -> Tensor:
    return (value * mask).sum(dim=0) / mask.sum(dim=0).clamp_min(1)


# Distillation.

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
        self.surroundings, self.networks = surroundings, []
        for folder in dict.fromkeys(folders):
            network = read_network(folder).requires_grad_(False)
            if replace(read_spec(folder), version="") != replace(spec, version=""):
                raise DataError(f"{folder} cannot teach this run: its network has another form.")
            if surroundings and network.light is None:
                raise DataError(f"{folder} cannot teach --surroundings: it has not learnt them.")
            self.networks.append(network.to(device, memory_format=torch.channels_last))  # type: ignore[call-overload]

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
