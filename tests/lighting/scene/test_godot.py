"""The project for Godot: its numbers, and with Godot 4.6 the light that it renders."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.color import srgb_decode
from lighting.scene import godot
from lighting.scene.records import Scene
from tests.helpers.engines import folder_in_chroot, needs_engines
from tests.helpers.materials import render_in_godot, shadow_error
from tests.helpers.scenes import half_shaded_scene, save_files, shaded_spot_scene, sunlit_scene

PICTURES = ("scene", "ground", "sky", "uniform")


def nodes(folder: Path) -> dict[str, dict[str, str]]:
    """The properties of each node of the scene, and of each resource by its name, as text."""
    text = (folder / "scene.tscn").read_text(encoding="utf-8")
    parts = re.findall(
        r'^\[(?:node name|sub_resource type="\w+" id)="(\w+)"[^\n]*\]\n(.*?)(?=^\[|\Z)', text, re.M | re.S
    )
    return {name: dict(re.findall(r"^([\w/]+) = (.*)$", body, re.M)) for name, body in parts}


def values(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text.partition("(")[2] or text)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_files(tmp_path, godot.encode_godot(sunlit_scene()))
    return tmp_path


def test_the_sun_has_direction_irradiance_colour_and_size(folder: Path) -> None:
    sun, scene = nodes(folder)["Sun"], sunlit_scene()
    matrix = values(sun["transform"])
    assert np.reshape(matrix[:9], (3, 3))[:, 2] == pytest.approx(scene.sun_direction, abs=1e-6)  # shines along -Z
    color = srgb_decode(np.array(values(sun["light_color"])[:3]))
    assert np.pi * float(sun["light_energy"]) * color == pytest.approx(scene.sun_irradiance, rel=1e-5)
    assert float(sun["light_angular_distance"]) == pytest.approx(0.5358)


def test_the_camera_is_the_photos(folder: Path) -> None:
    camera, scene = nodes(folder)["Camera"], sunlit_scene()
    matrix = values(camera["transform"])
    assert np.reshape(matrix[:9], (3, 3)) == pytest.approx(scene.camera_matrix[:3, :3], abs=1e-6)
    assert matrix[9:] == pytest.approx([0, 1.6, 0])
    assert float(camera["fov"]) == pytest.approx(50.0)


def test_the_project_is_for_forward_plus_and_imports_pictures_as_they_are(folder: Path) -> None:
    project = (folder / "project.godot").read_text()
    assert 'renderer/rendering_method="forward_plus"' in project
    assert "window/size/viewport_width=480\nwindow/size/viewport_height=360\n" in project
    for path in folder.glob("*.import"):
        assert f'source_file="res://{path.stem}"' in path.read_text()
        assert "compress/mode=0\n" in path.read_text()
        assert "detect_3d/compress_to=0\n" in path.read_text()


@pytest.mark.parametrize(("scene", "layers"), [(sunlit_scene, "3"), (shaded_spot_scene, "1")])
def test_the_sun_lights_the_ground_alone_where_the_spot_is_in_shade(tmp_path: Path, scene: Any, layers: str) -> None:
    save_files(tmp_path, godot.encode_godot(scene()))
    made = nodes(tmp_path)
    assert made["Sun"]["light_cull_mask"] == layers
    assert {made[name]["layers"] for name in ("Ball", "Stick")} == {"2"}  # the ground has the first


# In Godot


def negative() -> Scene:
    """The sunlit scene with a plate that cannot be mistaken for its map."""
    return replace(sunlit_scene(), plate=255 - sunlit_scene().plate)


@pytest.fixture(scope="module")
def pictures() -> Iterator[dict[str, NDArray[np.float32]]]:
    with folder_in_chroot() as folder:
        yield render_in_godot(negative(), folder, *PICTURES)


@needs_engines
def test_godot_lights_the_ground_as_we_do(pictures: dict[str, NDArray[np.float32]]) -> None:
    scene = sunlit_scene()
    open_ground = np.s_[330:355, 40:120]
    sky = scene.sky_irradiance / np.pi
    level = sky + scene.sun_irradiance * scene.sun_direction[1] / np.pi
    assert pictures["ground"][open_ground].mean(axis=(0, 1)) == pytest.approx(level, rel=0.02)
    assert pictures["sky"][open_ground].mean(axis=(0, 1)) == pytest.approx(sky, rel=0.04)
    assert pictures["uniform"][open_ground].mean(axis=(0, 1)) == pytest.approx([0.2, 0.3, 0.4], rel=0.04)


@needs_engines
def test_the_shadow_falls_where_it_does(pictures: dict[str, NDArray[np.float32]]) -> None:
    for name in ("scene", "ground"):
        assert abs(shadow_error(sunlit_scene(), pictures[name])) < 0.5


@needs_engines
def test_the_photo_stays_as_it_is_but_for_the_objects_and_their_shadow(
    pictures: dict[str, NDArray[np.float32]],
) -> None:
    scene = negative()
    photo = srgb_decode(scene.plate / 255.0)
    assert pictures["scene"][:200] == pytest.approx(photo[:200], abs=0.003)  # no object is there
    shadow = pictures["scene"][308:316, 284:292].mean(axis=(0, 1)) / photo[308:316, 284:292].mean(axis=(0, 1))
    assert shadow == pytest.approx(scene.shadow, rel=0.12)  # and the ball hides some of the sky


@needs_engines
def test_no_shadow_falls_on_shade() -> None:
    with folder_in_chroot() as folder:
        scene = half_shaded_scene()
        picture = render_in_godot(scene, folder, "scene")["scene"]
    ratio = picture / srgb_decode(scene.plate / 255.0)
    assert np.median(ratio[297:305, 230:235]) < 0.3
    assert np.median(ratio[320:325, 400:412]) > 0.9  # the stick's
