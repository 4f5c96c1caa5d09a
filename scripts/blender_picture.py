"""Blender's monkey in a photo, in the photo's light and after the sliders moved the sun.

BLENDER_USER_RESOURCES=FOLDER PYTHON_WITH_BPY blender_picture.py EXTENSION.zip COMMAND PHOTO OUT.png
"""

import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np

NAME = "bl_ext.user_default.light_from_photo"
WIDTH, SAMPLES = 480, 24


def main() -> None:
    package, command, photo, out = sys.argv[1:]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    folder = Path(bpy.utils.user_resource("EXTENSIONS", path="user_default/light_from_photo", create=True))
    zipfile.ZipFile(package).extractall(folder)
    bpy.ops.preferences.addon_enable(module=NAME)
    bpy.context.preferences.addons[NAME].preferences.command = command
    bpy.ops.light_from_photo.estimate(filepath=photo)
    scene = bpy.context.scene
    add_monkey(scene)
    scene.render.resolution_percentage = round(100 * WIDTH / scene.render.resolution_x)
    scene.cycles.samples = SAMPLES
    first = rendered(scene)
    light = scene.light_from_photo
    light.sun_azimuth += 120.0 if light.sun_azimuth < 0 else -120.0
    pictures = np.concatenate([first, rendered(scene)], axis=1)
    save(pictures, out)


def add_monkey(scene: Any) -> None:
    """Of gray matter, on the spot."""
    bpy.ops.mesh.primitive_monkey_add(size=1.0, location=scene.cursor.location)
    monkey = bpy.context.object
    monkey.location.z += 0.45
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("Grey")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.4, 0.4, 0.4, 1.0)
    monkey.data.materials.append(material)


def rendered(scene: Any) -> Any:
    """The scene's picture (h, w, 4), bottom row first."""
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = f"{folder}/picture.png"
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        pixels = np.empty(image.size[0] * image.size[1] * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(image.size[1], image.size[0], 4)


def save(pixels: Any, path: str) -> None:
    """As PNG, values as they are."""
    image = bpy.data.images.new("both", pixels.shape[1], pixels.shape[0])
    image.pixels.foreach_set(np.ascontiguousarray(pixels, dtype=np.float32).ravel())
    image.filepath_raw, image.file_format = str(Path(path).resolve()), "PNG"
    image.save()


main()
