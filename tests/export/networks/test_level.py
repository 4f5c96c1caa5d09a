"""The roll of photographs."""

import pytest
import torch

from export.networks.level import levelled


def said(roll: float, spread: float) -> float:
    return float(levelled(torch.tensor([[roll]]), torch.tensor([[spread]]))[0, 0])


def test_a_camera_that_is_nearly_level_is_level() -> None:
    assert abs(said(0.6, 1.5)) < 0.35
    assert said(0.0, 1.5) == 0.0


@pytest.mark.parametrize("roll", [-40.0, -12.0, 6.0, 20.0])
def test_a_camera_that_is_clearly_rolled_stays_so(roll: float) -> None:
    assert said(roll, 1.5) == pytest.approx(roll, rel=0.06)


def test_a_roll_grows_with_what_the_network_says_and_shrinks_with_its_doubt() -> None:
    rolls = [said(0.5 * step, 1.5) for step in range(40)]
    assert rolls == sorted(rolls)
    assert all(said(4.0, spread) > said(4.0, spread + 1) > 0 for spread in (0.0, 1.0, 3.0))
    assert said(-4.0, 2.0) == -said(4.0, 2.0)
