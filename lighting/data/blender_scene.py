"""Build in Blender 4.2 or newer the scene that scene.json, beside this file, describes.

    blender --python scene.py                                    opens it as a scene of its own
    blender --background --python scene.py -- --save --render    writes scene.blend and render.png

`python scene.py --save` does the same where the module bpy is installed. The light's units are those of the photo's
linear values; +Z is up and the camera looks along +Y. The value "Native sky" in the world's nodes blends from the
environment map (0) to Blender's own sky (1), with the same sun and turbidity. That sky is Multiple Scattering from
Blender 5.0, else that of Hosek and Wilkie. A new scene has the collections of GROUPS. Where the spot lies in the
photo's shade, the sun lights the collection "Lit by the Sun" alone, which holds the ground.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix, Vector

Json = dict[str, Any]  # of scene.json

LIT_BY_THE_SUN = "Lit by the Sun"  # what its collection is called where it excludes the object
MULTIPLE_SCATTERING = "MULTIPLE_SCATTERING"  # Blender's type of sky, from 5.0
SCATTERED_ELEVATIONS = (  # deg, of the sun: the rows of SCATTERED_LUMINANCE
    *(-4.2, -3.5, -2.7, -2.0, -1.0, 0.0, 1.0),
    *(2.0, 10.0, 25.0, 45.0, 70.0, 90.0),
)
SCATTERED_AEROSOLS = (0.0, 1.0, 3.0)  # densities: its columns
SCATTERED_LUMINANCE = (
    *((0.0786, 0.0795, 0.0857), (0.135, 0.132, 0.137), (0.256, 0.247, 0.247), (0.432, 0.413, 0.404)),
    *((0.825, 0.790, 0.755), (1.36, 1.33, 1.28), (1.98, 1.98, 1.94)),
    *((2.65, 2.71, 2.73), (6.45, 7.23, 8.42), (9.22, 10.82, 13.67)),
    *((11.16, 13.26, 17.16), (12.57, 14.97, 19.50), (12.93, 15.50, 20.35)),
)
GROUPS = ("Photo", "Ground", "Lights", "Objects")  # of the scene's collections


def _main() -> None:
    arguments = {"--save", "--render"} & set(sys.argv)
    if arguments:  # nothing of an open file is at stake
        bpy.ops.wm.read_factory_settings(use_empty=True)
    folder = _script_folder()
    scene = build_scene(json.loads((folder / "scene.json").read_text(encoding="utf-8")), folder)
    if arguments:
        for other in [other for other in bpy.data.scenes if other != scene]:
            bpy.data.scenes.remove(other)
    if "--save" in arguments:
        bpy.context.preferences.filepaths.save_version = 0
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"), relative_remap=True)
    if "--render" in arguments:
        scene.render.filepath = str(folder / "render.png")
        bpy.ops.render.render(write_still=True)


def _script_folder() -> Path:
    """Where this file lies, also when Blender's text editor runs it."""
    text = bpy.data.texts.get(Path(__file__).name)
    return Path(bpy.path.abspath(text.filepath) if text and text.filepath else __file__).resolve().parent


def build_scene(numbers: Json, folder: Path, scene: bpy.types.Scene | None = None) -> bpy.types.Scene:
    """The scene of the photo; a compositor that it has stays as it is.

    Args:
        numbers: of scene.json.
        folder: with the pictures beside it.
        scene: to build it in; None for a new one with collections, which is made the current one.
    """
    if scene is None:
        scene = bpy.data.scenes.new("Photo")
        homes = [bpy.data.collections.new(name) for name in GROUPS]
        for home in homes:
            scene.collection.children.link(home)
        if bpy.context.window:
            bpy.context.window.scene = scene
    else:
        homes = [scene.collection] * len(GROUPS)
    photo, below, lights, objects = homes
    plate = _load_image(folder / numbers["plate"], "sRGB")
    environment = _load_image(folder / numbers["environment"], "Linear Rec.709")
    _set_up_render(scene, numbers)
    scene.camera = _add_camera(photo, numbers["camera"], plate)
    sun = _add_sun_lamp(lights, numbers["sun"])
    scene.world = _make_world(numbers["sky"], environment)
    ground = _add_ground(below, numbers["ground"])
    if numbers["spot_in_shade"]:
        _keep_sun_from_object(sun, ground, numbers["shade"])
    _add_placeholder(objects, numbers["placeholder"])
    if not has_compositor(scene):
        lit = _load_image(folder / numbers["lit_ground"], "Non-Color")
        _composite_over(scene, plate, lit, numbers["shade"])
    return scene


def _load_image(path: Path, color_space: str) -> bpy.types.Image:
    image = bpy.data.images.load(str(path), check_existing=True)
    image.colorspace_settings.name = color_space
    return image


def _set_up_render(scene: bpy.types.Scene, numbers: Json) -> None:
    """Cycles over a transparent film, and a view transform that leaves the plate's values as they are."""
    bpy.ops.preferences.addon_enable(module="cycles")
    scene.render.engine = "CYCLES"
    scene.cycles.samples = numbers["samples"]
    scene.render.film_transparent = True
    scene.render.resolution_x, scene.render.resolution_y = numbers["size"]
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "PNG", "RGB"
    scene.render.dither_intensity = 0.0
    scene.display_settings.display_device = "sRGB"
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    scene.view_settings.exposure, scene.view_settings.gamma = 0.0, 1.0


def _add_object(
    home: bpy.types.Collection, name: str, data: bpy.types.ID | None, parent: bpy.types.Object | None = None
) -> bpy.types.Object:
    """An object in a collection."""
    made = bpy.data.objects.new(name, data)
    home.objects.link(made)
    made.parent = parent
    return made


def _add_camera(home: bpy.types.Collection, numbers: Json, plate: bpy.types.Image) -> bpy.types.Object:
    data = bpy.data.cameras.new("Camera")
    data.sensor_fit = "VERTICAL"
    data.sensor_width, data.sensor_height = numbers["sensor"]
    data.lens = numbers["focal_length"]
    data.clip_start, data.clip_end = numbers["clip"]
    data.show_background_images = True
    data.background_images.new().image = plate
    camera = _add_object(home, "Camera", data)
    camera.matrix_world = Matrix(numbers["matrix"])
    return camera


def _add_sun_lamp(home: bpy.types.Collection, numbers: Json) -> bpy.types.Object:
    data = bpy.data.lights.new("Sun", "SUN")
    data.angle = math.radians(numbers["angle"])
    sun = _add_object(home, "Sun", data)
    aim_sun(sun, numbers)
    return sun


def aim_sun(sun: bpy.types.Object, numbers: Json) -> None:
    """Aim the sun and give it its light.

    Args:
        sun: the lamp's object.
        numbers: "direction" (3,), "colour" (3,) and "irradiance", +Z up.
    """
    sun.data.color, sun.data.energy = numbers["colour"], numbers["irradiance"]
    sun.rotation_euler = Vector(numbers["direction"]).to_track_quat("Z", "Y").to_euler()
    sun.location = [10.0 * value for value in numbers["direction"]]  # where to find it; a sun shines from everywhere


def _make_world(numbers: Json, environment: bpy.types.Image) -> bpy.types.World:
    """The map and, to blend to, Blender's own sky."""
    world = bpy.data.worlds.new("Sky of the photo")
    nodes, links = _clear_nodes(world)
    switch = nodes.new("ShaderNodeValue")
    switch.name = "Native sky"
    switch.label = f"Native sky (0: map by {numbers['painted']})"
    switch.outputs[0].default_value = 0.0
    mix, output = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeOutputWorld")
    links.new(switch.outputs[0], mix.inputs[0])
    links.new(_environment_background(nodes, links, environment, numbers["yaw"]), mix.inputs[1])
    links.new(_native_background(nodes, links, numbers["native"]), mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])
    _arrange_nodes(nodes)
    return world


def _environment_background(
    nodes: bpy.types.Nodes, links: bpy.types.NodeLinks, environment: bpy.types.Image, yaw: float
) -> bpy.types.NodeSocket:
    coordinates, mapping = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value[2] = math.radians(yaw)
    texture, background = nodes.new("ShaderNodeTexEnvironment"), nodes.new("ShaderNodeBackground")
    texture.image = environment
    links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], background.inputs["Color"])
    return background.outputs[0]


def _native_background(nodes: bpy.types.Nodes, links: bpy.types.NodeLinks, numbers: Json) -> bpy.types.NodeSocket:
    sky, background = nodes.new("ShaderNodeTexSky"), nodes.new("ShaderNodeBackground")
    links.new(sky.outputs[0], background.inputs["Color"])
    aim_native_sky(sky, numbers)
    return background.outputs[0]


def aim_native_sky(sky: bpy.types.Node, numbers: Json) -> None:
    """Give Blender's own sky the sun and the air, and the node behind it the strength.

    Args:
        sky: the node, which another one takes the color of.
        numbers: "sun_direction" (3,), "turbidity", "ground_albedo", "strength" of Hosek and Wilkie's model, and the
            "luminance" of the sky's irradiance on level ground.
    """
    strength = sky.outputs[0].links[0].to_node.inputs["Strength"]
    if MULTIPLE_SCATTERING not in [item.identifier for item in sky.bl_rna.properties["sky_type"].enum_items]:
        sky.sky_type = sky.label = "HOSEK_WILKIE"
        sky.sun_direction = numbers["sun_direction"]
        sky.turbidity, sky.ground_albedo = numbers["turbidity"], numbers["ground_albedo"]
        strength.default_value = numbers["strength"]
        return
    sky.sky_type = sky.label = MULTIPLE_SCATTERING
    sky.sun_disc = False
    x, y, z = numbers["sun_direction"]
    elevation = math.asin(max(-1.0, min(1.0, z)))
    sky.sun_elevation, sky.sun_rotation = elevation, math.atan2(x, y)
    sky.aerosol_density = (numbers["turbidity"] - 1.0) / 2.0
    strength.default_value = numbers["luminance"] / _scattered_luminance(math.degrees(elevation), sky.aerosol_density)


def _scattered_luminance(elevation: float, aerosols: float) -> float:
    """Luminance of the irradiance on level ground under Multiple Scattering of strength 1.

    Measured in Blender 5.2, for suns under 2 deg in 5.0.1.

    Args:
        elevation: of the sun, deg.
        aerosols: their density.
    """
    column = 0 if aerosols < SCATTERED_AEROSOLS[1] else 1
    low, high = SCATTERED_AEROSOLS[column : column + 2]
    share = (aerosols - low) / (high - low)
    values = [row[column] + share * (row[column + 1] - row[column]) for row in SCATTERED_LUMINANCE]
    after = next((i for i, knot in enumerate(SCATTERED_ELEVATIONS) if knot >= elevation), len(values) - 1)
    if after == 0:
        return values[0]
    start, end = SCATTERED_ELEVATIONS[after - 1 : after + 1]
    along = min(1.0, (elevation - start) / (end - start))
    return values[after - 1] + along * (values[after] - values[after - 1])


def _clear_nodes(owner: bpy.types.World | bpy.types.Material) -> tuple[bpy.types.Nodes, bpy.types.NodeLinks]:
    """Nodes and links of a world or a material."""
    if owner.node_tree is None:
        owner.use_nodes = True
    owner.node_tree.nodes.clear()
    return owner.node_tree.nodes, owner.node_tree.links


def _arrange_nodes(nodes: bpy.types.Nodes) -> None:
    """Side by side, in the order in which they were made."""
    for index, node in enumerate(nodes):
        node.location = (220.0 * (index % 4), -320.0 * (index // 4))


def _diffuse_material(name: str, albedo: list[float]) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    nodes, links = _clear_nodes(material)
    surface, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    surface.inputs["Color"].default_value = (*albedo, 1.0)
    links.new(surface.outputs[0], output.inputs["Surface"])
    _arrange_nodes(nodes)
    return material


def _add_ground(home: bpy.types.Collection, numbers: Json) -> bpy.types.Object:
    reach = numbers["radius"]
    mesh = bpy.data.meshes.new("Ground")
    corners = [(-reach, -reach, 0.0), (reach, -reach, 0.0), (reach, reach, 0.0), (-reach, reach, 0.0)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    mesh.materials.append(_diffuse_material("Ground", numbers["albedo"]))
    ground = _add_object(home, "Ground", mesh)
    ground.is_shadow_catcher = True
    return ground


def _keep_sun_from_object(sun: bpy.types.Object, ground: bpy.types.Object, shade: list[float]) -> None:
    """Let the sun light the ground alone, and the ground light the object as ground in shade does.

    Shadows on the ground stay, since the camera sees the ground as it was. `shade` is the sky's share of open ground's
    light; the value "Object in shade" in the ground's material says how far it counts.
    """
    sun.light_linking.receiver_collection = bpy.data.collections.new(LIT_BY_THE_SUN)
    sun.light_linking.receiver_collection.objects.link(ground)
    tree = ground.data.materials[0].node_tree
    switch, path, unseen = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Value", "LightPath", "Math"))
    switch.label = switch.name = "Object in shade"
    switch.outputs[0].default_value = 1.0
    unseen.operation, unseen.use_clamp = "SUBTRACT", True
    tree.links.new(switch.outputs[0], unseen.inputs[0])
    tree.links.new(path.outputs["Is Camera Ray"], unseen.inputs[1])
    color = next(node for node in tree.nodes if node.type == "BSDF_DIFFUSE").inputs["Color"]
    tree.links.new(_blend(tree, "MULTIPLY", tuple(color.default_value), (*shade, 1.0), unseen.outputs[0]), color)
    _arrange_nodes(tree.nodes)


def _add_placeholder(home: bpy.types.Collection, numbers: Json) -> None:
    """A ball and a stick under an empty at the spot for one's own object."""
    material = _diffuse_material("Placeholder", numbers["albedo"])
    spot = _add_object(home, "Your object here", None)
    spot.location = numbers["spot"]
    spot.empty_display_size = numbers["ball_radius"]
    for name, mesh, location in (
        ("Ball", _ball_mesh(numbers["ball_radius"]), (0.0, 0.0, numbers["ball_radius"])),
        ("Stick", _stick_mesh(numbers["stick_radius"], numbers["stick_height"]), numbers["stick_foot"]),
    ):
        mesh.materials.append(material)
        _add_object(home, name, mesh, spot).location = location


def _ball_mesh(radius: float) -> bpy.types.Mesh:
    profile = [(radius * math.sin(t), -radius * math.cos(t)) for t in _steps(math.pi, 48)]
    return _revolved_mesh("Ball", profile, 96, smooth=True)


def _stick_mesh(radius: float, height: float) -> bpy.types.Mesh:
    return _revolved_mesh("Stick", [(0.0, 0.0), (radius, 0.0), (radius, height), (0.0, height)], 32, smooth=False)


def _steps(end: float, count: int) -> list[float]:
    return [end * index / count for index in range(count + 1)]


def _revolved_mesh(name: str, profile: list[tuple[float, float]], spokes: int, *, smooth: bool) -> bpy.types.Mesh:
    """The surface that a profile of (radius, height) makes when it is turned about the vertical."""
    angles = [2 * math.pi * spoke / spokes for spoke in range(spokes)]
    points = [(r * math.cos(angle), r * math.sin(angle), z) for r, z in profile for angle in angles]
    faces = [
        (low + a, low + b, low + spokes + b, low + spokes + a)
        for low in range(0, spokes * (len(profile) - 1), spokes)
        for a, b in ((spoke, (spoke + 1) % spokes) for spoke in range(spokes))
    ]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    mesh.validate()
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))
    return mesh


def _composite_over(scene: bpy.types.Scene, plate: bpy.types.Image, lit: bpy.types.Image, shade: list[float]) -> None:
    """The plate, stretched to the render's size and times the colored shadow on the ground; over it the object.

    `lit` shows where the plate's ground lies in sunlight; `shade` is the sky's share of open ground's light.
    """
    scene.view_layers[0].cycles.use_pass_shadow_catcher = True
    tree, output = _compositor(scene)
    nodes, links = tree.nodes, tree.links
    behind, sunlit = _fit_image(tree, plate), _fit_image(tree, lit)
    layers, over = nodes.new("CompositorNodeRLayers"), nodes.new("CompositorNodeAlphaOver")
    layers.scene = scene
    below, above = [socket for socket in over.inputs if socket.type == "RGBA"]
    shadow = _shadow_on(tree, layers.outputs["Shadow Catcher"], sunlit, (*shade, 1.0))
    links.new(_blend(tree, "MULTIPLY", behind, shadow), below)
    links.new(layers.outputs["Image"], above)
    links.new(over.outputs["Image"], output.inputs["Image"])
    _arrange_nodes(nodes)


def _fit_image(tree: bpy.types.NodeTree, image: bpy.types.Image) -> bpy.types.NodeSocket:
    """An image, stretched to the render's size."""
    picture, fit = tree.nodes.new("CompositorNodeImage"), tree.nodes.new("CompositorNodeScale")
    picture.image = image
    _fit_to_render(fit)
    tree.links.new(picture.outputs["Image"], fit.inputs["Image"])
    return fit.outputs["Image"]


def _shadow_on(
    tree: bpy.types.NodeTree, shadow: bpy.types.NodeSocket, lit: bpy.types.NodeSocket, shade: tuple[float, ...]
) -> bpy.types.NodeSocket:
    """The shadow on ground that the sun lights as far as `lit` says: it takes no sun from ground that has none.

    What a shadow leaves up to `shade` counts as the sky's light, and what it leaves beyond as the sun's.
    """
    sky = _blend(tree, "DARKEN", shadow, shade)
    sun = _blend(tree, "MULTIPLY", _blend(tree, "SUBTRACT", shadow, sky), lit)
    left = _blend(tree, "ADD", sky, sun)
    return _blend(tree, "DIVIDE", left, _blend(tree, "MIX", shade, (1.0, 1.0, 1.0, 1.0), lit))


def _blend(
    tree: bpy.types.NodeTree,
    kind: str,
    a: bpy.types.NodeSocket | tuple[float, ...],
    b: bpy.types.NodeSocket | tuple[float, ...],
    share: bpy.types.NodeSocket | float = 1.0,
) -> bpy.types.NodeSocket:
    """Two pictures or colors (4,) in one; `share` is how much of the blend replaces the first."""
    shared = bpy.app.version >= (5, 0, 0) or tree.type == "SHADER"
    mix = tree.nodes.new("ShaderNodeMix" if shared else "CompositorNodeMixRGB")
    if hasattr(mix, "data_type"):
        mix.data_type = "RGBA"
    mix.blend_type = kind
    pictures = [socket for socket in mix.inputs if socket.type == "RGBA"]
    factor = next(socket for socket in mix.inputs if socket.type == "VALUE")
    for value, socket in ((share, factor), (a, pictures[0]), (b, pictures[1])):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return next(socket for socket in mix.outputs if socket.type == "RGBA")


def has_compositor(scene: bpy.types.Scene) -> bool:
    """Whether the scene's pictures go through nodes already.

    Args:
        scene: of Blender.
    """
    if hasattr(scene, "compositing_node_group"):
        return scene.compositing_node_group is not None
    return scene.use_nodes and scene.node_tree is not None and len(scene.node_tree.nodes) > 0


def _compositor(scene: bpy.types.Scene) -> tuple[bpy.types.NodeTree, bpy.types.Node]:
    """The scene's node tree and the node that takes the picture; they changed in Blender 5."""
    if hasattr(scene, "compositing_node_group"):
        tree = bpy.data.node_groups.new("Over the plate", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        return tree, tree.nodes.new("NodeGroupOutput")
    scene.use_nodes = True
    scene.node_tree.nodes.clear()
    return scene.node_tree, scene.node_tree.nodes.new("CompositorNodeComposite")


def _fit_to_render(node: bpy.types.Node) -> None:
    if "Type" in node.inputs:
        node.inputs["Type"].default_value = "Render Size"
    else:
        node.space = "RENDER_SIZE"


if __name__ == "__main__":
    _main()
