"""Build in Blender 4.2 or newer the shot that shot.json and scene.json, beside this file, describe.

    blender --python shot.py                             opens it as a scene of its own
    blender --background --python shot.py -- --save      writes shot.blend

The light is that of scene.py and stands still. The camera has a key frame for each frame of the clip, and the clip
hangs behind it.
"""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix

Json = dict[str, Any]  # of scene.json and shot.json


def _main() -> None:
    folder = Path(__file__).resolve().parent
    build_scene = runpy.run_path(str(folder / "scene.py"))["build_scene"]
    if "--save" in sys.argv:
        bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = build_scene(json.loads((folder / "scene.json").read_text(encoding="utf-8")), folder)
    _move_camera(scene, json.loads((folder / "shot.json").read_text(encoding="utf-8")), folder)
    if "--save" in sys.argv:
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"), relative_remap=True)


def _move_camera(scene: bpy.types.Scene, numbers: Json, folder: Path) -> None:
    """Key frames for the camera, and the clip behind it."""
    camera, frames = scene.camera, numbers["frames"]
    camera.rotation_mode = "QUATERNION"
    scene.render.fps = max(1, round(numbers["frame_rate"]))
    scene.render.fps_base = scene.render.fps / numbers["frame_rate"]
    scene.frame_start, scene.frame_end = 1, max(1, round(frames[-1]))
    previous = None
    for frame, rows, length in zip(frames, numbers["matrices"], numbers["focal_lengths"], strict=True):
        rotation = Matrix(rows).to_quaternion()
        if previous is not None:
            rotation.make_compatible(previous)
        camera.rotation_quaternion = previous = rotation
        camera.keyframe_insert("rotation_quaternion", frame=frame)
        camera.data.lens = length
        camera.data.keyframe_insert("lens", frame=frame)
    _hang_clip(scene, numbers, folder)
    scene.frame_set(1)


def _hang_clip(scene: bpy.types.Scene, numbers: Json, folder: Path) -> None:
    """The clip in place of the still plate, where it lies where it lay."""
    path = (folder / numbers["clip"]).resolve()
    if not path.is_file():
        return
    clip = bpy.data.movieclips.load(str(path))
    clip.frame_start = 1 - numbers["first_frame"]
    for background in scene.camera.data.background_images:
        background.source, background.clip = "MOVIE_CLIP", clip
    _composite_clip_over(scene, clip)


def _composite_clip_over(scene: bpy.types.Scene, clip: bpy.types.MovieClip) -> None:
    """The clip in place of the still plate in what is rendered, too."""
    tree = scene.compositing_node_group if hasattr(scene, "compositing_node_group") else scene.node_tree
    plate = next(node for node in tree.nodes if node.bl_idname == "CompositorNodeImage")
    frames = tree.nodes.new("CompositorNodeMovieClip")
    frames.clip, frames.location = clip, plate.location
    for link in list(plate.outputs["Image"].links):
        tree.links.new(frames.outputs["Image"], link.to_socket)
    tree.nodes.remove(plate)


if __name__ == "__main__":
    _main()
