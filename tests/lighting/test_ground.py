"""Where an object may stand, and what is known of a photo's ground."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lighting.envmap.projection import photo_camera
from lighting.envmap.relighting import edit_lighting, rotate_lighting
from lighting.envmap.shadow_mask import is_in_shade
from lighting.errors import ParameterError
from lighting.estimator import Estimator
from lighting.fusion.user_input import UserInput
from lighting.geometry import Pinhole, angle_between, camera_directions, camera_pixel
from lighting.ground import (
    OBJECT_RADIUS,
    _find_ground_spot,
    _visible_ground,
    describe_ground,
    draw_ground_mask,
    find_lit_spot,
    is_in_sun,
    max_object_meters,
    object_radius,
    spot_warnings,
)
from lighting.photo.reader import photo_from_array, read_photo
from lighting.prediction import (
    EstimatedLight,
    Segments,
    SurfaceClass,
    class_planes,
    class_share,
    photo_segments,
    pixel_share,
)
from lighting.records import Lighting
from tests.helpers.predictions import prediction
from tests.helpers.scenes import distribution


def test_the_nearest_ground_in_the_sun_has_room_beside_it() -> None:
    mask = np.full((10, 10, 3), 200, dtype=np.uint8)
    mask[:, :5, 1] = 0
    assert find_lit_spot(mask, (0.1, 0.55)) == (0.75, 0.55)
    assert find_lit_spot(np.roll(mask, 1, axis=-1), (0.1, 0.55)) == (0.75, 0.55)  # where an object would be in shade
    assert find_lit_spot(mask, (2.0, -1.0)) == (0.75, 0.25)
    assert find_lit_spot(mask * np.array([1, 0, 1], dtype=np.uint8), (0.1, 0.5)) is None


CAMERA = Pinhole(1600, 1200, 50.0, elevation=-10.0)
LIGHT = Lighting(30.0, 40.0, 3.0, 5.0, camera_elevation=-10.0)


def cells(*patches: tuple[slice, slice, SurfaceClass]) -> Segments:
    """Sky over ground, with patches of other classes."""
    numbers = np.full((18, 24), SurfaceClass.SKY)
    numbers[8:] = SurfaceClass.GROUND
    for rows, columns, kind in patches:
        numbers[rows, columns] = kind
    segments: Segments = np.eye(10, dtype=np.float32)[numbers]
    return segments


def test_on_open_ground_the_spot_is_in_the_lower_middle() -> None:
    spot = _find_ground_spot(cells(), CAMERA, 1.6)
    assert spot is not None
    assert spot.pixel[0] == pytest.approx(800, abs=60)
    assert 0.7 < spot.pixel[1] / 1200 < 0.9
    assert camera_pixel(np.array(spot.direction), CAMERA) == pytest.approx(spot.pixel, abs=0.1)
    assert np.linalg.norm(spot.direction) == pytest.approx(1.0)


@pytest.mark.parametrize("kind", [kind for kind in SurfaceClass if kind != SurfaceClass.GROUND])
@pytest.mark.parametrize(("columns", "side"), [(slice(6, 14), 1), (slice(10, 18), -1)])
def test_the_spot_is_beside_what_is_no_ground(kind: SurfaceClass, columns: slice, side: int) -> None:
    spot = _find_ground_spot(cells((slice(8, 18), columns, kind)), CAMERA, 1.6)
    assert spot is not None
    edge = 1600 / 24 * (columns.stop if side > 0 else columns.start)
    assert (spot.pixel[0] - edge) * side > OBJECT_RADIUS * 1200


@pytest.mark.parametrize("kind", [SurfaceClass.WATER, SurfaceClass.PLANTS, SurfaceClass.UNEVEN, SurfaceClass.BUILDING])
def test_a_picture_without_ground_has_no_spot(kind: SurfaceClass) -> None:
    everywhere = cells((slice(8, 18), slice(0, 24), kind))
    assert _find_ground_spot(everywhere, CAMERA, 1.6) is None
    assert _visible_ground(everywhere) == 0.0


def test_what_looks_like_ground_above_the_horizon_has_no_spot() -> None:
    assert _find_ground_spot(cells(), replace(CAMERA, elevation=50.0), 1.6) is None


def test_ground_so_far_below_that_an_object_is_not_seen_has_no_spot() -> None:
    assert _find_ground_spot(cells(), replace(CAMERA, elevation=-40.0), 40.0) is not None
    assert _find_ground_spot(cells(), replace(CAMERA, elevation=-40.0), 400.0) is None


@pytest.mark.parametrize("size", [(32, 256), (256, 32), (33, 33)])
def test_narrow_and_tiny_pictures_have_their_spot_inside(size: tuple[int, int]) -> None:
    spot = _find_ground_spot(cells(), replace(CAMERA, width=size[0], height=size[1]), 1.6)
    assert spot is not None
    assert 0 < spot.pixel[0] < size[0]
    assert 0 < spot.pixel[1] < size[1]


def test_the_balls_are_no_giants() -> None:
    assert object_radius(CAMERA, np.array(1.0), 1.6) == pytest.approx(OBJECT_RADIUS * 1200)
    assert object_radius(CAMERA, np.array(-1.0), 1.6) == 0.0
    assert max_object_meters(1.6) == pytest.approx(0.64)
    assert max_object_meters(100.0) == 1.0


def test_visible_ground_is_the_share_of_its_cells() -> None:
    assert _visible_ground(cells()) == pytest.approx(10 / 18)


def test_the_mask_holds_ground_sunlight_and_where_an_object_is_in_the_sun() -> None:
    lit = np.zeros((36, 48), dtype=np.float32)
    things = cells((slice(8, 18), slice(12, 24), SurfaceClass.PERSON))
    mask = draw_ground_mask(lit, LIGHT, things)
    assert mask.shape == (36, 48, 3)
    assert mask[30, 4].tolist() == [255, 0, 0]
    assert mask[30, 44].tolist() == [0, 0, 0]
    assert draw_ground_mask(lit, LIGHT, None)[0, 0].tolist() == [255, 0, 0]
    assert draw_ground_mask(1 - lit, LIGHT, things)[30, 44].tolist() == [0, 0, 255]


def test_the_mask_says_of_shade_what_preview_and_scenes_say() -> None:
    lit = np.random.default_rng(0).uniform(0, 1, (36, 48)).astype(np.float32)
    camera = photo_camera(LIGHT, 48, 36)
    rays = camera_directions(camera)
    sunny = draw_ground_mask(lit, LIGHT, None)[..., 2] > 0
    assert 0.2 < sunny.mean() < 0.8
    for row, column in np.ndindex(lit.shape):
        ray = rays[row, column]
        radius = float(object_radius(camera, -ray[1] / (ray @ camera.axes[2]), LIGHT.camera_height))
        assert is_in_shade(lit, camera, ray[None], radius) != sunny[row, column]


def test_a_foot_beside_the_photo_counts_as_at_its_edge() -> None:
    sunny = np.array([[True, True], [False, True]])
    assert is_in_sun(sunny, np.array([1.4, 1.3]))
    assert not is_in_sun(sunny, np.array([-0.2, 1.01]))
    assert is_in_sun(sunny, np.array([np.nan, np.nan]))


def test_an_estimate_says_what_its_photo_shows() -> None:
    photo, estimate = (
        photo_from_array(np.full((120, 160, 3), 128, dtype=np.uint8)),
        EstimatedLight(LIGHT, distribution()),
    )
    predicted = replace(prediction(), segments=np.full((28, 28, 10), 0.1, dtype=np.float32))
    answer = describe_ground(photo, estimate, predicted)
    assert answer.segments is not None
    assert answer.segments.shape == (18, 24, 10)
    assert answer.lighting.ground_visible is not None
    record = answer.lighting.to_dict()["ground"]
    assert {"spot", "visible"} <= set(record)
    flying = describe_ground(photo, estimate, predicted, is_aerial=True)
    assert flying.lighting.to_dict()["ground"]["spot"] is None
    assert describe_ground(photo, estimate, replace(predicted, segments=None)) is estimate


def test_the_warning_says_why_there_is_no_spot() -> None:
    assert spot_warnings(LIGHT) == ()
    assert spot_warnings(with_spot()) == ()
    assert "no firm, level ground" in spot_warnings(replace(LIGHT, ground_visible=0.0))[0]
    assert "too far" in spot_warnings(replace(LIGHT, ground_visible=0.4))[0]


def with_spot() -> Lighting:
    spot = _find_ground_spot(cells(), CAMERA, 1.6)
    assert spot is not None
    return replace(LIGHT, ground_visible=0.5, spot_pixel=spot.pixel, spot_direction=spot.direction)


def test_a_spot_turns_with_the_map() -> None:
    light = with_spot()
    turned = rotate_lighting(light, 90.0)
    assert light.spot_direction is not None
    assert turned.spot_direction is not None
    x, y, z = light.spot_direction
    assert turned.spot_direction == pytest.approx((-z, y, x), abs=1e-6)
    assert turned.spot_pixel == light.spot_pixel


def test_a_spot_stays_on_its_pixel_when_the_camera_is_edited() -> None:
    light = with_spot()
    edited = edit_lighting(light, {"camera_elevation": -20.0, "vertical_fov": 70.0, "camera_roll": 5.0})
    assert edited.spot_direction is not None
    camera = replace(CAMERA, elevation=-20.0, vertical_fov=70.0, roll=5.0)
    assert camera_pixel(np.array(edited.spot_direction), camera) == pytest.approx(light.spot_pixel, abs=0.1)
    up = edit_lighting(light, {"camera_elevation": 60.0})
    assert (up.spot_pixel, up.spot_direction) == (None, None)
    moved = edit_lighting(light, {"sun_azimuth": 10.0})
    assert light.spot_direction is not None
    assert moved.spot_direction is not None
    assert angle_between(np.array(moved.spot_direction), np.array(light.spot_direction)) == 0.0


ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("size", "shape"), [((160, 120), (18, 24)), ((120, 160), (24, 18)), ((256, 128), (18, 24))])
def test_cells_of_the_photo_are_those_of_the_canvas_without_its_margins(
    size: tuple[int, int], shape: tuple[int, int]
) -> None:
    """The canvas shows water beside the photo, and in it plants on the left, sky on the right."""
    width, height = (28 * side // max(size) for side in size)
    top, left = (28 - height) // 2, (28 - width) // 2
    numbers = np.full((28, 28), SurfaceClass.WATER)
    numbers[top : top + height, left:14] = SurfaceClass.PLANTS
    numbers[top : top + height, 14 : left + width] = SurfaceClass.SKY
    segments = photo_segments(np.eye(10, dtype=np.float32)[numbers], *size)
    assert segments is not None
    assert segments.shape == (*shape, 10)
    assert segments.sum(axis=2) == pytest.approx(1.0, abs=1e-5)
    assert class_share(segments, SurfaceClass.WATER).max() < 0.6  # at the edges alone
    assert class_share(segments, SurfaceClass.WATER)[2:-2, 2:-2].max() < 0.01
    assert class_share(segments[2:-2, 2 : shape[1] // 2 - 1], SurfaceClass.PLANTS).min() > 0.9
    assert class_share(segments[2:-2, shape[1] // 2 + 1 : -2], SurfaceClass.SKY).min() > 0.9


def test_an_example_shows_sky_over_ground() -> None:
    photo = read_photo(ROOT / "examples" / "wide_street.jpg")
    segments = Estimator()(photo).segments
    assert segments is not None
    rows = len(segments)
    assert class_share(segments[: rows // 5], SurfaceClass.SKY).mean() > 0.5
    assert class_share(segments[-rows // 5 :], SurfaceClass.GROUND).mean() > 0.7


def test_shares_add_up_and_are_enlarged_smoothly() -> None:
    segments = np.zeros((2, 2, 10), dtype=np.float32)
    segments[..., SurfaceClass.PERSON], segments[..., SurfaceClass.VEHICLE] = 0.25, 0.5
    both = class_share(segments, SurfaceClass.PERSON, SurfaceClass.VEHICLE)
    assert both.tolist() == [[0.75, 0.75], [0.75, 0.75]]
    segments = np.zeros((1, 2, 10), dtype=np.float32)
    segments[0, 1, SurfaceClass.WATER] = 1.0
    enlarged = pixel_share(segments, 8, 3, SurfaceClass.WATER)
    assert enlarged.shape == (3, 8)
    assert (np.diff(enlarged[0]) >= 0).all()


@pytest.mark.parametrize("size", [(96, 72), (31, 40), (9, 7)])
def test_planes_of_classes_are_resized_as_pillow_does(size: tuple[int, int]) -> None:
    segments = np.random.default_rng(0).random((18, 24, 10), dtype=np.float32)
    expected = [
        np.asarray(Image.fromarray(plane).resize(size, Image.Resampling.BILINEAR))
        for plane in segments.transpose(2, 0, 1).copy()
    ]
    assert class_planes(segments, *size) == pytest.approx(np.stack(expected), abs=1e-6)
    sky = pixel_share(segments, *size, SurfaceClass.SKY)
    assert sky == pytest.approx(expected[SurfaceClass.SKY], abs=1e-6)


@pytest.mark.parametrize("size", [(160, 120), (100, 121)])
def test_cells_of_a_photo_are_resized_from_their_part_of_the_canvas_as_pillow_does(size: tuple[int, int]) -> None:
    canvas = np.random.default_rng(0).random((28, 28, 10), dtype=np.float32)
    left, top = ((28 - round(224 * side / max(size)) / 8) / 2 for side in size)
    water = Image.fromarray(canvas[..., SurfaceClass.WATER].copy())
    cells = (24, 18) if size[0] > size[1] else (18, 24)
    expected = water.resize(cells, Image.Resampling.BILINEAR, box=(left, top, 28 - left, 28 - top))
    segments = photo_segments(canvas, *size)
    assert segments is not None
    assert segments[..., SurfaceClass.WATER] == pytest.approx(np.asarray(expected), abs=1e-6)


def test_an_object_stands_where_the_user_says() -> None:
    photo, predicted = photo_from_array(np.full((60, 80, 3), 128, np.uint8)), prediction()
    estimate = EstimatedLight(LIGHT, distribution())
    light = describe_ground(photo, estimate, predicted, is_aerial=True, stated=(12.0, 55.0)).lighting
    assert light.spot_pixel == (12.0, 55.0)
    assert light.spot_direction is not None
    camera = photo_camera(light, photo.width, photo.height)
    np.testing.assert_allclose(camera_pixel(np.array(light.spot_direction), camera), (12.0, 55.0), atol=0.01)


@pytest.mark.parametrize(("spot", "words"), [((90.0, 50.0), "outside the photo"), ((40.0, 2.0), "at the horizon")])
def test_a_spot_without_ground_is_refused(spot: tuple[float, float], words: str) -> None:
    photo, predicted = photo_from_array(np.full((60, 80, 3), 128, np.uint8)), prediction()
    estimate = EstimatedLight(LIGHT, distribution())
    with pytest.raises(ParameterError, match=words) as refused:
        describe_ground(photo, estimate, predicted, stated=spot)
    assert refused.value.field == "spot"


def test_a_spot_is_read_and_checked() -> None:
    assert UserInput(spot="640,820.5").spot == (640.0, 820.5)
    assert UserInput(spot=(0.0, 0.0)).drawn_fields == ("spot",)
    for wrong in ("640", "640,x", (1.0, float("nan")), (1.0,)):
        with pytest.raises(ParameterError, match="spot"):
            UserInput(spot=wrong)  # type: ignore[arg-type]


def test_balls_cover_nothing_that_is_nearer() -> None:
    """A pole stands where the left ball would be; beside it there is room."""
    free = _find_ground_spot(cells(), CAMERA, 1.6)
    pole = _find_ground_spot(cells((slice(4, 18), slice(8, 10), SurfaceClass.OBJECT)), CAMERA, 1.6)
    assert free is not None
    assert pole is not None
    middle, radius = 9 * 1600 / 24, OBJECT_RADIUS * 1200
    assert abs(free.pixel[0] - 2.6 * radius - middle) < radius
    for ball in (-2.6, 0.0, 2.6):
        assert abs(pole.pixel[0] + ball * radius - middle) > radius
