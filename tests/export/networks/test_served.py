"""The answers that users get."""

import numpy as np
import pytest
import torch

from export.crops.surroundings import COLUMNS, ROWS
from export.networks.network import build
from export.networks.served import Served
from export.networks.specs import specs
from lighting.sun_grid import grid_directions

SPECS = specs("0")


GRID = SPECS["outdoor"].sun_grid


@pytest.mark.parametrize("name", ["outdoor", "cvpr2017"])
def test_outputs_fit_the_grid_and_the_parameters(name: str) -> None:
    spec = SPECS[name]
    served = Served([build(spec)], spec.sun_grid).eval()
    with torch.inference_mode():
        probability, parameters = served(torch.zeros(2, 3, spec.height, spec.width))
    assert probability.shape == (2, len(grid_directions(spec.sun_grid)))
    np.testing.assert_allclose(probability.sum(dim=1), 1.0, rtol=1e-5)
    assert parameters.shape == (2, 6)
    assert served.outputs == ["sun_probability", "parameters"]
    assert torch.isfinite(parameters).all()


def test_networks_that_learnt_the_light_say_it_in_final_units() -> None:
    network = build(SPECS["outdoor"], around=True).eval()
    served = Served([network, build(SPECS["outdoor"]).eval()], GRID)
    with torch.inference_mode():
        _, _, light, around = served(torch.randn(2, 3, 224, 224))
    assert served.outputs == ["sun_probability", "parameters", "light", "around"]
    assert light.shape == (2, 8)
    assert around.shape == (2, ROWS, COLUMNS, 3)
    assert (light > 0).all()
    assert (light[:, 6:] < 1).all()
    assert (around >= 0).all()


def test_temperature_widens_the_distribution() -> None:
    network = build(SPECS["outdoor"], sees=False).eval()
    photo = torch.randn(1, 3, 224, 224)
    with torch.inference_mode():
        sharp, soft = Served([network], GRID, 0.5)(photo)[0], Served([network], GRID, 2.0)(photo)[0]
    assert sharp.max() > soft.max()
    assert sharp.argmax() == soft.argmax()


def test_networks_together_answer_their_mean() -> None:
    torch.manual_seed(3)
    networks = [build(SPECS["outdoor"]).eval() for _ in range(2)]
    photo = torch.randn(2, 3, 224, 224)
    with torch.inference_mode():
        alone = [Served([network], GRID, 1.4)(photo) for network in networks]
        both = Served(networks, GRID, 1.4)(photo)
    torch.testing.assert_close(both[0], (alone[0][0] + alone[1][0]) / 2)
    torch.testing.assert_close(both[1][:, 2:5], (alone[0][1] + alone[1][1])[:, 2:5] / 2)
    torch.testing.assert_close(both[1][:, :2], (alone[0][1] * alone[1][1])[:, :2].sqrt())  # turbidity and exposure


def test_a_network_for_the_camera_answers_for_it_instead_of_the_others() -> None:
    torch.manual_seed(4)
    first, camera = (build(SPECS["outdoor"], sees=False).eval() for _ in range(2))
    photo = torch.randn(2, 3, 224, 224)
    with torch.inference_mode():
        sun, parameters = Served([first], GRID, cameras=[camera])(photo)
        alone, instead = Served([first], GRID)(photo), Served([camera], GRID)(photo)
    torch.testing.assert_close(sun, alone[0])
    torch.testing.assert_close(parameters[:, 2:5], instead[1][:, 2:5])
    torch.testing.assert_close(parameters[:, [0, 1, 5]], alone[1][:, [0, 1, 5]])
    assert (parameters[:, 2:5] - alone[1][:, 2:5]).abs().max() > 0
