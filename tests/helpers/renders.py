"""Renders of scenes by the tools that they are for, and what they show."""

import shutil
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from benchmarks.scene_measures import Picture, shadow_azimuth
from lighting.geometry import Floats, wrap_azimuth
from lighting.scene.records import Scene, make_placeholder
from lighting.scene.writer import write_scene
from tests.helpers.engines import run_in_chroot
from tests.helpers.pages import ROOT

_RENDER = ROOT / "tests" / "godot" / "render.gd"
_WINDOW = "xvfb-run -a -s '-screen 0 1024x768x24' godot --audio-driver Dummy --script render.gd -- "


def render_in_godot(scene: Scene, folder: Path, *names: str) -> dict[str, NDArray[np.float32]]:
    """The pictures of tests/godot/render.gd by their names, linear (h, w, 3).

    Args:
        scene: made by `make_scene`.
        folder: new or empty, of `folder_in_chroot`.
        names: of the pictures.
    """
    write_scene(scene, "godot", folder, overwrite=True)
    shutil.copy(_RENDER, folder)
    run_in_chroot(folder, "godot --headless --import > import.log 2>&1; " + _WINDOW + " ".join(names))
    return {name: OpenEXR.File(str(folder / f"{name}.exr")).channels()["RGB"].pixels for name in names}


def shadow_error(scene: Scene, pixels: Floats) -> float:
    """How far [deg] the direction in which the stick's shadow points is from the scene's.

    Args:
        scene: that was rendered.
        pixels: (h, w, 3) of level ground with the placeholder, linear; relative to the plate where it is no plain one.
    """
    placeholder = make_placeholder(scene)
    expected = float(wrap_azimuth(scene.lighting.sun_azimuth + 180.0))
    length = placeholder.stick_height / np.tan(np.radians(scene.lighting.sun_elevation))
    camera = (scene.vertical_fov, scene.lighting.camera_elevation, scene.lighting.camera_roll, scene.camera_position)
    ball, foot = scene.spot + placeholder.ball_center, scene.spot + placeholder.stick_foot
    reach = (0.3 * length, 0.9 * length)
    picture = Picture(pixels, *camera, ball, placeholder.ball_radius, foot, reach, np.zeros((0, 4)))
    return float(wrap_azimuth(shadow_azimuth(picture, expected) - expected))
