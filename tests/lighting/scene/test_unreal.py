"""The editor's script for Unreal, run against a stand-in of its module `unreal`. It was not run in the engine."""

import runpy
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from lighting.color import srgb_decode
from lighting.geometry import Floats
from lighting.scene import unreal
from lighting.scene.records import Scene
from tests.helpers import unreal as stand_in
from tests.helpers.scenes import half_shaded_scene, plain_scene, save_files, shaded_spot_scene, sunlit_scene


def run(
    scene: Scene, folder: Path, monkeypatch: pytest.MonkeyPatch, level: stand_in.Level | None = None
) -> stand_in.Level:
    folder.mkdir(exist_ok=True)
    save_files(folder, unreal.encode_unreal(scene))
    made = level or stand_in.Level()
    monkeypatch.setitem(sys.modules, "unreal", made.module())
    runpy.run_path(str(folder / "unreal_scene.py"))
    return made


@pytest.fixture
def level(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> stand_in.Level:
    return run(sunlit_scene(), tmp_path, monkeypatch)


def to_unreal(vectors: Floats) -> Floats:
    """Vectors (..., 3) of our frame in Unreal's: forward, right, up."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([-z, x, y], axis=-1)


def test_the_sun_shines_as_it_does(level: stand_in.Level) -> None:
    scene, light = sunlit_scene(), level["Sun"].part.values
    assert level["Sun"].rotation.axes[0] == pytest.approx(-to_unreal(scene.sun_direction), abs=1e-6)
    color = light["light_color"]
    linear = srgb_decode(np.array([color.r, color.g, color.b]) / 255.0)
    assert light["intensity"] * linear == pytest.approx(scene.sun_irradiance, rel=0.01)  # of 8 bits
    assert light["light_source_angle"] == pytest.approx(0.5358)
    assert (light["atmosphere_sun_light"], light["use_temperature"], light["affects_world"]) == (False, False, True)


def test_the_sky_is_the_map_with_its_ground(level: stand_in.Level) -> None:
    sky = level["Sky"].part
    assert isinstance(sky, stand_in.SkyLightComponent)
    assert sky.captured
    assert sky.values["source_type"] is stand_in.SkyLightSourceType.SLS_SPECIFIED_CUBEMAP
    assert sky.values["cubemap"].path.name == "environment.hdr"
    assert (sky.values["lower_hemisphere_is_black"], sky.values["intensity"]) == (False, 1.0)


def test_the_cubemaps_angle_puts_the_maps_centre_before_the_camera(level: stand_in.Level) -> None:
    """By the engine's sources: a lat-long's column is atan2(x, -y), and the lookup turns by the angle."""
    angle = np.radians(level["Sky"].part.values["source_cubemap_angle"])
    for ours, column in (([0, 0, -1], 0.5), ([1, 0, 0], 0.75), ([-1, 0, 0], 0.25)):
        x, y, _ = to_unreal(np.array(ours, float))
        x, y = x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)
        assert (1 + np.arctan2(x, -y) / np.pi) / 2 == pytest.approx(column)


@pytest.mark.parametrize("roll", [4.0, -7.0])
def test_the_camera_is_the_photos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, roll: float) -> None:
    scene = plain_scene(camera_roll=roll, camera_height=2.5)
    camera = run(scene, tmp_path, monkeypatch)["Camera"]
    right, up, forward = to_unreal(scene.camera_axes)
    assert camera.rotation.axes == pytest.approx(np.stack([forward, right, up]), abs=1e-6)
    assert camera.location.array == pytest.approx([0, 0, 250])
    lens = camera.part.values
    height = lens["filmback"].values["sensor_height"]
    assert 2 * np.degrees(np.arctan(height / 2 / lens["current_focal_length"])) == pytest.approx(50.0)
    assert lens["filmback"].values["sensor_width"] / height == pytest.approx(40 / 30)
    assert lens["constrain_aspect_ratio"]


def test_exposure_is_fixed_at_one(level: stand_in.Level) -> None:
    volume = level["Exposure"].values
    settings = volume["settings"].values
    assert volume["unbound"]
    assert settings["auto_exposure_method"] is stand_in.AutoExposureMethod.AEM_MANUAL
    assert (settings["auto_exposure_bias"], settings["auto_exposure_apply_physical_camera_exposure"]) == (0.0, False)
    stated = {name for name in settings if not name.startswith("override_")}
    assert {f"override_{name}" for name in stated} == {name for name in settings if name.startswith("override_")}


def test_the_backdrop_faces_the_camera_and_fills_its_picture(level: stand_in.Level) -> None:
    scene, plane, camera = sunlit_scene(), level["Backdrop"], level["Camera"]
    away = plane.location.array - camera.location.array
    distance = float(np.linalg.norm(away))
    assert away / distance == pytest.approx(to_unreal(scene.camera_axes[2]), abs=1e-6)
    assert plane.rotation.axes[2] == pytest.approx(-away / distance, abs=1e-6)
    diagonal = 2 * distance * np.tan(np.radians(25.0)) * np.hypot(1, scene.width / scene.height)
    assert min(plane.scale.x, plane.scale.y) * 100 > diagonal
    assert plane.parent is camera
    assert plane.part.material.values["shading_model"] is stand_in.MaterialShadingModel.MSM_UNLIT  # type: ignore[attr-defined]


def test_ball_and_stick_stand_on_the_spot(level: stand_in.Level) -> None:
    scene = sunlit_scene()
    made = scene.placeholder
    for label, center, size in (
        ("Ball", made.ball_center, [2 * made.ball_radius] * 3),
        ("Stick", made.stick_center, [2 * made.stick_radius] * 2 + [made.stick_height]),
    ):
        assert level[label].location.array == pytest.approx(100 * to_unreal(scene.spot + center))
        assert level[label].scale.array == pytest.approx(size)


def test_sun_and_ground_show_the_photo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its surface under sun and sky and its own light make the plate; shade holds no surface."""
    scene = half_shaded_scene()
    material = run(scene, tmp_path, monkeypatch)["Ground"].part.material  # type: ignore[attr-defined]
    albedo, emission = (
        srgb_decode(np.asarray(Image.open(material.inputs[target][0].values["texture"].path)) / 255.0)
        for target in (stand_in.MaterialProperty.MP_BASE_COLOR, stand_in.MaterialProperty.MP_EMISSIVE_COLOR)
    )
    level = (scene.sky_irradiance + scene.sun_irradiance * scene.sun_direction[1]) / np.pi
    np.testing.assert_allclose(albedo * level + emission, srgb_decode(scene.plate / 255.0), rtol=0, atol=0.006)
    assert albedo[300:350, 20:200].mean() > 0.1
    assert albedo[300:350, 260:460].max() == 0.0
    sunless = albedo[330, 40] * scene.sky_irradiance / np.pi + emission[330, 40]
    assert sunless == pytest.approx(scene.shadow * srgb_decode(scene.plate[330, 40] / 255.0), abs=0.006)


def test_an_object_in_the_photos_shade_has_no_sun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    level = run(shaded_spot_scene(), tmp_path, monkeypatch)
    assert level["Sun"].part.values["affects_world"] is False
    with Image.open(tmp_path / "ground_albedo.png") as albedo:
        assert np.asarray(albedo).max() == 0  # and the ground is the plate


def test_running_again_replaces_what_it_made_and_other_lights_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    level = stand_in.Level()
    other = level.spawn_actor_from_class(stand_in.DirectionalLight, stand_in.Vector(), stand_in.Rotator())
    for _ in range(2):
        run(sunlit_scene(), tmp_path, monkeypatch, level)
    assert len(level.actors) == 9
    assert other in level.actors
    assert level.warnings == ["The level has another light, which shines beside the photo's: DirectionalLight."] * 2


def test_the_map_is_radiance(tmp_path: Path) -> None:
    save_files(tmp_path, unreal.encode_unreal(plain_scene()))
    environment = plain_scene().environment
    read = cv2.imread(str(tmp_path / "environment.hdr"), cv2.IMREAD_UNCHANGED)
    assert read is not None
    error = np.abs(read[..., ::-1] - environment).max(axis=-1) / environment.max(axis=-1)
    assert error.max() < 1 / 128


def test_two_photos_have_assets_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    level = run(plain_scene(), tmp_path / "a", monkeypatch)
    first = dict(level.assets)
    run(replace(plain_scene(), plate=sunlit_scene().plate), tmp_path / "b", monkeypatch, level)
    assert {path: level.assets[path] for path in first} == first
    assert len(level.assets) == 2 * len(first)
    run(plain_scene(sun_azimuth=77.0), tmp_path / "a", monkeypatch, level)
    assert len(level.assets) == 2 * len(first)  # the same photo's were replaced
