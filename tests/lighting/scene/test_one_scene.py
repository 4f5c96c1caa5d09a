"""One scene for all tools: sun, light on the ground, shadow, camera and spot of three photos, as the files have them.

Computed from the files, and rendered where there is a renderer: Mitsuba always, Godot and Blender in the chroot of
scripts/engines.sh.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import mitsuba as mitsuba_renderer
import numpy as np
import pytest
from PIL import Image

from lighting.color import srgb_decode
from lighting.envmap.projection import photo_camera
from lighting.estimator import Estimator
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, camera_pixel
from lighting.photo.reader import read_photo
from lighting.scene import EXPORTERS
from lighting.scene.records import Scene, make_scene
from lighting.scene.writer import write_scene
from tests.helpers.engines import folder_in_chroot, needs_engines, run_in_chroot
from tests.helpers.exported import READERS, ExportedScene
from tests.helpers.materials import render_in_godot
from tests.helpers.pages import ROOT

mi: Any = mitsuba_renderer

# The height [m] of each photo's camera; the last has its spot in shade.
HEIGHTS = {"garden_noon": 1.6, "snow_field": 3.0, "garden_windows": 1.6}
SHADED_SPOT = (500, 800)  # in the last
UP = np.array([0.0, 1.0, 0.0])
PAGES = ("threejs", "page")


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    estimator = Estimator()
    made = {}
    for name, height in HEIGHTS.items():
        photo = read_photo((ROOT / "examples" / f"{name}.jpg").read_bytes(), target=320)
        stated = UserInput(spot=SHADED_SPOT) if name == "garden_windows" else UserInput()
        estimate = estimator(photo, stated)
        lighting = replace(estimate.lighting, camera_height=height)
        made[name] = make_scene(photo, lighting, map_height=128, segments=estimate.segments)
    assert [scene.spot_in_shade for scene in made.values()] == [False, False, True]
    return made


@pytest.fixture(params=HEIGHTS)
def scene(request: pytest.FixtureRequest, scenes: dict[str, Scene]) -> Scene:
    return scenes[request.param]


@pytest.fixture(params=sorted(set(EXPORTERS) - {"fspy"}))  # which takes the camera alone
def tool(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def exported(scene: Scene, tool: str, tmp_path: Path) -> ExportedScene:
    write_scene(scene, tool, tmp_path / "out")
    return READERS[tool](tmp_path / "out")


def test_every_tool_has_the_scene(exported: ExportedScene, scene: Scene, tool: str) -> None:
    # The camera, at its height, and the spot.
    assert exported.camera_axes == pytest.approx(scene.camera_axes, abs=1e-5)
    assert exported.camera_position == pytest.approx([0, scene.lighting.camera_height, 0], abs=1e-6)
    assert exported.vertical_fov == pytest.approx(scene.vertical_fov, abs=1e-3)
    assert exported.spot == pytest.approx(scene.spot, abs=1e-3)
    # The sun, and the tip of the shadow of what is as tall as the stick.
    assert exported.sun_direction == pytest.approx(scene.sun_direction, abs=1e-5)
    height = scene.placeholder.stick_height
    tips = [s.spot - s.sun_direction * height / s.sun_direction[1] for s in (exported, scene)]
    assert tips[0] == pytest.approx(tips[1], abs=0.002)
    # The shade rule.
    if tool not in PAGES:  # whose page follows it itself, wherever the object stands
        assert exported.sun_reaches_object is not scene.spot_in_shade
    assert exported.sun_irradiance == pytest.approx(scene.sun_irradiance, rel=0.01)
    # The light on open ground, and on walls to either side and behind the object.
    if exported.environment is not None:
        level = exported.sky_irradiance(UP) + exported.sun_irradiance * exported.sun_direction[1]
        assert level == pytest.approx(scene.sky_irradiance + scene.sun_irradiance * scene.sun_direction[1], rel=0.01)
        ours = replace(exported, environment=scene.environment, map_azimuth=0.0)
        for wall in ([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]):
            assert exported.sky_irradiance(np.array(wall)) == pytest.approx(
                ours.sky_irradiance(np.array(wall)), rel=0.01
            )


def test_every_tool_has_the_same_mask_of_lit_ground(exported: ExportedScene, scene: Scene, tool: str) -> None:
    height, width = exported.lit_ground.shape
    receivers = scene.shadow_receivers
    rows, columns = (
        ((np.arange(count) + 0.5) / count * ours).astype(int)
        for count, ours in zip((height, width), receivers.shape, strict=True)
    )
    ours = receivers[np.ix_(rows, columns)]
    shown = ours >= 0.5 if tool in PAGES or not scene.spot_in_shade else np.zeros_like(ours, bool)
    assert (exported.lit_ground == shown).mean() > 0.97  # but at the edges of shade


# Rendered by Mitsuba


def measure(folder: Path, scene: Scene, points: Floats) -> Floats:
    """Irradiance (N, 3) of the ground at points (N, 3) of the scene in a folder."""
    loaded = mi.load_file(str(folder / "scene.xml"), samples=1, width=1, height=1)
    values = []
    for point in points:
        meter = mi.load_dict(
            {
                "type": "radiancemeter",
                "origin": [point[0], 1e-3, point[2]],
                "direction": [0, -1, 0],
                "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}},
                "sampler": {"type": "independent", "sample_count": 16000},
            }
        )
        values.append(np.array(mi.render(loaded, sensor=meter, seed=3))[0, 0, :3])
    return np.array(values) * np.pi / scene.ground


@pytest.fixture(scope="module", autouse=True)
def _variant() -> None:
    mi.set_variant("scalar_rgb")


def test_mitsuba_lights_and_shades_the_ground_as_the_scene_says(scene: Scene, tmp_path: Path) -> None:
    write_scene(scene, "mitsuba", tmp_path / "out")
    level = scene.sky_irradiance + scene.sun_irradiance * scene.sun_direction[1]
    away = -scene.sun_direction * [1, 0, 1] / np.hypot(*scene.sun_direction[[0, 2]])
    aside = np.array([-away[2], 0.0, away[0]]) * np.sign(away[2])  # to the left, where no stick's shadow falls
    ball = scene.placeholder.ball_radius
    middle = scene.spot + away * ball / np.tan(np.arcsin(scene.sun_direction[1]))  # of the ball's shadow
    places = [0.0, 0.9, 1.1]  # across it, in radii
    points = np.array([*(middle + place * ball * aside for place in places), scene.spot - 30 * ball * away])
    shares = measure(tmp_path / "out", scene, points) / level
    assert shares[-1] == pytest.approx(np.ones(3), rel=0.02)
    assert (shares[:2] < scene.shadow + 0.02).all()
    assert (shares[2] > 0.9).all()


# Rendered by Godot and Blender


@needs_engines
def test_godot_renders_each_photos_light_and_shadow(scene: Scene) -> None:
    with folder_in_chroot() as folder:
        pictures = render_in_godot(scene, folder, "scene", "ground")
    level = (scene.sky_irradiance + scene.sun_irradiance * scene.sun_direction[1]) / np.pi
    ground = pictures["ground"][-6:, :40].mean(axis=(0, 1))
    share = pictures["scene"] / np.maximum(srgb_decode(scene.plate / 255.0), 1e-3)
    assert ground == pytest.approx(level, rel=0.02)
    if not scene.spot_in_shade:  # else the sun lights the ground alone, and this one's material is no shadow catcher
        check_shadow(scene, pictures["ground"] / level)
    check_shadow(scene, share)


@needs_engines
def test_blender_renders_each_photos_shadow(scene: Scene) -> None:
    with folder_in_chroot() as folder:
        write_scene(scene, "blender", folder, overwrite=True)
        numbers = json.loads((folder / "scene.json").read_text())
        (folder / "scene.json").write_text(json.dumps(numbers | {"samples": 16}))
        run_in_chroot(folder, "blender --background --factory-startup --python scene.py -- --render")
        picture = np.asarray(Image.open(folder / "render.png").convert("RGB"))
    check_shadow(scene, srgb_decode(picture / 255.0) / np.maximum(srgb_decode(scene.plate / 255.0), 1e-3))


def most_visible(scene: Scene, points: Floats) -> Floats:
    """That one of points (N, 3) which the camera sees farthest from the ball."""
    sights = points - scene.camera_position
    center = scene.spot + scene.placeholder.ball_center - scene.camera_position
    gap = np.linalg.norm(np.cross(sights / np.linalg.norm(sights, axis=1, keepdims=True), center), axis=1)
    return np.asarray(points[np.argmax(gap)])


def check_shadow(scene: Scene, share: Floats) -> None:
    """Check the ball's shadow in a picture / open ground: the sky's share, or none where the spot is in shade."""
    away = -scene.sun_direction * [1, 0, 1] / np.hypot(*scene.sun_direction[[0, 2]])
    aside = np.array([-away[2], 0.0, away[0]]) * np.sign(away[2])  # to the left, where no stick's shadow falls
    ball, height = scene.placeholder.ball_radius, scene.sun_direction[1]
    middle = scene.spot + away * ball / np.tan(np.arcsin(height))
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)[:, None]
    rim = ball * (np.cos(turn) * away / height + np.sin(turn) * aside)  # of the ball's shadow, from its middle
    beside = rim[np.sin(turn[:, 0]) > 0.5]  # on the side where no stick's shadow falls
    camera = photo_camera(scene.lighting, scene.width, scene.height)
    points = np.array([most_visible(scene, middle + share * part) for share, part in ((0.7, rim), (1.3, beside))])
    points -= scene.camera_position
    patches = [share[y - 1 : y + 2, x - 1 : x + 2] for x, y in camera_pixel(points, camera).astype(int)]
    shaded, beside = (np.median(patch.reshape(-1, 3), axis=0) for patch in patches)
    if scene.spot_in_shade:
        assert (shaded > 0.5).all()  # but for the sky that the ball hides
    else:
        assert (shaded < scene.shadow + 0.1).all()
        assert (beside > 0.8).all()
