"""Runs in Blender: import a USD file and render it: FILE OUT WIDTH HEIGHT SAMPLES.

What the file says of camera, lights and meshes is left as Blender's reader made it, but for the sun and the sphere.
"""

import sys
from typing import Any

import bpy

USD_SUN_TOO_BRIGHT, USD_SUN_TOO_WIDE = 4.0, 2.0  # what Blender 5.0 makes of a DistantLight


def main(file: str, out: str, width: str, height: str, samples: str) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="cycles")
    scene = bpy.context.scene
    import_usd(scene, file)
    scene.camera = next(thing for thing in scene.objects if thing.type == "CAMERA")
    set_up_render(scene, int(width), int(height), int(samples))
    scene.render.filepath = out
    bpy.ops.render.render(write_still=True)


def import_usd(scene: Any, file: str) -> None:
    scene.world = bpy.data.worlds.new("Sky")  # without one the DomeLight is dropped
    bpy.ops.wm.usd_import(filepath=file, import_guide=False, import_all_materials=True)
    for light in bpy.data.lights:
        light.energy, light.angle = light.energy / USD_SUN_TOO_BRIGHT, light.angle / USD_SUN_TOO_WIDE
    make_round(scene.objects["Ball"])
    for name in ("Ball", "Stick"):  # Blender 5.0 leaves USD's Sphere and Cylinder without their materials
        scene.objects[name].data.materials.append(bpy.data.materials["Placeholder"])


def make_round(ball: Any) -> None:
    """A sphere again of the few flat faces that Blender makes of USD's Sphere."""
    ball.modifiers.new("Finer", "SUBSURF").render_levels = 4
    cast = ball.modifiers.new("Round", "CAST")
    cast.factor, cast.size, cast.use_radius_as_size = 1.0, ball.data.vertices[0].co.length, False
    ball.data.polygons.foreach_set("use_smooth", [True] * len(ball.data.polygons))


def set_up_render(scene: Any, width: int, height: int, samples: int) -> None:
    scene.render.engine = "CYCLES"
    scene.cycles.samples = samples
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.image_settings.file_format = "PNG"
    scene.render.dither_intensity = 0.0
    scene.view_settings.view_transform = "Standard"


if __name__ == "__main__":
    main(*sys.argv[-5:])
