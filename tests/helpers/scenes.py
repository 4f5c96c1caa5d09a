"""Scenes for tests."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.color import srgb_decode, tone_map
from lighting.envmap.render import render
from lighting.files.deflate import encode_png
from lighting.geometry import Floats, Pinhole, camera_directions, sample_latlong
from lighting.photo.reader import Photo
from lighting.prediction import EstimatedLight, SunDistribution
from lighting.preview.drawing import SUN
from lighting.records import Lighting
from lighting.scene import Exporter, ExporterOption
from lighting.scene.records import Scene, make_scene
from lighting.scene.writer import Files
from lighting.sky import SkyModel, Weather

Bytes = NDArray[np.uint8]

GRID = "fibonacci:256"
GRAY = 110


def outdoors(azimuth: float = 150.0, elevation: float = 40.0, **others: Any) -> Lighting:
    return Lighting(azimuth, elevation, 3.0, 5.0, **others)


def photo(width: int, height: int) -> Bytes:
    return np.full((height, width, 3), GRAY, dtype=np.uint8)


def distribution(probability: Floats | None = None, grid: str = GRID) -> SunDistribution:
    """A probability on a grid, by default an even one."""
    even = np.full(256, 1 / 256)
    return SunDistribution(grid, np.asarray(even if probability is None else probability, dtype=np.float32))


def estimate(lighting: Lighting, probability: Floats | None = None) -> EstimatedLight:
    return EstimatedLight(lighting, distribution(probability))


@lru_cache
def small_map(lighting: Lighting) -> NDArray[np.float32]:
    return render(lighting, 64)


def amber(panel: NDArray[np.int64]) -> NDArray[np.intp]:
    """Rows and columns of the pixels in the sun's color."""
    return np.argwhere(np.abs(panel - np.array(SUN)).max(axis=-1) < 8)


LIGHT = Lighting(
    sun_azimuth=-40.0,
    sun_elevation=35.0,
    turbidity=3.0,
    exposure=1.0,
    camera_elevation=-12.0,
    camera_roll=4.0,
    vertical_fov=50.0,
)
PLAIN = np.full((30, 40, 3), 99, np.uint8)  # a gray photo
GROUND = 0.25  # the photo's linear value of open ground, which the exposure is chosen for


@lru_cache(maxsize=1)
def sunlit_scene(width: int = 480, height: int = 360) -> Scene:
    """Sky, sun and plain ground under LIGHT, photographed."""
    exposure = GROUND / float(render(LIGHT, 64)[-1, 0].mean())
    lighting = replace(LIGHT, exposure=exposure)
    rays = camera_directions(Pinhole(width, height, LIGHT.vertical_fov, 0.0, LIGHT.camera_elevation, LIGHT.camera_roll))
    pixels = tone_map(sample_latlong(render(lighting, 512), rays))
    return make_scene(Photo(pixels, width, height, "PNG"), lighting, map_height=256)


def plain_scene(**changes: Any) -> Scene:
    """A gray photo under LIGHT with these fields changed."""
    return make_scene(Photo(PLAIN, 40, 30, "PNG"), replace(LIGHT, **changes), map_height=32)


@lru_cache(maxsize=1)
def half_shaded_scene() -> Scene:
    """The same with the right half of the ground in shade but for the spot, where the placeholder's shadows fall."""
    return _shaded(slice(sunlit_scene().width // 2 + 3, None))


@lru_cache(maxsize=1)
def shaded_spot_scene() -> Scene:
    """The same with the spot in shade, whose edge lies beside the ball; the shadows fall beyond it."""
    return _shaded(slice(None, 276))


def _shaded(columns: slice) -> Scene:
    """The same with the ground of these columns in shade."""
    scene = sunlit_scene()
    camera = Pinhole(scene.width, scene.height, LIGHT.vertical_fov, 0.0, LIGHT.camera_elevation, LIGHT.camera_roll)
    shaded = np.zeros((scene.height, scene.width), dtype=bool)
    shaded[:, columns] = camera_directions(camera)[:, columns, 1] < 0
    linear = srgb_decode(scene.plate / 255.0)
    linear[shaded] *= scene.shadow
    return make_scene(Photo(tone_map(linear), scene.width, scene.height, "PNG"), scene.lighting, map_height=256)


TEXT, PICTURE = "toy.txt", "toy.png"


def eastern_luminance(direction: ArrayLike, _sun_direction: ArrayLike, weather: Weather) -> Floats:
    """Luminance (...) along unit vectors (..., 3): brighter to the right of the camera; 0 below the horizon."""
    x, y, _ = np.moveaxis(np.asarray(direction, dtype=float), -1, 0)
    return np.where(y > 0, weather.turbidity + x, 0.0)


def save_files(folder: Path, files: Files) -> None:
    """Write the files of a scene."""
    for name, data in files.items():
        (folder / name).write_bytes(data)


def encode_toy(scene: Scene, *, unit: str = "m") -> Files:
    """TEXT with the sun, and PICTURE, the photo."""
    height = scene.camera_position[1] * {"m": 1, "cm": 100}[unit]
    lines = [f"sun {scene.lighting.sun_azimuth:g} {scene.lighting.sun_elevation:g}", f"camera {height:g} {unit}"]
    return {TEXT: ("\n".join(lines) + "\n").encode(), PICTURE: encode_png(scene.plate)}


EASTERN = SkyModel(eastern_luminance)
TOY = Exporter(
    encode_toy, label="A toy", files=(TEXT, PICTURE), options={"unit": ExporterOption(("m", "cm"), default="m")}
)


def cube_directions(size: int) -> Floats:
    """Unit vectors (6, size, size, 3) of a cubemap's pixels, by table 8.19 of OpenGL's specification."""
    steps = (np.arange(size) + 0.5) * (2 / size) - 1
    s, t = np.meshgrid(steps, steps)
    one = np.ones_like(s)
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    vectors = np.array([np.stack(face, axis=-1) for face in faces])
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def harmonics(direction: Floats) -> Floats:
    """The nine real spherical harmonics (..., 9) of unit vectors (..., 3), as WebXR's light estimation numbers them."""
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    functions = [
        np.full_like(x, 0.282095), 0.488603 * y, 0.488603 * z, 0.488603 * x, 1.092548 * x * y, 1.092548 * y * z,
        0.315392 * (3 * z * z - 1), 1.092548 * x * z, 0.546274 * (x * x - y * y),
    ]  # fmt: skip
    return np.stack(functions, axis=-1)
