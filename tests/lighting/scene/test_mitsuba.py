"""The scene for Mitsuba, rendered: light, shadow and composite as they must be."""

import os
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import mitsuba as mitsuba_renderer
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.color import luminance, srgb_decode
from lighting.envmap.projection import photo_camera
from lighting.geometry import Pinhole, camera_pixel, direction
from lighting.scene import mitsuba
from lighting.scene.records import Scene
from tests.helpers.scenes import LIGHT, half_shaded_scene, save_files, shaded_spot_scene, sunlit_scene

mi: Any = mitsuba_renderer

WIDTH, HEIGHT = 160, 120


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    mi.set_variant("scalar_rgb")
    path = tmp_path_factory.mktemp("scene")
    save_files(path, mitsuba.encode_mitsuba(sunlit_scene()))
    return path


@pytest.fixture(scope="module")
def picture(folder: Path) -> NDArray[np.float32]:
    """The whole scene, linear (h, w, 3)."""
    scene = mi.load_file(str(folder / "scene.xml"), samples=48, width=WIDTH, height=HEIGHT)
    return np.array(mi.render(scene, seed=1))[..., :3]


def shown(picture: NDArray[Any], scene: Scene, points: NDArray[Any], reach: int = 1) -> NDArray[Any]:
    """Mean luminance around the pixels that show points (N, 3)."""
    pixels = camera_pixel(
        points - scene.camera_position,
        Pinhole(
            WIDTH,
            HEIGHT,
            LIGHT.vertical_fov,
            0.0,
            LIGHT.camera_elevation,
            LIGHT.camera_roll,
        ),
    )
    light = luminance(picture)
    return np.array(
        [
            light[int(y) - reach : int(y) + reach + 1, int(x) - reach : int(x) + reach + 1].mean()
            for x, y in pixels.reshape(-1, 2)
        ]
    )


@pytest.mark.slow
def test_open_ground_has_the_radiance_of_the_map(picture: NDArray[np.float32]) -> None:
    scene = sunlit_scene()
    open_ground = scene.spot + np.array([[-6.0, 0, 0], [-5.0, 0, -1.0], [0, 0, -8.0]]) * scene.placeholder.ball_radius
    expected = luminance(scene.environment[-1, 0])
    assert shown(picture, scene, open_ground, 3).mean() == pytest.approx(float(expected), rel=0.03)


@pytest.mark.slow
def test_the_shadow_lies_opposite_the_sun(picture: NDArray[np.float32]) -> None:
    scene = sunlit_scene()
    turn = np.arange(-36, 37, 3.0)  # the stick's shadow stays outside
    ring = scene.spot + 2.2 * scene.placeholder.ball_radius * direction(LIGHT.sun_azimuth + 180.0 + turn, 0.0)
    light = shown(picture, scene, ring, 0)
    dark = np.clip(0.8 - light / light.max(), 0, None)
    assert (dark * turn).sum() / dark.sum() == pytest.approx(0.0, abs=2.5)
    assert dark.max() > 0.3


@pytest.mark.slow
def test_the_camera_sees_the_map_as_the_photo_did(picture: NDArray[np.float32]) -> None:
    small = np.asarray(Image.fromarray(sunlit_scene().plate).resize((WIDTH, HEIGHT), Image.Resampling.BOX))
    tone = np.asarray(mi.Bitmap(picture).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, srgb_gamma=True))
    assert np.abs(tone[:20].astype(int) - small[:20]).max() <= 3


@pytest.fixture(scope="module")
def composite(tmp_path_factory: pytest.TempPathFactory) -> NDArray[np.uint8]:
    """What composite.py makes of a plate whose right half lies in shade."""
    folder = tmp_path_factory.mktemp("half_shaded")
    save_files(folder, mitsuba.encode_mitsuba(half_shaded_scene()))
    return composited(folder)


@pytest.mark.slow
def test_the_composite_keeps_the_plate(composite: NDArray[np.uint8]) -> None:
    plate = half_shaded_scene().plate
    assert composite.shape == plate.shape
    difference = np.abs(composite.astype(int) - plate)
    assert difference[:60].max() <= 1
    assert difference.max() > 30


@pytest.mark.slow
def test_no_shadow_darkens_shade(composite: NDArray[np.uint8]) -> None:
    """The ball's shadow begins on lit ground, in the picture's left half, and goes on in the shade at its right."""
    ratio = luminance(srgb_decode(composite / 255.0)) / luminance(srgb_decode(half_shaded_scene().plate / 255.0))
    assert np.median(ratio[297:305, 230:235]) < 0.3
    assert np.median(ratio[308:316, 284:292]) > 0.6
    assert np.median(ratio[320:325, 400:412]) > 0.9  # the stick's


@pytest.mark.slow
def test_an_object_in_the_photos_shade_is_in_shade(tmp_path: Path) -> None:
    """And `sun_on_object` gives it the sun again, while nothing else changes."""
    scene = shaded_spot_scene()
    save_files(tmp_path, mitsuba.encode_mitsuba(scene))
    shade = composited(tmp_path)
    objects = (tmp_path / "object.xml").read_text()
    assert objects.count('name="sun_on_object" value="0"') == 1
    (tmp_path / "object.xml").write_text(objects.replace('"sun_on_object" value="0"', '"sun_on_object" value="1"'))
    sun = composited(tmp_path)
    x, y = ball_pixel(scene)
    top = np.s_[y - 22 : y - 10, x - 15 : x + 16]
    assert srgb_decode(shade[top] / 255.0).mean() < 0.6 * srgb_decode(sun[top] / 255.0).mean()
    assert (shade[300:] == sun[300:]).all()  # the shadows on sunlit ground
    assert (shade[:, : x - 40] == sun[:, : x - 40]).all()


def ball_pixel(scene: Scene) -> tuple[int, int]:
    """Where the plate's camera sees the ball's center."""
    center = scene.spot + scene.placeholder.ball_center - scene.camera_position
    x, y = camera_pixel(center, photo_camera(scene.lighting, scene.width, scene.height))
    return int(x), int(y)


def composited(folder: Path) -> NDArray[np.uint8]:
    """What composite.py makes of a folder's scene."""
    subprocess.run([sys.executable, "composite.py", "4"], cwd=folder, check=True, capture_output=True)
    return np.asarray(Image.open(folder / "composite.png").convert("RGB"))


def test_a_variant_that_does_not_run_names_the_one_that_does(folder: Path) -> None:
    """Without its LLVM the library writes lines of its own, raises or aborts."""
    command = [sys.executable, "composite.py", "1", "llvm_ad_rgb"]
    environment = os.environ | {"DRJIT_LIBLLVM_PATH": "/nonexistent/libLLVM.so"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "Mitsuba's variant llvm_ad_rgb does not run here: " in done.stderr
    assert done.stderr.endswith(" Use scalar_rgb, which needs no LLVM.\n")


def test_a_variant_that_hangs_is_given_up(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The library may wait for itself while it looks for LLVM in vain."""
    spec = spec_from_file_location("composite", folder / "composite.py")
    assert spec is not None
    assert spec.loader is not None
    composite = module_from_spec(spec)
    spec.loader.exec_module(composite)

    def hang(command: list[str], *, timeout: float, **_: Any) -> None:
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(subprocess, "run", hang)
    with pytest.raises(SystemExit, match=r"llvm_ad_rgb does not run here: it hung for 60 s\. Use scalar_rgb"):
        composite._try("llvm_ad_rgb")
