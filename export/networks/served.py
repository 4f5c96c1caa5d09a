"""The networks as users get them: several answer together, in final units."""

import math
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn

from export.crops.surroundings import COLUMNS, DARKEST, ROWS
from export.networks.layers import Said
from export.networks.level import levelled
from export.networks.parameters import ROLL_SCALE, decode, expected, roll_spread
from export.networks.seen_sun import seen_probability, towards, with_the_seen
from lighting.geometry import angles
from lighting.model import MORE_OUTPUTS, OUTPUTS
from lighting.sun_grid import grid_directions


class Served(nn.Module):
    """Networks whose averaged answers are sun probabilities (B, G) and parameters (B, 6).

    Further networks, `cameras`, answer for the camera instead of the others. With an `elevation_scale` [deg], the sun's
    probabilities are multiplied by exp(-elevation / scale): suns are lower in photographs than in the training crops.
    In the same way the camera is taken to be held level, as photographs are, by networks with bins.
    A sun that the networks see in the picture enters the probabilities. Networks that learnt it also say the light
    (B, 8) and the radiance around the camera (B, ROWS, COLUMNS, 3).
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
    ) -> None:
        super().__init__()
        self.cameras = nn.ModuleList(cameras)
        self.networks = nn.ModuleList(networks)
        self.temperature = temperature
        cells = grid_directions(sun_grid)
        self.register_buffer("cells", torch.tensor(cells, dtype=torch.float32))
        self.register_buffer("prior", torch.tensor(np.exp(-angles(cells)[1] / elevation_scale), dtype=torch.float32))

    @property
    def outputs(self) -> list[str]:
        """Names of what `forward` returns."""
        return [*OUTPUTS, *(MORE_OUTPUTS if any(n.light is not None for n in self.networks) else ())]

    def forward(self, photo: Tensor) -> tuple[Tensor, ...]:
        said: list[Said] = [network(photo) for network in self.networks]
        sun = torch.stack([(one.sun.float() / self.temperature).softmax(dim=1) for one in said]).mean(dim=0)
        sun = nn.functional.normalize(sun * self.prior, p=1.0, dim=1)
        raw = torch.stack([one.raw.float() for one in said]).mean(dim=0)
        asked = [network(photo) for network in self.cameras] or said
        camera = torch.stack([_camera(one) for one in asked]).mean(dim=0)
        parameters = decode(torch.cat([raw[:, :2], camera, raw[:, 5:]], dim=1))
        seen = [seen_probability(one.seen.float()) for one in said if one.seen.shape[1]]
        if seen:
            rays = towards(photo, parameters[:, 2], parameters[:, 3], parameters[:, 4])
            sun = with_the_seen(sun, torch.stack(seen).mean(dim=0), rays, self.cells)
        return sun, parameters, *_light(said)


def _camera(said: Said) -> Tensor:
    """The camera's raw values (B, 3): the mean of those of its bins and of the head of values, where both are.

    The bins also say how sure they are of the roll, which is then that of photographs.
    """
    values = said.raw[:, 2:5].float()
    if not said.camera.shape[1]:
        return values
    camera = 0.5 * (values + expected(said.camera))
    roll = levelled(camera[:, 1:2] * ROLL_SCALE, roll_spread(said.camera) * ROLL_SCALE) / ROLL_SCALE
    return torch.cat([camera[:, :1], roll, camera[:, 2:]], dim=1)


def _light(said: Sequence[Said]) -> tuple[Tensor, ...]:
    """The light (B, 8) and what lies around (B, ROWS, COLUMNS, 3) of the networks that say it; nothing if none does."""
    known = [one for one in said if one.light.shape[1]]
    if not known:
        return ()
    light = torch.stack([one.light.float() for one in known]).mean(dim=0)
    suitable = torch.stack([one.suitable.float() for one in known]).mean(dim=0)
    around = torch.stack([one.around.float() for one in known]).mean(dim=0)
    shares = torch.cat([light[:, 6:], suitable], dim=1).sigmoid()
    radiance = (around.exp() - DARKEST).clamp_min(0.0).reshape(-1, ROWS, COLUMNS, 3)
    return torch.cat([light[:, :6].exp(), shares], dim=1), radiance
