"""One scene, seven tools, one answer: does the light that `lighting scene` writes fall the same way everywhere?

    python -m benchmarks.scenes [--sun -125 33] [--only TOOL ...] [--blender PROGRAM] [--samples 64]
                                [--picture docs/scenes.png] [--keep FOLDER]

The "photo" is rendered here from a known light, which the scenes are compared with. Blender reads and renders the USD,
Babylon.js the glTF, and Filament that and its KTX; both draw the ground as a disc, since glTF knows no shadow catcher.
A cubemap has no renderer of its own, and Unreal and Unity do not run here. Godot runs in the chroot of
scripts/engines.sh that LIGHTING_ENGINES names. Prints a table and draws all renders into one picture; a tool that this
machine lacks is named and left out. The sun stands on the left, so that the shadow of the preview's diffuse ball lies
free. PROGRAM is Blender or a Python that has its module bpy.
"""

import argparse
import tempfile
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.scene_measures import (
    Picture,
    ball,
    brightest_normal,
    shade_region,
    shadow_azimuth,
    sunlit_over_shaded,
    unhidden,
)
from benchmarks.scene_renders import (
    MissingToolError,
    render_babylon,
    render_blender,
    render_filament,
    render_godot,
    render_import,
    render_mitsuba,
    render_threejs,
)
from lighting.color import luminance, srgb_decode, tone_map
from lighting.envmap.render import render
from lighting.geometry import (
    Floats,
    Pinhole,
    angle_between,
    angles,
    camera_directions,
    latlong_directions,
    latlong_solid_angle,
    sample_latlong,
    wrap_azimuth,
)
from lighting.photo.reader import Photo
from lighting.preview.drawing import TextStyle, draw_text
from lighting.preview.spheres import DIFFUSE, VERTICAL_FOV, limit_elevation, render_spheres, sphere_centers
from lighting.records import Lighting
from lighting.scene.records import Scene, make_scene
from lighting.scene.writer import write_scene

SUN = (-125.0, 33.0)  # deg, azimuth and elevation
LIGHT = Lighting(*SUN, turbidity=3.0, exposure=1.0, camera_elevation=-7.0, camera_roll=2.0, vertical_fov=45.0)
GROUND = 0.22  # the photo's linear value of open ground, which the exposure is chosen for
SIZE = (640, 480)  # pixels
CAPTION = 26  # pixels
DRAWN = ("blender", "usd", "gltf", "filament", "threejs", "godot", "mitsuba")  # Unreal and Unity do not run here
OURS, ALONE = "our preview", "its ball alone"


def main() -> None:
    arguments = _arguments()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(arguments.keep or temporary)
        folder.mkdir(exist_ok=True)
        scene = synthetic_scene(*arguments.sun)
        renders_by_tool, measured = renders(scene, folder, arguments.only, arguments.samples, arguments.blender)
    renders_by_tool[OURS], measured[OURS] = preview(scene)
    measured[ALONE] = preview(scene, alone=True)[1]
    _print_table(scene, measured)
    if arguments.picture:
        contact_sheet(renders_by_tool).save(arguments.picture)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="One scene, seven tools, one answer.")
    parser.add_argument("--sun", nargs=2, type=float, default=SUN, help="azimuth, below 0, and elevation in degrees")
    parser.add_argument("--only", nargs="+", choices=DRAWN, default=DRAWN, help="the tools to render with")
    parser.add_argument("--blender", help="Blender, or a Python that has its module bpy")
    parser.add_argument("--samples", type=int, default=64, help="per pixel, where a tool traces paths")
    parser.add_argument("--picture", help="draw all renders into this file")
    parser.add_argument("--keep", help="leave the scenes and renders in this folder")
    return parser.parse_args()


def synthetic_scene(azimuth: float, elevation: float) -> Scene:
    """A level plain under LIGHT with its sun there, photographed by our own renderer."""
    light = replace(LIGHT, sun_azimuth=azimuth, sun_elevation=elevation)
    lighting = replace(light, exposure=GROUND / float(luminance(render(light, 64)[-1, 0])))
    rays = camera_directions(
        Pinhole(*SIZE, lighting.vertical_fov, elevation=lighting.camera_elevation, roll=lighting.camera_roll)
    )
    pixels = tone_map(sample_latlong(render(lighting, 1024), rays))
    return make_scene(Photo(pixels, *SIZE, "PNG"), lighting)


def renders(
    scene: Scene, folder: Path, only: Collection[str], samples: int, blender: str | None
) -> tuple[dict[str, NDArray[np.uint8]], dict[str, Picture]]:
    """What each tool made of the scene, as it is and ready to be measured."""
    draws: dict[str, Callable[[Path], NDArray[np.uint8]]] = {
        "blender": lambda made: render_blender(made, samples, blender),
        "usd": lambda made: render_import(made, "scene.usda", SIZE, samples, blender),
        "gltf": lambda made: render_babylon(made, SIZE),
        "filament": lambda made: render_filament(made, scene),
        "threejs": lambda made: render_threejs(made, SIZE),
        "godot": render_godot,
        "mitsuba": lambda made: render_mitsuba(made, samples),
    }
    renders_by_tool = {}
    for tool in filter(only.__contains__, draws):
        write_scene(scene, tool, folder / tool, overwrite=True)
        try:
            renders_by_tool[tool] = draws[tool](folder / tool)
        except MissingToolError as missing:
            print(f"{tool} is left out: this machine lacks {missing}.")
    return renders_by_tool, {tool: _picture(scene, pixels) for tool, pixels in renders_by_tool.items()}


def _picture(scene: Scene, pixels: NDArray[np.uint8]) -> Picture:
    placeholder = scene.placeholder
    ball, foot = scene.spot + placeholder.ball_center, scene.spot + placeholder.stick_foot
    shadow = placeholder.stick_height / np.tan(np.radians(scene.lighting.sun_elevation))
    heights = np.arange(0, placeholder.stick_height, placeholder.stick_radius)[:, None]
    stick = np.hstack([foot + heights * [0.0, 1.0, 0.0], np.full_like(heights, 1.5 * placeholder.stick_radius)])
    return Picture(
        srgb_decode(pixels / 255.0),
        scene.vertical_fov,
        scene.lighting.camera_elevation,
        scene.lighting.camera_roll,
        scene.camera_position,
        ball,
        placeholder.ball_radius,
        foot,
        (0.3 * shadow, 0.9 * shadow),
        np.vstack([[*ball, placeholder.ball_radius], stick]),
    )


def preview(scene: Scene, *, alone: bool = False) -> tuple[NDArray[np.uint8], Picture]:
    """Our own three spheres in the same light; the right one is diffuse, and `alone` it has the ground for itself."""
    width, height = SIZE
    lighting = scene.lighting
    elevation = limit_elevation(lighting)
    centers = sphere_centers(width / height, elevation)
    if alone:
        centers[:DIFFUSE, 0] -= 1000.0
    linear = render_spheres(render(lighting, 1024), lighting, width, height, 2, centers)
    picture = Picture(
        linear,
        VERTICAL_FOV,
        elevation,
        0.0,
        np.zeros(3),
        centers[DIFFUSE],
        1.0,
        centers[DIFFUSE] - [0.0, 1.0, 0.0],
        (1.5, 2.5),
        np.hstack([centers, np.ones((3, 1))]),
    )
    return np.asarray(Image.fromarray(tone_map(linear)).reduce(2)), picture


def brightness(scene: Scene, normals: Floats) -> Floats:
    """Luminance of the irradiance (N,) that map and sun give to surfaces of these normals (N, 3)."""
    small = scene.environment.reshape(32, len(scene.environment) // 32, 64, -1, 3).mean(axis=(1, 3))
    weighted = luminance(small) * latlong_solid_angle(32)[:, None]
    sky = np.maximum(normals @ latlong_directions(32).reshape(-1, 3).T, 0) @ weighted.ravel()
    sun = np.maximum(normals @ scene.sun_direction, 0) * float(luminance(scene.sun_irradiance))
    return np.asarray(sky + sun)


def _print_table(scene: Scene, measured: dict[str, Picture]) -> None:
    shadow = float(wrap_azimuth(scene.lighting.sun_azimuth + 180.0))
    region = shade_region(scene.sun_direction)
    visible = np.all([unhidden(picture, region) for picture in measured.values()], axis=0)
    print(f"{visible.mean():.0%} of the shade is in sight in all pictures.")
    print(f"{'':14} {'shadow towards':>15} {'off':>6}  {'brightest az / el':>18} {'off':>5}  {'sunlit / shaded':>15}")
    print(f"{'true':14} {shadow:14.2f}°")
    for tool, picture in measured.items():
        print(f"{tool:14} {_shadow_words(tool, picture, shadow)}  {_ball_words(scene, picture)}  ", end="")
        print(f"{sunlit_over_shaded(picture, scene.sun_direction, region[visible]):15.2f}")


def _shadow_words(tool: str, picture: Picture, shadow: float) -> str:
    if tool in (OURS, ALONE):
        return f"{'no stick':>15} {'':>6}"
    azimuth = shadow_azimuth(picture, shadow)
    return f"{azimuth:14.2f}° {float(wrap_azimuth(azimuth - shadow)):5.2f}°"


def _ball_words(scene: Scene, picture: Picture) -> str:
    normals, values = ball(picture)
    measured_normal, true = brightest_normal(normals, values), brightest_normal(normals, brightness(scene, normals))
    azimuth, elevation = (float(angle) for angle in angles(measured_normal))
    cell = f"{azimuth:.1f} / {elevation:.1f}"
    return f"{cell:>18} {float(angle_between(measured_normal, true)):4.1f}°"


def contact_sheet(renders_by_tool: dict[str, Any]) -> Image.Image:
    """All renders with their names, three in a row."""
    width, height = SIZE
    rows = -(-len(renders_by_tool) // 3)
    sheet = Image.new("RGB", (3 * width + 16, rows * (height + CAPTION + 8) - 8), (255, 255, 255))
    for index, (name, pixels) in enumerate(renders_by_tool.items()):
        x, y = index % 3 * (width + 8), index // 3 * (height + CAPTION + 8)
        draw_text(sheet, (x, y), TITLES[name], TextStyle(17, (40, 40, 40)))
        sheet.paste(Image.fromarray(pixels), (x, y + CAPTION))
    return sheet


TITLES = {
    "blender": "Blender, Cycles",
    "usd": "USD, read by Blender",
    "gltf": "glTF in Babylon.js",
    "filament": "Filament, with KTX",
    "threejs": "three.js in Chromium",
    "godot": "Godot 4",
    "mitsuba": "Mitsuba 3",
    OURS: "lighting preview",
}

if __name__ == "__main__":
    main()
