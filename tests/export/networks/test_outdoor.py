"""Our network's heads."""

import torch

from export.crops import CELL, CELLS
from export.networks.outdoor import Outdoor
from export.networks.specs import specs

SPEC = specs("0")["outdoor"]


def test_every_head_has_its_size() -> None:
    network = Outdoor(SPEC, 1024, sees=True, around=True).eval()
    with torch.inference_mode():
        said = network(torch.zeros(2, 3, SPEC.height, SPEC.width))
    cells = (SPEC.height // CELL) * (SPEC.width // CELL)
    assert [tuple(part.shape) for part in said] == [(2, 1024), (2, 6), (2, 1 + cells), (2, 2 * CELLS)]


def test_a_new_network_sees_no_sun() -> None:
    """Its bias says so: most pictures show none."""
    network = Outdoor(SPEC, 1024).eval()
    with torch.inference_mode():
        seen = network(torch.zeros(1, 3, SPEC.height, SPEC.width)).seen.softmax(dim=1)
    assert float(seen[0, 0]) > 0.5


def test_heads_that_are_not_asked_for_are_not_there() -> None:
    names = Outdoor(SPEC, 1024, sees=False).state_dict()
    assert not any(name.startswith(("seen.", "around.")) for name in names)
