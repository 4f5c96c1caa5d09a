"""A scene for Unreal Engine 5: a script for its editor, the numbers that it reads, and pictures.

Unreal is left-handed in centimeters, +Z up; the camera looks along +X at azimuth 0, and +Y is to its right. Its
lat-long maps have -Y at the center, so the sky light's cubemap is turned by 270 degrees. A manual exposure without the
physical camera is 1 at the engine's default lens attenuation.

References:
    Unreal Engine 5: TextureCompressorModule.cpp (lat-long), ReflectionEnvironmentShaders.usf (the cubemap's angle),
    PostProcessEyeAdaptation.cpp (exposure), UnrealMath.cpp (rotators).
"""

import numpy as np

from lighting.color import color_and_intensity, srgb_bytes
from lighting.fields import Json
from lighting.files import FileOptions, encode_envmap
from lighting.geometry import Floats
from lighting.scene import PLATE, records
from lighting.scene.writer import Files, encode_json, encode_projected_ground, encode_shared_files, read_data

_SCRIPT, _NUMBERS, SKY = "unreal_scene.py", "unreal_scene.json", "environment.hdr"
_ALBEDO, EMISSION = "ground_albedo.png", "ground_emission.png"

_SKY_ANGLE = 270.0  # deg, turns the viewing direction to the map's center
_CENTIMETERS = 100.0  # per meter
_BACKDROP_DISTANCE = 1000.0  # m


def encode_unreal(scene: records.Scene) -> Files:
    """Return _SCRIPT, the _NUMBERS that it reads, SKY, the pictures that the ground shows, and the shared files.

    Args:
        scene: made by `make_scene`.
    """
    albedo, emission = encode_projected_ground(scene)
    return {
        **encode_shared_files(scene),
        SKY: encode_envmap(scene.environment, options=FileOptions("hdr")),
        _ALBEDO: albedo,
        EMISSION: emission,
        _NUMBERS: encode_json(_description(scene)),
        _SCRIPT: read_data("unreal_scene.py"),
    }


def _description(scene: records.Scene) -> Json:
    """What data/unreal_scene.py reads: centimeters, degrees, millimeters; rotations are roll, pitch and yaw."""
    lighting = scene.lighting
    camera = [lighting.camera_roll, lighting.camera_elevation, 0.0]
    reach = 2 * records.GROUND_RADIUS * _CENTIMETERS
    return {
        "name": scene.photo_name,
        "plate": PLATE,
        "environment": SKY,
        "albedo": _ALBEDO,
        "emission": EMISSION,
        "sun": _sun(scene),
        "sky": {"angle": _SKY_ANGLE, "resolution": _power_of_two(len(scene.environment) // 2)},
        "camera": {
            "location": _point(scene.camera_position),
            "rotation": camera,
            "sensor": [scene.sensor_width, records.SENSOR_HEIGHT],
            "focal_length": scene.focal_length,
        },
        "backdrop": _backdrop(scene),
        "ground": {"location": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0], "size": [reach, reach, _CENTIMETERS]},
        "placeholder": _placeholder(scene),
    }


def _sun(scene: records.Scene) -> Json:
    color, intensity = color_and_intensity(scene.sun_irradiance)
    lighting = scene.lighting
    return {
        "rotation": [0.0, -lighting.sun_elevation, lighting.sun_azimuth + 180.0],
        "color": srgb_bytes(color).tolist(),
        "lux": intensity,
        "angle": records.SUN_ANGLE,
        "on": not scene.spot_in_shade,
    }


def _backdrop(scene: records.Scene) -> Json:
    """A plane across the camera's axis, which faces along its own +Z and fills the picture however the camera rolls."""
    height = 2 * _BACKDROP_DISTANCE * float(np.tan(np.radians(scene.vertical_fov) / 2))
    side = 1.1 * _CENTIMETERS * height * float(np.hypot(1.0, scene.width / scene.height))
    return {
        "location": _point(scene.camera_position + _BACKDROP_DISTANCE * scene.camera_axes[2]),
        "rotation": [0.0, scene.lighting.camera_elevation + 90.0, 0.0],
        "size": [side, side, _CENTIMETERS],
    }


def _placeholder(scene: records.Scene) -> Json:
    made, upright = scene.placeholder, [0.0, 0.0, 0.0]
    ball, stick = (_CENTIMETERS * 2 * radius for radius in (made.ball_radius, made.stick_radius))
    return {
        "albedo": records.PLACEHOLDER_ALBEDO,
        "ball": {"location": _point(scene.spot + made.ball_center), "rotation": upright, "size": [ball] * 3},
        "stick": {
            "location": _point(scene.spot + made.stick_center),
            "rotation": upright,
            "size": [stick, stick, _CENTIMETERS * made.stick_height],
        },
    }


def _point(position: Floats) -> list[float]:
    """A position of our frame in Unreal's."""
    x, y, z = (_CENTIMETERS * float(value) + 0.0 for value in position)
    return [-z, x, y]


def _power_of_two(count: int) -> int:
    """The next one, 64 to 1024, as a sky light's cubemap wants."""
    return int(min(1024, max(64, 1 << (count - 1).bit_length())))
