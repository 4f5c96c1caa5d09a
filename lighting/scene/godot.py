"""A scene as a project for Godot 4: its scene, two shaders, the plate, the map and how to import them.

Godot's frame is ours. Its lat-long maps have +Z at the center, so the sky is turned by 180 degrees. A directional
light of energy 1 gives an irradiance of pi, and its color is encoded as sRGB. The renderer is Forward+: Compatibility
applies the transfer curve to maps twice, and its sun has no size. Mirrors of few layers, not arrays, keep the ground's
light out of the sky's (2 % in place of 8 %).

References:
    Godot 4.6: doc/classes/Light3D.xml; servers/rendering/renderer_rd/shaders/environment/sky.glsl.
"""

import numpy as np
from numpy.typing import ArrayLike

from lighting.color import color_and_intensity, srgb_encode
from lighting.geometry import Floats
from lighting.scene import ENVIRONMENT, GROUND, LIT_GROUND, PLATE, records
from lighting.scene.writer import Files, encode_shared_files, fill_template, read_data

_PROJECT, _SCENE, CATCHER, BACKDROP = "project.godot", "scene.tscn", "ground.gdshader", "backdrop.gdshader"

_WINDOW = 1280  # pixels, the longer side of the window; the picture has the plate's size
_SHADOW_REACH = 2.5  # how far shadows are drawn / the distance from the camera to the spot


def encode_godot(scene: records.Scene) -> Files:
    """Return _PROJECT, _SCENE, the shaders CATCHER and BACKDROP, the shared files and how Godot imports the pictures.

    Args:
        scene: made by `make_scene`.
    """
    pictures = (PLATE, ENVIRONMENT, LIT_GROUND, GROUND)
    return {
        **encode_shared_files(scene),
        **{f"{name}.import": fill_template("godot_import.txt", {"name": name}) for name in pictures},
        _SCENE: fill_template("godot_scene.tscn", _values(scene)),
        **{name: read_data(f"godot_{name}") for name in (CATCHER, BACKDROP)},
        _PROJECT: fill_template("godot_project.txt", _window(scene)),
    }


def _window(scene: records.Scene) -> dict[str, object]:
    share = min(1.0, _WINDOW / max(scene.width, scene.height))
    return {
        "width": scene.width,
        "height": scene.height,
        "window_width": round(scene.width * share),
        "window_height": round(scene.height * share),
    }


def _values(scene: records.Scene) -> dict[str, object]:
    """The values of the placeholders in data/godot_scene.tscn."""
    placeholder = scene.placeholder
    color, intensity = color_and_intensity(scene.sun_irradiance)
    return {
        "environment": ENVIRONMENT,
        "plate": PLATE,
        "lit_ground": LIT_GROUND,
        "shade": _numbers(scene.shadow),
        "contact": _numbers([*(scene.spot + placeholder.ball_center), placeholder.ball_radius]),
        "aspect": _number(scene.width / scene.height),
        "camera": _transform(scene.camera_matrix),
        "vertical_fov": _number(scene.vertical_fov),
        "near": _number(records.NEAR),
        "far": _number(records.FAR),
        "sun": _transform(scene.sun_matrix),
        "sun_color": _numbers([*srgb_encode(color), 1.0]),
        "sun_energy": _number(intensity / np.pi),
        "sun_angle": _number(records.SUN_ANGLE),
        "sun_layers": 1 if scene.spot_in_shade else 3,
        "shadow_reach": _number(_SHADOW_REACH * float(np.linalg.norm(scene.spot - scene.camera_position))),
        "ground_size": _number(2 * records.GROUND_RADIUS),
        "spot": _numbers(scene.spot),
        "albedo": _numbers([*srgb_encode(np.full(3, records.PLACEHOLDER_ALBEDO)), 1.0]),
        "ball_center": _numbers(placeholder.ball_center),
        "ball_radius": _number(placeholder.ball_radius),
        "ball_height": _number(2 * placeholder.ball_radius),
        "stick_center": _numbers(placeholder.stick_center),
        "stick_radius": _number(placeholder.stick_radius),
        "stick_height": _number(placeholder.stick_height),
    }


def _transform(matrix: Floats) -> str:
    """A matrix (4, 4) for column vectors as Godot writes it: the rows of the axes, then the origin."""
    return _numbers([*matrix[:3, :3].ravel(), *matrix[:3, 3]])


def _numbers(values: ArrayLike) -> str:
    return ", ".join(_number(value) for value in np.asarray(values, dtype=np.float64))


def _number(value: float) -> str:
    return f"{float(value) + 0.0:.9g}"  # + 0.0 turns -0 into 0
