"""Accuracy of a network: the report, the model card, the figures that the service returns."""

from export.evaluation.card import write_card
from export.evaluation.evaluate import Evaluation, Options, evaluate
from export.evaluation.metrics import median, sun_error
from export.evaluation.views import View, cameras, collect, interpret

__all__ = [
    "Evaluation",
    "Options",
    "View",
    "cameras",
    "collect",
    "evaluate",
    "interpret",
    "median",
    "sun_error",
    "write_card",
]
