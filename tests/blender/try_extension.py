"""Run by a Python that has bpy: install the zip, pick a photo, move the sliders, undo; prints one line of JSON.

BLENDER_USER_RESOURCES=FOLDER PYTHON try_extension.py EXTENSION.zip COMMAND PHOTO [PICTURE.png]
BLENDER_USER_RESOURCES=FOLDER blender --background --python try_extension.py -- EXTENSION.zip COMMAND PHOTO
"""

import json
import sys
import zipfile
from pathlib import Path
from typing import Any
from unittest import mock

import bpy

NAME = "bl_ext.user_default.light_from_photo"
SHADOW = "800,900,400,950"  # of nothing, in brick_street.jpg


def main() -> None:
    package, command, photo, *picture = sys.argv[sys.argv.index("--") + 1 if "--" in sys.argv else 1 :]
    bpy.ops.wm.read_factory_settings(use_empty=False)
    folder = Path(bpy.utils.user_resource("EXTENSIONS", path="user_default/light_from_photo", create=True))
    zipfile.ZipFile(package).extractall(folder)
    bpy.ops.preferences.addon_enable(module=NAME)
    bpy.context.preferences.addons[NAME].preferences.command = command
    found: dict[str, Any] = {"blender": bpy.app.version_string}
    scene = bpy.context.scene
    kept = {thing.name for thing in scene.objects}
    bpy.ops.ed.undo_push(message="before")
    found["estimate"] = sorted(bpy.ops.light_from_photo.estimate(filepath=photo))
    settings = scene.light_from_photo
    found["made"] = sorted({thing.name for thing in scene.objects} - kept)
    found["kept"] = kept <= {thing.name for thing in scene.objects}
    found["first"], found["record"] = state(scene), json.loads(settings.record)
    found["seen"] = [seen(scene, 0.0), seen(scene, 1.0)]
    settings.sun_azimuth, settings.sun_elevation = -90.0, 40.0
    settings.haze, settings.exposure = 2.0, 1.0
    found["moved"] = state(scene)
    if picture:
        render(scene, picture[0])
    bpy.ops.light_from_photo.reset()
    found["reset"] = state(scene)
    bpy.ops.light_from_photo.estimate(filepath=photo)
    found["again"] = sorted({thing.name.split(".")[0] for thing in scene.objects} - kept)
    found["sun lamps"] = sum(thing.type == "LIGHT" and thing.data.type == "SUN" for thing in scene.objects)
    found["known"] = known(scene)
    found["own"] = own(scene, photo)
    found["lit"] = [group.name for group in bpy.data.collections if group.name.startswith("Lit")]
    found |= undone(photo)
    scene = bpy.context.scene
    settings = scene.light_from_photo
    settings.sun_azimuth = 12.0
    saved = folder.parent / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(saved))
    bpy.ops.wm.open_mainfile(filepath=str(saved))
    found["reopened"] = state(bpy.context.scene)
    found["worlds"] = [world.name for world in bpy.data.worlds]
    bpy.ops.preferences.addon_disable(module=NAME)
    sys.stdout.write("FOUND " + json.dumps(found) + "\n")


def seen(scene: Any, higher: float) -> bool:
    """Whether the camera, turned up by an angle [rad], sees the spot."""
    camera = scene.light_from_photo.camera
    camera.rotation_euler.x += higher
    answer = bool(sys.modules[f"{NAME}.furnish"].spot_is_in_view(scene))
    camera.rotation_euler.x -= higher
    return answer


def known(scene: Any) -> dict[str, Any]:
    """What a shadow, a pick and the dragged ball make of the light."""
    settings, buttons = scene.light_from_photo, bpy.ops.light_from_photo
    found: dict[str, Any] = {"photo size": list(settings.photo_size), "drawn": sorted(buttons.shadow(mark=SHADOW))}
    found |= {"drawn record": json.loads(settings.record), "marks": [settings.marks]}
    try:
        buttons.shadow(mark="1,2,3")
    except RuntimeError as error:  # as Blender raises the error that a button shows
        found["refused"] = str(error)
    found["marks"].append(settings.marks)
    drawn = json.loads(settings.record)["sun"]
    for _ in range(2):
        buttons.guess()
        found["marks"].append(settings.marks)
        found.setdefault("guessed as before", []).append(json.loads(settings.record)["sun"] == drawn)
    found["forgotten"] = [sorted(buttons.forget()), settings.marks, json.loads(settings.record)["sun"]]
    answer = settings.answer
    buttons.pick(number=2)
    found["picked"] = [settings.sun_azimuth, settings.sun_elevation, settings.pick, settings.answer == answer]
    buttons.pick(number=1)
    found["first again"] = json.loads(settings.record)["sun"]
    sliders, gizmo = sys.modules[f"{NAME}.sliders"], sys.modules[f"{NAME}.gizmo"]
    with mock.patch.object(sliders, "_painted", wraps=sliders._painted) as painted:
        sliders.turn_sun(settings, -30.0, 20.0)
    group = gizmo.LIGHTFROMPHOTO_GGT_sun
    registered = bpy.types.GizmoGroup.bl_rna_get_subclass_py(group.bl_idname) is group
    found["turned"] = [settings.sun_azimuth, settings.sun_elevation, painted.call_count, registered]
    buttons.reset()
    return found


def own(scene: Any, photo: str) -> list[Any]:
    """What another photo does to the artist's own things among those of the extension, and to a copy of one of them."""
    collection, settings = scene.light_from_photo.collection, scene.light_from_photo
    mine, below, copy = bpy.data.objects.new("Mine", None), bpy.data.objects.new("Below", None), settings.ground.copy()
    child = bpy.data.objects.new("Child", None)
    child.parent, child.location = settings.spot, (0.0, 0.0, 1.0)
    props = bpy.data.collections.new("Props")
    collection.children.link(props)
    props.objects.link(below)
    for thing in (mine, copy, child):
        collection.objects.link(thing)
    settings.spot.location.x += 7.0  # as if the first photo's spot were another
    settings.spot.scale = (3.0, 3.0, 3.0)
    count = len(scene.objects)
    bpy.ops.light_from_photo.estimate(filepath=photo)
    bpy.context.view_layer.update()
    at = (child.matrix_world.translation - settings.spot.matrix_world.translation)[:]
    kept = [thing.name in collection.objects for thing in (mine, copy, child)]
    kept += [props.name in collection.children, below.name in props.objects, len(scene.objects) == count]
    names = [thing.name for thing in (settings.camera, settings.sun, settings.ground, settings.spot)]
    found = [all(kept), child.parent == settings.spot, at, settings.spot.location == scene.cursor.location, names]
    found.append(lit_by_the_sun(settings))
    for thing in (mine, below, copy, child):
        bpy.data.objects.remove(thing)
    bpy.data.collections.remove(props)
    return found


def undone(photo: str) -> dict[str, Any]:
    """What one step of undo and one of redo leave of another estimate, in a scene that had none."""
    empty = bpy.data.scenes.new("Empty")
    bpy.context.window.scene = empty
    bpy.ops.ed.undo_push(message="an empty scene")
    bpy.ops.light_from_photo.estimate("EXEC_DEFAULT", True, filepath=photo)
    things = [len(bpy.context.scene.objects)]
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo):
        step()
        things.append(len(bpy.context.scene.objects))
    bpy.context.window.scene = bpy.data.scenes["Scene"]
    return {"undone": things}


def state(scene: Any) -> dict[str, Any]:
    """What the light is, as numbers."""
    settings = scene.light_from_photo
    node = next(node for node in scene.world.node_tree.nodes if node.type == "TEX_ENVIRONMENT")
    width, height = node.image.size
    pixels = [0.0] * (width * height * 4)
    node.image.pixels.foreach_get(pixels)
    sun = settings.sun
    return {
        "sliders": [settings.sun_azimuth, settings.sun_elevation, settings.haze, settings.exposure],
        "image": node.image.name,
        "size": [width, height],
        "zenith": pixels[-4 * (width // 2) :][:3],
        "sun": list(sun.rotation_euler.to_matrix().col[2]),
        "energy": sun.data.energy,
        "lit by the sun": lit_by_the_sun(settings),
        "camera": scene.camera.name,
        "plate": scene.camera.data.background_images[0].image.name,
        "catcher": [thing.name for thing in scene.objects if thing.is_shadow_catcher],
        "packed": all(image.packed_file for image in bpy.data.images if image.source == "FILE"),
    }


def lit_by_the_sun(settings: Any) -> list[str]:
    """What the sun lights, if it does not light all."""
    lit = settings.sun.light_linking.receiver_collection
    return [thing.name for thing in lit.objects] if lit else []


def render(scene: Any, path: str) -> None:
    """A quick picture of Blender's cube in that light."""
    cube = bpy.data.objects["Cube"]
    cube.location, cube.scale = scene.cursor.location, (0.3, 0.3, 0.3)
    cube.location.z = 0.3
    scene.cycles.samples, scene.render.resolution_percentage = 32, 50
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)


main()
