"""Scenes for fSpy's importers."""

import json
import struct
import subprocess
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lighting.fusion.fspy import read_fspy
from lighting.geometry import camera_pixel
from lighting.scene.writer import write_scene
from tests.helpers.engines import PYTHON, needs_blender
from tests.helpers.scenes import sunlit_scene


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_scene(sunlit_scene(), "fspy", tmp_path / "scene")
    return tmp_path / "scene"


def test_the_camera_comes_back(folder: Path) -> None:
    light = sunlit_scene().lighting
    for name in ("camera.json", "scene.fspy"):
        found = read_fspy((folder / name).read_bytes())
        expected = (light.camera_elevation, light.camera_roll, light.vertical_fov)
        assert (found.elevation, found.roll, found.vertical_fov) == pytest.approx(expected, abs=1e-6)


def test_the_project_holds_camera_and_photo(folder: Path) -> None:
    data = (folder / "scene.fspy").read_bytes()
    name, version, state, picture = struct.unpack_from("<4sIII", data)
    assert (name, version, 16 + state + picture) == (b"fspy", 1, len(data))
    content = json.loads(data[16 : 16 + state])
    assert content["cameraParameters"] == json.loads((folder / "camera.json").read_text())
    assert content["calibrationSettingsBase"]["referenceDistanceUnit"] == "Meters"
    scene = sunlit_scene()
    assert Image.open(BytesIO(data[16 + state :])).size == (scene.width, scene.height)


def test_points_of_the_world_fall_on_their_pixels_as_blender_computes_them(folder: Path) -> None:
    scene, camera = sunlit_scene(), json.loads((folder / "camera.json").read_text())
    view = np.array(camera["viewTransform"]["rows"])
    assert view @ np.array(camera["cameraTransform"]["rows"]) == pytest.approx(np.eye(4))
    x, y, z = scene.spot  # with Y up
    right, up, backward, _ = view @ [x, -z, y, 1.0]
    half = np.tan(camera["horizontalFieldOfView"] / 2)  # Blender's `angle` is that of the longer side
    scale = scene.width / 2 / half / -backward
    pixel = camera_pixel(scene.spot - scene.camera_position, scene._camera)
    assert (scene.width / 2 + scale * right, scene.height / 2 - scale * up) == pytest.approx(tuple(pixel))


def test_vanishing_points_lie_where_the_axes_meet_the_picture(folder: Path) -> None:
    camera = json.loads((folder / "camera.json").read_text())
    _, ahead, above = camera["vanishingPoints"]
    pitch = np.radians(sunlit_scene().lighting.camera_elevation)
    focal = camera["relativeFocalLength"]
    assert np.hypot(ahead["x"], ahead["y"]) == pytest.approx(focal * abs(np.tan(pitch)))
    assert np.hypot(above["x"], above["y"]) == pytest.approx(focal / abs(np.tan(pitch)))


IMPORT = """
import json, math, bpy
from mathutils import Matrix
values = json.load(open("camera.json"))
bpy.ops.object.camera_add()
camera, render = bpy.context.active_object.data, bpy.context.scene.render
camera.angle = values["horizontalFieldOfView"]
render.resolution_x, render.resolution_y = values["imageWidth"], values["imageHeight"]
for camera.sensor_fit in ("AUTO", "HORIZONTAL"):
    x, y, z = camera.view_frame(scene=bpy.context.scene)[0]
    print("FOUND", math.degrees(2 * math.atan(y / -z)))
"""


@pytest.mark.slow
@needs_blender
@pytest.mark.parametrize("size", [(48, 36), (36, 48)])
def test_the_add_on_needs_a_horizontal_sensor_for_upright_photos(tmp_path: Path, size: tuple[int, int]) -> None:
    """It sets `angle`, which Blender takes for the longer side's, and leaves the sensor's fit."""
    scene = sunlit_scene(*size)
    write_scene(scene, "fspy", tmp_path / "scene")
    done = subprocess.run([PYTHON, "-c", IMPORT], cwd=tmp_path / "scene", capture_output=True, text=True, check=True)
    left, fitted = (float(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("FOUND"))
    assert fitted == pytest.approx(scene.vertical_fov, abs=1e-3)
    assert (left == pytest.approx(fitted, abs=1e-3)) is (size[0] > size[1])
