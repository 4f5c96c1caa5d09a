"""What the networks expect."""

import pytest

from export.networks.specs import TARGET_WIDTH, specs
from lighting.model import Model
from lighting.records import ModelSpec
from lighting.sun_grid import grid_directions


@pytest.mark.parametrize("name", ["outdoor", "cvpr2017"])
def test_a_spec_survives_its_json_and_has_a_grid(name: str) -> None:
    spec = specs("1.2.3")[name]
    assert (spec.name, spec.version) == (name, "1.2.3")
    assert ModelSpec.from_json(spec.to_json()) == spec
    assert len(grid_directions(spec.sun_grid)) in (160, 1024)
    assert TARGET_WIDTH[name] > 0


def test_the_packaged_network_expects_what_training_gives() -> None:
    shipped, ours = Model.load().spec, specs("")["outdoor"]
    assert (shipped.width, shipped.height, shipped.sun_grid) == (ours.width, ours.height, ours.sun_grid)
    assert shipped.mean == pytest.approx(ours.mean)
    assert shipped.std == pytest.approx(ours.std)
