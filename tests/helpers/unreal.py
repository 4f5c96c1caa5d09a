"""A stand-in for Unreal's module `unreal`, which checks names and types and keeps what a script makes of a level.

PROPERTIES are those that the reference of Unreal's Python API 5.7 documents, of the classes that the script uses.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import PurePath
from types import ModuleType
from typing import Any

import numpy as np

from lighting.geometry import Floats


class ComponentMobility(Enum):
    STATIC, STATIONARY, MOVABLE = range(3)


class SkyLightSourceType(Enum):
    SLS_CAPTURED_SCENE, SLS_SPECIFIED_CUBEMAP = range(2)


class AutoExposureMethod(Enum):
    AEM_HISTOGRAM, AEM_BASIC, AEM_MANUAL = range(3)


class DynamicGlobalIlluminationMethod(Enum):
    NONE, LUMEN, SCREEN_SPACE, PLUGIN = range(4)


class TextureCompressionSettings(Enum):
    TC_DEFAULT, TC_HDR, TC_EDITOR_ICON = 0, 6, 7


class TextureMipGenSettings(Enum):
    TMGS_FROM_TEXTURE_GROUP, TMGS_NO_MIPMAPS = 0, 13


class MaterialShadingModel(Enum):
    MSM_UNLIT, MSM_DEFAULT_LIT = range(2)


class MaterialProperty(Enum):
    MP_BASE_COLOR, MP_EMISSIVE_COLOR, MP_ROUGHNESS, MP_SPECULAR = range(4)


class CameraFocusMethod(Enum):
    DO_NOT_OVERRIDE, MANUAL, TRACKING, DISABLE = range(4)


class AttachmentRule(Enum):
    KEEP_RELATIVE, KEEP_WORLD, SNAP_TO_TARGET = range(3)


@dataclass(frozen=True)
class Vector:
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    @property
    def array(self) -> Floats:
        return np.array([self.x, self.y, self.z])


@dataclass(frozen=True)
class Rotator:
    """Degrees; the axes are those of Unreal's FRotationMatrix."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0

    @property
    def axes(self) -> Floats:
        """Forward, right and up (3, 3) in Unreal's left-handed frame."""
        (sr, sp, sy), (cr, cp, cy) = (f(np.radians([self.roll, self.pitch, self.yaw])) for f in (np.sin, np.cos))
        return np.array(
            [
                [cp * cy, cp * sy, sp],
                [sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, -sr * cp],
                [-(cr * sp * cy + sr * sy), cy * sr - cr * sp * sy, cr * cp],
            ]
        )


@dataclass(frozen=True)
class LinearColor:
    r: float
    g: float
    b: float
    a: float


@dataclass(frozen=True)
class Color:
    b: int = 0
    g: int = 0
    r: int = 0
    a: int = 0

    def __post_init__(self) -> None:
        assert all(isinstance(value, int) and 0 <= value <= 255 for value in (self.b, self.g, self.r, self.a))


class Object:
    """Has the documented properties alone, each of its type."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = {}

    def set_editor_property(self, name: str, value: Any) -> None:
        kind = _property_type(type(self), name)
        number = kind is float and isinstance(value, int) and not isinstance(value, bool)
        assert number or (type(value) is kind if kind in (bool, int, float, str) else isinstance(value, kind)), (
            f"{type(self).__name__}.{name} is of {kind.__name__}, not {value!r}"
        )
        self.values[name] = value

    def get_editor_property(self, name: str) -> Any:
        kind = _property_type(type(self), name)
        return self.values.setdefault(name, kind())


def _property_type(owner: type, name: str) -> type:
    for base in owner.__mro__:
        if name in PROPERTIES.get(base.__name__, {}):
            return PROPERTIES[base.__name__][name]
    raise AssertionError(f"the documentation of {owner.__name__} has no property {name}")


class Texture(Object):
    path: PurePath


class TextureCube(Texture): ...


class Texture2D(Texture): ...


class StaticMesh(Object):
    name: str


class MaterialExpression(Object):
    def __init__(self) -> None:
        super().__init__()
        self.inputs: dict[str, tuple[MaterialExpression, str]] = {}


class MaterialExpressionScreenPosition(MaterialExpression): ...


class MaterialExpressionTextureSample(MaterialExpression): ...


class MaterialExpressionConstant(MaterialExpression): ...


class MaterialExpressionConstant3Vector(MaterialExpression): ...


class Material(Object):
    def __init__(self) -> None:
        super().__init__()
        self.inputs: dict[MaterialProperty, tuple[MaterialExpression, str]] = {}
        self.compiled = False


class MaterialFactoryNew(Object): ...


class AssetImportTask(Object): ...


class SceneComponent(Object):
    mobility = ComponentMobility.STATIC

    def set_mobility(self, new_mobility: ComponentMobility) -> None:
        assert isinstance(new_mobility, ComponentMobility)
        self.mobility = new_mobility


class DirectionalLightComponent(SceneComponent): ...


class SkyLightComponent(SceneComponent):
    captured = False

    def recapture_sky(self) -> None:
        self.captured = True


class CameraFilmbackSettings(Object): ...


class CameraFocusSettings(Object): ...


class CineCameraComponent(SceneComponent): ...


class PostProcessSettings(Object): ...


class StaticMeshComponent(SceneComponent):
    mesh: StaticMesh
    material: Material

    def set_static_mesh(self, new_mesh: StaticMesh) -> bool:
        assert isinstance(new_mesh, StaticMesh)
        assert self.mobility is ComponentMobility.MOVABLE
        self.mesh = new_mesh
        return True

    def set_material(self, element_index: int, material: Material) -> None:
        assert element_index == 0
        assert material.compiled
        self.material = material


class Actor(Object):
    component: type[SceneComponent] = SceneComponent

    def __init__(self, location: Vector, rotation: Rotator) -> None:
        super().__init__()
        self.location, self.rotation, self.scale = location, rotation, Vector(1.0, 1.0, 1.0)
        self.part = self.component()
        self.label = self.folder = ""
        self.parent: Actor | None = None

    def get_component_by_class(self, component_class: type[SceneComponent]) -> SceneComponent | None:
        return self.part if isinstance(self.part, component_class) else None

    def set_actor_label(self, new_actor_label: str) -> None:
        self.label = new_actor_label

    def get_name(self) -> str:
        return self.label or type(self).__name__

    def set_folder_path(self, new_folder_path: str) -> None:
        self.folder = new_folder_path

    def set_actor_scale3d(self, new_scale3d: Vector) -> None:
        assert isinstance(new_scale3d, Vector)
        self.scale = new_scale3d

    def attach_to_actor(
        self,
        parent_actor: "Actor",
        socket_name: str,
        location_rule: AttachmentRule,
        rotation_rule: AttachmentRule,
        scale_rule: AttachmentRule,
        weld_simulated_bodies: bool = True,
    ) -> bool:
        assert isinstance(socket_name, str)
        assert isinstance(weld_simulated_bodies, bool)
        assert {location_rule, rotation_rule, scale_rule} == {AttachmentRule.KEEP_WORLD}
        self.parent = parent_actor
        return True


class DirectionalLight(Actor):
    component = DirectionalLightComponent


class SkyLight(Actor):
    component = SkyLightComponent


class CineCameraActor(Actor):
    component = CineCameraComponent


class StaticMeshActor(Actor):
    component = StaticMeshComponent


class PostProcessVolume(Actor): ...


class EditorActorSubsystem: ...


PROPERTIES: dict[str, dict[str, type]] = {
    "Actor": {"tags": list},
    "Texture": {
        "compression_settings": TextureCompressionSettings,
        "mip_gen_settings": TextureMipGenSettings,
        "srgb": bool,
    },
    "AssetImportTask": {
        **{"filename": str, "destination_path": str, "destination_name": str},
        **{"automated": bool, "replace_existing": bool, "save": bool},
    },
    "Material": {"shading_model": MaterialShadingModel, "two_sided": bool},
    "MaterialExpressionTextureSample": {"texture": Texture},
    "MaterialExpressionConstant": {"r": float},
    "MaterialExpressionConstant3Vector": {"constant": LinearColor},
    "DirectionalLightComponent": {
        **{"light_color": Color, "intensity": float, "light_source_angle": float, "use_temperature": bool},
        **{"atmosphere_sun_light": bool, "cast_shadows": bool, "affects_world": bool},
    },
    "SkyLightComponent": {
        **{"real_time_capture": bool, "source_type": SkyLightSourceType, "cubemap": TextureCube, "intensity": float},
        **{"source_cubemap_angle": float, "cubemap_resolution": int, "lower_hemisphere_is_black": bool},
    },
    "PostProcessVolume": {"unbound": bool, "settings": PostProcessSettings},
    "PostProcessSettings": {
        f"{prefix}{name}": bool if prefix else kind
        for name, kind in {
            **{"auto_exposure_method": AutoExposureMethod, "auto_exposure_bias": float},
            **{"auto_exposure_apply_physical_camera_exposure": bool, "tone_curve_amount": float},
            **{"expand_gamut": float, "blue_correction": float, "bloom_intensity": float, "vignette_intensity": float},
            "dynamic_global_illumination_method": DynamicGlobalIlluminationMethod,
        }.items()
        for prefix in ("", "override_")
    },
    "CameraFilmbackSettings": {"sensor_width": float, "sensor_height": float},
    "CameraFocusSettings": {"focus_method": CameraFocusMethod},
    "CineCameraComponent": {
        **{"filmback": CameraFilmbackSettings, "focus_settings": CameraFocusSettings},
        **{"current_focal_length": float, "constrain_aspect_ratio": bool},
    },
    "StaticMeshComponent": {"cast_shadow": bool},
}


@dataclass
class Level:
    """What a script made: actors by their label, assets by their path, and what it warned of."""

    actors: list[Actor] = field(default_factory=list)
    assets: dict[str, Object] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def __getitem__(self, label: str) -> Actor:
        (actor,) = [actor for actor in self.actors if actor.label == label]
        return actor

    def module(self) -> ModuleType:
        """The module `unreal` for this level."""
        module = ModuleType("unreal")
        for name, value in globals().items():
            if isinstance(value, type) and value.__module__ == __name__:
                setattr(module, name, value)
        functions: dict[str, Callable[..., Any]] = {
            "get_editor_subsystem": self._subsystem,
            "log_warning": self.warnings.append,
        }
        for name, function in functions.items():
            setattr(module, name, function)
        for name in ("AssetToolsHelpers", "EditorAssetLibrary", "MaterialEditingLibrary"):
            setattr(module, name, self)
        return module

    def _subsystem(self, kind: type) -> "Level":
        assert kind is EditorActorSubsystem
        return self

    # EditorActorSubsystem

    def get_all_level_actors(self) -> list[Actor]:
        return list(self.actors)

    def destroy_actor(self, actor_to_destroy: Actor) -> bool:
        self.actors.remove(actor_to_destroy)
        return True

    def spawn_actor_from_class(self, actor_class: type[Actor], location: Vector, rotation: Rotator) -> Actor:
        assert isinstance(location, Vector)
        assert isinstance(rotation, Rotator)
        self.actors.append(actor_class(location, rotation))
        return self.actors[-1]

    # AssetTools and EditorAssetLibrary

    def get_asset_tools(self) -> "Level":
        return self

    def import_asset_tasks(self, import_tasks: list[AssetImportTask]) -> None:
        for task in import_tasks:
            path = PurePath(task.values["filename"])
            assert task.values["automated"]
            texture = TextureCube() if path.suffix == ".hdr" else Texture2D()
            texture.path = path
            self.assets[f"{task.values['destination_path']}/{path.stem}"] = texture

    def create_asset(self, asset_name: str, package_path: str, asset_class: type[Material], factory: Object) -> Object:
        assert isinstance(factory, MaterialFactoryNew)
        path = f"{package_path}/{asset_name}"
        assert path not in self.assets
        self.assets[path] = asset_class()
        return self.assets[path]

    def does_asset_exist(self, asset_path: str) -> bool:
        return asset_path in self.assets

    def delete_asset(self, asset_path_to_delete: str) -> bool:
        return self.assets.pop(asset_path_to_delete) is not None

    def load_asset(self, asset_path: str) -> Object:
        if asset_path.startswith("/Engine/BasicShapes/"):
            mesh = StaticMesh()
            mesh.name = asset_path.rpartition("/")[2]
            assert mesh.name in ("Plane", "Sphere", "Cylinder", "Cube", "Cone")
            return mesh
        return self.assets[asset_path]

    # MaterialEditingLibrary

    def create_material_expression(
        self, material: Material, expression_class: type[MaterialExpression], node_pos_x: int, node_pos_y: int
    ) -> MaterialExpression:
        assert isinstance(material, Material)
        assert issubclass(expression_class, MaterialExpression)
        assert isinstance(node_pos_x, int)
        assert isinstance(node_pos_y, int)
        return expression_class()

    def connect_material_expressions(
        self, from_expression: MaterialExpression, from_output_name: str, to_expression: Any, to_input_name: str
    ) -> bool:
        assert (type(from_expression), from_output_name) == (MaterialExpressionScreenPosition, "ViewportUV")
        assert (type(to_expression), to_input_name) == (MaterialExpressionTextureSample, "UVs")
        to_expression.inputs[to_input_name] = (from_expression, from_output_name)
        return True

    def connect_material_property(
        self, from_expression: MaterialExpression, from_output_name: str, property_: MaterialProperty
    ) -> bool:
        owner = next(
            asset for asset in reversed(self.assets.values()) if isinstance(asset, Material) and not asset.compiled
        )
        owner.inputs[property_] = (from_expression, from_output_name)
        return True

    def recompile_material(self, material: Material) -> None:
        material.compiled = True
