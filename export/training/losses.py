"""What training minimizes."""

import torch
from torch import Tensor
from torch.nn import functional as F

from export.networks.backbone import NetworkOutput
from export.networks.outdoor import camera_bin_targets, encode_parameters
from export.training.dataset import Batch

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
