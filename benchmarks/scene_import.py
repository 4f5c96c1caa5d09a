"""Runs in Blender: import a USD or glTF file, render it as it stands: FILE OUT WIDTH HEIGHT SAMPLES.

What the file's camera, lights and meshes say is left as Blender's reader made it, but for the strength of USD's sun.
"""

import sys
from typing import Any

import bpy


def main(file: str, out: str, width: str, height: str, samples: str) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="cycles")
    scene = bpy.context.scene
    if file.endswith(".glb"):
        bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
        bpy.ops.import_scene.gltf(filepath=file, export_import_convert_lighting_mode="RAW")
    else:
        scene.world = bpy.data.worlds.new("Sky")  # without one the DomeLight is dropped
        bpy.ops.wm.usd_import(filepath=file, import_guide=False)
        for light in bpy.data.lights:  # Blender 5.0 takes DistantLights four times too bright and twice too wide
            light.energy, light.angle = light.energy / 4, light.angle / 2
    scene.camera = next(thing for thing in scene.objects if thing.type == "CAMERA")
    set_up_render(scene, int(width), int(height), int(samples))
    scene.render.filepath = out
    bpy.ops.render.render(write_still=True)


def set_up_render(scene: Any, width: int, height: int, samples: int) -> None:
    scene.render.engine = "CYCLES"
    scene.cycles.samples = samples
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.image_settings.file_format = "PNG"
    scene.render.dither_intensity = 0.0
    scene.view_settings.view_transform = "Standard"


if __name__ == "__main__":
    main(*sys.argv[-5:])
