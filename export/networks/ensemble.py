"""What several networks answer together, in final units."""

import copy
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from export.crops.targets import CELL, COLUMNS, MIN_RADIANCE, ROWS
from export.networks.backbone import Backbone, NetworkOutput
from export.networks.outdoor import ROLL_SCALE, decode_parameters, mean_of_camera_bins, roll_bins_std
from export.networks.segmentation import SegmentationBranch
from lighting.geometry import angles
from lighting.model import OUTPUTS
from lighting.sun_grid import grid_directions

# How a sun in the picture enters the answer.

# nats; the sun is rarer in photos than in the crops that teach to see it; 0.5 to 1 on crops of `train`
SUN_IN_VIEW_PRIOR = 1.0
_DIRECTION_STD = 5.0  # deg per axis, of the directions that a cell stands for: the error of the estimated camera


def sun_in_view_probability(logits: Tensor) -> Tensor:
    """Probabilities (B, 1 + cells) that the sun is nowhere in the picture, and in each cell.

    Args:
        logits: (B, 1 + cells) of the network.
    """
    return (logits - SUN_IN_VIEW_PRIOR * (torch.arange(logits.shape[1], device=logits.device) > 0)).softmax(dim=1)


def cell_directions(photo: Tensor, elevation: Tensor, roll: Tensor, vertical_fov: Tensor) -> Tensor:
    """Unit vectors (B, cells, 3) through the centers of a canvas's cells; signs are those of `lighting.geometry`.

    Args:
        photo: (B, 3, H, W) canvases; a photo's height is that of its canvas without the zero rows around it.
        elevation: (B,) deg, of the camera, positive looks up.
        roll: (B,) deg.
        vertical_fov: (B,) deg, of the photo.
    """
    height, width = photo.shape[2:]
    photo_height = (photo.abs().amax(dim=(1, 3)) > 0).sum(dim=1).clamp_min(1).to(photo.dtype)
    focal = (0.5 * photo_height / torch.tan(torch.deg2rad(vertical_fov) / 2))[:, None]
    y = (0.5 * height - (torch.arange(height // CELL, device=photo.device) + 0.5) * CELL).to(photo.dtype)
    x = ((torch.arange(width // CELL, device=photo.device) + 0.5) * CELL - 0.5 * width).to(photo.dtype)
    lateral = x.repeat(len(y))[None] / focal
    vertical = y.repeat_interleave(len(x))[None] / focal
    rotation, tilt = torch.deg2rad(roll)[:, None], torch.deg2rad(elevation)[:, None]
    right = torch.cos(rotation) * lateral + torch.sin(rotation) * vertical
    up = torch.cos(rotation) * vertical - torch.sin(rotation) * lateral
    rays = torch.stack([right, torch.sin(tilt) + torch.cos(tilt) * up, torch.sin(tilt) * up - torch.cos(tilt)], dim=2)
    return nn.functional.normalize(rays, dim=2)


def fuse_sun_in_view(sun: Tensor, sun_in_view: Tensor, rays: Tensor, cells: Tensor) -> Tensor:
    """Probabilities (B, G) over the grid, with those of a sun in the picture mixed in.

    Args:
        sun: (B, G) probabilities without the picture's cells.
        sun_in_view: (B, 1 + cells) probabilities of nowhere and of each cell.
        rays: (B, cells, 3) unit vectors where the cells look.
        cells: (G, 3) unit vectors of the grid.
    """
    concentration = float(np.radians(_DIRECTION_STD) ** -2)
    lobes = (rays @ (concentration * cells).T).softmax(dim=2)
    return sun_in_view[:, :1] * sun + (sun_in_view[:, None, 1:] @ lobes)[:, 0]


# How level photographs are, and the camera's roll that follows from it and from the networks' answers.
#
# Photographs are level far more often than training crops, half of which are rolled by up to 10 deg: people hold
# cameras level, and straighten what is not. Hold-Geoffroy et al. ("A perceptual measure for deep single image camera
# calibration", CVPR 2018) draw a third of their photos level and the others from a Cauchy distribution of 0.1 rad. Of
# the ordinary photos that training sees, the networks tell that nearly all are within 4 deg. Here a fifth is level, so
# that a camera which is rolled on purpose is not made level.

_SHARES = torch.tensor([0.20, 0.24, 0.36, 0.20])  # of photographs, by how far they are rolled:
_ROLL_STD = torch.tensor([0.06, 2.0, 6.0, 25.0])  # deg
_TRUST = 0.65  # errors over the bins' deviation, less that of their targets; 0.6 and 0.7 on crops of `train`
_MIN_ERROR = 0.3  # deg, of a network


def expected_roll(roll: Tensor, roll_std: Tensor) -> Tensor:
    """The expected roll (B, 1) [deg] of photographs.

    Args:
        roll: (B, 1) deg, that a network predicts.
        roll_std: (B, 1) deg, of its bins.
    """
    error = (_TRUST * roll_std).clamp_min(_MIN_ERROR) ** 2
    prior = _ROLL_STD.to(roll) ** 2
    total = prior + error
    likelihood = _SHARES.to(roll) * torch.exp(-0.5 * roll**2 / total) / total.sqrt()
    share = likelihood / likelihood.sum(dim=1, keepdim=True)
    return roll * (share * prior / total).sum(dim=1, keepdim=True)


# The networks in one.


class NetworkEnsemble(nn.Module):
    """Networks whose averaged answers are sun probabilities (B, G) and parameters (B, 6).

    Further networks, `cameras`, answer for the camera instead of the others. With an `elevation_scale` [deg], the sun's
    probabilities are multiplied by exp(-elevation / scale): suns are lower in photographs than in the training crops.
    In the same way the camera is taken to be level, as photographs are, by networks with bins.
    A sun that the networks see in the picture enters the probabilities. Networks that learnt it also predict the light
    (B, 8) and the radiance around the camera (B, ROWS, COLUMNS, 3). With `segmentation`, a branch of the first network
    tells what the canvas shows. Further networks, `suns`, answer for the sun's direction and the powers of light too.
    """

    cells: Tensor
    prior: Tensor

    def __init__(
        self,
        networks: Sequence[nn.Module],
        sun_grid: str,
        temperature: float = 1.0,
        cameras: Sequence[nn.Module] = (),
        elevation_scale: float = math.inf,
        segmentation: SegmentationBranch | None = None,
        suns: Sequence[nn.Module] = (),
    ) -> None:
        super().__init__()
        self.segmentation = segmentation
        # A copy, for weights of one layer that is used twice are not folded; equal nodes are merged later.
        self.beginning = copy.deepcopy(find_backbone([*networks, *suns]).backbone) if segmentation else None
        self.cameras = nn.ModuleList(cameras)
        self.networks = nn.ModuleList(networks)
        self.suns = nn.ModuleList(suns)
        self.temperature = temperature
        cells = grid_directions(sun_grid)
        self.register_buffer("cells", torch.tensor(cells, dtype=torch.float32))
        self.register_buffer("prior", torch.tensor(np.exp(-angles(cells)[1] / elevation_scale), dtype=torch.float32))

    @property
    def outputs(self) -> list[str]:
        """Names of what `forward` returns."""
        of_light = ["light", "around"] if any(n.light is not None for n in self.networks) else []
        return [*OUTPUTS, *of_light, *(["segments"] if self.segmentation else [])]

    def forward(self, photo: Tensor) -> tuple[Tensor, ...]:
        predicted: list[NetworkOutput] = [network(photo) for network in self.networks]
        of_suns = [*predicted, *(network(photo) for network in self.suns)]
        sun = torch.stack([(one.sun.float() / self.temperature).softmax(dim=1) for one in of_suns]).mean(dim=0)
        sun = nn.functional.normalize(sun * self.prior, p=1.0, dim=1)
        raw = torch.stack([one.raw.float() for one in predicted]).mean(dim=0)
        of_cameras = [network(photo) for network in self.cameras] or predicted
        camera = torch.stack([_camera_values(one) for one in of_cameras]).mean(dim=0)
        parameters = decode_parameters(torch.cat([raw[:, :2], camera, raw[:, 5:]], dim=1))
        in_view = [sun_in_view_probability(p.sun_in_view.float()) for p in of_suns if p.sun_in_view.shape[1]]
        if in_view:
            rays = cell_directions(photo, parameters[:, 2], parameters[:, 3], parameters[:, 4])
            sun = fuse_sun_in_view(sun, torch.stack(in_view).mean(dim=0), rays, self.cells)
        return sun, parameters, *_light_values(predicted, of_suns), *self._segments(photo)

    def _segments(self, photo: Tensor) -> tuple[Tensor, ...]:
        """Probabilities (B, H/8, W/8, classes) of what the canvas shows; nothing without a branch for it."""
        if self.segmentation is None or not isinstance(self.beginning, Backbone):
            return ()
        logits = self.segmentation(self.beginning.frozen_features(photo))
        return (logits.softmax(dim=1).permute(0, 2, 3, 1),)


def find_backbone(networks: Sequence[nn.Module]) -> Any:
    """The first network that has a convolutional backbone, else the first.

    Args:
        networks: one at least.
    """
    return next((one for one in networks if isinstance(getattr(one, "backbone", None), Backbone)), networks[0])


def _camera_values(predicted: NetworkOutput) -> Tensor:
    """The camera's raw values (B, 3): the mean of those of its bins and of the head of values, where both are.

    The bins also tell how sure they are of the roll, which is then that of photographs.
    """
    values = predicted.raw[:, 2:5].float()
    if not predicted.camera.shape[1]:
        return values
    camera = 0.5 * (values + mean_of_camera_bins(predicted.camera))
    roll = expected_roll(camera[:, 1:2] * ROLL_SCALE, roll_bins_std(predicted.camera) * ROLL_SCALE) / ROLL_SCALE
    return torch.cat([camera[:, :1], roll, camera[:, 2:]], dim=1)


def _light_values(predicted: Sequence[NetworkOutput], of_suns: Sequence[NetworkOutput]) -> tuple[Tensor, ...]:
    """The light (B, 8) and the surroundings (B, ROWS, COLUMNS, 3) by networks that predict them; nothing if none.

    Powers and surroundings are of all that answer for suns: two see them better than one. Shares are of the others.
    """
    lit, bright = ([one for one in some if one.light.shape[1]] for some in (predicted, of_suns))
    if not lit:
        return ()
    shares = torch.stack([torch.cat([o.light[:, 6:], o.suitable], dim=1).float() for o in lit]).mean(dim=0).sigmoid()
    powers = torch.stack([one.light[:, :6].float() for one in bright]).mean(dim=0).exp()
    surroundings = torch.stack([one.surroundings.float() for one in bright]).mean(dim=0)
    radiance = (surroundings.exp() - MIN_RADIANCE).clamp_min(0.0).reshape(-1, ROWS, COLUMNS, 3)
    return torch.cat([powers, shares], dim=1), radiance
