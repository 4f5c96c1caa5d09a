"""What every scene shares: its geometry, its light, its folder, and the command that writes it."""

import json
import zipfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from lighting.envmap import render
from lighting.errors import SceneError
from lighting.files import full_record
from lighting.geometry import angle_between, camera_directions, camera_pixel, direction, latlong_solid_angle
from lighting.photo.read import Photo
from lighting.scene import TOOLS, blender, mitsuba
from lighting.scene.common import EYE_HEIGHT, Scene, colour_and_strength, make_scene, to_z_up
from lighting.scene.files import write_scene, zip_scene
from tests.lighting.cli.runners import error_of, run
from tests.scenes import LIGHT, known_scene

PIXELS = np.full((30, 40, 3), 99, np.uint8)


def scene_of(**changes: Any) -> Scene:
    return make_scene(Photo(PIXELS, 40, 30, "PNG"), replace(LIGHT, **changes), map_height=32)


# Geometry


def test_the_camera_matrix_agrees_with_the_rays_of_the_photo() -> None:
    scene = known_scene()
    rays = camera_directions(480, 360, scene.vertical_fov, elevation=-12.0, roll=4.0)
    x = 0.5 * scene.sensor_width / scene.focal_length * (1 - 1 / 480)
    y = np.tan(np.radians(scene.vertical_fov) / 2) * (1 - 1 / 360)
    corner = scene.camera_matrix[:3, :3] @ np.array([x, y, -1.0])
    assert angle_between(corner, rays[0, -1]) < 1e-6
    assert np.linalg.det(scene.camera_matrix) == pytest.approx(1.0)
    assert scene.camera_matrix[:3, 3] == pytest.approx([0.0, EYE_HEIGHT, 0.0])


@pytest.mark.parametrize("roll", [-20.0, 0.0, 7.0])
def test_the_spot_is_on_the_ground_in_the_lower_middle_of_the_picture(roll: float) -> None:
    scene = scene_of(camera_roll=roll)
    pixel = camera_pixel(scene.spot - scene.camera_position, 40, 30, scene.vertical_fov, 0.0, -12.0, roll)
    assert pixel == pytest.approx([20.0, 24.0])
    assert scene.spot[1] == 0.0


@pytest.mark.parametrize("elevation", [-90.0, -89.0, 0.0, 40.0, 90.0])
def test_the_spot_exists_wherever_the_camera_looks(elevation: float) -> None:
    scene = scene_of(camera_elevation=elevation)
    assert np.isfinite(scene.spot).all()
    assert np.linalg.norm(scene.spot) < 40
    assert scene.ball_radius > 0.05


def test_the_ball_always_has_the_same_size_in_the_picture() -> None:
    for scene in (scene_of(), scene_of(vertical_fov=25.0), scene_of(camera_elevation=-40.0)):
        distance = np.linalg.norm(scene.spot - scene.camera_position)
        half_picture = distance * np.tan(np.radians(scene.vertical_fov) / 2)
        assert scene.ball_radius / half_picture == pytest.approx(0.16)


def test_z_up_keeps_right_handedness() -> None:
    right, up, forward = to_z_up(np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0]]))
    assert np.cross(right, forward) == pytest.approx(up)
    assert up == pytest.approx([0, 0, 1])
    assert forward == pytest.approx([0, 1, 0])


# Light


def test_the_map_and_the_sun_together_are_the_whole_light() -> None:
    scene = scene_of(exposure=0.5)
    weight = latlong_solid_angle(32)[:, None, None]
    whole = (render(scene.lighting, 32, sun=True) * weight).sum(axis=(0, 1), dtype=np.float64)
    assert (scene.environment * weight).sum(axis=(0, 1)) + scene.sun_irradiance == pytest.approx(whole, rel=1e-4)


def test_the_ground_in_the_map_is_what_a_renderer_makes_of_the_plane() -> None:
    scene = scene_of(sun_elevation=20.0)
    irradiance = scene.sky_irradiance + scene.sun_irradiance * scene.sun_direction[1]
    assert scene.environment[-1, 0] == pytest.approx(irradiance * LIGHT.ground_albedo / np.pi, rel=1e-4)
    assert scene.shadow == pytest.approx(scene.sky_irradiance / irradiance)


def test_without_direct_sun_there_is_no_sun_light() -> None:
    for scene in (scene_of(sun_visibility=0.2), make_scene(Photo(PIXELS, 40, 30, "PNG"), LIGHT, sun=False)):
        assert scene.sun_irradiance == pytest.approx(0.0)
        assert scene.shadow == pytest.approx(1.0)
        assert scene.environment == pytest.approx(render(scene.lighting, len(scene.environment), sun=False))


def test_colour_and_strength_multiply_to_the_irradiance() -> None:
    colour, strength = colour_and_strength(np.array([2.0, 8.0, 4.0]))
    assert colour.tolist() == [0.25, 1.0, 0.5]
    assert strength == 8.0
    assert colour_and_strength(np.zeros(3))[1] == 0.0
    assert colour_and_strength(np.zeros(3))[0].tolist() == [1.0, 1.0, 1.0]


# Folders


def test_a_new_folder_holds_the_scene_alone(tmp_path: Path) -> None:
    write_scene(scene_of(), "mitsuba", tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert {"scene.xml", "plate.png", "environment.exr", "lighting.json"} < {
        p.name for p in (tmp_path / "out").iterdir()
    }
    assert np.array_equal(np.asarray(Image.open(tmp_path / "out" / "plate.png")), PIXELS)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o755


def test_overwriting_replaces_the_scene_and_nothing_else(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    write_scene(scene_of(), "mitsuba", folder)
    (folder / "mine.txt").write_text("keep")
    with pytest.raises(SceneError, match="is not empty; --overwrite replaces"):
        write_scene(scene_of(turbidity=6.0), "mitsuba", folder)
    assert json.loads((folder / "lighting.json").read_text())["sky"]["turbidity"] == 3.0
    write_scene(scene_of(turbidity=6.0), "mitsuba", folder, overwrite=True)
    assert json.loads((folder / "lighting.json").read_text())["sky"]["turbidity"] == 6.0
    assert (folder / "mine.txt").read_text() == "keep"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_empty_folder_is_filled(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    write_scene(scene_of(), "mitsuba", tmp_path / "out")
    assert (tmp_path / "out" / "scene.xml").is_file()


def test_the_folder_may_be_the_current_one_or_a_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    write_scene(known_scene(), "gltf", ".")
    assert list(here.iterdir())
    other, link = tmp_path / "other", tmp_path / "link"
    other.mkdir()
    link.symlink_to(other)
    write_scene(known_scene(), "gltf", link)
    assert link.is_symlink()
    assert sorted(p.name for p in other.iterdir()) == sorted(p.name for p in here.iterdir())


def test_what_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_scene: Scene, folder: Path) -> None:
        (folder / "half").write_text("written")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(mitsuba, "write", fail)
    with pytest.raises(SceneError, match=r"out cannot be written: No space left on device\.$"):
        write_scene(scene_of(), "mitsuba", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_tool_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"'maya' is not known; it must be one of blender, usd, gltf"):
        write_scene(scene_of(), "maya", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("tool", TOOLS)
def test_an_archive_holds_what_the_folder_holds(tmp_path: Path, tool: str) -> None:
    write_scene(scene_of(), tool, tmp_path / "out")
    with zipfile.ZipFile(BytesIO(zip_scene(scene_of(), tool))) as archive:
        assert archive.testzip() is None
        on_disk = {path.name for path in (tmp_path / "out").iterdir()} - {blender.FILE}  # which needs a disk
        assert sorted(archive.namelist()) == sorted(on_disk)


def test_one_scene_makes_one_archive() -> None:
    assert zip_scene(scene_of(), "mitsuba") == zip_scene(scene_of(), "mitsuba")


# Command line


@pytest.fixture
def record_path(tmp_path: Path) -> Path:
    path = tmp_path / "lighting.json"
    path.write_text(json.dumps(LIGHT.to_dict()))
    return path


def test_the_command_estimates_the_light(network: Path, photo_path: Path, tmp_path: Path) -> None:
    result = run("scene", photo_path, "--for", "mitsuba", "-o", tmp_path / "out", "--model", network)
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith(str(photo_path))
    record = json.loads((tmp_path / "out" / "lighting.json").read_text())
    assert record["model"]["name"] == "tiny"
    with Image.open(tmp_path / "out" / "plate.png") as plate:
        assert plate.size == (320, 240)


def test_the_command_takes_a_record_in_place_of_an_estimate(
    photo_path: Path, record_path: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    result = run("scene", photo_path, "--for", "usd", "--lighting", record_path, "-o", out, "-q", "--up-axis", "z")
    assert (result.exit_code, result.output) == (0, "")
    assert json.loads((out / "lighting.json").read_text()) == full_record(LIGHT)
    assert 'upAxis = "Z"' in (out / "scene.usda").read_text()


def test_warnings_of_the_light_are_on_stderr(photo_path: Path, tmp_path: Path) -> None:
    (tmp_path / "l.json").write_text(json.dumps(replace(LIGHT, warnings=("It was night.",)).to_dict()))
    arguments: list[str | Path] = ["scene", photo_path, "--for", "usd", "--lighting", tmp_path / "l.json"]
    assert run(*arguments, "-o", tmp_path / "a").stderr == f"Warning: {photo_path}: It was night.\n"
    assert run(*arguments, "-o", tmp_path / "b", "-q").stderr == ""


@pytest.mark.parametrize(
    ("output", "sentence"),
    [
        ("lighting.json", "is a file; a scene is a folder."),
        ("none/out", "There is no folder"),
        (".", "is not empty; --overwrite replaces the scene in it."),
    ],
)
def test_a_folder_that_must_not_be_written_is_one_sentence(
    photo_path: Path, record_path: Path, tmp_path: Path, output: str, sentence: str
) -> None:
    before = sorted(tmp_path.iterdir())
    arguments: list[str | Path] = [
        "scene",
        photo_path,
        "--for",
        "usd",
        "--lighting",
        record_path,
        "-o",
        tmp_path / output,
    ]
    assert sentence in error_of(run(*arguments))
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--for", "maya"], "'maya' is not one of 'blender', 'usd', 'gltf', 'threejs', 'mitsuba'."),
        (["--for", "gltf", "--up-axis", "Y"], "--up-axis goes with --for usd."),
        (["--for", "usd", "--lighting", "any.json", "--model", "any.onnx"], "--model does not go with it."),
        (["--for", "gltf", "--height", "64"], "a glTF scene holds no map."),
        (["--for", "usd", "--height", "15"], "15 is not an even number from 16 to 4096."),
    ],
)
def test_wrong_usage_is_one_sentence(photo_path: Path, tmp_path: Path, arguments: list[str], sentence: str) -> None:
    assert sentence in error_of(run("scene", photo_path, "-o", tmp_path / "out", *arguments), 2)
    assert not (tmp_path / "out").exists()


def test_a_bad_photo_is_one_sentence(tmp_path: Path, record_path: Path) -> None:
    (tmp_path / "bad.jpg").write_bytes(b"no photo")
    result = run("scene", tmp_path / "bad.jpg", "--for", "usd", "--lighting", record_path, "-o", tmp_path / "out")
    assert "not a JPEG" in error_of(result)
    assert not (tmp_path / "out").exists()


def test_the_sun_lies_where_the_record_says() -> None:
    assert angle_between(known_scene().sun_direction, direction(-40.0, 35.0)) < 1e-6
