"""A scene for Blender: a script that builds it and, if it is asked for, the .blend file.

Blender's lat-long maps have +X at the center where its camera here looks along +Y, hence _YAW. The native Sky Texture
is Blender's Multiple Scattering, from 5.0, or that of Hosek and Wilkie on the record's scale; the map may be of
another.
"""

import json
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lighting.color import color_and_intensity, luminance
from lighting.errors import ErrorCode, SceneError
from lighting.fields import Json
from lighting.geometry import to_z_up
from lighting.scene import ENVIRONMENT, LIT_GROUND, PLATE, records
from lighting.scene.writer import Files, encode_json, encode_shared_files, read_data

_SCRIPT, _NUMBERS, BLEND_FILE = "scene.py", "scene.json", "scene.blend"
SHOT_SCRIPT, SHOT_NUMBERS = "shot.py", "shot.json"

_BLENDERS = (  # where Blender lies that is in no search path
    "/Applications/Blender.app/Contents/MacOS/Blender",
    "/snap/bin/blender",
    *(
        f"C:/Program Files/Blender Foundation/Blender {version}/blender.exe"
        for version in ("5.2", "5.1", "5.0", "4.5", "4.2")
    ),
)
_RUN = ("--background", "--factory-startup", "--python-exit-code", "1", "--python")  # a script
_SAMPLES = 128  # of Cycles, per pixel
_YAW = -90.0  # deg about +Z, turns the viewing direction to the map's center


def encode_blender(scene: records.Scene, *, blend: bool = False) -> Files:
    """Return _SCRIPT, the _NUMBERS that it reads and the shared files.

    Args:
        scene: made by `make_scene`.
        blend: have Blender write BLEND_FILE, too.

    Raises:
        SceneError: there is no Blender, or it fails.
    """
    numbers = {_NUMBERS: encode_json(_description(scene))}
    files = {**encode_shared_files(scene), **numbers, _SCRIPT: read_data("blender_scene.py")}
    return {**files, BLEND_FILE: _build(files)} if blend else files


def find_blender() -> list[str] | None:
    """Return the command that runs a script in Blender: this Python, if it has bpy, or Blender; None without either."""
    if find_spec("bpy") is not None:
        return [sys.executable]
    program = find_blender_program()
    return None if program is None else [program, *_RUN]


def find_blender_program() -> str | None:
    """Return the path of Blender; None where it is not found."""
    return shutil.which("blender") or next((name for name in _BLENDERS if Path(name).is_file()), None)


def animate_blender(motion: records.CameraMotion) -> dict[str, str]:
    """SHOT_SCRIPT, which builds the scene and sets key frames, and the SHOT_NUMBERS that it reads.

    Args:
        motion: of the camera.
    """
    matrices = motion.matrices.copy()
    matrices[:, :3] = np.swapaxes(to_z_up(np.swapaxes(matrices[:, :3], 1, 2)), 1, 2)
    numbers = {
        "clip": motion.clip,
        "first_frame": motion.first_frame,
        "frame_rate": motion.frame_rate,
        "frames": [round(float(frame) + 1.0, 4) for frame in motion.frames],
        "matrices": np.round(matrices, 7).tolist(),
        "focal_lengths": np.round(motion.focal_lengths, 4).tolist(),
    }
    return {SHOT_NUMBERS: json.dumps(numbers) + "\n", SHOT_SCRIPT: read_data("blender_shot.py").decode()}


def _build(files: Files) -> bytes:
    """What BLEND_FILE holds: the script runs in a process of its own, since bpy has one open file per process."""
    blender = find_blender()
    if blender is None:
        sentence = f"{BLEND_FILE} needs Blender, from blender.org, or its module: pip install bpy."
        raise SceneError(sentence, "blend", ErrorCode.MISSING)
    command = [*blender, _SCRIPT, "--", "--save"]
    try:
        with TemporaryDirectory() as name:
            folder = Path(name)
            for file, data in files.items():
                (folder / file).write_bytes(data)
            result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            if result.returncode == 0 and (folder / BLEND_FILE).is_file():
                return (folder / BLEND_FILE).read_bytes()
    except OSError as error:
        cause = error.strerror or error
        raise SceneError(f"Blender cannot be run in the folder of temporary files: {cause}.") from error
    lines = result.stderr.strip().splitlines() or ["no reason given"]
    raise SceneError(f"Blender could not build {BLEND_FILE}: {lines[-1]}", code=ErrorCode.FAILED)


def _description(scene: records.Scene) -> Json:
    """What data/blender_scene.py reads: meters, degrees, millimeters; +Z up, the camera looks along +Y."""
    matrix = scene.camera_matrix
    matrix[:3] = to_z_up(matrix[:3].T).T
    color, strength = color_and_intensity(scene.sun_irradiance)
    sun = to_z_up(scene.sun_direction).tolist()
    return {
        "plate": PLATE,
        "environment": ENVIRONMENT,
        "lit_ground": LIT_GROUND,
        "shade": scene.shadow.tolist(),
        "spot_in_shade": scene.spot_in_shade,
        "samples": _SAMPLES,
        "size": [scene.width, scene.height],
        "photo_size": list(scene.photo_size or (scene.width, scene.height)),
        "camera": {
            "matrix": matrix.tolist(),
            "sensor": [scene.sensor_width, records.SENSOR_HEIGHT],
            "focal_length": scene.focal_length,
            "clip": [records.NEAR, records.FAR],
        },
        "sun": {"direction": sun, "angle": records.SUN_ANGLE, "colour": color.tolist(), "irradiance": strength},
        "sky": {"yaw": _YAW, "painted": scene.lighting.map_sky, "native": _native_sky(scene)},
        "ground": {"radius": records.GROUND_RADIUS, "albedo": scene.ground.tolist()},
        "placeholder": _placeholder(scene),
    }


def _native_sky(scene: records.Scene) -> Json:
    return {
        "sun_direction": to_z_up(scene.sun_direction).tolist(),
        "turbidity": scene.lighting.turbidity,
        "ground_albedo": scene.lighting.ground_albedo,
        "strength": scene.lighting.exposure,
        "luminance": float(luminance(scene.sky_irradiance)),
    }


def _placeholder(scene: records.Scene) -> Json:
    """The stick's foot is relative to the spot."""
    placeholder = scene.placeholder
    return {
        "spot": to_z_up(scene.spot).tolist(),
        "ball_radius": placeholder.ball_radius,
        "stick_foot": to_z_up(placeholder.stick_foot).tolist(),
        "stick_radius": placeholder.stick_radius,
        "stick_height": placeholder.stick_height,
        "albedo": [records.PLACEHOLDER_ALBEDO] * 3,
    }
