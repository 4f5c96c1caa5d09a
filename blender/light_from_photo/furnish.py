"""What a photo's scene puts into the open scene, and what of it another photo replaces."""

import json
from pathlib import Path
from typing import Any

import bpy
from bpy_extras.object_utils import world_to_camera_view

from . import scene as script
from .skies import SLIDERS

COLLECTION = "Light from Photo"
_MADE = {"Camera": "camera", "Sun": "sun", "Ground": "ground", "Your object here": "spot"}  # and the settings' names


def furnish(scene: Any, folder: Path) -> dict[str, Any]:
    """Put camera, plate, world, sun and shadow catcher of a folder into the scene; returns the lighting record.

    They replace what an earlier photo brought. All pictures are packed into the .blend file: the folder may vanish.
    """
    numbers = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    record = json.loads((folder / "lighting.json").read_text(encoding="utf-8"))
    _make_way(scene)
    before, images = set(scene.collection.objects), set(bpy.data.images)
    script.build_scene(numbers, folder, scene)
    _take_over([thing for thing in scene.collection.objects if thing not in before], scene)
    for image in set(bpy.data.images) - images:
        image.pack()
    scene.cursor.location = numbers["placeholder"]["spot"]
    _remember(scene.light_from_photo, record, numbers, scene.world)
    return dict(record)


def _make_way(scene: Any) -> None:
    """Stop the sliders, and remove the compositor that an earlier photo brought and the list of what its sun lights.

    What is the user's own stays.
    """
    if scene.world is not None and scene.world != scene.light_from_photo.world:
        scene.world.use_fake_user = True  # else the file, once saved, has lost the world that the photo's replaces
    scene.light_from_photo.world = None
    _light_all(scene.light_from_photo.sun)
    if scene.light_from_photo_compositor:
        if hasattr(scene, "compositing_node_group"):
            scene.compositing_node_group = None
        else:
            scene.node_tree.nodes.clear()
        scene.light_from_photo_compositor = False
    scene.light_from_photo_compositor = not script.has_compositor(scene)


def _light_all(sun: Any) -> None:
    """Remove the collection that the script made of what the sun lights, so that another one has its name."""
    lit = sun.light_linking.receiver_collection if sun else None
    if lit and lit.name.startswith(script.LIT_BY_THE_SUN):
        bpy.data.collections.remove(lit)


def _take_over(made: list[Any], scene: Any) -> None:
    """Put what a script has made in the place of what an earlier photo brought, and leave out its placeholder.

    The artist's own things stay as they are: in the collection, below it, or with one of these objects as parent.
    """
    settings, collection = scene.light_from_photo, _collection(scene)
    for thing in made:
        kind = thing.name.split(".")[0]
        if kind not in _MADE:
            bpy.data.objects.remove(thing)
            continue
        _replace(getattr(settings, _MADE[kind]), thing)
        setattr(settings, _MADE[kind], thing)
        scene.collection.objects.unlink(thing)
        if thing.name not in scene.objects:  # not `users_collection`: what the sun lights is a collection, too
            collection.objects.link(thing)


def _replace(old: Any, new: Any) -> None:
    """Let everything that knows the old object, as a child does its parent, know the new one."""
    if old is None:
        return
    name = old.name
    if new.type == "EMPTY":  # as the artist has turned and scaled what stands there
        new.rotation_euler, new.scale = old.rotation_euler, old.scale
    old.user_remap(new)
    bpy.data.objects.remove(old)
    new.name = name


def _collection(scene: Any) -> Any:
    """The scene's collection of this extension; one that is gone is made again."""
    settings = scene.light_from_photo
    if settings.collection is None:
        settings.collection = bpy.data.collections.new(COLLECTION)
    if settings.collection not in scene.collection.children_recursive:
        scene.collection.children.link(settings.collection)
    return settings.collection


def _remember(settings: Any, record: dict[str, Any], numbers: dict[str, Any], world: Any) -> None:
    """The estimate behind the sliders; the world last, since only then do they work."""
    settings.shines = numbers["sun"]["irradiance"] > 0
    settings.record = json.dumps(record)
    settings.photo_size = numbers.get("photo_size", numbers["size"])  # of a service older than this extension
    settings.environment = environment_node(world).image
    settings.estimate = (record["sun"]["azimuth"], record["sun"]["elevation"], record["sky"]["turbidity"], 0.0)
    settings.overcast = False
    for name, value in zip(SLIDERS, settings.estimate, strict=True):
        setattr(settings, name, value)
    settings.world = world


def other_lights(scene: Any) -> list[str]:
    """The names of the lights that shine in the scene's renders beside the photo's."""
    lights = [thing for thing in scene.objects if thing.type == "LIGHT" and not thing.hide_render]
    return sorted(thing.name for thing in lights if thing != scene.light_from_photo.sun)


def spot_is_in_view(scene: Any) -> bool:
    """Whether the photo's camera sees the spot of "Your object here"."""
    settings = scene.light_from_photo
    scene.view_layers[0].update()
    x, y, depth = world_to_camera_view(scene, settings.camera, settings.spot.matrix_world.translation)
    return bool(depth > 0 and 0 <= x <= 1 and 0 <= y <= 1)


def spot_is_in_shade(scene: Any) -> bool:
    """Whether the photo's sun leaves out what stands on the spot."""
    return scene.light_from_photo.sun.light_linking.receiver_collection is not None


def environment_node(world: Any) -> Any:
    """The node that holds the map."""
    return next(node for node in world.node_tree.nodes if node.type == "TEX_ENVIRONMENT")


def sky_node(world: Any) -> Any:
    """The node of Blender's own sky, beside the map."""
    return next(node for node in world.node_tree.nodes if node.type == "TEX_SKY")
