"""What training minimises."""

import torch
from torch import Tensor
from torch.nn import functional as F

from export.networks import Said, encode
from export.training.batches import Batch

PARAMETER_WEIGHTS = (0.5, 0.5, 1.5, 1.0, 1.0)  # turbidity, exposure, camera elevation, roll, field of view
AROUND_WEIGHT = 5.0  # of the light around the camera


def losses(said: Said, batch: Batch) -> dict[str, Tensor]:
    """Mean losses of one batch by name, each over the crops that have the target."""
    target = torch.cat([encode(batch.parameters[:, :5]), batch.parameters[:, 5:]], dim=1)
    known = torch.isfinite(target)
    target = torch.where(known, target, torch.zeros_like(target))
    fit = F.smooth_l1_loss(said.raw[:, :5].float(), target[:, :5], reduction="none", beta=0.3)
    shining = F.binary_cross_entropy_with_logits(said.raw[:, 5].float(), target[:, 5], reduction="none")
    by_parameter = _masked_mean(fit, known[:, :5])
    parts = {
        "sun": _cross_entropy(said.sun, batch.sun),
        "parameters": (by_parameter * by_parameter.new_tensor(PARAMETER_WEIGHTS)).sum(),
        "visibility": _masked_mean(shining, known[:, 5]),
    }
    if said.seen.shape[1]:
        parts["seen"] = _cross_entropy(said.seen, batch.seen)
    if said.around.shape[1]:
        parts["around"] = AROUND_WEIGHT * F.smooth_l1_loss(said.around.float(), batch.around, beta=0.3)
    return parts


def _cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    cost = -(target * F.log_softmax(logits.float(), dim=1)).sum(dim=1)
    return _masked_mean(cost, target.sum(dim=1) > 0.5)


def _masked_mean(value: Tensor, mask: Tensor) -> Tensor:
    return (value * mask).sum(dim=0) / mask.sum(dim=0).clamp_min(1)
