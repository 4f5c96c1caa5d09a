"""The network on a transformer: its answers' shapes, what it does not look at, constants multiplied out, its rates."""

import json
from pathlib import Path

import pytest
import torch

from export.crops.targets import CELLS
from export.networks.backbone import NetworkOutput
from export.networks.outdoor import BINS, LIGHT, network_specs
from export.networks.outdoor_transformer import DEPTH, OutdoorTransformer
from export.networks.vision_transformer import PATCH
from export.networks.weights import read_network, write_run

SPEC = network_specs("0")["transformer"]


@pytest.fixture(scope="module")
def network() -> OutdoorTransformer:
    torch.manual_seed(0)
    return OutdoorTransformer(SPEC, has_surroundings=True).eval()


def answers(network: torch.nn.Module, photo: torch.Tensor) -> NetworkOutput:
    with torch.inference_mode():
        output: NetworkOutput = network(photo)
    return output


def canvas(rows: int) -> torch.Tensor:
    """A photo of some rows of patches in the middle of an empty canvas (1, 3, H, W)."""
    photo = torch.zeros(1, 3, SPEC.height, SPEC.width)
    margin = (SPEC.height - rows * PATCH) // 2
    photo[:, :, margin : margin + rows * PATCH] = torch.randn(1, 3, rows * PATCH, SPEC.width)
    return photo


def test_every_head_answers_but_that_of_a_sun_in_view(network: OutdoorTransformer) -> None:
    output = answers(network, torch.cat([canvas(12), canvas(16)]))
    shapes = [tuple(part.shape) for part in output]
    assert shapes == [(2, 1024), (2, 6), (2, 0), (2, 3 * CELLS), (2, 3, BINS), (2, LIGHT), (2, 1)]


def test_a_photo_answers_alike_alone_and_among_others(network: OutdoorTransformer) -> None:
    one, other = canvas(10), canvas(16)
    together = answers(network, torch.cat([one, other]))
    for part, alone in zip(together, answers(network, one), strict=True):
        assert torch.allclose(part[:1], alone, atol=1e-4)


def test_the_empty_canvas_does_not_count(network: OutdoorTransformer) -> None:
    photo = canvas(12)
    before = answers(network, photo).sun
    with torch.no_grad():
        table = network.trunk.position.clone()
        network.trunk.position[:, : 37 * 3] += 5.0  # of the canvas's first row of patches alone
        after = answers(network, photo).sun
        network.trunk.position.copy_(table)
    assert torch.allclose(before, after, atol=1e-4)


def test_training_looks_at_patches_of_the_photo_at_random() -> None:
    learning, counts = OutdoorTransformer(SPEC, has_surroundings=True).train(), []
    learning.trunk.blocks[0].register_forward_pre_hook(lambda _, inputs: counts.append(tuple(inputs[0].shape)))
    photo = torch.cat([canvas(10), canvas(16)])
    with torch.no_grad():
        first, second = learning(photo).surroundings, learning(photo).surroundings
        learning.trunk.position[:, : 37 * 4] = torch.nan  # of the canvas's first row of patches alone
        assert learning(photo[:1]).surroundings.isfinite().all()
    assert set(counts) == {(2, 97, 384), (1, 97, 384)}
    assert not torch.equal(first, second)


def test_constants_multiplied_out_leave_the_answers(network: OutdoorTransformer) -> None:
    folded = OutdoorTransformer(SPEC, has_surroundings=True).eval()
    with torch.no_grad():
        for block in network.trunk.blocks:
            for name, value in block.named_parameters():
                if name.startswith("scale"):
                    value.uniform_(0.1, 2.0)
    folded.load_state_dict(network.state_dict())
    photo = canvas(12)
    for part, expected in zip(answers(folded.fold(), photo), answers(network, photo), strict=True):
        assert torch.allclose(part, expected, atol=1e-3)


def test_earlier_blocks_learn_less_and_the_first_not_at_all(network: OutdoorTransformer) -> None:
    scales = [group["scale"] for group in network.rate_groups()]
    assert scales[0] == 1.0
    assert scales[1:] == sorted(scales[1:])
    assert scales[-1] < 0.5
    learns = {id(value) for group in network.rate_groups() for value in group["params"]}
    frozen = [not any(id(value) in learns for value in block.parameters()) for block in network.trunk.blocks]
    assert frozen == [number < 3 for number in range(DEPTH)]


def test_a_run_is_read_back(network: OutdoorTransformer, tmp_path: Path) -> None:
    write_run(tmp_path / "run", {"spec": json.loads(SPEC.to_json())}, network.state_dict())
    again = read_network(tmp_path / "run")
    photo = canvas(16)
    assert torch.equal(answers(again, photo).sun, answers(network, photo).sun)
