"""A scene for Blender: a script that builds it and, if the module bpy is installed, the .blend file.

Blender's lat-long maps have +X at the centre where its camera here looks along +Y, hence YAW. The native Sky Texture is
Blender's Multiple Scattering, from 5.0, or that of Hosek and Wilkie on the record's scale; the map may be of another.
"""

import json
import subprocess
import sys
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from lighting.color import color_and_intensity, luminance
from lighting.errors import ErrorCode, SceneError
from lighting.geometry import to_z_up
from lighting.records import Json
from lighting.scene import ENVIRONMENT, LIT_GROUND, PLATE, records
from lighting.scene.writer import Folder, read_data_text, write_shared_files

SCRIPT, NUMBERS, FILE = "scene.py", "scene.json", "scene.blend"
SHOT_SCRIPT, SHOT_NUMBERS = "shot.py", "shot.json"

SAMPLES = 128  # of Cycles, per pixel
YAW = -90.0  # deg about +Z, turns the viewing direction to the map's centre


def write_blender(scene: records.Scene, folder: Folder) -> None:
    """Write SCRIPT, the NUMBERS that it reads and the shared files; in a folder on disk also FILE where bpy is.

    Args:
        scene: made by `make_scene`.
        folder: where the files go.
    """
    write_shared_files(scene, folder)
    (folder / NUMBERS).write_text(json.dumps(_description(scene), indent=2) + "\n", encoding="utf-8")
    (folder / SCRIPT).write_text(read_data_text("blender_scene.py"), encoding="utf-8")
    if isinstance(folder, Path) and find_spec("bpy") is not None:
        _save(folder)


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
    script = files("lighting") / "data" / "blender_shot.py"
    return {SHOT_NUMBERS: json.dumps(numbers) + "\n", SHOT_SCRIPT: script.read_text(encoding="utf-8")}


def _save(folder: Path) -> None:
    """Run the script in a process of its own, since bpy has one open file per process."""
    command = [sys.executable, SCRIPT, "--save"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if result.returncode or not (folder / FILE).is_file():
        lines = result.stderr.strip().splitlines() or ["no reason given"]
        raise SceneError(f"Blender could not build {FILE}: {lines[-1]}", code=ErrorCode.FAILED)


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
        "samples": SAMPLES,
        "size": [scene.width, scene.height],
        "camera": {
            "matrix": matrix.tolist(),
            "sensor": [scene.sensor_width, records.SENSOR_HEIGHT],
            "focal_length": scene.focal_length,
            "clip": [records.NEAR, records.FAR],
        },
        "sun": {"direction": sun, "angle": records.SUN_ANGLE, "colour": color.tolist(), "irradiance": strength},
        "sky": {"yaw": YAW, "painted": scene.lighting.map_sky, "native": _native_sky(scene)},
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
