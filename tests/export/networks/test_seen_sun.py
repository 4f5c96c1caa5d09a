"""How a sun seen in the picture moves the answer."""

import numpy as np
import pytest
import torch

from export.crops.cameras import Camera
from export.crops.crops import Crop
from export.crops.seen_sun import CELL, where_seen
from export.networks.seen_sun import RARER, seen_probability, towards, with_the_seen
from lighting.colour import tone_map
from lighting.geometry import Pinhole, angle_between, camera_directions, direction
from lighting.photo import place
from lighting.sun_grid import grid_directions
from tests.export.crops.examples import SPEC, VIEWS, crop

CELLS = torch.tensor(grid_directions(SPEC.sun_grid), dtype=torch.float32)


def canvas(one: Crop) -> torch.Tensor:
    return torch.from_numpy(place(tone_map(one.linear), SPEC))[None]


def rays(one: Crop) -> torch.Tensor:
    c = one.camera
    return towards(canvas(one), torch.tensor([c.elevation]), torch.tensor([c.roll]), torch.tensor([c.vertical_fov]))


@pytest.mark.parametrize("camera", VIEWS)
def test_cells_look_where_the_cameras_pixels_do(camera: Camera) -> None:
    one = crop(camera, 0.0, 20.0)
    height, width = one.linear.shape[:2]
    expected = camera_directions(Pinhole(width, height, camera.vertical_fov, 0.0, camera.elevation, camera.roll))
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
