"""The glTF file, by its numbers and by the validator of Khronos."""

import json
import struct
import subprocess
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.geometry import sample_latlong
from lighting.light_probe import CONDON_SHORTLEY, irradiance_from_harmonics
from lighting.scene import gltf
from tests.helpers.predictions import UNIT_NORMALS
from tests.helpers.requirements import require
from tests.helpers.scenes import cube_directions, harmonics, save_files, sunlit_scene

NOTED = {"IMAGE_NPOT_DIMENSIONS", "UNSUPPORTED_EXTENSION", "UNUSED_OBJECT"}  # a photo's size; what it does not know


def document_of(folder: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary chunk of the file in a folder."""
    data = (folder / gltf.GLB_FILE).read_bytes()
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    length, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    size, kind = struct.unpack_from("<I4s", data, 20 + length)
    assert (kind, 28 + length + size) == (b"BIN\0", len(data))
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def node(document: dict[str, Any], name: str) -> dict[str, Any]:
    return next(dict(item) for item in document["nodes"] if item["name"] == name)


def matrix(item: dict[str, Any]) -> NDArray[Any]:
    return np.reshape(item["matrix"], (4, 4)).T


def validated(file: Path) -> dict[str, Any]:
    """The Khronos validator's report."""
    command = [require("node"), str(Path(require("tests/node")).with_name("validate.cjs")), str(file)]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(json.loads(result.stdout)["issues"])


@pytest.mark.slow
def test_the_khronos_validator_finds_neither_errors_nor_warnings(tmp_path: Path) -> None:
    save_files(tmp_path, gltf.encode_gltf(sunlit_scene()))
    issues = validated(tmp_path / gltf.GLB_FILE)
    assert (issues["numErrors"], issues["numWarnings"], issues["numHints"]) == (0, 0, 0), issues["messages"]
    assert {message["code"] for message in issues["messages"]} <= NOTED


def test_the_validator_does_find_faults(tmp_path: Path) -> None:
    save_files(tmp_path, gltf.encode_gltf(sunlit_scene()))
    file = tmp_path / gltf.GLB_FILE
    file.write_bytes(file.read_bytes().replace(b'"intensity":', b'"intensitx":').replace(b'"camera":0', b'"camera":7'))
    assert validated(file)["numErrors"] >= 1


def test_the_camera_is_the_scenes(tmp_path: Path) -> None:
    scene = sunlit_scene()
    save_files(tmp_path, gltf.encode_gltf(scene))
    document, _ = document_of(tmp_path)
    assert matrix(node(document, "Camera")) == pytest.approx(scene.camera_matrix)
    camera = document["cameras"][0]["perspective"]
    assert np.degrees(camera["yfov"]) == pytest.approx(scene.vertical_fov)
    assert camera["aspectRatio"] == pytest.approx(scene.width / scene.height)


def test_the_ground_says_where_an_object_touches_it(tmp_path: Path) -> None:
    scene = sunlit_scene()
    save_files(tmp_path, gltf.encode_gltf(scene))
    document, _ = document_of(tmp_path)
    ground, ball = node(document, "Ground"), node(document, "Ball")
    contact = ground["extras"]["contact"]
    assert ground["translation"] == node(document, "YourObject")["translation"]
    assert contact["center"] == ball["translation"]
    assert contact["center"][1] == pytest.approx(contact["radius"])


def test_the_sun_shines_from_its_direction_with_its_irradiance(tmp_path: Path) -> None:
    scene = sunlit_scene()
    save_files(tmp_path, gltf.encode_gltf(scene))
    document, _ = document_of(tmp_path)
    shining = matrix(node(document, "Sun")) @ [0, 0, -1, 0]
    assert shining[:3] == pytest.approx(-scene.sun_direction)
    (light,) = document["extensions"]["KHR_lights_punctual"]["lights"]
    assert light["type"] == "directional"
    assert light["intensity"] * np.array(light["color"]) == pytest.approx(scene.sun_irradiance)
    assert max(light["color"]) == pytest.approx(1)


def test_no_direct_sun_is_a_light_of_no_intensity(tmp_path: Path) -> None:
    save_files(tmp_path, gltf.encode_gltf(replace(sunlit_scene(), sun_irradiance=np.zeros(3))))
    (light,) = document_of(tmp_path)[0]["extensions"]["KHR_lights_punctual"]["lights"]
    assert (light["intensity"], light["color"]) == (0, [1, 1, 1])


def test_the_plate_is_the_photo_and_fills_the_view(tmp_path: Path) -> None:
    scene = sunlit_scene()
    save_files(tmp_path, gltf.encode_gltf(scene))
    document, binary = document_of(tmp_path)
    view = document["bufferViews"][document["images"][0]["bufferView"]]
    data = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    assert np.array_equal(np.asarray(Image.open(BytesIO(data))), scene.plate)
    in_camera = np.linalg.inv(scene.camera_matrix) @ matrix(node(document, "Plate"))
    distance = -in_camera[2, 3]
    assert in_camera == pytest.approx(np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -distance], [0, 0, 0, 1]]))
    attributes = document["meshes"][node(document, "Plate")["mesh"]]["primitives"][0]["attributes"]
    right, top, _ = document["accessors"][attributes["POSITION"]]["max"]
    assert np.degrees(2 * np.arctan(top / distance)) == pytest.approx(scene.vertical_fov, abs=1e-4)
    assert right / top == pytest.approx(scene.width / scene.height)


SHAPES = {
    "ball": (gltf._ball(0.3), 4 * np.pi * 0.3**2),
    "stick": (gltf._stick(0.1, 2.0), 2 * np.pi * 0.1 * 2.0 + 2 * np.pi * 0.1**2),
    "disc": (gltf._disc(5.0), np.pi * 5.0**2),
    "picture": (gltf._picture(4.0, 3.0), 12.0),
}


@pytest.mark.parametrize("name", SHAPES)
def test_triangles_face_along_their_normals_and_cover_the_surface(name: str) -> None:
    mesh, area = SHAPES[name]
    a, b, c = (mesh.positions[mesh.triangles[:, corner]] for corner in range(3))
    facing = np.cross(b - a, c - a)
    normals = mesh.normals[mesh.triangles].mean(axis=1)
    assert np.all(np.einsum("ij,ij->i", facing, normals) > 0)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1, abs=1e-6)
    assert np.linalg.norm(facing, axis=1).sum() / 2 == pytest.approx(area, rel=0.01)


def test_where_they_stand() -> None:
    assert gltf._ball(0.3).positions[:, 1].min() == pytest.approx(-0.3)
    stick = gltf._stick(0.1, 2.0).positions[:, 1]
    assert (stick.min(), stick.max()) == pytest.approx((0.0, 2.0))
    assert np.all(gltf._disc(5.0).positions[:, 1] == 0)


def test_the_pictures_upper_left_corner() -> None:
    picture = gltf._picture(4.0, 3.0)
    assert picture.coordinates is not None
    corner = picture.positions[np.all(picture.coordinates == 0, axis=1)]
    assert corner == pytest.approx(np.array([[-2.0, 1.5, 0.0]]))


def image_light(document: dict[str, Any]) -> dict[str, Any]:
    assert document["scenes"][0]["extensions"]["EXT_lights_image_based"] == {"light": 0}
    (light,) = document["extensions"]["EXT_lights_image_based"]["lights"]
    return dict(light)


def test_the_map_lights_by_its_irradiance(tmp_path: Path) -> None:
    scene = sunlit_scene()
    save_files(tmp_path, gltf.encode_gltf(scene))
    light = image_light(document_of(tmp_path)[0])
    assert light["intensity"] == 1.0  # written, too: left out, Babylon.js shows black; another squares diffuse light
    irradiance = np.array(light["irradianceCoefficients"])
    in_babylon = UNIT_NORMALS * [-1, 1, 1]  # its left-handed frame, turned as its loader turns it
    values = harmonics(in_babylon) @ (CONDON_SHORTLEY[:, None] * irradiance)
    assert values == pytest.approx(irradiance_from_harmonics(scene.light_probe.coefficients, UNIT_NORMALS), rel=1e-4)


def test_the_maps_mirror_images_are_its_pictures(tmp_path: Path) -> None:
    scene = sunlit_scene()
    save_files(tmp_path, gltf.encode_gltf(scene))
    document, binary = document_of(tmp_path)
    light = image_light(document)
    sizes = []
    for level, faces in enumerate(light["specularImages"]):
        pictures = []
        for index in faces:
            view = document["bufferViews"][document["images"][index]["bufferView"]]
            data = binary[view.get("byteOffset", 0) :][: view["byteLength"]]
            pictures.append(np.asarray(Image.open(BytesIO(data)), dtype=np.float64) / 255)
        pixels = np.array(pictures)
        sizes.append(pixels.shape[1])
        radiance = (pixels[..., :3] ** 2.2 / pixels[..., 3:]) ** 2.2
        shown = sample_latlong(scene.environment, cube_directions(sizes[-1]) * [-1, 1, 1])
        if level == 0:
            assert (np.abs(radiance - shown) <= np.maximum(0.03 * np.abs(shown), 0.02)).all()
        assert radiance.mean() == pytest.approx(shown.mean(), rel=0.03)
    assert sizes == [light["specularImageSize"] >> level for level in range(len(sizes))]
    assert sizes[-1] == 16
