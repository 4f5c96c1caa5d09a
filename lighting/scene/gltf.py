"""A scene as one binary glTF 2.0 file, `scene.glb`.

The sun is a directional light of KHR_lights_punctual, in lux on the scale where radiance 1 of the map is 1 nit; its
angular size has no place there. The map lights by EXT_lights_image_based [1], on the same scale: mirror images at
several roughnesses, as RGBD, and the harmonics of the irradiance. Babylon.js alone reads it. It takes the pictures for
those of its own left-handed frame and decodes them twice, so they are made for that. The format has no backgrounds: the
plate is an unlit picture behind the ground. It has no shadow catchers: the ground is a diffuse disc of its albedo
around the object. What glTF has no word for is in `extras`. `Plate` has the image `litGround`: where on it the sun's
shadows may fall, as `lit_ground.png` of other tools. `YourObject` has `inShade`, and `Sun` its `irradiance`, also where
it is off.

References:
    [1] Khronos, glTF 2.0 vendor extension EXT_lights_image_based.
"""

import json
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.color import color_and_intensity, max_channel
from lighting.envmap.latlong import Image, face_size, level_count, prefilter_cubemap
from lighting.fields import Json
from lighting.files.deflate import encode_png
from lighting.files.exr import SOFTWARE
from lighting.geometry import Floats
from lighting.light_probe import CONDON_SHORTLEY, COSINE_FACTORS, project_latlong
from lighting.record_json import record_with_coefficients
from lighting.scene.records import FAR, NEAR, PLACEHOLDER_ALBEDO, Scene
from lighting.scene.writer import Files, encode_lit_ground

GLB_FILE = "scene.glb"

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_FLOAT, _UNSIGNED_SHORT = 5126, 5123  # component types
_VERTICES, _INDICES = 34962, 34963  # buffer targets
_LINEAR, _CLAMPED = 9729, 33071  # of samplers
_GROUND_IN_BALLS = 12.0  # the disc's radius / the ball's; it holds the shadow of a sun 12 deg high
_BEHIND = 1.2  # the plate's distance / that of the disc's far edge

_IBL = "EXT_lights_image_based"
_SPECULAR = "KHR_materials_specular"  # without which surfaces mirror 4 %
_MAX_FACE = 256  # pixels of the map's mirror images
_GAMMA = 2.2  # of Babylon.js

_PLACEHOLDER, _GROUND, _PLATE = range(3)  # materials
_LIT_GROUND = 1  # of the images, after the plate

_SEGMENTS = 64  # around the axis
_RINGS = 32  # of the ball, from pole to pole
_MIN_AREA = 1e-4  # relative to the largest; smaller triangles are degenerate ones at a pole


def encode_gltf(scene: Scene) -> Files:
    """Return GLB_FILE, which holds everything.

    Args:
        scene: made by `make_scene`.
    """
    binary = _Binary()
    images = [binary.png(encode_png(scene.plate)), binary.png(encode_lit_ground(scene))]
    image_light = _image_light(scene, images, binary)
    document = {
        "asset": {
            "version": "2.0",
            "generator": SOFTWARE,
            "extras": {"lighting": record_with_coefficients(scene.lighting, scene.light_probe)},
        },
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_unlit", _SPECULAR, _IBL],
        "extensions": {"KHR_lights_punctual": {"lights": [_sun(scene)]}, _IBL: {"lights": [image_light]}},
        "scene": 0,
        "scenes": [{"nodes": [0, 1, 2, 3, 4], "extensions": {_IBL: {"light": 0}}}],
        "nodes": _nodes(scene),
        "cameras": [_camera(scene)],
        "materials": _materials(scene),
        "meshes": _meshes(scene, binary),
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"magFilter": _LINEAR, "minFilter": _LINEAR, "wrapS": _CLAMPED, "wrapT": _CLAMPED}],
        "images": images,
    }
    return {GLB_FILE: binary.packed(document)}


def _nodes(scene: Scene) -> list[Json]:
    """Camera, plate, sun, ground, and the spot for the user's object with the placeholder."""
    placeholder, plate = scene.placeholder, scene.camera_matrix
    plate[:3, 3] += _plate_distance(scene) * scene.camera_axes[2]
    return [
        {"name": "Camera", "camera": 0, "matrix": _columns(scene.camera_matrix)},
        {  # not the camera's child, which Babylon.js mirrors
            "name": "Plate",
            "mesh": 3,
            "matrix": _columns(plate),
            "extras": {"litGround": {"image": _LIT_GROUND}},
        },
        {
            "name": "Sun",
            "matrix": _columns(scene.sun_matrix),
            "extensions": {"KHR_lights_punctual": {"light": 0}},
            "extras": {"irradiance": scene.sun_irradiance.tolist()},
        },
        {
            "name": "Ground",
            "mesh": 2,
            "translation": scene.spot.tolist(),
            "extras": {"contact": {"center": placeholder.ball_center.tolist(), "radius": placeholder.ball_radius}},
        },
        {
            "name": "YourObject",
            "translation": scene.spot.tolist(),
            "children": [5, 6],
            "extras": {"inShade": scene.spot_in_shade},
        },
        {"name": "Ball", "mesh": 0, "translation": placeholder.ball_center.tolist()},
        {"name": "Stick", "mesh": 1, "translation": placeholder.stick_foot.tolist()},
    ]


def _columns(matrix: NDArray[np.floating]) -> list[float]:
    return [float(value) for value in matrix.T.ravel()]


def _plate_distance(scene: Scene) -> float:
    """Meters along the camera's axis."""
    to_spot = float(np.linalg.norm(scene.spot - scene.camera_position))
    return _BEHIND * (to_spot + _GROUND_IN_BALLS * scene.placeholder.ball_radius)


def _sun(scene: Scene) -> Json:
    """It has no light where the spot lies in the photo's shade, since lights in glTF light everything."""
    color, intensity = color_and_intensity(scene.sun_irradiance)
    intensity = 0.0 if scene.spot_in_shade else intensity
    return {"name": "Sun", "type": "directional", "color": color.tolist(), "intensity": intensity}


def _image_light(scene: Scene, images: list[Json], binary: "_Binary") -> Json:
    """The map's light; its pictures are added to the others."""
    size = min(_MAX_FACE, face_size(scene.environment))
    mirrored = np.ascontiguousarray(scene.environment[:, ::-1])
    levels = prefilter_cubemap(mirrored, size, np.linspace(0.0, 1.0, level_count(size)).tolist())
    pictures = []
    for faces in levels:
        pictures.append(list(range(len(images), len(images) + len(faces))))
        images += [binary.png(encode_png(_encode_rgbd(face))) for face in faces]
    harmonics = (CONDON_SHORTLEY * COSINE_FACTORS)[:, None] * project_latlong(mirrored)
    return {
        "name": "Environment",
        "intensity": 1.0,
        "rotation": [0.0, 0.0, 0.0, 1.0],
        "irradianceCoefficients": harmonics.tolist(),
        "specularImageSize": size,
        "specularImages": pictures,
    }


def _encode_rgbd(face: Image) -> NDArray[np.uint8]:
    """Radiance (h, w, 3) as RGBA: encoded colors are the decoded ones over alpha, to be decoded once more."""
    encoded = face ** np.float32(1 / _GAMMA)
    divisor = np.floor(255.0 / np.maximum(max_channel(encoded), 1.0)) / 255.0
    color = np.clip(encoded * divisor[..., None], 0.0, 1.0) ** (1 / _GAMMA)
    return np.round(255.0 * np.concatenate([color, divisor[..., None]], axis=-1)).astype(np.uint8)


def _camera(scene: Scene) -> Json:
    yfov, aspect = float(np.radians(scene.vertical_fov)), scene.width / scene.height
    perspective = {"yfov": yfov, "aspectRatio": aspect, "znear": NEAR, "zfar": FAR}
    return {"name": "Camera", "type": "perspective", "perspective": perspective}


def _materials(scene: Scene) -> list[Json]:
    return [
        _diffuse("Placeholder", [PLACEHOLDER_ALBEDO] * 3),
        _diffuse("Ground", scene.ground.tolist()),
        {
            "name": "Plate",
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0},
            "extensions": {"KHR_materials_unlit": {}},
        },
    ]


def _diffuse(name: str, albedo: list[float]) -> Json:
    surface = {"baseColorFactor": [*albedo, 1], "metallicFactor": 0, "roughnessFactor": 1}
    return {"name": name, "pbrMetallicRoughness": surface, "extensions": {_SPECULAR: {"specularFactor": 0}}}


def _meshes(scene: Scene, binary: "_Binary") -> list[Json]:
    placeholder = scene.placeholder
    height = 2 * _plate_distance(scene) * float(np.tan(np.radians(scene.vertical_fov) / 2))
    parts = [
        ("Ball", _ball(placeholder.ball_radius), _PLACEHOLDER),
        ("Stick", _stick(placeholder.stick_radius, placeholder.stick_height), _PLACEHOLDER),
        ("Ground", _disc(_GROUND_IN_BALLS * placeholder.ball_radius), _GROUND),
        ("Plate", _picture(height * scene.width / scene.height, height), _PLATE),
    ]
    return [{"name": name, "primitives": [binary.primitive(mesh, material)]} for name, mesh, material in parts]


class _Binary:
    """The file's binary part and the lists that describe it."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._views: list[Json] = []
        self._accessors: list[Json] = []

    def png(self, data: bytes) -> Json:
        return {"mimeType": "image/png", "bufferView": self._view(data)}

    def primitive(self, mesh: "_Mesh", material: int) -> Json:
        attributes = {"POSITION": self._vectors(mesh.positions), "NORMAL": self._vectors(mesh.normals)}
        if mesh.coordinates is not None:
            attributes["TEXCOORD_0"] = self._vectors(mesh.coordinates)
        view = self._view(mesh.triangles.tobytes(), target=_INDICES)
        indices = self._accessor(view, _UNSIGNED_SHORT, mesh.triangles.size, "SCALAR")
        return {"attributes": attributes, "indices": indices, "material": material}

    def packed(self, document: Json) -> bytes:
        """The whole file."""
        lists = {"accessors": self._accessors, "bufferViews": self._views}
        described = {**document, **lists, "buffers": [{"byteLength": len(self._data)}]}
        text = _padded(json.dumps(described, separators=(",", ":")).encode(), b" ")
        chunks = struct.pack("<II", len(text), _JSON) + text
        chunks += struct.pack("<II", len(self._data), _BIN) + self._data
        return struct.pack("<III", _MAGIC, 2, 12 + len(chunks)) + chunks

    def _vectors(self, values: NDArray[np.float32]) -> int:
        view = self._view(values.tobytes(), target=_VERTICES)
        limits = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self._accessor(view, _FLOAT, len(values), f"VEC{values.shape[1]}", **limits)

    def _accessor(self, view: int, component: int, count: int, kind: str, **limits: list[float]) -> int:
        self._accessors.append({"bufferView": view, "componentType": component, "count": count, "type": kind, **limits})
        return len(self._accessors) - 1

    def _view(self, data: bytes, **target: int) -> int:
        self._views.append({"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data), **target})
        self._data += _padded(data, b"\0")
        return len(self._views) - 1


def _padded(data: bytes, filler: bytes) -> bytes:
    return data + filler * (-len(data) % 4)


# Triangle meshes.


@dataclass(frozen=True, eq=False)
class _Mesh:
    """Triangles, counter-clockwise seen from outside."""

    positions: NDArray[np.float32]  # (V, 3), meters, +Y up
    normals: NDArray[np.float32]  # (V, 3)
    triangles: NDArray[np.uint16]  # (T, 3)
    coordinates: NDArray[np.float32] | None = None  # (V, 2) of a picture, (0, 0) is its upper left corner


def _ball(radius: float) -> _Mesh:
    """A sphere around the origin."""
    slope = np.linspace(-np.pi / 2, np.pi / 2, _RINGS + 1)
    normals = np.stack([np.cos(slope), np.sin(slope)], axis=-1)
    return _surface_of_revolution(radius * normals, normals)


def _stick(radius: float, height: float) -> _Mesh:
    """An upright cylinder that stands on the origin."""
    profile = np.array([[0, 0], [radius, 0], [radius, 0], [radius, height], [radius, height], [0, height]])
    normals = np.array([[0, -1], [0, -1], [1, 0], [1, 0], [0, 1], [0, 1]])
    return _surface_of_revolution(profile, normals)


def _disc(radius: float) -> _Mesh:
    """A level disc around the origin, facing up."""
    return _surface_of_revolution(np.array([[radius, 0.0], [0.0, 0.0]]), np.array([[0.0, 1.0], [0.0, 1.0]]))


def _picture(width: float, height: float) -> _Mesh:
    """An upright rectangle around the origin, facing +Z, with texture coordinates."""
    corners = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)
    across, down = (corners - 0.5).T
    positions = np.stack([across * width, -down * height, np.zeros(4)], axis=-1).astype(np.float32)
    normals = np.tile(np.array([0, 0, 1], dtype=np.float32), (4, 1))
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint16)
    return _Mesh(positions, normals, triangles, corners)


def _surface_of_revolution(profile: Floats, normals: Floats) -> _Mesh:
    """The surface of revolution of a profile (P, 2) of (radius, height) around the Y axis; outside is on its right."""
    angle = np.linspace(0.0, 2 * np.pi, _SEGMENTS + 1)
    ring = np.stack([np.cos(angle), np.ones_like(angle), -np.sin(angle)], axis=-1)
    points, outward = (ring * values[:, None, [0, 1, 0]] for values in (profile, normals))
    first = np.arange(_SEGMENTS) + (_SEGMENTS + 1) * np.arange(len(profile) - 1)[:, None]
    above = first + _SEGMENTS + 1
    triangles = np.stack([first, first + 1, above + 1, first, above + 1, above], axis=-1).reshape(-1, 3)
    corners = _flat(points)[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    kept = triangles[area > _MIN_AREA * area.max()]
    return _Mesh(_flat(points), _flat(outward), kept.astype(np.uint16))


def _flat(values: Floats) -> NDArray[np.float32]:
    return values.reshape(-1, 3).astype(np.float32)
