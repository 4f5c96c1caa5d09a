"""Print how many stops Blender's own sky, aimed by the scene.py of this folder, differs from what it should give.

python native_sky.py ELEVATION...     # of suns, deg
"""

import math
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from scene import aim_native_sky  # type: ignore[import-not-found]  # of the folder where this runs

WIDTH, HEIGHT = 64, 32  # of the panorama that is rendered
LUMINANCE = 2.5  # of the irradiance on level ground that is asked for


def render_level(node: Any, turbidity: float, elevation: float) -> float:
    """Luminance of the irradiance on level ground under the node's sky."""
    sun = [0.0, math.cos(math.radians(elevation)), math.sin(math.radians(elevation))]
    numbers = {"sun_direction": sun, "turbidity": turbidity, "ground_albedo": 0.3, "strength": 1.0}
    aim_native_sky(node, numbers | {"luminance": LUMINANCE})
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(bpy.context.scene.render.filepath)
    pixels = np.array(image.pixels[:]).reshape(HEIGHT, WIDTH, 4)[::-1, :, :3]
    bpy.data.images.remove(image)
    height = math.pi / 2 - (np.arange(HEIGHT) + 0.5) * math.pi / HEIGHT
    rows = pixels.mean(axis=1) @ [0.2126, 0.7152, 0.0722] * np.sin(height) * np.cos(height)
    return float(rows[: HEIGHT // 2].sum() * math.pi / HEIGHT * 2 * math.pi)


def main() -> None:
    """Print a line for each sun and turbidity."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.panorama_type = "PANO", "EQUIRECTANGULAR"
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.camera.rotation_euler = (math.pi / 2, 0, 0)
    scene.collection.objects.link(scene.camera)
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 1, False
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(Path("sky.exr").absolute())
    scene.world = bpy.data.worlds.new("World")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
    nodes.clear()
    output, background, sky = (nodes.new(f"ShaderNode{name}") for name in ("OutputWorld", "Background", "TexSky"))
    links.new(sky.outputs[0], background.inputs[0])
    links.new(background.outputs[0], output.inputs[0])
    if "MULTIPLE_SCATTERING" not in [item.identifier for item in sky.bl_rna.properties["sky_type"].enum_items]:
        sys.stdout.write("this Blender has no such sky\n")
        return
    for elevation in map(float, sys.argv[1:]):
        for turbidity in (2.0, 5.0):
            stops = math.log2(render_level(sky, turbidity, elevation) / LUMINANCE)
            sys.stdout.write(f"sun {elevation}, turbidity {turbidity}: {stops:.3f}\n")


main()
