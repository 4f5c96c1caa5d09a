"""A scene as one HTML page that needs neither server nor network: it contains three.js, the plate and the map.

PAGE is for whoever puts an object in. SENT_PAGE is for whoever is sent it: a teapot to drag, in a file for mails and
phones. Both are the same page, `lighting/data/viewer.js`.

three.js knows no size of a directional light: the sun's color and irradiance are right, its shadow's edge is as sharp
as the shadow map. Its lat-long maps have +X at the center, so the map is turned by a quarter.
"""

import json
from base64 import b64encode
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.color import color_and_intensity
from lighting.envmap.latlong import shrink_envmap
from lighting.envmap.relighting import rotate_envmap
from lighting.fields import Json
from lighting.files import FileOptions, encode_envmap, encode_jpeg
from lighting.files.deflate import encode_png
from lighting.record_json import record_with_coefficients
from lighting.scene.records import FAR, GROUND_RADIUS, NEAR, PLACEHOLDER_ALBEDO, Scene
from lighting.scene.writer import Files, encode_ground_mask, encode_lit_ground, fill_template, read_data

PAGE, SENT_PAGE = "scene.html", "page.html"
MAX_SENT_BYTES = 6_000_000  # of SENT_PAGE

_MAP_HEIGHT = 256  # rows of its map, at most
_SIZES = [(side, quality) for side in (2048, 1536, 1024) for quality in (90, 75, 60)]  # of its plate, until it fits
_YAW = -90.0  # deg, turns the map so that three.js finds -Z where our maps have it


def encode_threejs(scene: Scene) -> Files:
    """Return PAGE.

    Args:
        scene: made by `make_scene`.
    """
    note = "Drop a .glb file to see it in this light; click on the ground to move it."
    return {PAGE: _fill_page(_description(scene, _png_url(encode_png(scene.plate))), note)}


def encode_page(scene: Scene) -> Files:
    """Return SENT_PAGE, whose plate is a JPEG as good as MAX_SENT_BYTES allow.

    Args:
        scene: made by `make_scene`.
    """
    rows = min(_MAP_HEIGHT, len(scene.environment))
    light = replace(scene, environment=shrink_envmap(scene.environment, rows))
    numbers = _description(light, "") | {"object": "teapot"}
    for side, quality in _SIZES:
        plate = _jpeg_url(scene.plate, side, quality)
        page = _fill_page(numbers | {"plate": plate}, "Drag the teapot, or tap the ground.")
        if len(page) <= MAX_SENT_BYTES:
            break
    return {SENT_PAGE: page}


def _jpeg_url(plate: NDArray[np.uint8], side: int, quality: int) -> str:
    """A plate (h, w, 3) of at most so many pixels along its longer side."""
    picture = Image.fromarray(plate)
    picture.thumbnail((side, side), Image.Resampling.LANCZOS)
    return "data:image/jpeg;base64," + b64encode(encode_jpeg(np.asarray(picture), quality)).decode()


def _fill_page(numbers: Json, note: str) -> bytes:
    parts = {
        "note": note,
        "scene": json.dumps(numbers).replace("<", "\\u003c"),  # no text in it ends the script
        "three": read_data("three.min.js").decode(),
        "viewer": read_data("viewer.js").decode(),
    }
    return fill_template("viewer.html", parts)


def _description(scene: Scene, plate: str) -> Json:
    """The values that viewer.js reads, in meters and degrees; three.js has the frame of geometry.py."""
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
        "plate": plate,
        "litGround": _png_url(encode_lit_ground(scene, movable=True)),
        "ground": _png_url(encode_ground_mask(scene)),
        "environment": b64encode(
            encode_envmap(rotate_envmap(scene.environment, _YAW), options=FileOptions("hdr"))
        ).decode(),
        "lighting": record_with_coefficients(scene.lighting, scene.light_probe),
    }


def _png_url(data: bytes) -> str:
    return "data:image/png;base64," + b64encode(data).decode()
