"""Training: settings in, a folder with a checkpoint out."""

from export.training.config import TrainConfig
from export.training.samples import write_samples
from export.training.train import train

__all__ = ["TrainConfig", "train", "write_samples"]
