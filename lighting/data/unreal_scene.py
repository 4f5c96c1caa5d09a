"""Put a photo's light into the open level of Unreal Engine 5; run it by File > Execute Python Script.

The folder's pictures become assets under /Game/LightFromPhoto, and the actors lie in a folder of that name in the
Outliner. Running it again replaces both. Units are centimeters; +Z is up, the photo's camera looks along +X.
"""

import json
from pathlib import Path

import unreal

NAME = "LightFromPhoto"
ASSETS = f"/Game/{NAME}"
SHAPES = "/Engine/BasicShapes"  # each 100 units wide and tall, around its middle

actors = unreal.get_editor_subsystem(unreal.EditorActorSubsystem)
tools = unreal.AssetToolsHelpers.get_asset_tools()
library = unreal.EditorAssetLibrary
editing = unreal.MaterialEditingLibrary


def main():
    folder = Path(__file__).resolve().parent
    numbers = json.loads((folder / "unreal_scene.json").read_text(encoding="utf-8"))
    remove_last()
    warn_of_other_lights()
    cubemap = import_picture(folder / numbers["environment"])
    plate, albedo, emission = (import_plain(folder / numbers[name]) for name in ("plate", "albedo", "emission"))
    add_sun(numbers["sun"])
    add_sky(cubemap, numbers["sky"])
    add_exposure()
    camera = add_camera(numbers["camera"])
    add_backdrop(camera, numbers["backdrop"], projected_material("Backdrop", None, plate))
    add_shape("Plane", "Ground", numbers["ground"], projected_material("Ground", albedo, emission), shadow=False)
    gray = plain_material("Placeholder", numbers["placeholder"]["albedo"])
    add_shape("Sphere", "Ball", numbers["placeholder"]["ball"], gray)
    add_shape("Cylinder", "Stick", numbers["placeholder"]["stick"], gray)


def remove_last():
    for actor in actors.get_all_level_actors():
        if NAME in [str(tag) for tag in actor.get_editor_property("tags")]:
            actors.destroy_actor(actor)


def warn_of_other_lights():
    for actor in actors.get_all_level_actors():
        if isinstance(actor, (unreal.DirectionalLight, unreal.SkyLight)):
            unreal.log_warning(f"The level has another light, which shines beside the photo's: {actor.get_name()}.")


# Assets


def import_picture(path):
    """The asset that a picture becomes; a lat-long .hdr becomes a cubemap."""
    task = unreal.AssetImportTask()
    task.set_editor_property("filename", str(path))
    task.set_editor_property("destination_path", ASSETS)
    task.set_editor_property("automated", True)
    task.set_editor_property("replace_existing", True)
    task.set_editor_property("save", True)
    tools.import_asset_tasks([task])
    return library.load_asset(f"{ASSETS}/{path.stem}")


def import_plain(path):
    """The same, neither compressed nor scaled."""
    texture = import_picture(path)
    texture.set_editor_property("compression_settings", unreal.TextureCompressionSettings.TC_EDITOR_ICON)
    texture.set_editor_property("mip_gen_settings", unreal.TextureMipGenSettings.TMGS_NO_MIPMAPS)
    texture.set_editor_property("srgb", True)
    return texture


def new_material(name):
    if library.does_asset_exist(f"{ASSETS}/{name}"):
        library.delete_asset(f"{ASSETS}/{name}")
    return tools.create_asset(name, ASSETS, unreal.Material, unreal.MaterialFactoryNew())


def projected_material(name, albedo, emission):
    """Pictures in their places in the viewport, as surface and as light; without an albedo it takes no light."""
    material = new_material(name)
    place = editing.create_material_expression(material, unreal.MaterialExpressionScreenPosition, -600, 0)
    for picture, target in (
        (albedo, unreal.MaterialProperty.MP_BASE_COLOR),
        (emission, unreal.MaterialProperty.MP_EMISSIVE_COLOR),
    ):
        if picture:
            sample = editing.create_material_expression(material, unreal.MaterialExpressionTextureSample, -300, 0)
            sample.set_editor_property("texture", picture)
            editing.connect_material_expressions(place, "ViewportUV", sample, "UVs")
            editing.connect_material_property(sample, "RGB", target)
    if albedo:
        make_diffuse(material)
    else:
        material.set_editor_property("shading_model", unreal.MaterialShadingModel.MSM_UNLIT)
    material.set_editor_property("two_sided", True)
    editing.recompile_material(material)
    return material


def plain_material(name, albedo):
    material = new_material(name)
    color = editing.create_material_expression(material, unreal.MaterialExpressionConstant3Vector, -300, 0)
    color.set_editor_property("constant", unreal.LinearColor(albedo, albedo, albedo, 1.0))
    editing.connect_material_property(color, "", unreal.MaterialProperty.MP_BASE_COLOR)
    make_diffuse(material)
    editing.recompile_material(material)
    return material


def make_diffuse(material):
    for value, target in ((1.0, unreal.MaterialProperty.MP_ROUGHNESS), (0.0, unreal.MaterialProperty.MP_SPECULAR)):
        constant = editing.create_material_expression(material, unreal.MaterialExpressionConstant, -300, 300)
        constant.set_editor_property("r", value)
        editing.connect_material_property(constant, "", target)


# Actors


def spawn(kind, label, location, rotation=(0.0, 0.0, 0.0)):
    """An actor; its rotation is roll, pitch and yaw."""
    roll, pitch, yaw = rotation
    actor = actors.spawn_actor_from_class(
        kind, unreal.Vector(*location), unreal.Rotator(roll=roll, pitch=pitch, yaw=yaw)
    )
    actor.set_actor_label(label)
    actor.set_folder_path(NAME)
    actor.set_editor_property("tags", [NAME])
    return actor


def add_sun(numbers):
    """It shines along its own +X. Where the spot lies in the photo's shade it is off; see affects_world."""
    light = spawn(unreal.DirectionalLight, "Sun", (0.0, 0.0, 0.0), numbers["rotation"]).get_component_by_class(
        unreal.DirectionalLightComponent
    )
    light.set_mobility(unreal.ComponentMobility.MOVABLE)
    red, green, blue = numbers["color"]
    light.set_editor_property("light_color", unreal.Color(b=blue, g=green, r=red, a=255))
    light.set_editor_property("intensity", numbers["lux"])
    light.set_editor_property("light_source_angle", numbers["angle"])
    light.set_editor_property("use_temperature", False)
    light.set_editor_property("atmosphere_sun_light", False)
    light.set_editor_property("cast_shadows", True)
    light.set_editor_property("affects_world", numbers["on"])


def add_sky(cubemap, numbers):
    light = spawn(unreal.SkyLight, "Sky", (0.0, 0.0, 0.0)).get_component_by_class(unreal.SkyLightComponent)
    light.set_mobility(unreal.ComponentMobility.MOVABLE)
    light.set_editor_property("real_time_capture", False)
    light.set_editor_property("source_type", unreal.SkyLightSourceType.SLS_SPECIFIED_CUBEMAP)
    light.set_editor_property("cubemap", cubemap)
    light.set_editor_property("source_cubemap_angle", numbers["angle"])
    light.set_editor_property("cubemap_resolution", numbers["resolution"])
    light.set_editor_property("lower_hemisphere_is_black", False)
    light.set_editor_property("intensity", 1.0)
    light.recapture_sky()


def add_exposure():
    """Exposure 1, no tone curve, and no light that bounces: the map holds what the ground reflects."""
    volume = spawn(unreal.PostProcessVolume, "Exposure", (0.0, 0.0, 0.0))
    volume.set_editor_property("unbound", True)
    settings = volume.get_editor_property("settings")
    for name, value in (
        ("auto_exposure_method", unreal.AutoExposureMethod.AEM_MANUAL),
        ("auto_exposure_bias", 0.0),
        ("auto_exposure_apply_physical_camera_exposure", False),
        ("tone_curve_amount", 0.0),
        ("expand_gamut", 0.0),
        ("blue_correction", 0.0),
        ("bloom_intensity", 0.0),
        ("vignette_intensity", 0.0),
        ("dynamic_global_illumination_method", unreal.DynamicGlobalIlluminationMethod.NONE),
    ):
        settings.set_editor_property(f"override_{name}", True)
        settings.set_editor_property(name, value)
    volume.set_editor_property("settings", settings)


def add_camera(numbers):
    actor = spawn(unreal.CineCameraActor, "Camera", numbers["location"], numbers["rotation"])
    camera = actor.get_component_by_class(unreal.CineCameraComponent)
    filmback = camera.get_editor_property("filmback")
    filmback.set_editor_property("sensor_width", numbers["sensor"][0])
    filmback.set_editor_property("sensor_height", numbers["sensor"][1])
    camera.set_editor_property("filmback", filmback)
    camera.set_editor_property("current_focal_length", numbers["focal_length"])
    focus = camera.get_editor_property("focus_settings")
    focus.set_editor_property("focus_method", unreal.CameraFocusMethod.DISABLE)
    camera.set_editor_property("focus_settings", focus)
    camera.set_editor_property("constrain_aspect_ratio", True)
    return actor


def add_backdrop(camera, numbers, material):
    """The photo on a plane that fills the camera's picture behind everything."""
    actor = add_shape("Plane", "Backdrop", numbers, material, shadow=False)
    keep = unreal.AttachmentRule.KEEP_WORLD
    actor.attach_to_actor(camera, "", keep, keep, keep, False)


def add_shape(shape, label, numbers, material, shadow=True):
    actor = spawn(unreal.StaticMeshActor, label, numbers["location"], numbers["rotation"])
    actor.set_actor_scale3d(unreal.Vector(*(size / 100.0 for size in numbers["size"])))
    mesh = actor.get_component_by_class(unreal.StaticMeshComponent)
    mesh.set_mobility(unreal.ComponentMobility.MOVABLE)
    mesh.set_static_mesh(library.load_asset(f"{SHAPES}/{shape}"))
    mesh.set_material(0, material)
    mesh.set_editor_property("cast_shadow", shadow)
    return actor


main()
