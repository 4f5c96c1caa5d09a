"""A scene for Unity 6 as one package: a script for its editor, the numbers that it reads, and pictures.

Unity is left-handed in meters, +Y up; the camera looks along +Z at azimuth 0, and +X is to its right. HDRP takes the
sun in lux, URP as irradiance / pi. Which face of a cubemap its importer gives a map's center is not documented, so the
script compares the faces' means with those of the map.

References:
    Unity Graphics: HDRISkyRenderer.cs and SkyUtils.hlsl (rotation), ColorUtils.cs (exposure). Skybox-Cubed.shader.
"""

import gzip
import io
import json
import tarfile
from hashlib import md5

import numpy as np
from numpy.typing import NDArray

from lighting.color import color_and_intensity, srgb_encode
from lighting.fields import Json
from lighting.files import encode_envmap
from lighting.files.deflate import encode_png
from lighting.geometry import Floats, direction, latlong_directions, latlong_solid_angle
from lighting.scene import ENVIRONMENT, PLATE, RECORD, records
from lighting.scene.writer import Files, encode_projected_ground, encode_record, read_data

_PACKAGE = "scene.unitypackage"
ASSETS = "Assets/LightFromPhoto"

_COLUMNS, _ROWS = 24, 96  # of the picture, in the ground's mesh; a cell at the horizon errs by 0.1 % of the height
_MAX_TEXTURE = 8192  # pixels; larger pictures are scaled down


def encode_unity(scene: records.Scene) -> Files:
    """Return _PACKAGE.

    Args:
        scene: made by `make_scene`.
    """
    albedo, emission = encode_projected_ground(scene)
    members = {
        "Editor/LightFromPhoto.cs": (read_data("LightFromPhoto.cs"), "MonoImporter:\n"),
        "Editor/LightFromPhoto.asmdef": (read_data("LightFromPhoto.asmdef"), "AssemblyDefinitionImporter:\n"),
        ENVIRONMENT: (
            encode_envmap(scene.environment, scene.lighting, probe=scene.light_probe),
            _texture_meta(cube=True),
        ),
        PLATE: (encode_png(scene.plate), _texture_meta()),
        "ground_albedo.png": (albedo, _texture_meta()),
        "ground_emission.png": (emission, _texture_meta()),
        "scene.json": (json.dumps(_description(scene)).encode(), "TextScriptImporter:\n"),
        RECORD: (encode_record(scene), "TextScriptImporter:\n"),
    }
    own = f"{ASSETS}/{scene.photo_name}"  # so that another photo's assets are others; the script is shared
    paths = {name: f"{ASSETS if name.startswith('Editor/') else own}/{name}" for name in members}
    return {_PACKAGE: _pack({paths[name]: member for name, member in members.items()})}


def _pack(members: dict[str, tuple[bytes, str]]) -> bytes:
    """A .unitypackage: for each asset a folder named by its GUID, which holds it, its path and its import settings.

    The same members make the same bytes.
    """
    stream = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=stream, mode="wb", compresslevel=1, mtime=0) as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.USTAR_FORMAT) as archive,
    ):
        for path, (data, importer) in members.items():
            guid = md5(path.encode(), usedforsecurity=False).hexdigest()
            meta = f"fileFormatVersion: 2\nguid: {guid}\n{importer}".encode()
            for name, content in (("asset", data), ("asset.meta", meta), ("pathname", path.encode())):
                info = tarfile.TarInfo(f"{guid}/{name}")
                info.size = len(content)
                archive.addfile(info, io.BytesIO(content))
    return stream.getvalue()


def _texture_meta(*, cube: bool = False) -> str:
    """Settings of TextureImporter: uncompressed; a lat-long cubemap that scripts can read, or an sRGB picture."""
    return f"""TextureImporter:
  serializedVersion: 13
  mipmaps:
    sRGBTexture: {int(not cube)}
    enableMipMap: {int(cube)}
  isReadable: {int(cube)}
  generateCubemap: {2 if cube else 6}
  seamlessCubemap: {int(cube)}
  textureShape: {2 if cube else 1}
  nPOTScale: {int(cube)}
  maxTextureSize: {_MAX_TEXTURE}
  textureCompression: 0
  textureSettings:
    serializedVersion: 2
    filterMode: 1
    aniso: 1
    wrapU: 1
    wrapV: 1
    wrapW: 1
"""


def _description(scene: records.Scene) -> Json:
    """The SceneNumbers of data/LightFromPhoto.cs: meters and degrees, in Unity's frame."""
    color, intensity = color_and_intensity(scene.sun_irradiance)
    made = scene.placeholder
    right, up, forward = scene.camera_axes
    side = direction(scene.lighting.sun_azimuth - 90.0, 0.0)  # to the right of the sun's rays
    return {
        "verticalFov": scene.vertical_fov,
        "aspect": scene.width / scene.height,
        "near": records.NEAR,
        "far": records.FAR,
        "cameraPosition": _vector(scene.camera_position),
        "cameraRotation": _rotation(right, up, forward),
        "sunRotation": _rotation(side, np.cross(side, -scene.sun_direction), -scene.sun_direction),
        "sunColor": dict(zip("rgba", [*map(float, srgb_encode(color)), 1.0], strict=True)),
        "sunIrradiance": intensity,
        "sunAngle": records.SUN_ANGLE,
        "sunReachesObject": not scene.spot_in_shade,
        "ringMeans": _ring_means(scene.environment).ravel().tolist(),
        **_ground_mesh(scene),
        "spot": _vector(scene.spot),
        "ballCenter": _vector(made.ball_center),
        "ballRadius": made.ball_radius,
        "stickCenter": _vector(made.stick_center),
        "stickRadius": made.stick_radius,
        "stickHeight": made.stick_height,
        "albedo": records.PLACEHOLDER_ALBEDO,
    }


def _vector(value: Floats) -> dict[str, float]:
    """A vector (3,) of our frame in Unity's."""
    return dict(zip("xyz", (float(value[0]), float(value[1]), 0.0 - float(value[2])), strict=True))


def _rotation(right: Floats, up: Floats, forward: Floats) -> dict[str, float]:
    """The quaternion that turns Unity's +X, +Y and +Z to axes (3,) of our frame.

    References:
        I. Bar-Itzhack, New method for extracting the quaternion from a rotation matrix, 2000.
    """
    m = np.column_stack([right, up, forward]) * np.array([[1.0], [1.0], [-1.0]])
    k = np.empty((4, 4))
    k[:3, :3] = m + m.T - np.eye(3) * np.trace(m)
    k[3, :3] = k[:3, 3] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    k[3, 3] = np.trace(m)
    quaternion = np.linalg.eigh(k)[1][:, -1]
    return dict(zip("xyzw", map(float, quaternion), strict=True))


def _ring_means(environment: NDArray[np.float32]) -> Floats:
    """Means (4, 3) of the map over the upright faces of a cube: ahead, right, behind and left."""
    height = len(environment)
    rays = latlong_directions(height)
    axes = direction(np.arange(4) * 90.0, 0.0)
    depth, nearest = rays @ axes.T, np.abs(rays).max(axis=-1)
    weight = latlong_solid_angle(height)[:, None] * nearest**-3.0  # of the face's area
    faces = [depth[..., side] >= nearest for side in range(4)]
    return np.stack([np.average(environment[face], axis=0, weights=weight[face]) for face in faces])


def _ground_mesh(scene: records.Scene) -> Json:
    """The ground that the picture shows, as far as GROUND_RADIUS, with the picture's places on it."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, _COLUMNS + 1), np.linspace(0.0, 1.0, _ROWS + 1))  # v from the top
    half = np.tan(np.radians(scene.vertical_fov) / 2)
    side = half * scene.width / scene.height
    rays = np.stack([(2 * u - 1) * side, (1 - 2 * v) * half, np.ones_like(u)], axis=-1) @ scene.camera_axes
    down = np.minimum(rays[..., 1], -1e-9)
    reach = np.where(rays[..., 1] < 0, -scene.lighting.camera_height / down, np.inf)
    inside = reach * np.hypot(rays[..., 0], rays[..., 2]) <= records.GROUND_RADIUS
    cells = inside[:-1, :-1] & inside[1:, :-1] & inside[:-1, 1:] & inside[1:, 1:]
    index = np.cumsum(inside).reshape(inside.shape) - 1
    corners = [index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]]
    a, b, c, d = (corner[cells] for corner in corners)
    points = (scene.camera_position + rays[inside] * reach[inside][:, None]) * [1.0, 0.0, -1.0]
    return {
        "groundPoints": np.round(points, 5).ravel().tolist(),
        "groundPlaces": np.round(np.column_stack([u[inside], 1.0 - v[inside]]), 6).ravel().tolist(),
        "groundTriangles": np.column_stack([a, b, c, a, c, d]).ravel().tolist(),
    }
