"""A scene's camera, light, spot and placeholder."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lighting.color import color_and_intensity
from lighting.envmap.relighting import edit_lighting
from lighting.envmap.render import render
from lighting.envmap.surroundings import PhotoContext
from lighting.errors import ParameterError
from lighting.geometry import (
    EYE_HEIGHT,
    OBJECT_POSITION,
    Pinhole,
    angle_between,
    camera_directions,
    camera_pixel,
    direction,
    latlong_angles,
    latlong_solid_angle,
    to_z_up,
)
from lighting.photo.reader import Photo
from lighting.prediction import SurfaceClass
from lighting.preview.spheres import DIFFUSE_REFLECTANCE
from lighting.scene.records import PLACEHOLDER_ALBEDO, make_scene
from tests.helpers.scenes import LIGHT, PLAIN, half_shaded_scene, plain_scene, shaded_spot_scene, sunlit_scene


def test_z_up_keeps_right_handedness() -> None:
    right, up, forward = to_z_up(np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0]]))
    assert np.cross(right, forward) == pytest.approx(up)
    assert up == pytest.approx([0, 0, 1])
    assert forward == pytest.approx([0, 1, 0])


def test_colour_and_strength_multiply_to_the_irradiance() -> None:
    color, strength = color_and_intensity(np.array([2.0, 8.0, 4.0]))
    assert color.tolist() == [0.25, 1.0, 0.5]
    assert strength == 8.0
    assert color_and_intensity(np.zeros(3))[1] == 0.0
    assert color_and_intensity(np.zeros(3))[0].tolist() == [1.0, 1.0, 1.0]


CASE = Path(__file__).with_name("spot.json")

# Geometry


def test_a_scene_is_made_of_a_lighting_and_not_of_an_estimate() -> None:
    estimate: Any = object()
    with pytest.raises(ParameterError, match="A Lighting is needed, not object"):
        make_scene(Photo(PLAIN, 40, 30, "PNG"), estimate)


def test_the_camera_matrix_agrees_with_the_rays_of_the_photo() -> None:
    scene = sunlit_scene()
    rays = camera_directions(Pinhole(480, 360, scene.vertical_fov, elevation=-12.0, roll=4.0))
    x = 0.5 * scene.sensor_width / scene.focal_length * (1 - 1 / 480)
    y = np.tan(np.radians(scene.vertical_fov) / 2) * (1 - 1 / 360)
    corner = scene.camera_matrix[:3, :3] @ np.array([x, y, -1.0])
    assert angle_between(corner, rays[0, -1]) < 1e-6
    assert np.linalg.det(scene.camera_matrix) == pytest.approx(1.0)
    assert scene.camera_matrix[:3, 3] == pytest.approx([0.0, EYE_HEIGHT, 0.0])


@pytest.mark.parametrize("roll", [-20.0, 0.0, 7.0])
def test_the_spot_is_on_the_ground_in_the_lower_middle_of_the_picture(roll: float) -> None:
    scene = plain_scene(camera_roll=roll)
    pixel = camera_pixel(scene.spot - scene.camera_position, Pinhole(40, 30, scene.vertical_fov, 0.0, -12.0, roll))
    assert pixel == pytest.approx([20.0, 24.0])
    assert scene.spot[1] == 0.0


def test_the_spot_is_where_the_page_puts_an_object() -> None:
    """The page's own test reads the same file."""
    case = json.loads(CASE.read_text())
    camera = case["camera"]
    scene = plain_scene(
        camera_elevation=camera["elevation"], camera_roll=camera["roll"], vertical_fov=camera["vertical_fov"]
    )
    assert case["shares"] == [0.5, 0.5 + OBJECT_POSITION / 2]
    assert scene.spot - scene.camera_position == pytest.approx(case["point"], abs=1e-5)


@pytest.mark.parametrize("elevation", [-90.0, -89.0, 0.0, 40.0, 90.0])
def test_the_spot_exists_wherever_the_camera_looks(elevation: float) -> None:
    scene = plain_scene(camera_elevation=elevation)
    assert np.isfinite(scene.spot).all()
    assert np.linalg.norm(scene.spot) < 40


@pytest.mark.parametrize(("elevation", "fov"), [(-90.0, 50.0), (-12.0, 50.0), (10.0, 50.0), (25.0, 84.0)])
def test_a_spot_in_the_picture_has_no_warning(elevation: float, fov: float) -> None:
    assert plain_scene(camera_elevation=elevation, vertical_fov=fov).warnings == ()


@pytest.mark.parametrize(("elevation", "fov"), [(4.5, 7.0), (40.0, 50.0), (90.0, 50.0)])
def test_a_spot_that_the_picture_does_not_show_has_a_warning(elevation: float, fov: float) -> None:
    scene = plain_scene(camera_elevation=elevation, vertical_fov=fov, warnings=("It was night.",))
    night, hidden = scene.warnings
    assert night == "It was night."
    assert hidden.endswith("would stand 32 m ahead, below the picture's edge.")


def test_the_object_stands_on_the_records_spot_at_the_cameras_height() -> None:
    forward = direction(10.0, -15.0)
    light = replace(LIGHT, camera_height=5.0, ground_visible=0.4, spot_pixel=(3.0, 4.0), spot_direction=tuple(forward))
    scene = make_scene(Photo(PLAIN, 40, 30, "PNG"), light, map_height=32)
    assert scene.camera_position == pytest.approx([0.0, 5.0, 0.0])
    assert scene.spot[1] == 0.0
    assert angle_between(scene.spot - scene.camera_position, forward) < 1e-4
    assert scene.warnings == ()


def test_without_a_spot_the_object_stands_on_a_stage_of_its_own() -> None:
    """A warning says so, and no shadow of the sun falls on the photo."""
    scene = plain_scene(ground_visible=0.0)
    (warning,) = scene.warnings
    assert "their own stage" in warning
    assert scene.shadow_receivers.max() == 0.0
    assert plain_scene().shadow_receivers.max() == 1.0


def test_no_shadow_falls_on_what_stands_before_the_ground() -> None:
    segments = np.zeros((9, 12, 10), dtype=np.float32)
    segments[..., SurfaceClass.GROUND] = 1.0
    segments[:, :6] = np.eye(10)[SurfaceClass.PERSON]
    scene = make_scene(Photo(PLAIN, 40, 30, "PNG"), LIGHT, map_height=32, segments=segments)
    assert scene.shadow_receivers[:, :14].max() == 0.0
    assert scene.shadow_receivers[-3:, -14:].min() == 1.0


def test_the_placeholder_is_no_giant() -> None:
    """From 80 m above, the ball would be as large as a house in the share of the picture that it has on a street."""
    scene = plain_scene(camera_height=80.0, camera_elevation=-40.0)
    assert scene.placeholder.ball_radius == 1.0
    assert plain_scene().placeholder.ball_radius < 0.7


# Light


def test_the_map_and_the_sun_together_are_the_whole_light() -> None:
    scene = plain_scene(exposure=0.5)
    weight = latlong_solid_angle(32)[:, None, None]
    whole = (render(scene.lighting, 32, sun=True) * weight).sum(axis=(0, 1), dtype=np.float64)
    assert (scene.environment * weight).sum(axis=(0, 1)) + scene.sun_irradiance == pytest.approx(whole, rel=1e-4)


def test_the_ground_in_the_map_is_what_a_renderer_makes_of_the_plane() -> None:
    scene = plain_scene(sun_elevation=20.0)
    irradiance = scene.sky_irradiance + scene.sun_irradiance * scene.sun_direction[1]
    assert scene.environment[-1, 0] == pytest.approx(irradiance * LIGHT.ground_albedo / np.pi, rel=1e-4)
    assert scene.shadow == pytest.approx(scene.sky_irradiance / irradiance)


def test_without_direct_sun_there_is_no_sun_light() -> None:
    for scene in (plain_scene(sun_visibility=0.2), make_scene(Photo(PLAIN, 40, 30, "PNG"), LIGHT, sun=False)):
        assert scene.sun_irradiance == pytest.approx(0.0)
        assert scene.shadow == pytest.approx(1.0)
        expected = render(scene.lighting, len(scene.environment), sun=False)
        np.testing.assert_allclose(scene.environment, expected, rtol=1e-6)  # a thousandth of the time of pytest.approx


def test_the_sun_lies_where_the_record_says() -> None:
    assert angle_between(sunlit_scene().sun_direction, direction(-40.0, 35.0)) < 1e-6


def test_the_place_is_in_the_map_with_the_same_light() -> None:
    cells = np.random.default_rng(2).uniform(0.1, 1.0, (12, 24, 3)).astype(np.float32)
    plain = plain_scene()
    in_place = make_scene(
        Photo(PLAIN, 40, 30, "PNG"), plain.lighting, map_height=32, context=PhotoContext(PLAIN, cells)
    )
    assert not np.allclose(in_place.environment, plain.environment)
    weight = (latlong_solid_angle(32) * np.sin(np.radians(latlong_angles(32)[1])))[:16, None, None]
    level = [(scene.environment[:16] * weight).sum(axis=(0, 1)) for scene in (in_place, plain)]
    assert level[0] == pytest.approx(level[1], rel=1e-2)
    assert in_place.sun_irradiance == pytest.approx(plain.sun_irradiance)


def test_where_a_channel_has_no_light_its_shadow_is_none() -> None:
    shadow = plain_scene(sky_irradiance=(0.3, 0.3, 0.0), sun_irradiance=(1.0, 0.5, 0.0)).shadow
    assert shadow[2] == 1.0
    assert (shadow[:2] < 1.0).all()


# The spot in shade


def test_the_spot_is_in_shade_where_the_plates_ground_around_it_is() -> None:
    assert (sunlit_scene().spot_in_shade, shaded_spot_scene().spot_in_shade) == (False, True)


def test_a_spot_in_shade_has_a_warning() -> None:
    assert sunlit_scene().warnings == ()
    (shaded,) = shaded_spot_scene().warnings
    assert shaded.startswith("The object is in the photo's shade")


def test_a_spot_in_shade_just_below_the_picture_has_both_warnings() -> None:
    """Tools take the sun from the object by the shade at the picture's edge."""
    scene = plain_scene(camera_elevation=1.0, vertical_fov=7.0)
    scene = replace(scene, lit_ground=np.zeros_like(scene.lit_ground))
    hidden, shaded = scene.warnings
    assert hidden.startswith("The object would stand")
    assert shaded.startswith("The object is in the photo's shade")


@pytest.mark.parametrize("stops", [-3.0, 3.0])
def test_shade_is_where_the_photo_has_it_whatever_the_exposure_of_the_scene(stops: float) -> None:
    scene = half_shaded_scene()
    photo, exposure = Photo(scene.plate, scene.width, scene.height, "PNG"), scene.lighting.exposure
    light = edit_lighting(scene.lighting, {"exposure": exposure * 2.0**stops})
    context = PhotoContext(scene.plate, exposure=exposure)
    assert np.array_equal(make_scene(photo, light, map_height=32, context=context).lit_ground, scene.lit_ground)


def test_a_scene_without_sun_has_no_spot_in_shade() -> None:
    scene = shaded_spot_scene()
    photo = Photo(scene.plate, scene.width, scene.height, "PNG")
    assert not make_scene(photo, scene.lighting, map_height=32, sun=False).spot_in_shade


def test_the_ball_always_has_the_same_size_in_the_picture() -> None:
    for scene in (plain_scene(), plain_scene(vertical_fov=25.0), plain_scene(camera_elevation=-40.0)):
        distance = np.linalg.norm(scene.spot - scene.camera_position)
        half_picture = distance * np.tan(np.radians(scene.vertical_fov) / 2)
        assert scene.placeholder.ball_radius / half_picture == pytest.approx(0.16)


@pytest.mark.parametrize("elevation", [-90.0, -12.0, 0.0, 90.0])
def test_both_stand_on_the_ground_apart_from_each_other(elevation: float) -> None:
    placeholder = plain_scene(camera_elevation=elevation).placeholder
    assert placeholder.ball_radius > 0.05
    assert placeholder.ball_center[1] == placeholder.ball_radius
    assert placeholder.stick_foot[1] == 0.0
    assert placeholder.stick_foot[0] - placeholder.stick_radius > placeholder.ball_radius
    assert placeholder.stick_height > 2 * placeholder.ball_radius


def test_it_is_as_grey_as_the_ball_of_previews() -> None:
    """So pictures of both can be compared, and less sunlight burns out."""
    assert PLACEHOLDER_ALBEDO == DIFFUSE_REFLECTANCE
