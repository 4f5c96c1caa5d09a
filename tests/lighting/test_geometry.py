"""Tests of geometry."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import integers
from numpy.typing import NDArray

from lighting.geometry import (
    Floats,
    Pinhole,
    angle_between,
    angles,
    camera_axes,
    camera_directions,
    camera_pixel,
    direction,
    fit_in_box,
    focal_length,
    latlong_angles,
    latlong_directions,
    latlong_pixel,
    latlong_solid_angle,
    pixel_window,
    ray_sphere,
    sample_latlong,
    scale_size,
    shrink_size,
    wrap_azimuth,
)

azimuths = st.floats(-180, 180)
elevations = st.floats(-90, 90)
tilts = st.floats(-89, 89)
rolls = st.floats(-180, 180)
heights = st.integers(1, 40).map(lambda n: 2 * n)
fields_of_view = st.floats(5, 140)
seeds = st.integers(0, 2**32 - 1)

X, Y, Z = np.eye(3)


def vectors(seed: int, count: int = 50) -> Floats:
    return np.random.default_rng(seed).normal(size=(count, 3))


def picture(seed: int, height: int) -> NDArray[np.float32]:
    return np.random.default_rng(seed).random((height, 2 * height, 3), dtype=np.float32)


# Axes and angles


@pytest.mark.parametrize(
    ("axis", "azimuth", "elevation"),
    [(-Z, 0, 0), (X, 90, 0), (Z, 180, 0), (-X, -90, 0), (Y, 0, 90), (-Y, 0, -90)],
)
def test_the_six_axes_have_these_angles(axis: Floats, azimuth: float, elevation: float) -> None:
    assert direction(azimuth, elevation) == pytest.approx(axis, abs=1e-15)
    if abs(elevation) < 90:
        assert angles(axis)[0] == azimuth
    assert angles(axis)[1] == elevation


@pytest.mark.parametrize(
    ("axis", "x", "y"),
    [(-Z, 64, 32), (X, 96, 32), (Z, 0, 32), (-X, 32, 32)],
)
def test_the_horizontal_axes_have_these_pixels(axis: Floats, x: float, y: float) -> None:
    assert latlong_pixel(axis, 64).tolist() == pytest.approx([x, y])


def test_zenith_is_the_top_edge_and_nadir_the_bottom_edge() -> None:
    assert latlong_pixel(Y, 64)[1] == 0
    assert latlong_pixel(-Y, 64)[1] == 64


def test_frame_is_right_handed() -> None:
    right, up, forward = camera_axes(0, 0, 0)
    assert np.stack([right, up, forward]) == pytest.approx(np.stack([X, Y, -Z]), abs=1e-15)
    assert np.cross(right, up) == pytest.approx(-forward)


@given(azimuths, elevations, st.floats(1e-3, 1e3))
def test_angles_undo_direction(azimuth: float, elevation: float, length: float) -> None:
    vector = direction(azimuth, elevation)
    assert np.linalg.norm(vector) == pytest.approx(1)
    back_azimuth, back_elevation = angles(length * vector)
    assert back_elevation == pytest.approx(elevation, abs=1e-5)
    assert angle_between(direction(back_azimuth, back_elevation), vector) < 1e-9
    assert -180 < back_azimuth <= 180


@given(st.floats(-1e4, 1e4))
def test_wrapped_azimuth_is_the_same_direction_in_range(azimuth: float) -> None:
    wrapped = float(wrap_azimuth(azimuth))
    assert -180 < wrapped <= 180
    assert angle_between(direction(wrapped, 0), direction(azimuth, 0)) < 1e-9


def test_the_back_has_one_azimuth() -> None:
    assert wrap_azimuth([-180.0, 180.0, 540.0]).tolist() == [180.0, 180.0, 180.0]


@pytest.mark.parametrize("angle", [0.0, 1e-7, 0.3, 90.0, 179.9999999, 180.0])
def test_angle_between_is_exact_at_both_ends(angle: float) -> None:
    a, b = direction(20.0, 0.0), direction(20.0 + angle, 0.0)
    assert angle_between(3 * a, b) == pytest.approx(angle, rel=1e-6, abs=1e-13)


# Lat-long pixels


@given(heights)
def test_pixel_centres_come_back(height: int) -> None:
    pixel = latlong_pixel(latlong_directions(height), height)
    x, y = np.meshgrid(np.arange(2 * height) + 0.5, np.arange(height) + 0.5)
    np.testing.assert_allclose(pixel, np.stack([x, y], axis=-1), atol=1e-9 * height)


@given(heights, st.floats(0, 1, exclude_max=True), st.floats(0.01, 0.99))
def test_any_pixel_comes_back(height: int, u: float, v: float) -> None:
    pixel = latlong_pixel(direction((u - 0.5) * 360, (0.5 - v) * 180), height)
    seam = min(abs(pixel[0] - u * 2 * height), abs(2 * height - abs(pixel[0] - u * 2 * height)))
    assert seam < 1e-9 * height
    assert pixel[1] == pytest.approx(v * height)


@given(seeds, heights)
def test_pixels_lie_in_the_picture(seed: int, height: int) -> None:
    pixel = latlong_pixel(vectors(seed), height)
    assert ((pixel >= 0) & (pixel <= [2 * height, height])).all()
    assert (pixel[:, 0] < 2 * height).all()


def test_directions_match_the_angles_of_rows_and_columns() -> None:
    azimuth, elevation = latlong_angles(16)
    assert azimuth[[0, 15, 16, 31]].tolist() == [-174.375, -5.625, 5.625, 174.375]
    assert elevation[[0, 7, 8, 15]].tolist() == [84.375, 5.625, -5.625, -84.375]
    assert latlong_directions(16)[3, 9] == pytest.approx(direction(azimuth[9], elevation[3]))


@given(heights)
def test_solid_angles_sum_to_the_sphere(height: int) -> None:
    solid_angle = latlong_solid_angle(height)
    assert solid_angle.shape == (height,)
    assert (solid_angle > 0).all()
    assert solid_angle.sum() * 2 * height == pytest.approx(4 * np.pi)
    assert solid_angle == pytest.approx(solid_angle[::-1])


def test_a_cap_has_its_solid_angle() -> None:
    rows = 90 - latlong_angles(180)[1] < 30
    assert latlong_solid_angle(180)[rows].sum() * 360 == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(30))))


# Sampling


@given(seeds, heights)
def test_sampling_pixel_centres_gives_the_pixels(seed: int, height: int) -> None:
    image = picture(seed, height)
    np.testing.assert_allclose(sample_latlong(image, latlong_directions(height)), image, atol=1e-5)


@given(seeds, heights)
def test_mirror_commutes_with_sampling(seed: int, height: int) -> None:
    image, d = picture(seed, height), vectors(seed)
    mirrored = sample_latlong(image[:, ::-1], d * [-1, 1, 1])
    np.testing.assert_allclose(mirrored, sample_latlong(image, d), atol=1e-5)


@given(seeds, heights, st.integers(-100, 100))
def test_yaw_commutes_with_sampling(seed: int, height: int, columns: int) -> None:
    image = picture(seed, height)
    azimuth, elevation = angles(vectors(seed))
    turned = direction(azimuth + columns * 180 / height, elevation)
    np.testing.assert_allclose(
        sample_latlong(np.roll(image, columns, axis=1), turned),
        sample_latlong(image, direction(azimuth, elevation)),
        atol=1e-5,
    )


@given(seeds, heights)
def test_upside_down_commutes_with_sampling(seed: int, height: int) -> None:
    image, d = picture(seed, height), vectors(seed)
    flipped = sample_latlong(image[::-1], d * [1, -1, 1])
    np.testing.assert_allclose(flipped, sample_latlong(image, d), atol=1e-5)


@given(seeds)
def test_sampling_a_smooth_picture_is_accurate_everywhere(seed: int) -> None:
    d = vectors(seed)
    d = np.concatenate([d / np.linalg.norm(d, axis=1, keepdims=True), [Y, -Y, Z, X, -X, -Z]])
    image = latlong_directions(64).astype(np.float32)  # a picture whose color is its own direction
    assert np.abs(sample_latlong(image, d) - d).max() < (np.pi / 64) ** 2 / 4 + 1e-6


def test_the_seam_interpolates_between_the_outer_columns() -> None:
    image = np.zeros((8, 16, 1), dtype=np.float32)
    image[:, 0], image[:, 15] = 1.0, 3.0
    assert sample_latlong(image, direction([180.0, -180.0], 0.0)).ravel() == pytest.approx([2.0, 2.0])


@pytest.mark.parametrize(("row", "elevation"), [(0, 90.0), (7, -90.0)])
def test_a_pole_interpolates_with_the_opposite_side(row: int, elevation: float) -> None:
    image = np.zeros((8, 16, 1), dtype=np.float32)
    image[row, 12], image[row, 4] = 1.0, 3.0
    azimuth = latlong_angles(8)[0][12]
    inner = np.sign(elevation) * (90 - 180 / 8 / 4)
    assert sample_latlong(image, direction(azimuth, elevation))[0] == pytest.approx(2.0)
    assert sample_latlong(image, direction(azimuth, inner))[0] == pytest.approx(0.75 * 1 + 0.25 * 3)


def test_any_number_of_channels_and_any_shape() -> None:
    image = np.ones((4, 8, 5), dtype=np.float32)
    assert sample_latlong(image, np.ones((2, 3, 3))).shape == (2, 3, 5)
    assert sample_latlong(image, X).shape == (5,)


# Camera


@given(fields_of_view, azimuths, tilts, rolls, st.sampled_from([(7, 4), (4, 7), (6, 6), (1, 1)]))
def test_camera_pixels_come_back(
    vertical_fov: float, azimuth: float, elevation: float, roll: float, size: tuple[int, int]
) -> None:
    width, height = size
    rays = camera_directions(Pinhole(width, height, vertical_fov, azimuth, elevation, roll))
    assert rays.shape == (height, width, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1)
    pixel = camera_pixel(rays, Pinhole(width, height, vertical_fov, azimuth, elevation, roll))
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    np.testing.assert_allclose(pixel, np.stack([x, y], axis=-1), atol=1e-6)


@given(azimuths, tilts, rolls)
def test_camera_axes_are_a_rotation(azimuth: float, elevation: float, roll: float) -> None:
    axes = camera_axes(azimuth, elevation, roll)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert axes[2] == pytest.approx(direction(azimuth, elevation))
    assert np.cross(axes[0], axes[1]) == pytest.approx(-axes[2])


@given(azimuths, tilts)
def test_without_roll_the_camera_stays_level(azimuth: float, elevation: float) -> None:
    right, up, _ = camera_axes(azimuth, elevation, 0)
    assert right[1] == pytest.approx(0, abs=1e-12)
    assert up[1] > 0


@given(fields_of_view, azimuths, tilts)
def test_the_field_of_view_is_vertical(vertical_fov: float, azimuth: float, elevation: float) -> None:
    _, up, forward = camera_axes(azimuth, elevation, 0)
    half = np.radians(vertical_fov / 2)
    top = np.cos(half) * forward + np.sin(half) * up
    pixel = camera_pixel(top, Pinhole(300, 200, vertical_fov, azimuth, elevation))
    assert pixel == pytest.approx([150, 0], abs=1e-6)
    assert 2 * np.degrees(np.arctan(100 / focal_length(200, vertical_fov))) == pytest.approx(vertical_fov)


def test_signs_of_the_camera() -> None:
    def seen(vector: Floats, **camera: float) -> Floats:
        return camera_pixel(vector, Pinhole(200, 200, 60.0, **camera))

    assert seen(direction(10, 0))[0] > 100  # to the right of where it points is to the right
    assert seen(direction(0, 10))[1] < 100  # above is above
    assert seen(direction(0, 0), elevation=10.0)[1] > 100  # looking up, the horizon sinks
    assert seen(direction(30, 0), azimuth=30.0) == pytest.approx([100, 100])
    assert seen(direction(10, 0), roll=10.0)[1] < 100  # turned clockwise, the horizon rises on the right
    assert seen(direction(-10, 0), roll=10.0)[1] > 100


def test_behind_the_camera_there_is_no_pixel() -> None:
    assert np.isnan(camera_pixel([Z, X], Pinhole(20, 20, 60.0))).all()


@given(azimuths, tilts, st.floats(0.01, 100.0), st.floats(1.01, 50.0))
def test_a_ray_towards_the_centre_ends_a_radius_before_it(
    azimuth: float, elevation: float, radius: float, radii: float
) -> None:
    towards = direction(azimuth, elevation)
    origin = np.array([3.0, -2.0, 7.0])
    distance = ray_sphere(origin, towards, origin + radii * radius * towards, radius)
    assert distance == pytest.approx((radii - 1) * radius, rel=1e-7)


def test_rays_enter_a_sphere_at_its_surface_up_to_its_rim() -> None:
    """From 2 radii away the rim stands at 30 deg, where the tangent is sqrt(3) long."""
    rays = direction([0.0, 29.999, 30.001, 0.0], [0.0, 0.0, 0.0, -15.0])
    distance = ray_sphere(np.zeros(3), rays, np.array([0.0, 0.0, -2.0]))
    assert distance[0] == pytest.approx(1.0)
    assert distance[1] == pytest.approx(np.sqrt(3.0), abs=0.01)
    assert np.isinf(distance[2])
    point = rays[3] * distance[3]
    assert np.linalg.norm(point - [0.0, 0.0, -2.0]) == pytest.approx(1.0)


def test_a_sphere_behind_or_around_the_origin_is_not_entered() -> None:
    assert np.isinf(ray_sphere(np.zeros(3), -Z, np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -0.5]]))).all()


def test_origins_rays_and_centres_broadcast_and_keep_their_precision() -> None:
    origins, rays = np.zeros((5, 1, 3), np.float32), np.tile(-Z, (4, 1)).astype(np.float32)
    found = ray_sphere(origins, rays, np.array([0.0, 0.0, -3.0], np.float32))
    assert found.shape == (5, 4)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, 2.0, rtol=1e-6)


def test_a_window_holds_the_true_cells_and_one_more_on_each_side() -> None:
    cells = np.zeros((6, 8), dtype=bool)
    assert pixel_window(cells, 60, 100) is None
    cells[2, 3] = True
    assert pixel_window(cells, 60, 100) == (slice(10, 40), slice(25, 63))
    cells[0, 7] = True
    assert pixel_window(cells, 60, 100) == (slice(0, 40), slice(25, 100))


SIDES = integers(1, 20_000)


@pytest.mark.parametrize(
    ("size", "side", "expected"),
    [((4000, 3000), 448, (448, 336)), ((3000, 4001), 1024, (768, 1024)), ((300, 200), 300, (300, 200))],
)
def test_pictures_are_shrunk_and_never_grow(size: tuple[int, int], side: int, expected: tuple[int, int]) -> None:
    assert shrink_size(*size, side) == expected


@given(SIDES, SIDES, SIDES)
def test_the_longer_side_is_what_is_asked_for(width: int, height: int, side: int) -> None:
    found = shrink_size(width, height, side)
    assert max(found) == min(side, max(width, height))
    assert min(found) >= 1


@given(SIDES, SIDES, SIDES, SIDES)
def test_a_box_is_filled_one_way(width: int, height: int, most_width: int, most_height: int) -> None:
    found = fit_in_box(width, height, most_width, most_height)
    assert 1 <= found[0] <= most_width
    assert 1 <= found[1] <= most_height
    assert found[0] == most_width or found[1] == most_height


def test_no_picture_is_empty() -> None:
    assert scale_size(1000, 1, 0.01) == (10, 1)
