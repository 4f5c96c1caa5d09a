"""What a photo's scene puts into the open scene, and takes out when another photo comes."""

import json
from pathlib import Path
from typing import Any

import bpy

from . import scene as script

COLLECTION = "Light from Photo"
_PLACEHOLDER = ("Ball", "Stick")  # of the scenes; here the artist's own object is at hand


def furnish(scene: Any, folder: Path) -> dict[str, Any]:
    """Put camera, plate, world, sun and shadow catcher of a folder into the scene; returns the lighting record.

    What an earlier photo brought goes. All pictures are packed into the .blend file: the folder may vanish.
    """
    numbers = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    record = json.loads((folder / "lighting.json").read_text(encoding="utf-8"))
    clear(scene)
    before, images = set(scene.collection.objects), set(bpy.data.images)
    script.build(numbers, folder, scene)
    made = [thing for thing in scene.collection.objects if thing not in before]
    collection = bpy.data.collections.new(COLLECTION)
    scene.collection.children.link(collection)
    for thing in made:
        scene.collection.objects.unlink(thing)
        if thing.name.split(".")[0] in _PLACEHOLDER:
            bpy.data.objects.remove(thing)
        else:
            collection.objects.link(thing)
    for image in set(bpy.data.images) - images:
        image.pack()
    scene.cursor.location = numbers["placeholder"]["spot"]
    _remember(scene.light_from_photo, record, numbers, collection, scene.world)
    return dict(record)


def clear(scene: Any) -> None:
    """Remove what an earlier photo brought."""
    settings = scene.light_from_photo
    collection, settings.world = settings.collection, None
    if collection is not None:
        for thing in list(collection.objects):
            bpy.data.objects.remove(thing)
        bpy.data.collections.remove(collection)
    ours = scene.light_from_photo_compositor
    if ours:  # a compositor of the user's own stays
        if hasattr(scene, "compositing_node_group"):
            scene.compositing_node_group = None
        else:
            scene.node_tree.nodes.clear()
        scene.light_from_photo_compositor = False
    scene.light_from_photo_compositor = not script.has_compositor(scene)


def _remember(settings: Any, record: dict[str, Any], numbers: dict[str, Any], collection: Any, world: Any) -> None:
    """The estimate behind the sliders; the world last, since only then do they work."""
    settings.collection = collection
    settings.sun = next(thing for thing in collection.objects if thing.type == "LIGHT")
    settings.shines = numbers["sun"]["irradiance"] > 0
    settings.record = json.dumps(record)
    settings.environment = environment_node(world).image
    estimate = (record["sun"]["azimuth"], record["sun"]["elevation"], record["sky"]["turbidity"])
    settings.estimate = (*estimate, record["sky"]["exposure"])
    settings.sun_azimuth, settings.sun_elevation, settings.turbidity = estimate
    settings.exposure = record["sky"]["exposure"]
    settings.world = world


def environment_node(world: Any) -> Any:
    """The node that holds the map."""
    return next(node for node in world.node_tree.nodes if node.type == "TEX_ENVIRONMENT")


def sky_node(world: Any) -> Any:
    """The node of Blender's own sky, beside the map."""
    return next(node for node in world.node_tree.nodes if node.type == "TEX_SKY")
