"""What a scene's files say, for each tool by that tool's own conventions, in our frame."""

import json
import re
import struct
import xml.etree.ElementTree as ElementTree
from base64 import b64decode
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pxr import Usd, UsdGeom, UsdLux
from unitypackage_extractor.extractor import extractPackage

from lighting.color import srgb_decode
from lighting.files.exr import read_exr
from lighting.geometry import Floats, angles, direction, latlong_angles, latlong_solid_angle
from tests.helpers.unreal import Rotator


@dataclass(frozen=True, eq=False)
class ExportedScene:
    """Of one tool's files; units and frame are those of `Scene`."""

    sun_direction: Floats  # (3,)
    sun_irradiance: Floats  # (3,)
    sun_reaches_object: bool
    camera_axes: Floats  # (3, 3) right, up and forward
    camera_position: Floats  # (3,)
    vertical_fov: float  # deg
    spot: Floats  # (3,)
    lit_ground: NDArray[np.bool_]  # (H, W) where shadows of the sun may fall
    environment: Floats | None  # (H, 2H, 3); None: the tool has no map
    map_azimuth: float = 0.0  # deg, of the map's center

    def sky_irradiance(self, normal: Floats) -> Floats:
        """(3,) that the map gives to a surface, by its normal (3,)."""
        assert self.environment is not None
        azimuth, elevation = latlong_angles(len(self.environment))
        rays = direction(azimuth[None, :] + self.map_azimuth, elevation[:, None])
        weight = latlong_solid_angle(len(self.environment))[:, None] * np.maximum(rays @ normal, 0.0)
        return np.asarray((self.environment * weight[..., None]).sum(axis=(0, 1)))


def _lit_surface(albedo: Path, emission: Path, plate: Path) -> NDArray[np.bool_]:
    """Where (H, W) what the light takes from a plate is at least half of it."""
    stays, whole = (srgb_decode(np.asarray(Image.open(file)) / 255.0).sum(axis=-1) for file in (emission, plate))
    return np.asarray((stays <= 0.5 * whole) & np.asarray(Image.open(albedo)).any(axis=-1))


def _mask(file: Path | BytesIO) -> NDArray[np.bool_]:
    return np.asarray(Image.open(file)) >= 128


def _read_map(path: Path) -> Floats:
    return np.asarray(read_exr(path)[0])


def _from_z_up(vectors: Any) -> Floats:
    """Vectors (..., 3) of Blender's frame, forward +Y, in ours."""
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=float), -1, 0)
    return np.stack([x, z, -y], axis=-1)


def _camera(matrix: Any) -> Floats:
    """Right, up and forward (3, 3) of a camera that looks along its own -Z; columns are its axes."""
    return np.asarray(matrix, dtype=float)[:3, :3].T * [[1.0], [1.0], [-1.0]]


def _read_blender(folder: Path) -> ExportedScene:
    numbers = json.loads((folder / "scene.json").read_text())
    sun, camera = numbers["sun"], numbers["camera"]
    matrix = np.array(camera["matrix"])
    yaw = np.radians(-numbers["sky"]["yaw"])  # lookups turn by yaw; the map's center is +X
    return ExportedScene(
        sun_direction=_from_z_up(sun["direction"]),
        sun_irradiance=np.array(sun["colour"]) * sun["irradiance"],
        sun_reaches_object=not numbers["spot_in_shade"],
        camera_axes=_from_z_up(_camera(matrix)),
        camera_position=_from_z_up(matrix[:3, 3]),
        vertical_fov=float(2 * np.degrees(np.arctan(camera["sensor"][1] / 2 / camera["focal_length"]))),
        spot=_from_z_up(numbers["placeholder"]["spot"]),
        lit_ground=_mask(folder / numbers["lit_ground"]),
        environment=_read_map(folder / numbers["environment"]),
        map_azimuth=float(angles(_from_z_up([np.cos(yaw), np.sin(yaw), 0.0]))[0]),
    )


def _read_usd(folder: Path) -> ExportedScene:
    stage = Usd.Stage.Open(str(folder / "scene.usda"))

    def world(path: str) -> Floats:
        prim = UsdGeom.Xformable(stage.GetPrimAtPath(path))
        return np.array(prim.ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T

    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/Sun"))
    sky = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Sky"))
    lens = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera"))
    linked = UsdLux.LightAPI(sun).GetLightLinkCollectionAPI()
    ratio = lens.GetVerticalApertureAttr().Get() / 2 / lens.GetFocalLengthAttr().Get()
    plate, thing = (stage.GetPrimAtPath(f"/World/{name}") for name in ("Camera/Plate", "YourObject"))
    assert thing.GetCustomDataByKey("inShade") is not bool(linked.GetIncludeRootAttr().Get())
    return ExportedScene(
        sun_direction=world("/World/Sun")[:3, 2],
        sun_irradiance=np.array(sun.GetColorAttr().Get()) * sun.GetIntensityAttr().Get(),
        sun_reaches_object=bool(linked.GetIncludeRootAttr().Get()),
        camera_axes=_camera(world("/World/Camera")),
        camera_position=world("/World/Camera")[:3, 3],
        vertical_fov=float(2 * np.degrees(np.arctan(ratio))),
        spot=world("/World/YourObject")[:3, 3],
        lit_ground=_mask(folder / plate.GetCustomDataByKey("litGround").path),
        environment=_read_map(folder / sky.GetTextureFileAttr().Get().path),
        map_azimuth=float(angles(world("/World/Sky")[:3, 2])[0]),  # OpenEXR's lat-long has +Z at the center
    )


def _read_gltf(folder: Path) -> ExportedScene:
    data = (folder / "scene.glb").read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    document = json.loads(data[20 : 20 + length])
    nodes = {node["name"]: node for node in document["nodes"]}
    camera, sun = (np.reshape(nodes[name]["matrix"], (4, 4)).T for name in ("Camera", "Sun"))
    light = document["extensions"]["KHR_lights_punctual"]["lights"][0]
    irradiance, in_shade = np.array(nodes["Sun"]["extras"]["irradiance"]), nodes["YourObject"]["extras"]["inShade"]
    assert np.allclose(np.array(light["color"]) * light["intensity"], irradiance * (not in_shade))
    picture = document["images"][nodes["Plate"]["extras"]["litGround"]["image"]]
    view = document["bufferViews"][picture["bufferView"]]
    start = 20 + length + 8 + view["byteOffset"]
    return ExportedScene(
        sun_direction=sun[:3, 2],
        sun_irradiance=irradiance,
        sun_reaches_object=not in_shade,
        camera_axes=_camera(camera),
        camera_position=camera[:3, 3],
        vertical_fov=float(np.degrees(document["cameras"][0]["perspective"]["yfov"])),
        spot=np.array(nodes["YourObject"]["translation"]),
        lit_ground=_mask(BytesIO(data[start : start + view["byteLength"]])),
        environment=None,
    )


def _read_threejs(folder: Path) -> ExportedScene:
    (file,) = folder.glob("*.html")
    page = file.read_text(encoding="utf-8")
    match = re.search(r'<script id="scene" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert match
    numbers = json.loads(match[1])
    matrix = np.reshape(numbers["cameraMatrix"], (4, 4))
    pictures = (
        np.frombuffer(b64decode(numbers[name].rpartition(",")[2]), np.uint8) for name in ("litGround", "environment")
    )
    mask, environment = (np.asarray(cv2.imdecode(picture, cv2.IMREAD_UNCHANGED)) for picture in pictures)
    return ExportedScene(
        sun_direction=np.array(numbers["sunDirection"]),
        sun_irradiance=np.array(numbers["sunColour"]) * numbers["sunIntensity"],
        sun_reaches_object=True,  # until the page has looked at the mask
        camera_axes=_camera(matrix),
        camera_position=matrix[:3, 3],
        vertical_fov=numbers["verticalFov"],
        spot=np.array(numbers["spot"]),
        lit_ground=np.asarray(mask >= 128),
        environment=np.asarray(environment[..., ::-1], dtype=np.float64),
        map_azimuth=90.0,  # three.js has +X at the center
    )


def _read_godot(folder: Path) -> ExportedScene:
    text = (folder / "scene.tscn").read_text(encoding="utf-8")
    parts = re.findall(
        r'^\[(?:node name|sub_resource type="\w+" id)="(\w+)"[^\n]*\]\n(.*?)(?=^\[|\Z)', text, re.M | re.S
    )
    nodes = {name: dict(re.findall(r"^([\w/]+) = (.*)$", body, re.M)) for name, body in parts}

    def values(node: str, name: str) -> Floats:
        return np.array([float(value) for value in nodes[node][name].rstrip(")").rpartition("(")[2].split(",")])

    camera, sun, spot = (values(node, "transform") for node in ("Camera", "Sun", "YourObject"))
    turn = values("environment", "sky_rotation")[1]
    return ExportedScene(
        sun_direction=np.reshape(sun[:9], (3, 3))[:, 2],
        sun_irradiance=np.pi * float(nodes["Sun"]["light_energy"]) * srgb_decode(values("Sun", "light_color")[:3]),
        sun_reaches_object=nodes["Sun"]["light_cull_mask"] == "3",
        camera_axes=_camera(np.reshape(camera[:9], (3, 3))),
        camera_position=camera[9:],
        vertical_fov=float(nodes["Camera"]["fov"]),
        spot=spot[9:],
        lit_ground=_mask(folder / "lit_ground.png"),
        environment=_read_map(folder / "environment.exr"),
        map_azimuth=float(angles(np.array([np.sin(turn), 0.0, np.cos(turn)]))[0]),  # Godot has +Z at the center
    )


def _read_unreal(folder: Path) -> ExportedScene:
    numbers = json.loads((folder / "unreal_scene.json").read_text())

    def ours(vectors: Any) -> Floats:
        x, y, z = np.moveaxis(np.asarray(vectors, dtype=float), -1, 0)
        return np.stack([y, z, -x], axis=-1)

    def axes(rotation: list[float]) -> Floats:
        return ours(Rotator(*rotation).axes)

    sun, camera = numbers["sun"], numbers["camera"]
    forward, right, up = axes(camera["rotation"])
    angle = np.radians(-numbers["sky"]["angle"])  # lookups turn by the angle; the map's center is -Y
    center = ours([np.sin(angle), -np.cos(angle), 0.0])
    ball = numbers["placeholder"]["ball"]
    environment = cv2.imread(str(folder / numbers["environment"]), cv2.IMREAD_UNCHANGED)
    assert environment is not None
    return ExportedScene(
        sun_direction=-axes(sun["rotation"])[0],
        sun_irradiance=sun["lux"] * srgb_decode(np.array(sun["color"]) / 255.0),
        sun_reaches_object=sun["on"],
        camera_axes=np.stack([right, up, forward]),
        camera_position=ours(camera["location"]) / 100,
        vertical_fov=float(2 * np.degrees(np.arctan(camera["sensor"][1] / 2 / camera["focal_length"]))),
        spot=ours(np.array(ball["location"]) - [0, 0, ball["size"][2] / 2]) / 100,
        lit_ground=_lit_surface(folder / numbers["albedo"], folder / numbers["emission"], folder / numbers["plate"]),
        environment=np.asarray(environment[..., ::-1], dtype=np.float64),
        map_azimuth=float(angles(center)[0]),
    )


def _read_unity(folder: Path) -> ExportedScene:
    extractPackage(str(folder / "scene.unitypackage"), outputPath=str(folder))
    (assets,) = (file.parent for file in folder.rglob("scene.json"))  # of the photo's own folder
    numbers = json.loads((assets / "scene.json").read_text())

    def vector(name: str) -> Floats:
        return np.array([numbers[name]["x"], numbers[name]["y"], -numbers[name]["z"]])

    def axes(name: str) -> Floats:
        x, y, z, w = (numbers[name][part] for part in "xyzw")
        matrix = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return np.asarray(matrix.T * [1.0, 1.0, -1.0])

    return ExportedScene(
        sun_direction=-axes("sunRotation")[2],
        sun_irradiance=numbers["sunIrradiance"] * srgb_decode(np.array([numbers["sunColor"][name] for name in "rgb"])),
        sun_reaches_object=numbers["sunReachesObject"],
        camera_axes=axes("cameraRotation"),
        camera_position=vector("cameraPosition"),
        vertical_fov=numbers["verticalFov"],
        spot=vector("spot"),
        lit_ground=_lit_surface(assets / "ground_albedo.png", assets / "ground_emission.png", assets / "plate.png"),
        environment=_read_map(assets / "environment.exr"),
    )


def _read_mitsuba(folder: Path) -> ExportedScene:
    light, camera, thing = (
        ElementTree.parse(folder / f"{name}.xml").getroot() for name in ("light", "camera", "object")
    )

    def find(root: Any, path: str, name: str) -> Floats:
        element = root.find(path)
        return np.array([float(value) for value in element.get(name).replace(",", " ").split()])

    origin, target = (find(light, "shape/transform/lookat", name) for name in ("origin", "target"))
    radius = float(find(light, "shape/transform/scale", "value")[0])
    distance = float(np.linalg.norm(origin - target))
    radiance = find(light, "default[@name='sun_radiance']", "value")
    matrix = np.reshape(find(camera, "sensor/transform/matrix", "value"), (4, 4))
    ball = "shape[@id='ball']"
    turn = np.radians(find(light, "emitter/transform/rotate", "angle")[0])
    return ExportedScene(
        sun_direction=(origin - target) / distance,
        sun_irradiance=radiance * np.pi * radius**2 / (radius**2 + distance**2),
        sun_reaches_object=find(thing, "default[@name='sun_on_object']", "value")[0] == 1.0,
        camera_axes=np.asarray(matrix[:3, :3].T * [[-1.0], [1.0], [1.0]]),  # it looks along +Z with +X to the left
        camera_position=matrix[:3, 3],
        vertical_fov=float(find(camera, "sensor/float[@name='fov']", "value")[0]),
        spot=find(thing, f"{ball}/point", "value") - [0, find(thing, f"{ball}/float", "value")[0], 0],
        lit_ground=_mask(folder / "lit_ground.png"),
        environment=_read_map(folder / "environment.exr"),
        map_azimuth=float(angles(np.array([np.sin(turn), 0.0, np.cos(turn)]))[0]),  # it has +Z at the center
    )


READERS: dict[str, Callable[[Path], ExportedScene]] = {
    "blender": _read_blender,
    "usd": _read_usd,
    **dict.fromkeys(("gltf", "filament", "cubemap"), _read_gltf),
    **dict.fromkeys(("threejs", "page"), _read_threejs),
    "godot": _read_godot,
    "unreal": _read_unreal,
    "unity": _read_unity,
    "mitsuba": _read_mitsuba,
}
