"""Our network's heads."""

import torch

from export.crops import CELL, CELLS
from export.networks.outdoor import Outdoor
from export.networks.parameters import BINS, LIGHT
from export.networks.specs import specs

SPEC = specs("0")["outdoor"]


def test_every_head_has_its_size() -> None:
    network = Outdoor(SPEC, 1024, sees=True, around=True).eval()
    with torch.inference_mode():
        said = network(torch.zeros(2, 3, SPEC.height, SPEC.width))
    cells = (SPEC.height // CELL) * (SPEC.width // CELL)
    sizes: dict[str, tuple[int, ...]] = {"sun": (1024,), "raw": (6,), "seen": (1 + cells,), "around": (3 * CELLS,)}
    sizes |= {"camera": (3, BINS), "light": (LIGHT,), "suitable": (1,)}
    assert {name: tuple(part.shape[1:]) for name, part in said._asdict().items()} == sizes


def test_a_new_network_sees_no_sun() -> None:
    """Its bias says so: most pictures show none."""
    network = Outdoor(SPEC, 1024).eval()
    with torch.inference_mode():
        seen = network(torch.zeros(1, 3, SPEC.height, SPEC.width)).seen.softmax(dim=1)
    assert float(seen[0, 0]) > 0.5


def test_heads_that_are_not_asked_for_are_not_there() -> None:
    names = Outdoor(SPEC, 1024, sees=False, bins=False).state_dict()
    assert not any(name.startswith(("seen.", "around.", "camera.", "light.", "suitable.")) for name in names)
