"""Tests of rendered panoramas."""

from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import read_index, read_picture
from export.data.rendered_panoramas import _blocked, _Things, _write_dataset, render_panorama
from lighting.color import luminance
from lighting.geometry import direction, latlong_directions, latlong_pixel
from lighting.records import GROUND_ALBEDO
from lighting.sky.hosek_wilkie import sky_radiance


def test_a_box_and_a_ball_cast_shadows_away_from_the_sun() -> None:
    box = np.array([[4.0, 0.0, -1.0]]), np.array([[6.0, 10.0, 1.0]]), np.full((1, 3), 0.5)
    ball = np.array([[0.0, 3.0, 20.0]]), np.array([2.0]), np.full((1, 3), 0.5)
    points = np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 0.0, 5.0], [-3.0, 1.3, 20.0], [3.0, 1.3, 20.0]])
    hidden = _blocked(points, direction(90.0, 30.0), _Things(*box, *ball))
    assert hidden.tolist() == [True, False, False, True, False]


def test_the_same_seed_gives_the_same_pixels() -> None:
    first, again, other = (render_panorama(seed, 32) for seed in (1, 1, 2))
    assert np.array_equal(first.linear, again.linear)
    assert not np.array_equal(first.linear, other.linear)


def test_the_sky_is_the_model_times_the_exposure() -> None:
    scene = render_panorama(0, 32, things=0)
    assert scene.sun_azimuth is not None
    assert scene.sun_elevation is not None
    assert scene.turbidity is not None
    sun = direction(scene.sun_azimuth, scene.sun_elevation)
    towards = latlong_directions(32)[:15]
    far = towards @ sun < 0.7
    expected = sky_radiance(towards[far], sun, scene.turbidity, GROUND_ALBEDO) * scene.exposure
    np.testing.assert_allclose(scene.linear[:15][far], expected, rtol=1e-4)


def test_the_sun_is_the_brightest_spot_and_clipped_in_the_picture() -> None:
    scene = render_panorama(0, 64, things=0)
    x, y = latlong_pixel(direction(scene.sun_azimuth or 0.0, scene.sun_elevation or 0.0), 64)
    row, column = np.unravel_index(int(luminance(scene.linear).argmax()), (64, 128))
    assert scene.sun_visible
    assert abs(column + 0.5 - x) <= 1
    assert abs(row + 0.5 - y) <= 1
    assert scene.picture[row, column].min() == 255


def test_an_overcast_sky_has_no_sun_and_is_brightest_overhead() -> None:
    scene = render_panorama(3, 64, overcast=True)
    assert scene.sun_azimuth is scene.sun_elevation is scene.turbidity is None
    assert not scene.sun_visible
    assert luminance(scene.linear[0]).mean() > 1.5 * luminance(scene.linear[29]).mean()


def test_some_crowded_scenes_hide_the_sun() -> None:
    visible = [render_panorama(seed, 16, things=40).sun_visible for seed in range(12)]
    assert any(visible)
    assert not all(visible)


def test_a_folder_is_written_that_can_be_read(tmp_path: Path) -> None:
    _write_dataset(tmp_path, 6, 16, seed=5)
    panoramas = read_index(tmp_path)
    assert len(panoramas) == 6
    assert {p.split for p in panoramas} == {"train", "val"}
    assert np.array_equal(read_picture(panoramas[2]), render_panorama(7, 16).picture)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["panoramas", "panoramas.csv"]


@pytest.mark.parametrize("turbidity", [2.0, 6.0])
def test_turbidity_can_be_chosen(turbidity: float) -> None:
    assert render_panorama(0, 16, turbidity=turbidity).turbidity == turbidity
