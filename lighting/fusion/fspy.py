"""Cameras of fSpy: its projects and its JSON."""

import math
import struct

import numpy as np

from lighting.errors import ErrorCode, ParameterError
from lighting.fusion.drawn_camera import camera_through
from lighting.fusion.marks import KnownCamera
from lighting.geometry import Floats

_FSPY_HEADER = struct.Struct("<4sIII")  # name, version, bytes of the state, bytes of the picture
MAX_FSPY_BYTES = 100_000_000


def read_fspy(data: bytes) -> KnownCamera:
    """Return the camera in a project of fSpy, or in the JSON that fSpy exports.

    The world's axis that lies nearest to the camera's own vertical is taken for the world's vertical. Where the
    principal point is off the picture's middle, as in a cropped photo, the camera is turned to look at the middle.

    Args:
        data: what the file holds.

    Raises:
        ParameterError: it is no such file, or holds no camera.
    """
    import json

    try:
        if data.startswith(b"fspy"):
            _, _, size, _ = _FSPY_HEADER.unpack_from(data)
            data = data[_FSPY_HEADER.size : _FSPY_HEADER.size + size]
        content = json.loads(data)
        content = content.get("cameraParameters", content)
        rows, point = np.array(content["cameraTransform"]["rows"], dtype=float), content["principalPoint"]
        size = (float(content["imageWidth"]), float(content["imageHeight"]))
        return _camera_of_fspy(rows[:3, :3], size, float(content["horizontalFieldOfView"]), (point["x"], point["y"]))
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError, struct.error) as error:
        sentence = "It is no project of fSpy with a camera, nor the camera's JSON that fSpy exports."
        raise ParameterError(sentence, "camera", ErrorCode.UNREADABLE) from error


def _camera_of_fspy(
    axes: Floats, size: tuple[float, float], horizontal_fov: float, principal: tuple[float, float]
) -> KnownCamera:
    """The camera by its right, up and backward axes (3, 3) in columns, its picture's size, and fSpy's two numbers.

    Coordinates of fSpy in the picture are from the middle, to the right and up, in halves of its longer side.
    """
    if not np.allclose(axes.T @ axes, np.eye(3), atol=1e-3) or not min(size) > 0 or not 0 < horizontal_fov < math.pi:
        raise ValueError(size)
    up = np.eye(3)[int(np.argmax(np.abs(axes[:, 1])))]
    up = up * np.sign(float(up @ axes[:, 1]))
    width, height = (side / max(size) for side in size)
    focal = width / math.tan(horizontal_fov / 2)
    x, y = map(float, principal)

    def ray(right: float, above: float) -> Floats:
        vector = axes @ np.array([right - x, above - y, -focal])
        return np.asarray(vector / np.linalg.norm(vector))

    return camera_through(ray(0.0, 0.0), ray(0.0, height), ray(0.0, -height), up)
