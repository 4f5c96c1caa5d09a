"""A scene as one HTML page that needs neither server nor network: it contains three.js, the plate and the map.

three.js knows no size of a directional light: the sun's colour and irradiance are right, its shadow's edge is as sharp
as the shadow map. Its lat-long maps have +X at the centre, so the map is turned by a quarter.
"""

import json
from base64 import b64encode

from lighting.color import color_and_intensity
from lighting.envmap.relighting import rotate_envmap
from lighting.files import FileOptions, encode_envmap
from lighting.records import Json, record_with_coefficients
from lighting.scene.records import FAR, GROUND_RADIUS, NEAR, PLACEHOLDER_ALBEDO, Scene
from lighting.scene.writer import (
    Folder,
    encode_ground_mask,
    encode_lit_ground,
    encode_plate,
    fill_template,
    read_data_text,
)

PAGE = "scene.html"

_YAW = -90.0  # deg, turns the map so that three.js finds -Z where our maps have it


def write_threejs(scene: Scene, folder: Folder) -> None:
    """Write PAGE.

    Args:
        scene: made by `make_scene`.
        folder: where the files go.
    """
    parts = {
        "scene": json.dumps(_description(scene)).replace("<", "\\u003c"),  # no text in it ends the script
        "three": read_data_text("three.min.js"),
        "viewer": read_data_text("viewer.js"),
    }
    (folder / PAGE).write_text(fill_template("viewer.html", parts), encoding="utf-8")


def _description(scene: Scene) -> Json:
    """The values that viewer.js reads, in metres and degrees; three.js has the frame of geometry.py."""
    placeholder = scene.placeholder
    color, intensity = color_and_intensity(scene.sun_irradiance)
    return {
        "width": scene.width,
        "height": scene.height,
        "verticalFov": scene.vertical_fov,
        "near": NEAR,
        "far": FAR,
        "cameraMatrix": scene.camera_matrix.ravel().tolist(),
        "sunDirection": scene.sun_direction.tolist(),
        "sunColour": color.tolist(),
        "sunIntensity": intensity,
        "shadow": scene.shadow.tolist(),
        "groundRadius": GROUND_RADIUS,
        "spot": scene.spot.tolist(),
        "ballRadius": placeholder.ball_radius,
        "stickFoot": (scene.spot + placeholder.stick_foot).tolist(),
        "stickHeight": placeholder.stick_height,
        "stickRadius": placeholder.stick_radius,
        "albedo": PLACEHOLDER_ALBEDO,
        "plate": _png_url(encode_plate(scene)),
        "litGround": _png_url(encode_lit_ground(scene, movable=True)),
        "ground": _png_url(encode_ground_mask(scene)),
        "environment": b64encode(
            encode_envmap(rotate_envmap(scene.environment, _YAW), options=FileOptions("hdr"))
        ).decode(),
        "lighting": record_with_coefficients(scene.lighting, scene.light_probe),
    }


def _png_url(data: bytes) -> str:
    return "data:image/png;base64," + b64encode(data).decode()
