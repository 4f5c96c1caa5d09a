"""Put a photo's light into the open level of Unreal Engine 5; run it by Tools > Execute Python Script.

The folder's pictures become assets under /Game/LightFromPhoto, in a folder of the photo's own. The actors lie in a
folder LightFromPhoto in the Outliner. Running it again replaces the photo's assets and the level's actors. Units are
centimeters; +Z is up, the photo's camera looks along +X.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import unreal

Json = dict[str, Any]
Numbers = Sequence[float]

NAME = "LightFromPhoto"
_FOLDER = Path(__file__).resolve().parent
_NUMBERS = json.loads((_FOLDER / "unreal_scene.json").read_text(encoding="utf-8"))
_ASSETS = f"/Game/{NAME}/{_NUMBERS['name']}"
SHAPES = "/Engine/BasicShapes"  # each 100 units wide and tall, around its middle

actors = unreal.get_editor_subsystem(unreal.EditorActorSubsystem)
tools = unreal.AssetToolsHelpers.get_asset_tools()
library = unreal.EditorAssetLibrary
editing = unreal.MaterialEditingLibrary


def _main() -> None:
    folder, numbers = _FOLDER, _NUMBERS
    _remove_last()
    _warn_of_other_lights()
    cubemap = _import_picture(folder / numbers["environment"])
    plate, albedo, emission = (_import_plain(folder / numbers[name]) for name in ("plate", "albedo", "emission"))
    _add_sun(numbers["sun"])
    _add_sky(cubemap, numbers["sky"])
    _add_exposure()
    camera = _add_camera(numbers["camera"])
    _add_backdrop(camera, numbers["backdrop"], _projected_material("Backdrop", None, plate))
    _add_shape("Plane", "Ground", numbers["ground"], _projected_material("Ground", albedo, emission), shadow=False)
    gray = _plain_material("Placeholder", numbers["placeholder"]["albedo"])
    _add_shape("Sphere", "Ball", numbers["placeholder"]["ball"], gray)
    _add_shape("Cylinder", "Stick", numbers["placeholder"]["stick"], gray)


def _remove_last() -> None:
    for actor in actors.get_all_level_actors():
        if NAME in [str(tag) for tag in actor.get_editor_property("tags")]:
            actors.destroy_actor(actor)


def _warn_of_other_lights() -> None:
    for actor in actors.get_all_level_actors():
        if isinstance(actor, (unreal.DirectionalLight, unreal.SkyLight)):
            unreal.log_warning(f"The level has another light, which shines beside the photo's: {actor.get_name()}.")


def _set(thing: unreal.Object, **values: object) -> None:
    for name, value in values.items():
        thing.set_editor_property(name, value)


# Assets


def _import_picture(path: Path) -> unreal.Texture:
    """The asset that a picture becomes; a lat-long .hdr becomes a cubemap."""
    task = unreal.AssetImportTask()
    _set(task, filename=str(path), destination_path=_ASSETS, automated=True, replace_existing=True, save=True)
    tools.import_asset_tasks([task])
    return library.load_asset(f"{_ASSETS}/{path.stem}")


def _import_plain(path: Path) -> unreal.Texture:
    """The same, neither compressed nor scaled."""
    texture = _import_picture(path)
    plain, no_mipmaps = unreal.TextureCompressionSettings.TC_EDITOR_ICON, unreal.TextureMipGenSettings.TMGS_NO_MIPMAPS
    _set(texture, compression_settings=plain, mip_gen_settings=no_mipmaps, srgb=True)
    return texture


def _new_material(name: str) -> unreal.Material:
    if library.does_asset_exist(f"{_ASSETS}/{name}"):
        library.delete_asset(f"{_ASSETS}/{name}")
    return tools.create_asset(name, _ASSETS, unreal.Material, unreal.MaterialFactoryNew())


def _projected_material(name: str, albedo: unreal.Texture | None, emission: unreal.Texture) -> unreal.Material:
    """Pictures in their places in the viewport, as surface and as light; without an albedo it takes no light."""
    material = _new_material(name)
    place = editing.create_material_expression(material, unreal.MaterialExpressionScreenPosition, -600, 0)
    for picture, target in (
        (albedo, unreal.MaterialProperty.MP_BASE_COLOR),
        (emission, unreal.MaterialProperty.MP_EMISSIVE_COLOR),
    ):
        if picture:
            sample = editing.create_material_expression(material, unreal.MaterialExpressionTextureSample, -300, 0)
            _set(sample, texture=picture)
            editing.connect_material_expressions(place, "ViewportUV", sample, "UVs")
            editing.connect_material_property(sample, "RGB", target)
    if albedo:
        _make_diffuse(material)
    else:
        _set(material, shading_model=unreal.MaterialShadingModel.MSM_UNLIT)
    _set(material, two_sided=True)
    editing.recompile_material(material)
    return material


def _plain_material(name: str, albedo: float) -> unreal.Material:
    material = _new_material(name)
    color = editing.create_material_expression(material, unreal.MaterialExpressionConstant3Vector, -300, 0)
    _set(color, constant=unreal.LinearColor(albedo, albedo, albedo, 1.0))
    editing.connect_material_property(color, "", unreal.MaterialProperty.MP_BASE_COLOR)
    _make_diffuse(material)
    editing.recompile_material(material)
    return material


def _make_diffuse(material: unreal.Material) -> None:
    for value, target in ((1.0, unreal.MaterialProperty.MP_ROUGHNESS), (0.0, unreal.MaterialProperty.MP_SPECULAR)):
        constant = editing.create_material_expression(material, unreal.MaterialExpressionConstant, -300, 300)
        _set(constant, r=value)
        editing.connect_material_property(constant, "", target)


# Actors


def _spawn(
    kind: type[unreal.Actor], label: str, location: Numbers, rotation: Numbers = (0.0, 0.0, 0.0)
) -> unreal.Actor:
    """An actor; its rotation is roll, pitch and yaw."""
    roll, pitch, yaw = rotation
    actor = actors.spawn_actor_from_class(
        kind, unreal.Vector(*location), unreal.Rotator(roll=roll, pitch=pitch, yaw=yaw)
    )
    actor.set_actor_label(label)
    actor.set_folder_path(NAME)
    _set(actor, tags=[NAME])
    return actor


def _add_sun(numbers: Json) -> None:
    """It shines along its own +X. Where the spot lies in the photo's shade it is off; see affects_world."""
    light = _spawn(unreal.DirectionalLight, "Sun", (0.0, 0.0, 0.0), numbers["rotation"]).get_component_by_class(
        unreal.DirectionalLightComponent
    )
    light.set_mobility(unreal.ComponentMobility.MOVABLE)
    red, green, blue = numbers["color"]
    color = unreal.Color(b=blue, g=green, r=red, a=255)
    _set(light, light_color=color, intensity=numbers["lux"], light_source_angle=numbers["angle"], use_temperature=False)
    _set(light, atmosphere_sun_light=False, cast_shadows=True, affects_world=numbers["on"])


def _add_sky(cubemap: unreal.TextureCube, numbers: Json) -> None:
    light = _spawn(unreal.SkyLight, "Sky", (0.0, 0.0, 0.0)).get_component_by_class(unreal.SkyLightComponent)
    light.set_mobility(unreal.ComponentMobility.MOVABLE)
    _set(light, real_time_capture=False, source_type=unreal.SkyLightSourceType.SLS_SPECIFIED_CUBEMAP, cubemap=cubemap)
    _set(light, source_cubemap_angle=numbers["angle"], cubemap_resolution=numbers["resolution"])
    _set(light, lower_hemisphere_is_black=False, intensity=1.0)
    light.recapture_sky()


def _add_exposure() -> None:
    """Exposure 1, no tone curve, and no light that bounces: the map holds what the ground reflects."""
    volume = _spawn(unreal.PostProcessVolume, "Exposure", (0.0, 0.0, 0.0))
    _set(volume, unbound=True)
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
        _set(settings, **{f"override_{name}": True, name: value})
    _set(volume, settings=settings)


def _add_camera(numbers: Json) -> unreal.Actor:
    actor = _spawn(unreal.CineCameraActor, "Camera", numbers["location"], numbers["rotation"])
    camera = actor.get_component_by_class(unreal.CineCameraComponent)
    filmback, focus = camera.get_editor_property("filmback"), camera.get_editor_property("focus_settings")
    width, height = numbers["sensor"]
    _set(filmback, sensor_width=width, sensor_height=height)
    _set(focus, focus_method=unreal.CameraFocusMethod.DISABLE)
    _set(camera, filmback=filmback, current_focal_length=numbers["focal_length"])
    _set(camera, focus_settings=focus, constrain_aspect_ratio=True)
    return actor


def _add_backdrop(camera: unreal.Actor, numbers: Json, material: unreal.Material) -> None:
    """The photo on a plane that fills the camera's picture behind everything."""
    actor = _add_shape("Plane", "Backdrop", numbers, material, shadow=False)
    keep = unreal.AttachmentRule.KEEP_WORLD
    actor.attach_to_actor(camera, "", keep, keep, keep, False)


def _add_shape(
    shape: str, label: str, numbers: Json, material: unreal.Material, *, shadow: bool = True
) -> unreal.Actor:
    actor = _spawn(unreal.StaticMeshActor, label, numbers["location"], numbers["rotation"])
    actor.set_actor_scale3d(unreal.Vector(*(size / 100.0 for size in numbers["size"])))
    mesh = actor.get_component_by_class(unreal.StaticMeshComponent)
    mesh.set_mobility(unreal.ComponentMobility.MOVABLE)
    mesh.set_static_mesh(library.load_asset(f"{SHAPES}/{shape}"))
    mesh.set_material(0, material)
    _set(mesh, cast_shadow=shadow)
    return actor


_main()
