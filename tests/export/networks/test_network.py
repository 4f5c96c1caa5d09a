"""Networks by their spec, and weights that fit them."""

import pytest
import torch

from export.crops.seen_sun import CELL
from export.data import DataError
from export.networks.network import build, load_weights
from export.networks.specs import specs

SPECS = specs("0")


def test_weights_with_the_light_around_fit_a_network_without_it_and_the_other_way_round() -> None:
    learnt, served = build(SPECS["outdoor"], around=True), build(SPECS["outdoor"])
    load_weights(served, learnt.state_dict())
    again = build(SPECS["outdoor"], around=True)
    load_weights(again, served.state_dict())
    for name, value in served.state_dict().items():
        torch.testing.assert_close(value, learnt.state_dict()[name])
        torch.testing.assert_close(value, again.state_dict()[name])
    with pytest.raises(DataError, match="are of another network"):
        load_weights(served, {"sun.2.weight": torch.zeros(3)} | build(SPECS["cvpr2017"]).state_dict())


SPEC = specs("0")["outdoor"]


def test_networks_without_it_do_not_say_where_and_can_learn_it() -> None:
    mute, seeing = build(SPEC, sees=False).eval(), build(SPEC).eval()
    photo = torch.randn(2, 3, SPEC.height, SPEC.width)
    with torch.inference_mode():
        assert mute(photo)[2].shape == (2, 0)
        assert seeing(photo)[2].shape == (2, 1 + (SPEC.height // CELL) * (SPEC.width // CELL))
        load_weights(seeing, mute.state_dict())
        torch.testing.assert_close(seeing(photo)[:2], mute(photo)[:2])
    with pytest.raises(DataError, match="are of another network"):
        load_weights(seeing, {})
