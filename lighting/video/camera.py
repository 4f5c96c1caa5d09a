"""A shot as a scene for Blender or USD: a camera with key frames, a still sun, the map without its disc.

The scene is that of the shot's first frame, as `lighting scene` writes it; beside it lies what moves the camera. In
USD `shot.usda` lays time samples over `scene.usda`; in Blender `shot.py` builds `scene.py`'s scene and sets key frames.
"""

import json
import os
from collections.abc import Iterable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.files import replacing
from lighting.geometry import Floats, camera_axes
from lighting.photo import Photo
from lighting.scene import APERTURE_UNIT, Scene, make_scene, to_z_up, write_scene
from lighting.video.records import light_of
from lighting.video.shot import Shot

STAGE, SCRIPT, NUMBERS = "shot.usda", "shot.py", "shot.json"


def write_shot(
    shot: Shot, plate: NDArray[np.uint8], tool: str, folder: Path, clip: str, frame_rate: float
) -> tuple[str, ...]:
    """Write a shot's scene for blender or usd to a folder, replacing a scene that is there; the scene's warnings.

    `plate` (h, w, 3) is the shot's first frame, `clip` the file's name. Raises SceneError where it cannot be written.
    """
    height, width = plate.shape[:2]
    scene = make_scene(Photo(plate, width, height, "PNG"), light_of(shot))
    scene = replace(scene, lit_ground=np.ones_like(scene.lit_ground))  # the first frame's would not move with the rest
    write_scene(scene, tool, folder, overwrite=True)
    rate = frame_rate or 30.0
    matrices = camera_matrices(shot, scene)
    codes, lenses = (shot.path.time - shot.path.time[0]) * rate, scene.focal_length * shot.zoom
    if tool == "usd":
        _write(folder / STAGE, _stage(matrices, lenses / APERTURE_UNIT, codes, rate))
        return scene.warnings
    numbers = {
        "clip": os.path.relpath(clip, folder),
        "first_frame": int(shot.frames[0]),
        "frame_rate": rate,
        "frames": [round(float(c) + 1.0, 4) for c in codes],
        "matrices": np.round(_z_up(matrices), 7).tolist(),
        "focal_lengths": np.round(lenses, 4).tolist(),
    }
    _write(folder / NUMBERS, json.dumps(numbers) + "\n")
    script = files("lighting") / "video" / "data" / "blender_shot.py"
    _write(folder / SCRIPT, script.read_text(encoding="utf-8"))
    return scene.warnings


def _write(path: Path, text: str) -> None:
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def camera_matrices(shot: Shot, scene: Scene) -> Floats:
    """Camera to world (N, 4, 4) for column vectors, in the scene's frame."""
    matrices = np.tile(np.eye(4), (len(shot.frames), 1, 1))
    path = shot.path
    for matrix, *angle in zip(matrices, path.heading, path.elevation, path.roll, strict=True):
        right, up, forward = camera_axes(*map(float, angle))
        matrix[:3] = np.stack([right, up, -forward, scene.camera_position], axis=1)
    return matrices


def _z_up(matrices: Floats) -> Floats:
    turned = matrices.copy()
    turned[:, :3] = np.swapaxes(to_z_up(np.swapaxes(matrices[:, :3], 1, 2)), 1, 2)
    return turned


def _stage(matrices: Floats, lenses: Floats, codes: Floats, rate: float) -> str:
    samples = _samples(codes, map(_rows, matrices))
    lens = _samples(codes, (f"{length:.6g}" for length in lenses))
    return f"""#usda 1.0
(
    defaultPrim = "World"
    endTimeCode = {codes[-1]:.6g}
    framesPerSecond = {rate:.6g}
    metersPerUnit = 1
    renderSettingsPrimPath = "/Render/Settings"
    startTimeCode = 0
    subLayers = [@./scene.usda@]
    timeCodesPerSecond = {rate:.6g}
    upAxis = "Y"
)

over "World"
{{
    over "Camera"
    {{
        float focalLength.timeSamples = {{
{lens}
        }}
        matrix4d xformOp:transform.timeSamples = {{
{samples}
        }}
    }}
}}
"""


def _samples(codes: Floats, values: Iterable[str]) -> str:
    return "\n".join(f"            {code:.6g}: {value}," for code, value in zip(codes, values, strict=True))


def _rows(matrix: Floats) -> str:
    """A matrix (4, 4) for column vectors as USD writes it: rows of row vectors."""
    rows = (", ".join(f"{float(v) + 0.0:.9g}" for v in row) for row in matrix.T)
    return f"( {', '.join(f'({row})' for row in rows)} )"
