"""A shot as a scene for another tool: a camera with key frames, a still sun, the map without its disc.

The scene is that of the shot's first frame, as `lighting scene` writes it. Beside it lies what moves the camera, as the
tool's entry of EXPORTERS has it.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ErrorCode, SceneError
from lighting.files import replacing
from lighting.geometry import Floats, camera_axes
from lighting.photo import Photo
from lighting.scene import EXPORTERS, CameraMotion, Scene, make_scene, write_scene
from lighting.video.records import light_of
from lighting.video.shot import Shot


def write_shot(
    shot: Shot, plate: NDArray[np.uint8], tool: str, folder: Path, clip: str, frame_rate: float
) -> tuple[str, ...]:
    """Write a shot's scene to a folder, replacing a scene that is there; the scene's warnings.

    `plate` (h, w, 3) is the shot's first frame, `clip` the file's name. Raises SceneError where it cannot be written,
    and for a tool whose cameras stand still.
    """
    animate = EXPORTERS[tool].animate if tool in EXPORTERS else None
    if animate is None:
        raise SceneError(f"There is no scene with a moving camera for {tool!r}.", "tool", ErrorCode.UNKNOWN)
    height, width = plate.shape[:2]
    scene = make_scene(Photo(plate, width, height, "PNG"), light_of(shot))
    scene = replace(scene, lit_ground=np.ones_like(scene.lit_ground))  # the first frame's would not move with the rest
    write_scene(scene, tool, folder, overwrite=True)
    rate = frame_rate or 30.0
    motion = CameraMotion(
        matrices=camera_matrices(shot, scene),
        focal_lengths=scene.focal_length * shot.zoom,
        frames=(shot.path.time - shot.path.time[0]) * rate,
        frame_rate=rate,
        first_frame=int(shot.frames[0]),
        clip=os.path.relpath(clip, folder),
    )
    for name, text in animate(motion).items():
        with replacing(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return scene.warnings


def camera_matrices(shot: Shot, scene: Scene) -> Floats:
    """Camera to world (N, 4, 4) for column vectors, in the scene's frame."""
    matrices = np.tile(np.eye(4), (len(shot.frames), 1, 1))
    path = shot.path
    for matrix, *angle in zip(matrices, path.heading, path.elevation, path.roll, strict=True):
        right, up, forward = camera_axes(*map(float, angle))
        matrix[:3] = np.stack([right, up, -forward, scene.camera_position], axis=1)
    return matrices
