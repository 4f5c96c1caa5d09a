"""A network by its spec, with random, ImageNet or earlier weights.

All take the normalised canvas (B, 3, H, W) of `lighting.photo` and return `Said`.
"""

from torch import Tensor, nn

from export.data import DataError
from export.networks.backbone import load_imagenet
from export.networks.cvpr2017 import DeepOutdoor
from export.networks.outdoor import Outdoor
from lighting.records import ModelSpec
from lighting.sun_grid import grid_directions

HEADS = ("seen.", "around.", "camera.", "light.", "suitable.")  # that not every run has


def build(
    spec: ModelSpec, *, pretrained: bool = False, sees: bool = True, bins: bool = True, around: bool = False
) -> nn.Module:
    """The network of `spec.name`; `pretrained` loads the ImageNet weights of the backbone if it has one.

    Our network before version 1.3 did not say where in the picture the sun is: it lacks `sees`. Before 2.0 it had no
    `bins` of the camera's angles. With `around` it also says the light around the camera and its power.
    """
    cells = len(grid_directions(spec.sun_grid))
    if spec.name == "cvpr2017":
        return DeepOutdoor(spec, cells)
    network = Outdoor(spec, cells, sees=sees, bins=bins, around=around)
    if pretrained:
        load_imagenet(network.backbone)
    return network


def load_weights(network: nn.Module, weights: dict[str, Tensor]) -> None:
    """Load the weights of a run into a network; DataError if they are of another one.

    Heads of HEADS keep their own weights if the run has none for them. Weights of heads that the network lacks are
    ignored.
    """
    missing, unknown = network.load_state_dict(weights, strict=False)
    unknown = [name for name in unknown if not name.startswith(HEADS)]
    if unknown or not all(name.startswith(HEADS) for name in missing):
        name = [*missing, *unknown][0]
        raise DataError(f"The weights of the run are of another network than this one, which shows in {name}.")
