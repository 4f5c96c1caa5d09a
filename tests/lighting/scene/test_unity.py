"""The package for Unity, taken apart by readers of its formats. Its script was compiled, and not run in the engine."""

import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from unitypackage_extractor.extractor import extractPackage
from unityparser import UnityDocument

from lighting.color import srgb_decode
from lighting.files.exr import read_exr
from lighting.geometry import Floats, camera_pixel
from lighting.scene import unity
from lighting.scene.records import Scene
from tests.helpers.engines import folder_in_chroot, needs_engines, run_in_chroot
from tests.helpers.pages import ROOT
from tests.helpers.scenes import LIGHT, plain_scene, save_files, shaded_spot_scene, sunlit_scene

SCRIPT = ROOT / "lighting" / "data" / "LightFromPhoto.cs"


def extracted(scene: Scene, folder: Path) -> Path:
    """The folder of assets of a scene's package."""
    save_files(folder, unity.encode_unity(scene))
    extractPackage(str(folder / "scene.unitypackage"), outputPath=str(folder))
    return folder / unity.ASSETS / scene.photo_name


@pytest.fixture(scope="module")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return extracted(sunlit_scene(), tmp_path_factory.mktemp("unity"))


@pytest.fixture(scope="module")
def numbers(assets: Path) -> dict[str, Any]:
    return dict(json.loads((assets / "scene.json").read_text()))


def vector(value: dict[str, float]) -> Floats:
    """In our frame."""
    return np.array([value["x"], value["y"], -value["z"]])


def rotated(quaternion: dict[str, float], axis: Sequence[float]) -> Floats:
    """An axis of Unity's, turned, in our frame."""
    w, q = quaternion["w"], np.array([quaternion[name] for name in "xyz"])
    v = np.array(axis)
    turned = v + 2 * np.cross(q, np.cross(q, v) + w * v)
    return np.array([turned[0], turned[1], -turned[2]])


def test_the_package_holds_the_assets(assets: Path) -> None:
    assert {path.name for path in assets.iterdir()} == {
        *("scene.json", "lighting.json", "environment.exr", "plate.png", "ground_albedo.png", "ground_emission.png"),
    }
    scripts = assets.parent / "Editor"
    assert {path.name for path in scripts.iterdir()} == {"LightFromPhoto.cs", "LightFromPhoto.asmdef"}
    assert (scripts / "LightFromPhoto.cs").read_bytes() == SCRIPT.read_bytes()


def test_each_asset_has_settings_with_its_own_guid(tmp_path: Path) -> None:
    save_files(tmp_path, unity.encode_unity(plain_scene()))
    packed = tmp_path / "scene.unitypackage"
    shutil.unpack_archive(packed, tmp_path / "raw", "gztar")
    settings = {}
    for folder in (tmp_path / "raw").iterdir():
        assert sorted(path.name for path in folder.iterdir()) == ["asset", "asset.meta", "pathname"]
        meta = UnityDocument.load_yaml(str(folder / "asset.meta")).entry
        assert meta["guid"] == folder.name
        settings[(folder / "pathname").read_text()] = meta
    own = f"{unity.ASSETS}/{plain_scene().photo_name}"
    cube, flat = (settings[f"{own}/{name}"]["TextureImporter"] for name in ("environment.exr", "plate.png"))
    wanted = {"textureShape": "2", "generateCubemap": "2", "isReadable": "1", "maxTextureSize": "8192"}
    assert wanted.items() <= cube.items()
    assert {"textureShape": "1", "textureCompression": "0", "nPOTScale": "0"}.items() <= flat.items()
    assert (cube["mipmaps"]["sRGBTexture"], flat["mipmaps"]["sRGBTexture"]) == ("0", "1")


def test_the_same_scene_makes_the_same_package(tmp_path: Path) -> None:
    packages = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        save_files(tmp_path / name, unity.encode_unity(plain_scene()))
        packages.append((tmp_path / name / "scene.unitypackage").read_bytes())
    assert packages[0] == packages[1]


def test_two_photos_share_the_script_alone(tmp_path: Path) -> None:
    """The second one's import would else replace the first one's pictures, in scenes that are saved already."""
    assets = {}
    lit, moved, other = plain_scene(), plain_scene(sun_azimuth=77.0), replace(plain_scene(), plate=sunlit_scene().plate)
    for name, scene in (("lit", lit), ("moved", moved), ("other", other)):
        save_files(tmp_path, unity.encode_unity(scene))
        shutil.unpack_archive(tmp_path / "scene.unitypackage", tmp_path / name, "gztar")
        assets[name] = {folder.name: (folder / "pathname").read_text() for folder in (tmp_path / name).iterdir()}
    assert assets["moved"] == assets["lit"]  # the same photo's are replaced
    shared = {guid: path for guid, path in assets["lit"].items() if guid in assets["other"]}
    assert sorted(shared.values()) == [f"{unity.ASSETS}/Editor/LightFromPhoto.{end}" for end in ("asmdef", "cs")]
    paths = [set(assets[name].values()) - set(shared.values()) for name in ("lit", "other")]
    assert paths[0].isdisjoint(paths[1])


def test_the_script_reads_what_is_written(numbers: dict[str, Any]) -> None:
    body = SCRIPT.read_text().partition("class SceneNumbers")[2].partition("public static class")[0]
    declared = re.findall(r"public \w+(?:\[\])? ([\w, ]+);", body)
    assert set(numbers) == {name for names in declared for name in names.split(", ")}


@pytest.mark.parametrize("azimuth", [-40.0, 0.0, 90.0, 180.0])
def test_the_sun_shines_as_it_does(azimuth: float) -> None:
    scene = plain_scene(sun_azimuth=azimuth)
    numbers = unity._description(scene)
    assert rotated(numbers["sunRotation"], [0, 0, 1]) == pytest.approx(-scene.sun_direction, abs=1e-6)
    color = srgb_decode(np.array([numbers["sunColor"][name] for name in "rgb"]))
    assert numbers["sunIrradiance"] * color == pytest.approx(scene.sun_irradiance, rel=1e-6)
    assert numbers["sunAngle"] == pytest.approx(0.5358)
    assert numbers["sunReachesObject"] is True


def test_the_camera_is_the_photos(numbers: dict[str, Any]) -> None:
    scene = sunlit_scene()
    axes = [rotated(numbers["cameraRotation"], axis) for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1])]
    assert np.stack(axes) == pytest.approx(scene.camera_axes, abs=1e-6)
    assert vector(numbers["cameraPosition"]) == pytest.approx([0, 1.6, 0])
    assert numbers["verticalFov"] == 50.0
    assert numbers["aspect"] == pytest.approx(480 / 360)


def test_the_spot_and_what_stands_on_it(numbers: dict[str, Any]) -> None:
    scene = sunlit_scene()
    made = scene.placeholder
    assert vector(numbers["spot"]) == pytest.approx(scene.spot)
    assert vector(numbers["ballCenter"]) == pytest.approx(made.ball_center)
    assert numbers["ballRadius"] == pytest.approx(made.ball_radius)


def test_the_ground_shows_the_picture_where_the_camera_sees_it(numbers: dict[str, Any]) -> None:
    scene = sunlit_scene()
    points = np.reshape(numbers["groundPoints"], (-1, 3)) * [1, 1, -1]
    places = np.reshape(numbers["groundPlaces"], (-1, 2))
    assert points[:, 1] == pytest.approx(np.zeros(len(points)), abs=1e-4)
    pixel = camera_pixel(points - scene.camera_position, scene._camera)
    assert pixel / [480, 360] == pytest.approx(np.column_stack([places[:, 0], 1 - places[:, 1]]), abs=1e-4)
    corners = places[np.reshape(numbers["groundTriangles"], (-1, 3))]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    assert (first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]).all()  # clockwise in the picture: their fronts
    assert places[:, 1].min() == 0.0


def test_the_means_of_the_maps_faces_tell_where_its_centre_is() -> None:
    height = 64
    environment = np.zeros((height, 2 * height, 3), np.float32)
    environment[:, height - 4 : height + 4] = 1.0  # ahead
    ahead, right, behind, left = unity._ring_means(environment)
    assert ahead[0] > 0.05
    assert max(right.max(), behind.max(), left.max()) == 0.0
    assert unity._ring_means(np.ones_like(environment)) == pytest.approx(np.ones((4, 3)))


def test_the_map_is_the_scenes(assets: Path) -> None:
    image, light = read_exr(assets / "environment.exr")
    np.testing.assert_allclose(image, sunlit_scene().environment, rtol=2e-3)
    assert light is not None
    assert light.sun_azimuth == LIGHT.sun_azimuth


def test_an_object_in_the_photos_shade_has_no_sun() -> None:
    assert unity._description(shaded_spot_scene())["sunReachesObject"] is False


@needs_engines
@pytest.mark.parametrize("pipeline", ["", "-define:LIGHT_FROM_PHOTO_HDRP"])
def test_the_script_compiles_against_the_documented_names(pipeline: str) -> None:
    with folder_in_chroot() as folder:
        for path in (SCRIPT, ROOT / "tests" / "unity" / "UnityApi.cs"):
            shutil.copy(path, folder)
        run_in_chroot(folder, f"mcs -langversion:latest -warnaserror -target:library {pipeline} -out:a.dll *.cs")
