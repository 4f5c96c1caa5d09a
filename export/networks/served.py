"""The networks as users get them: several answer together, in final units."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from export.networks.layers import Said
from export.networks.parameters import decode
from export.networks.seen_sun import seen_probability, towards, with_the_seen
from lighting.sun_grid import grid_directions


class Served(nn.Module):
    """Networks whose averaged answers are sun probabilities (B, G) and parameters (B, 6).

    A sun that they see in the picture enters the probabilities.
    """

    cells: Tensor

    def __init__(self, networks: Sequence[nn.Module], sun_grid: str, temperature: float = 1.0) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)
        self.temperature = temperature
        self.register_buffer("cells", torch.tensor(grid_directions(sun_grid), dtype=torch.float32))

    def forward(self, photo: Tensor) -> tuple[Tensor, Tensor]:
        said: list[Said] = [network(photo) for network in self.networks]
        sun = torch.stack([(one.sun.float() / self.temperature).softmax(dim=1) for one in said]).mean(dim=0)
        parameters = decode(torch.stack([one.raw.float() for one in said]).mean(dim=0))
        seen = [seen_probability(one.seen.float()) for one in said if one.seen.shape[1]]
        if not seen:
            return sun, parameters
        rays = towards(photo, parameters[:, 2], parameters[:, 3], parameters[:, 4])
        return with_the_seen(sun, torch.stack(seen).mean(dim=0), rays, self.cells), parameters
