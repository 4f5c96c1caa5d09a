"""A photo's camera as fSpy exports it: the JSON that its importers read, and a project with the photo in it.

The world has Z up and Y where the camera looks, as in Blender; the camera looks along its own -Z with +Y up. Angles are
radians. Points of the picture are from its middle, to the right and up, in halves of its longer side.
"""

import json
import struct

import numpy as np

from lighting.fields import Json
from lighting.geometry import Floats, to_z_up
from lighting.scene import PLATE
from lighting.scene.records import Scene
from lighting.scene.writer import Files, encode_json, encode_shared_files

_CAMERA, _PROJECT = "camera.json", "scene.fspy"

_VERSION = 1
_MIN_DEPTH = 1e-6  # of a unit vector along the view: stands for that of vanishing points at infinity


def encode_fspy(scene: Scene) -> Files:
    """Return _CAMERA, _PROJECT and the shared files.

    Args:
        scene: made by `make_scene`.
    """
    camera = _camera(scene)
    settings = {"referenceDistanceUnit": "Meters", "referenceDistance": scene.lighting.camera_height}
    state = json.dumps({"cameraParameters": camera, "calibrationSettingsBase": settings}).encode()
    shared = encode_shared_files(scene)
    plate = shared[PLATE]
    header = struct.pack("<4sIII", b"fspy", _VERSION, len(state), len(plate))
    return {**shared, _CAMERA: encode_json(camera), _PROJECT: header + state + plate}


def _camera(scene: Scene) -> Json:
    matrix = scene.camera_matrix
    matrix[:3] = to_z_up(matrix[:3].T).T
    vertical = np.radians(scene.vertical_fov) / 2
    longer = max(scene.width, scene.height)
    focal = scene.height / longer / np.tan(vertical)  # in halves of the longer side
    return {
        "principalPoint": {"x": 0.0, "y": 0.0},
        "viewTransform": {"rows": np.linalg.inv(matrix).tolist()},
        "cameraTransform": {"rows": matrix.tolist()},
        "horizontalFieldOfView": float(2 * np.arctan(np.tan(vertical) * scene.width / scene.height)),
        "verticalFieldOfView": float(2 * vertical),
        "vanishingPoints": [_vanishing_point(row, focal) for row in matrix[:3, :3]],
        "vanishingPointAxes": ["xPositive", "yPositive", "zPositive"],
        "relativeFocalLength": float(focal),
        "imageWidth": scene.width,
        "imageHeight": scene.height,
    }


def _vanishing_point(axis: Floats, focal: float) -> dict[str, float]:
    """Where the picture has one of the world's axes (3,), which is in the camera's frame."""
    right, up, backward = map(float, axis)
    depth = -backward if abs(backward) > _MIN_DEPTH else _MIN_DEPTH
    return {"x": focal * right / depth, "y": focal * up / depth}
