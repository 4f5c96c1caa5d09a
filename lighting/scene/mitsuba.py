"""A scene for Mitsuba 3 in several files, and a script that composites the object over the plate.

Mitsuba's frame is ours, its maps have +Z at the center and its cameras look along their own +Z with +X to the left. The
sun is a disc of the right angle far away, since a `directional` emitter casts shadows without penumbra.
"""

import numpy as np

from lighting.geometry import Floats, direction
from lighting.scene import ENVIRONMENT
from lighting.scene.records import GROUND_RADIUS, PLACEHOLDER_ALBEDO, SUN_ANGLE, Scene
from lighting.scene.writer import Files, encode_shared_files, fill_template, read_data

_SCENE, _CAMERA, _LIGHT, OBJECT, COMPOSITE = "scene.xml", "camera.xml", "light.xml", "object.xml", "composite.py"

_SUN_DISTANCE = 10_000.0  # m; ten meters from the spot the sun's direction differs by 0.06 deg

_HALF_ANGLE = np.radians(SUN_ANGLE / 2)


def encode_mitsuba(scene: Scene) -> Files:
    """Return _SCENE, which includes _CAMERA, _LIGHT (with the ground) and OBJECT, then COMPOSITE and the shared files.

    Args:
        scene: made by `make_scene`.
    """
    return {
        **encode_shared_files(scene),
        _SCENE: read_data("mitsuba_scene.xml"),
        _CAMERA: fill_template("mitsuba_camera.xml", _camera_values(scene)),
        _LIGHT: fill_template("mitsuba_light.xml", _light_values(scene)),
        OBJECT: fill_template("mitsuba_object.xml", _object_values(scene)),
        COMPOSITE: read_data("mitsuba_composite.py"),
    }


def _camera_values(scene: Scene) -> dict[str, object]:
    right, up, forward = scene.camera_axes
    matrix = np.eye(4)
    matrix[:3] = np.stack([-right, up, forward, scene.camera_position], axis=1)
    size = {"plate_width": scene.width, "plate_height": scene.height}
    return {**size, "vertical_fov": scene.vertical_fov, "camera_matrix": _numbers(matrix.ravel())}


def _light_values(scene: Scene) -> dict[str, object]:
    return {
        "environment": ENVIRONMENT,
        "sun_angle": SUN_ANGLE,
        "sun_irradiance": _numbers(scene.sun_irradiance),
        "sun_radiance": _numbers(scene.sun_irradiance / (np.pi * np.sin(_HALF_ANGLE) ** 2)),
        "sun_radius": f"{_SUN_DISTANCE * np.tan(_HALF_ANGLE):.9g}",
        "sun": _numbers(scene.spot + _SUN_DISTANCE * scene.sun_direction),
        "spot": _numbers(scene.spot),
        "aside": _numbers(direction(scene.lighting.sun_azimuth + 90.0, 0.0)),  # never parallel to the sun's direction
        "ground_radius": f"{GROUND_RADIUS:.9g}",
        "ground_albedo": _numbers(scene.ground),
    }


def _object_values(scene: Scene) -> dict[str, object]:
    placeholder = scene.placeholder
    foot = scene.spot + placeholder.stick_foot
    return {
        "spot": _numbers(scene.spot),
        "spot_lit": "0" if scene.spot_in_shade else "1",
        "albedo": PLACEHOLDER_ALBEDO,
        "ball_centre": _numbers(scene.spot + placeholder.ball_center),
        "ball_radius": f"{placeholder.ball_radius:.9g}",
        "stick_foot": _numbers(foot),
        "stick_top": _numbers(foot + np.array([0.0, placeholder.stick_height, 0.0])),
        "stick_radius": f"{placeholder.stick_radius:.9g}",
    }


def _numbers(values: Floats) -> str:
    return " ".join(f"{value:.9g}" for value in values)
