"""Tests of outdoor."""

import numpy as np
import pytest
import torch

from export.crops.crops import Camera, Crop
from export.crops.targets import CELL, CELLS, sun_in_view_target
from export.data.panoramas import DataError
from export.networks.backbone import InvertedResidual, conv_batch_norm
from export.networks.ensemble import (
    SUN_IN_VIEW_PRIOR,
    cell_directions,
    expected_roll,
    fuse_sun_in_view,
    sun_in_view_probability,
)
from export.networks.outdoor import (
    BINS,
    LIGHT,
    ROLL_SCALE,
    Outdoor,
    camera_bin_targets,
    decode_parameters,
    encode_parameters,
    load_weights,
    mean_of_camera_bins,
    network_specs,
    roll_bins_std,
)
from lighting.color import tone_map
from lighting.geometry import Pinhole, angle_between, camera_directions, direction
from lighting.model import Model, pad_to_input
from lighting.prediction import ModelSpec
from lighting.sun_grid import grid_directions
from tests.helpers.panoramas import EXAMPLES_SPEC, VIEWS, crop


def level_roll(roll: float, spread: float) -> float:
    return float(expected_roll(torch.tensor([[roll]]), torch.tensor([[spread]]))[0, 0])


def test_a_camera_that_is_nearly_level_is_level() -> None:
    assert abs(level_roll(0.6, 1.5)) < 0.35
    assert level_roll(0.0, 1.5) == 0.0


@pytest.mark.parametrize("roll", [-40.0, -12.0, 6.0, 20.0])
def test_a_camera_that_is_clearly_rolled_stays_so(roll: float) -> None:
    assert level_roll(roll, 1.5) == pytest.approx(roll, rel=0.06)


def test_a_roll_grows_with_what_the_network_says_and_shrinks_with_its_doubt() -> None:
    rolls = [level_roll(0.5 * step, 1.5) for step in range(40)]
    assert rolls == sorted(rolls)
    assert all(level_roll(4.0, spread) > level_roll(4.0, spread + 1) > 0 for spread in (0.0, 1.0, 3.0))
    assert level_roll(-4.0, 2.0) == -level_roll(4.0, 2.0)


SPECS = network_specs("0")


def test_weights_with_the_light_around_fit_a_network_without_it_and_the_other_way_round() -> None:
    learnt, served = Outdoor(SPECS["outdoor"], has_surroundings=True), Outdoor(SPECS["outdoor"])
    load_weights(served, learnt.state_dict())
    again = Outdoor(SPECS["outdoor"], has_surroundings=True)
    load_weights(again, served.state_dict())
    for name, value in served.state_dict().items():
        torch.testing.assert_close(value, learnt.state_dict()[name])
        torch.testing.assert_close(value, again.state_dict()[name])
    with pytest.raises(DataError, match="are of another network"):
        load_weights(served, {"sun.2.weight": torch.zeros(3)} | {"convolutions.0.weight": torch.zeros(3)})


SPEC = network_specs("0")["outdoor"]


def test_weights_that_are_missing_are_told() -> None:
    with pytest.raises(DataError, match="are of another network"):
        load_weights(Outdoor(SPEC), {})


def test_every_head_has_its_size() -> None:
    network = Outdoor(SPEC, has_surroundings=True).eval()
    with torch.inference_mode():
        predicted = network(torch.zeros(2, 3, SPEC.height, SPEC.width))
    cells = (SPEC.height // CELL) * (SPEC.width // CELL)
    sizes: dict[str, tuple[int, ...]] = {
        "sun": (1024,),
        "raw": (6,),
        "sun_in_view": (1 + cells,),
        "surroundings": (3 * CELLS,),
    }
    sizes |= {"camera": (3, BINS), "light": (LIGHT,), "suitable": (1,)}
    assert {name: tuple(part.shape[1:]) for name, part in predicted._asdict().items()} == sizes


def test_a_new_network_sees_no_sun() -> None:
    """Its bias says so: most pictures show none."""
    network = Outdoor(SPEC).eval()
    with torch.inference_mode():
        in_view = network(torch.zeros(1, 3, SPEC.height, SPEC.width)).sun_in_view.softmax(dim=1)
    assert float(in_view[0, 0]) > 0.5


def test_heads_that_are_not_asked_for_are_not_there() -> None:
    names = Outdoor(SPEC, has_camera_bins=False).state_dict()
    assert not any(name.startswith(("around.", "camera.", "light.", "suitable.")) for name in names)


def test_encode_and_decode_are_inverse() -> None:
    parameters = torch.tensor([[1.0, 0.01, -35.0, -10.0, 25.0], [10.0, 40.0, 35.0, 10.0, 90.0]])
    raw = torch.cat([encode_parameters(parameters), torch.zeros(2, 1)], dim=1)
    torch.testing.assert_close(decode_parameters(raw)[:, :5], parameters)
    assert (decode_parameters(raw)[:, 5] == 0.5).all()


def test_the_mean_of_a_target_s_bins_is_the_target() -> None:
    camera = encode_parameters(torch.tensor([[1.0, 1.0, 12.3, -38.0, 91.0], [1.0, 1.0, -31.0, 0.4, 27.0]]))[:, 2:5]
    target = camera_bin_targets(camera)
    assert target.shape == (2, 3, BINS)
    torch.testing.assert_close(mean_of_camera_bins(target.clamp_min(1e-12).log()), camera, rtol=1e-3, atol=1e-3)


def test_the_spread_of_a_roll_is_what_its_bins_have_beyond_their_target() -> None:
    camera = encode_parameters(torch.tensor([[1.0, 1.0, 12.3, -8.0, 91.0], [1.0, 1.0, 12.3, 8.0, 91.0]]))[:, 2:5]
    one, other = camera_bin_targets(camera)
    sure, torn = ROLL_SCALE * roll_bins_std(torch.stack([one, 0.5 * (one + other)]).clamp_min(1e-12).log())
    assert float(sure) < 0.1
    assert float(torn) == pytest.approx(8.0, rel=0.01)


GRID_DIRECTIONS = torch.tensor(grid_directions(EXAMPLES_SPEC.sun_grid), dtype=torch.float32)


def canvas(one: Crop) -> torch.Tensor:
    return torch.from_numpy(pad_to_input(tone_map(one.linear), EXAMPLES_SPEC))[None]


def rays(one: Crop) -> torch.Tensor:
    c = one.camera
    return cell_directions(
        canvas(one), torch.tensor([c.elevation]), torch.tensor([c.roll]), torch.tensor([c.vertical_fov])
    )


@pytest.mark.parametrize("camera", VIEWS)
def test_cells_look_where_the_cameras_pixels_do(camera: Camera) -> None:
    one = crop(camera, 0.0, 20.0)
    height, width = one.linear.shape[:2]
    expected = camera_directions(Pinhole(width, height, camera.vertical_fov, 0.0, camera.elevation, camera.roll))
    top, left = (EXAMPLES_SPEC.height - height) // 2, (EXAMPLES_SPEC.width - width) // 2
    directions = rays(one)[0].reshape(EXAMPLES_SPEC.height // CELL, EXAMPLES_SPEC.width // CELL, 3).numpy()
    for row, column in [(7, 7), (6, 8), (8, 5)]:
        y, x = (row + 0.5) * CELL - top, (column + 0.5) * CELL - left
        between = expected[round(y) - 1 : round(y) + 1, round(x) - 1 : round(x) + 1].reshape(-1, 3).mean(axis=0)
        assert angle_between(directions[row, column], between) < 0.3


@pytest.mark.parametrize("camera", VIEWS)
def test_a_target_that_the_network_meets_points_at_the_sun(camera: Camera) -> None:
    """From the pixel of the sun to the cells and back to a direction, whatever the camera's angles."""
    one = crop(camera, 8.0, 17.0)
    assert one.sun_pixel
    target = torch.from_numpy(sun_in_view_target(one, EXAMPLES_SPEC, True)).float()[None]
    uniform = torch.full((1, len(GRID_DIRECTIONS)), 1 / len(GRID_DIRECTIONS))
    answer = fuse_sun_in_view(uniform, target, rays(one), GRID_DIRECTIONS)
    assert float(answer.sum()) == pytest.approx(1.0, abs=1e-5)
    assert angle_between((answer @ GRID_DIRECTIONS)[0].numpy(), direction(8.0, 17.0)) < 1.0


def test_what_is_not_seen_changes_nothing_and_half_a_doubt_counts_half() -> None:
    one = crop(VIEWS[0], 8.0, 17.0)
    sun = torch.rand(1, len(GRID_DIRECTIONS)).softmax(dim=1)
    nowhere = torch.from_numpy(sun_in_view_target(one, EXAMPLES_SPEC, False)).float()[None]
    in_view = torch.from_numpy(sun_in_view_target(one, EXAMPLES_SPEC, True)).float()[None]
    torch.testing.assert_close(fuse_sun_in_view(sun, nowhere, rays(one), GRID_DIRECTIONS), sun)
    half = fuse_sun_in_view(sun, (nowhere + in_view) / 2, rays(one), GRID_DIRECTIONS)
    torch.testing.assert_close(half, (sun + fuse_sun_in_view(sun, in_view, rays(one), GRID_DIRECTIONS)) / 2)


def test_suns_in_the_picture_are_as_rare_as_in_photos_not_as_in_training() -> None:
    """Of even odds in training: they fall by SUN_IN_VIEW_PRIOR, and the cells keep theirs among each other."""
    logits = torch.tensor([[2.0, *np.log([0.1, 0.3, 0.6]) + 2.0]], dtype=torch.float32)
    nowhere, *cells = sun_in_view_probability(logits)[0].tolist()
    assert sum(cells) / nowhere == pytest.approx(np.exp(-SUN_IN_VIEW_PRIOR), rel=1e-5)
    assert cells == pytest.approx(np.array([0.1, 0.3, 0.6]) * (1 - nowhere), rel=1e-5)


@pytest.mark.parametrize("name", ["outdoor", "transformer"])
def test_a_spec_survives_its_json_and_has_a_grid(name: str) -> None:
    spec = network_specs("1.2.3")[name]
    assert (spec.name, spec.version) == ("outdoor", "1.2.3")
    assert ModelSpec.from_json(spec.to_json()) == spec
    assert len(grid_directions(spec.sun_grid)) == 1024


def test_the_packaged_network_expects_what_training_gives() -> None:
    shipped, ours = Model.load().spec, network_specs("")["outdoor"]
    assert (shipped.width, shipped.height, shipped.sun_grid) == (ours.width, ours.height, ours.sun_grid)
    assert shipped.mean == pytest.approx(ours.mean)
    assert shipped.std == pytest.approx(ours.std)


def test_pretrained_features_tell_pictures_apart_like_imagenet_does() -> None:
    """The weights land in the right layers: the last features neither die nor explode, and differ between pictures."""
    torch.manual_seed(0)
    network = Outdoor(SPECS["outdoor"], pretrained=True).eval()
    assert isinstance(network, Outdoor)
    smooth = torch.linspace(-1, 1, 224).expand(1, 3, 224, 224)
    with torch.inference_mode():
        pooled = network.backbone(torch.cat([smooth, torch.randn(1, 3, 224, 224)]))[2]
    assert 0.05 < float(pooled.mean()) < 2.0
    assert float((pooled[0] - pooled[1]).abs().mean()) > 0.1


def test_frozen_layers_do_not_learn() -> None:
    network = Outdoor(SPECS["outdoor"], has_surroundings=True).train()
    assert isinstance(network, Outdoor)
    frozen = [p for p in network.backbone.parameters() if not p.requires_grad]
    before = [p.clone() for p in network.backbone.stem.parameters()]
    statistics = network.backbone.stem.state_dict()["2.running_mean"].clone()
    torch.autograd.backward([part.sum() for part in network(torch.randn(2, 3, 224, 224))])
    assert frozen
    assert all(p.grad is None for p in frozen)
    assert all(p.grad is not None for p in network.parameters() if p.requires_grad)
    torch.testing.assert_close(network.backbone.stem.state_dict()["2.running_mean"], statistics)
    torch.testing.assert_close(before, list(network.backbone.stem.parameters()))


@pytest.mark.parametrize(("kernel", "stride"), [(1, 1), (3, 1), (5, 1), (3, 2), (5, 2)])
def test_a_convolution_keeps_or_halves_the_map(kernel: int, stride: int) -> None:
    layer = conv_batch_norm(2, 4, kernel, stride).eval()
    assert layer(torch.zeros(1, 2, 16, 16)).shape == (1, 4, 16 // stride, 16 // stride)


def test_a_strided_convolution_pads_right_and_bottom_first() -> None:
    """TensorFlow's SAME on an even input: a kernel of 3 with stride 2 begins at the first pixel."""
    layer = conv_batch_norm(1, 1, 3, 2).eval()
    weight = layer.get_parameter("1.weight")
    weight.data.zero_()
    weight.data[0, 0, 0, 0] = 1.0  # passes its upper left input
    picture = torch.arange(16.0).reshape(1, 1, 4, 4)
    torch.testing.assert_close(layer(picture)[0, 0], torch.tensor([[0.0, 2.0], [8.0, 10.0]]), rtol=1e-3, atol=1e-3)


def test_a_block_adds_its_input_only_where_shapes_agree() -> None:
    same, other = (InvertedResidual(8, outside, 3, 1, 2, drop=0.0).eval() for outside in (8, 12))
    assert same.residual
    assert not other.residual
    same.get_parameter("project.1.weight").data.zero_()  # the last normalisation then gives zero
    x = torch.randn(2, 8, 6, 6)
    torch.testing.assert_close(same(x), x)


def test_dropped_blocks_pass_their_input_in_training_alone() -> None:
    torch.manual_seed(0)
    block = InvertedResidual(4, 4, 3, 1, 1, drop=0.5)
    x = torch.randn(64, 4, 4, 4)
    passed = [bool(torch.equal(a, b)) for a, b in zip(block.train()(x), x, strict=True)]
    assert 16 < sum(passed) < 48
    assert not any(torch.equal(a, b) for a, b in zip(block.eval()(x), x, strict=True))
