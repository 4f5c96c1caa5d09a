"""Maps of a shot show one frame of it, and the same place in all."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from lighting.cli import cli
from lighting.color import SRGB_LINEAR
from lighting.envmap.latlong import Image
from lighting.envmap.relighting import rotate_envmap
from lighting.files.exr import read_exr
from lighting.geometry import Pinhole, camera_directions, latlong_pixel
from tests.helpers.clips import SIZE, pan, write_clip


@pytest.fixture(scope="module")
def results(lit_network: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the answers to a clip whose third frame alone is sharp, with detail and without."""
    folder, frames = tmp_path_factory.mktemp("maps"), pan(6, 5.0)
    blurred = [np.asarray(cv2.blur(frame, (3, 3)), dtype=np.uint8) for frame in frames]
    clip = write_clip(folder / "pan.mp4", [*blurred[:2], frames[2], *blurred[3:]])
    options = ("--model", lit_network, "--height", 128, "--every", 0.04, "--no-sun", "--frames-exr", "--fov", 45)
    for name, more in (("detail", ("--for", "blender")), ("plain", ("--no-detail",))):
        arguments = map(str, ("video", clip, "-o", folder / name, *options, *more))
        done = CliRunner().invoke(cli, list(arguments))
        assert done.exit_code == 0, done.output
    return folder


def test_the_map_shows_the_sharpest_frame_where_its_camera_saw_it(results: Path) -> None:
    lines = (results / "detail" / "lighting.jsonl").read_text().splitlines()
    assert [json.loads(line)["in_map"] for line in lines] == [False, False, True, False, False, False]
    assert '"in_map": true' not in (results / "plain" / "lighting.jsonl").read_text()
    camera = json.loads(lines[2])["lighting"]["camera"]
    pose = camera["vertical_fov"], camera["relative_heading"], camera["elevation"], camera["roll"]
    pixel = latlong_pixel(camera_directions(Pinhole(*SIZE, *pose)), 128)
    column, row = np.moveaxis(np.floor(pixel).astype(int), -1, 0)
    shown, plain = (read_exr(results / name / "shot-1.exr")[0][row, column % 256, 1] for name in ("detail", "plain"))
    photo = SRGB_LINEAR[pan(6, 5.0)[2][..., 1]]
    inside = np.s_[30:-30, 30:-30]
    assert np.corrcoef(shown[inside].ravel(), photo[inside].ravel())[0, 1] > 0.8
    assert np.corrcoef(plain[inside].ravel(), photo[inside].ravel())[0, 1] < 0.7


def test_maps_of_frames_and_scene_show_the_same_place(results: Path) -> None:
    world, _ = read_exr(results / "detail" / "shot-1.exr")
    scene, _ = read_exr(results / "detail" / "shot-1-blender" / "environment.exr")
    assert _difference(scene, world) < 0.01
    for line in map(json.loads, (results / "detail" / "lighting.jsonl").read_text().splitlines()):
        seen, _ = read_exr(results / "detail" / "frames" / f"{line['frame']:06d}.exr")
        turned = rotate_envmap(world, -line["lighting"]["camera"]["relative_heading"]) * np.float32(line["gain"])
        assert _difference(seen, turned) < 0.1  # a map that is turned once more is a little softer


def _difference(image: Image, other: Image) -> float:
    return float(np.abs(image - other).mean() / other.mean())
