"""The page, as Chromium draws it, and the glTF file, as three.js reads it."""

import base64
import json
import re
from dataclasses import replace
from importlib import resources
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.color import luminance, srgb_decode, tone_map
from lighting.geometry import (
    Floats,
    Pinhole,
    camera_directions,
    camera_pixel,
    direction,
    latlong_directions,
    latlong_solid_angle,
    sample_latlong,
    wrap_azimuth,
)
from lighting.record_json import record_with_coefficients
from lighting.scene import gltf, threejs
from lighting.scene.records import PLACEHOLDER_ALBEDO, Scene
from tests.helpers.drawings import drawings
from tests.helpers.scenes import half_shaded_scene, save_files, shaded_spot_scene, sunlit_scene

Pictures = dict[str, NDArray[Any]]

VIEWS = """
  const { scene, camera, renderer, ground, object } = lightingScene;
  drawn("page");
  const bytes = Uint8Array.from(atob("GLB"), (letter) => letter.charCodeAt(0));
  const file = await new THREE.GLTFLoader().parseAsync(bytes.buffer, "");
  const stage = new THREE.Scene().add(file.scene);
  stage.environment = scene.environment;
  file.scene.traverse((part) => {
    if (part.isDirectionalLight) {
      part.castShadow = true;
      part.shadow.mapSize.set(2048, 2048);
      Object.assign(part.shadow.camera, { left: -4, right: 4, top: 4, bottom: -4, near: -20, far: 20 });
    }
    if (["Ball", "Stick"].includes(part.name)) part.castShadow = true;
    if (part.name === "Ground") part.receiveShadow = true;
  });
  renderer.render(stage, file.cameras[0]);
  drawn("gltf");
  MOVED
  ground.visible = object.visible = false;
  scene.background = scene.environment;
  renderer.render(scene, camera);
  drawn("map");
"""  # three.js leaves it to the page which meshes of a glTF file cast shadows


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Pictures:
    """The page as it opens and after a click, the glTF file in three.js, and the map as the page's background."""
    folder = tmp_path_factory.mktemp("page")
    scene = sunlit_scene()
    save_files(folder, threejs.encode_threejs(scene))
    save_files(folder, gltf.encode_gltf(scene))
    glb = base64.b64encode((folder / gltf.GLB_FILE).read_bytes()).decode()
    drawn = drawings(
        folder / threejs.PAGE, VIEWS.replace("GLB", glb).replace("MOVED", MOVED), scene.width, scene.height
    )
    assert list(drawn) == ["page", "gltf", "moved", "map"]
    return drawn


@pytest.fixture(scope="module")
def half_pictures(tmp_path_factory: pytest.TempPathFactory) -> Pictures:
    """The page of a photo whose ground is half in shade, and the sun's share there as gray."""
    return draw_page(half_shaded_scene(), tmp_path_factory.mktemp("half"))


@pytest.fixture(scope="module")
def shade_pictures(tmp_path_factory: pytest.TempPathFactory) -> Pictures:
    """The page of a photo whose object stands in shade, also after a click, and the sun's share at first as gray."""
    return draw_page(shaded_spot_scene(), tmp_path_factory.mktemp("shade"))


def draw_page(scene: Scene, folder: Path) -> Pictures:
    save_files(folder, threejs.encode_threejs(scene))
    page = folder / threejs.PAGE
    whole = str(description(page.read_text(encoding="utf-8"))["sunIntensity"])
    return drawings(page, 'drawn("page");' + SHARE.replace("WHOLE", whole) + MOVED, scene.width, scene.height)


def pixel_at(picture: NDArray[Any], scene: Scene, points: NDArray[Any]) -> NDArray[Any]:
    """Linear colors (..., 3) that a picture shows at points (..., 3)."""
    light = scene.lighting
    x, y = np.moveaxis(
        camera_pixel(
            points - scene.camera_position,
            Pinhole(
                scene.width,
                scene.height,
                light.vertical_fov,
                0.0,
                light.camera_elevation,
                light.camera_roll,
            ),
        ),
        -1,
        0,
    )
    return srgb_decode(picture[y.astype(int), x.astype(int)] / 255.0)


def shadow_azimuth(picture: NDArray[Any], scene: Scene) -> float:
    """Azimuth [deg] of the stick's shadow: the darkness' centroid on arcs around its foot."""
    expected = scene.lighting.sun_azimuth + 180.0
    offsets = np.linspace(-8, 8, 401)
    placeholder = scene.placeholder
    length = placeholder.stick_height / np.tan(np.radians(scene.lighting.sun_elevation))
    reach = length * np.linspace(0.4, 0.9, 40)[:, None, None]
    light = luminance(
        pixel_at(picture, scene, scene.spot + placeholder.stick_foot + reach * direction(expected + offsets, 0.0))
    )
    dark = np.maximum(0.85 - light / light.max(), 0)
    assert dark.max() > 0.2
    return float(expected + (dark * offsets).sum() / dark.sum())


def test_text_of_a_record_stays_text(tmp_path: Path) -> None:
    scene, hostile = sunlit_scene(), "</script><script>alert(1)</script><!--"
    save_files(tmp_path, threejs.encode_threejs(scene))
    harmless = (tmp_path / threejs.PAGE).read_text()
    save_files(tmp_path, threejs.encode_threejs(replace(scene, lighting=replace(scene.lighting, warnings=(hostile,)))))
    page = (tmp_path / threejs.PAGE).read_text()
    assert "alert(1)" in page
    assert [page.count(mark) for mark in ("<script", "</script", "<!--")] == [
        harmless.count(mark) for mark in ("<script", "</script", "<!--")
    ]
    described = re.search(r'<script id="scene" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert described is not None
    assert json.loads(described[1])["lighting"]["warnings"] == [hostile]


@pytest.mark.slow
def test_the_plate_is_unchanged_where_nothing_stands(pictures: Pictures) -> None:
    page, plate = pictures["page"].astype(int), sunlit_scene().plate.astype(int)
    assert page.shape == plate.shape
    upper, left = slice(0, page.shape[0] // 2), slice(0, page.shape[1] // 3)
    assert np.abs(page - plate)[upper].max() <= 1
    assert np.abs(page - plate)[:, left].max() <= 1
    assert np.abs(page - plate).max() > 50  # but there is an object


@pytest.mark.slow
@pytest.mark.parametrize("view", ["page", "gltf"])
def test_the_sticks_shadow_points_away_from_the_sun(pictures: Pictures, view: str) -> None:
    scene = sunlit_scene()
    drawn = shadow_azimuth(pictures[view], scene)
    assert abs(wrap_azimuth(drawn - scene.lighting.sun_azimuth - 180.0)) < 0.5


@pytest.mark.slow
def test_the_shadow_keeps_the_skys_share_of_the_light(pictures: Pictures) -> None:
    scene = sunlit_scene()
    away = -scene.sun_direction * [1, 0, 1] / scene.sun_direction[1]
    inside = scene.spot + scene.placeholder.ball_radius * (1.0 + 0.3 / scene.sun_direction[1]) * away
    ratio = pixel_at(pictures["page"], scene, inside) / pixel_at(scene.plate, scene, inside)
    assert ratio == pytest.approx(scene.shadow * open_share(scene, inside), rel=0.03)


def open_share(scene: Scene, point: Floats) -> float:
    """The share of the sky that a ball in the place of the placeholder's box leaves a point of the ground."""
    radius = scene.placeholder.ball_radius
    middle = scene.spot + radius * np.array([0.78, 1.25, 0.0])
    return float(1 - 1.25 * radius**3 / np.linalg.norm(point - middle) ** 3)


@pytest.mark.slow
def test_no_shadow_darkens_shade(half_pictures: Pictures) -> None:
    scene, page = half_shaded_scene(), half_pictures["page"].astype(int)
    change = (page - scene.plate)[290:, scene.width // 2 + 40 :]  # below the stick, and beside the ball
    assert change.min() > -30  # of contact alone, which fades away from the object
    assert np.abs(change[:, 120:]).max() <= 3
    assert (page - scene.plate)[297:305, 230:235].mean() < -30  # the shadow's beginning on lit ground


@pytest.mark.slow
def test_an_object_in_the_photos_shade_is_in_shade_until_it_is_moved_into_the_sun(
    shade_pictures: Pictures, pictures: Pictures
) -> None:
    scene, pictures_of = shaded_spot_scene(), {"shade": shade_pictures, "sun": pictures}
    center, radius = scene.spot + scene.placeholder.ball_center, scene.placeholder.ball_radius
    to_camera = scene.camera_position - center
    normal = to_camera / np.linalg.norm(to_camera)
    dark = scene.environment.copy()
    dark[len(dark) // 2 :] *= scene.shadow
    light = sky_irradiance(replace(scene, environment=dark), normal)
    drawn = pixel_at(pictures_of["shade"]["page"], scene, center + radius * normal)
    assert luminance(drawn) == pytest.approx(luminance(PLACEHOLDER_ALBEDO / np.pi * light), rel=0.1)
    change = np.abs(pictures_of["shade"]["moved"][:, 330:].astype(int) - pictures_of["sun"]["moved"][:, 330:])
    assert change.max() <= 1
    dark, lit = ((pictures_of[name]["page"] - scene.plate.astype(int))[290:, 280:] for name in ("shade", "sun"))
    assert lit.min() < 2 * dark.min()  # the shadow of one in the sun; in shade there is that of contact alone
    assert np.abs(pictures_of["shade"]["moved"].astype(int) - scene.plate)[230:, 330:].max() > 30  # the object is there


@pytest.mark.slow
def test_the_page_has_the_same_rule_of_shade(half_pictures: Pictures, shade_pictures: Pictures) -> None:
    """Shown as a gray background."""
    for scene, drawn in ((half_shaded_scene(), half_pictures), (shaded_spot_scene(), shade_pictures)):
        share = srgb_decode(drawn["share"][0, 0] / 255.0)
        assert share == pytest.approx(0.0 if scene.spot_in_shade else 1.0, abs=0.02)


SHARE = """{
  const { scene, camera, renderer, sun, ground, object } = lightingScene;
  const background = scene.background;
  scene.background = new THREE.Color().setScalar(sun.intensity / WHOLE);
  ground.visible = object.visible = false;
  renderer.render(scene, camera);
  drawn("share");
  scene.background = background;
  ground.visible = object.visible = true;
}"""
MOVED = """{
  const canvas = lightingScene.renderer.domElement, frame = canvas.getBoundingClientRect();
  const [clientX, clientY] = [frame.left + (390 / 480) * frame.width, frame.top + (300 / 360) * frame.height];
  canvas.dispatchEvent(new MouseEvent("click", { clientX, clientY }));
  drawn("moved");
}"""


@pytest.mark.slow
@pytest.mark.parametrize("view", ["page", "gltf"])
def test_the_ball_is_a_diffuse_surface_under_sun_and_sky(pictures: Pictures, view: str) -> None:
    """Where the camera sees it in the sun, and where it faces away from the sun."""
    scene = sunlit_scene()
    placeholder = scene.placeholder
    center = scene.spot + placeholder.ball_center
    to_camera = scene.camera_position - center
    to_camera /= np.linalg.norm(to_camera)
    for normal in (scene.sun_direction + to_camera, 2 * to_camera - scene.sun_direction):
        normal = normal / np.linalg.norm(normal)
        light = sky_irradiance(scene, normal) + max(float(normal @ scene.sun_direction), 0.0) * scene.sun_irradiance
        drawn = pixel_at(pictures[view], scene, center + placeholder.ball_radius * normal)
        assert luminance(drawn) == pytest.approx(luminance(PLACEHOLDER_ALBEDO / np.pi * light), rel=0.1)


def sky_irradiance(scene: Scene, normal: NDArray[Any]) -> NDArray[Any]:
    height = len(scene.environment)
    cosine = np.maximum(latlong_directions(height) @ normal, 0) * latlong_solid_angle(height)[:, None]
    return np.asarray(np.einsum("ij,ijk->k", cosine, scene.environment))


@pytest.mark.slow
def test_the_map_lies_behind_the_page_as_the_photo_does(pictures: Pictures) -> None:
    scene = sunlit_scene()
    light = scene.lighting
    rays = camera_directions(
        Pinhole(scene.width, scene.height, light.vertical_fov, 0.0, light.camera_elevation, light.camera_roll)
    )
    expected = tone_map(sample_latlong(scene.environment, rays)).astype(int)
    difference = np.abs(pictures["map"].astype(int) - expected)
    assert np.percentile(difference, 99) <= 4  # the rest is the horizon, which the two resample differently


def description(page: str) -> dict[str, Any]:
    drawn = re.search(r'<script id="scene" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert drawn is not None
    return dict(json.loads(drawn[1]))


def test_the_page_holds_all_it_needs(tmp_path: Path) -> None:
    save_files(tmp_path, threejs.encode_threejs(sunlit_scene()))
    page = (tmp_path / threejs.PAGE).read_text(encoding="utf-8")
    assert [path.name for path in tmp_path.iterdir()] == [threejs.PAGE]
    assert re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=", page) == []
    assert "SPDX-License-Identifier: MIT" in page
    assert page.count("</script>") == 3


def test_what_the_page_is_told(tmp_path: Path) -> None:
    scene = sunlit_scene()
    save_files(tmp_path, threejs.encode_threejs(scene))
    values = description((tmp_path / threejs.PAGE).read_text(encoding="utf-8"))
    assert values["sunIntensity"] * np.array(values["sunColour"]) == pytest.approx(scene.sun_irradiance)
    assert np.reshape(values["cameraMatrix"], (4, 4)) == pytest.approx(scene.camera_matrix)
    assert values["lighting"] == record_with_coefficients(scene.lighting, scene.light_probe)
    plate = Image.open(BytesIO(base64.b64decode(values["plate"].split(",")[1])))
    assert np.array_equal(np.asarray(plate), scene.plate)
    lit = Image.open(BytesIO(base64.b64decode(values["litGround"].split(",")[1])))
    assert (lit.mode, lit.size) == ("L", (256, 192))


def test_the_notice_of_three_js_is_kept() -> None:
    library = resources.files("lighting") / "data" / "three.min.js"
    assert "SPDX-License-Identifier: MIT" in library.read_text(encoding="utf-8")
    assert "three.js authors" in Path("NOTICE").read_text(encoding="utf-8")


def test_the_page_to_send_is_small_whatever_the_photo(tmp_path: Path) -> None:
    """Noise is what JPEG packs worst."""
    noise = np.random.default_rng(1).integers(0, 256, (2160, 3840, 3), np.uint8)
    scene = replace(sunlit_scene(), plate=noise)
    save_files(tmp_path, threejs.encode_page(scene))
    page = (tmp_path / threejs.SENT_PAGE).read_bytes()
    assert len(page) <= threejs.MAX_SENT_BYTES
    assert not re.search(rb'(?:src|href)\s*=\s*"?https?:', page)
    assert description(page.decode())["plate"].startswith("data:image/jpeg")


@pytest.mark.slow
def test_the_teapot_of_the_page_to_send_follows_the_finger(tmp_path: Path) -> None:
    scene = sunlit_scene()
    save_files(tmp_path, threejs.encode_page(scene))
    moves = """
      const { renderer } = lightingScene;
      drawn("first");
      const { left, top, width, height } = renderer.domElement.getBoundingClientRect();
      const at = { clientX: left + width * 0.2, clientY: top + height * 0.85, bubbles: true };
      renderer.domElement.dispatchEvent(new PointerEvent("pointermove", { ...at, buttons: 0 }));
      drawn("hovered");
      renderer.domElement.dispatchEvent(new PointerEvent("pointermove", { ...at, buttons: 1 }));
      drawn("dragged");
    """
    drawn = drawings(tmp_path / threejs.SENT_PAGE, moves, scene.width, scene.height)
    centers = {}
    for name, picture in drawn.items():
        red = picture[..., 0].astype(int) - picture[..., 1:].max(axis=-1) > 60
        assert red.sum() > 200, name
        centers[name] = np.nonzero(red)[1].mean() / scene.width
    assert centers["first"] == centers["hovered"]
    assert centers["dragged"] == pytest.approx(0.2, abs=0.08)
