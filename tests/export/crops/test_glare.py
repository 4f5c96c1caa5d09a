"""The sun seen in the picture: where training asks for it, and how it moves the answer."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from export.crops.augment import augment
from export.crops.crops import Camera, Crop, aimed_camera
from export.crops.glare import CELL, RARER, seen_probability, towards, where_seen, with_the_seen
from export.networks.network import build, load_weights, specs
from lighting.colour import tone_map
from lighting.geometry import angle_between, camera_directions, direction
from lighting.photo import place
from lighting.sun_grid import grid_directions

SPEC = specs("0")["outdoor"]
CELLS = torch.tensor(grid_directions(SPEC.sun_grid), dtype=torch.float32)
VIEWS = [Camera(0, 12.0, -7.0, 60.0, 4 / 3), Camera(0, -5.0, 9.0, 70.0, 3 / 4), Camera(0, 20.0, 0.0, 40.0, 16 / 9)]


def crop(camera: Camera, azimuth: float, elevation: float) -> Crop:
    """A grey picture of the size that the canvas holds."""
    height = round(SPEC.width / max(camera.aspect, 1.0))
    linear = np.full((height, round(height * camera.aspect), 3), 0.2, np.float32)
    return Crop(linear, camera, azimuth, elevation, 2.0, 1.0, 3.0, 0.5)


def canvas(one: Crop) -> torch.Tensor:
    return torch.from_numpy(place(tone_map(one.linear), SPEC))[None]


def rays(one: Crop) -> torch.Tensor:
    c = one.camera
    return towards(canvas(one), torch.tensor([c.elevation]), torch.tensor([c.roll]), torch.tensor([c.vertical_fov]))


@pytest.mark.parametrize("camera", VIEWS)
def test_cells_look_where_the_cameras_pixels_do(camera: Camera) -> None:
    one = crop(camera, 0.0, 20.0)
    height, width = one.linear.shape[:2]
    expected = camera_directions(width, height, camera.vertical_fov, 0.0, camera.elevation, camera.roll)
    top, left = (SPEC.height - height) // 2, (SPEC.width - width) // 2
    found = rays(one)[0].reshape(SPEC.height // CELL, SPEC.width // CELL, 3).numpy()
    for row, column in [(7, 7), (6, 8), (8, 5)]:
        y, x = (row + 0.5) * CELL - top, (column + 0.5) * CELL - left
        between = expected[round(y) - 1 : round(y) + 1, round(x) - 1 : round(x) + 1].reshape(-1, 3).mean(axis=0)
        assert angle_between(found[row, column], between) < 0.3


@pytest.mark.parametrize("camera", VIEWS)
def test_a_target_that_the_network_meets_points_at_the_sun(camera: Camera) -> None:
    """From the pixel of the sun to the cells and back to a direction, whatever the camera's angles."""
    one = crop(camera, 8.0, 17.0)
    assert one.sun_pixel
    wanted = torch.from_numpy(where_seen(one, SPEC, True)).float()[None]
    uniform = torch.full((1, len(CELLS)), 1 / len(CELLS))
    answer = with_the_seen(uniform, wanted, rays(one), CELLS)
    assert float(answer.sum()) == pytest.approx(1.0, abs=1e-5)
    assert angle_between((answer @ CELLS)[0].numpy(), direction(8.0, 17.0)) < 1.0


def test_what_is_not_seen_changes_nothing_and_half_a_doubt_counts_half() -> None:
    one = crop(VIEWS[0], 8.0, 17.0)
    sun = torch.rand(1, len(CELLS)).softmax(dim=1)
    nowhere = torch.from_numpy(where_seen(one, SPEC, False)).float()[None]
    seen = torch.from_numpy(where_seen(one, SPEC, True)).float()[None]
    torch.testing.assert_close(with_the_seen(sun, nowhere, rays(one), CELLS), sun)
    half = with_the_seen(sun, (nowhere + seen) / 2, rays(one), CELLS)
    torch.testing.assert_close(half, (sun + with_the_seen(sun, seen, rays(one), CELLS)) / 2)


def test_suns_in_the_picture_are_as_rare_as_in_photos_not_as_in_training() -> None:
    """Of even odds in training: they fall by RARER, and the cells keep theirs among each other."""
    logits = torch.tensor([[2.0, *np.log([0.1, 0.3, 0.6]) + 2.0]], dtype=torch.float32)
    nowhere, *cells = seen_probability(logits)[0].tolist()
    assert sum(cells) / nowhere == pytest.approx(np.exp(-RARER), rel=1e-5)
    assert cells == pytest.approx(np.array([0.1, 0.3, 0.6]) * (1 - nowhere), rel=1e-5)


def test_a_sun_outside_the_picture_is_seen_nowhere_and_an_unknown_one_asks_nothing() -> None:
    assert where_seen(crop(VIEWS[0], 120.0, 17.0), SPEC, True)[0] == 1.0
    assert where_seen(crop(VIEWS[0], float("nan"), float("nan")), SPEC, False)[0] == 1.0
    assert where_seen(crop(VIEWS[0], 8.0, 17.0), SPEC, None).sum() == 0.0


def test_augmentation_tells_when_it_hides_the_sun() -> None:
    """A white spot stands where the sun is; it is gone from the picture exactly when it is said to be."""
    one = crop(replace(VIEWS[2], roll=0.0), 0.0, 20.0)
    x, y = map(int, one.sun_pixel or (0, 0))
    one.linear[y - 6 : y + 7, x - 6 : x + 7] = 1.0
    rng = np.random.default_rng(5)
    drawn = [augment(one, rng) for _ in range(80)]
    assert 4 < sum(hidden for *_, hidden in drawn) < 40
    for picture, _, hidden in drawn:
        spot, beside = (float(picture[y - 3 : y + 4, at - 3 : at + 4].mean()) for at in (x, x + 30))
        assert hidden or spot > beside + 20
    away = replace(one, sun_azimuth=170.0)
    assert not any(augment(away, rng)[2] for _ in range(40))


def test_aimed_cameras_hold_the_sun() -> None:
    rng = np.random.default_rng(1)
    held = 0
    for azimuth, elevation in [(0.0, 5.0), (100.0, 30.0), (-170.0, 45.0)]:
        for _ in range(20):
            camera = aimed_camera(rng, azimuth, elevation)
            held += crop(camera, azimuth - camera.azimuth, elevation).sun_pixel is not None
    assert held > 55


def test_networks_without_it_do_not_say_where_and_can_learn_it() -> None:
    mute, seeing = build(SPEC, sees=False).eval(), build(SPEC).eval()
    photo = torch.randn(2, 3, SPEC.height, SPEC.width)
    with torch.inference_mode():
        assert mute(photo)[2].shape == (2, 0)
        assert seeing(photo)[2].shape == (2, 1 + (SPEC.height // CELL) * (SPEC.width // CELL))
        load_weights(seeing, mute.state_dict())
        torch.testing.assert_close(seeing(photo)[:2], mute(photo)[:2])
    with pytest.raises(ValueError, match="do not fit"):
        load_weights(seeing, {})
