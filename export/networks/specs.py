"""What the networks expect: the photo's size, its normalisation, the grid of sun directions."""

from lighting.records import ModelSpec

TARGET_WIDTH = {"outdoor": 4.0, "cvpr2017": 6.4}  # deg per axis; CVPR 2017 has a kappa of 80
BACKBONE_MEAN = (127 / 255,) * 3  # what the pretrained weights were trained with
BACKBONE_STD = (128 / 255,) * 3


def specs(version: str) -> dict[str, ModelSpec]:
    """The spec of each network by its name, for a version of it."""
    return {
        "outdoor": ModelSpec("outdoor", version, 224, 224, BACKBONE_MEAN, BACKBONE_STD, "fibonacci:1024"),
        "cvpr2017": ModelSpec("cvpr2017", version, 320, 240, BACKBONE_MEAN, BACKBONE_STD, "rings:5x32"),
    }
