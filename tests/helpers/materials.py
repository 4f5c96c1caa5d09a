"""What readers of the book's pages bring along, made small under the names that the pages use."""

import shutil
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Literal

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

from benchmarks.scene_measures import Picture, shadow_azimuth
from lighting.geometry import Floats, wrap_azimuth
from lighting.probe.alignment import yaw_rotation
from lighting.probe.develop import Moment
from lighting.probe.fisheye import make_lens
from lighting.scene.records import Scene
from lighting.scene.writer import write_scene
from lighting.stereo.light_vectors import clear_skies, sun_directions
from lighting.stereo.normal_search import Pose
from tests.helpers.brackets import SKY_DAY, BracketCamera, clear_sky_at, expose_bracket, photograph_sky
from tests.helpers.clips import write_clip
from tests.helpers.engines import run_in_chroot
from tests.helpers.pages import ROOT
from tests.helpers.photos import plain_dng, taken, write_png16
from tests.helpers.skies import ball, photos

PHOTO = Path("examples/wide_street.jpg")  # in the reader's folder
PLACE = (47.0, 8.0)  # deg, of the page on skies
RELIEF_PLACE = (47.5, 9.75)  # deg, of the page on normals
EXPOSURES = (1 / 8000, 1 / 90, 1.0)  # s
RATE = 15  # frames a second


def write_shot(path: Path) -> None:
    """Write two seconds of a camera that pans over a photo."""
    picture = np.asarray(Image.open(PHOTO).convert("RGB").resize((480, 360)))
    frames = [np.ascontiguousarray(picture[40:220, 4 * i : 4 * i + 320]) for i in range(2 * RATE)]
    write_clip(path, frames, times=[i / RATE for i in range(len(frames))])


def write_views(folder: Path) -> None:
    """Write what a camera sees that turns to the right: two halves of a photo that overlap."""
    photo = Image.open(PHOTO).convert("RGB")
    for name, left in (("left.jpg", 0.0), ("right.jpg", 0.3)):
        photo.crop((int(left * photo.width), 0, int((left + 0.7) * photo.width), photo.height)).save(folder / name)


def write_unsure_photo(folder: Path) -> None:
    """Write one in which the sun may be in two places."""
    Image.open("examples/garden_windows.jpg").resize((800, 600)).save(folder / "photo.jpg")


def write_clips(folder: Path) -> None:
    write_shot(folder / "shot.mp4")
    (folder / "drone.mp4").write_bytes((folder / "shot.mp4").read_bytes())


def write_uploads(folder: Path) -> None:
    write_shot(folder / "clip.mp4")
    (folder / "other.jpg").write_bytes(PHOTO.read_bytes())


def write_service_files(folder: Path) -> None:
    write_uploads(folder)
    write_views(folder)


def expose_sky(kind: Literal["equidistant", "ball"], time: datetime) -> list[np.ndarray]:
    """Exposures (H, W, 3) of a clear sky from 0 to 1, the shortest first."""
    sky = clear_sky_at(Moment(time, *PLACE))
    picture = photograph_sky(sky, make_lens(kind, 160, 160), yaw_rotation(40.0))
    return [photo.pixels for photo in expose_bracket(picture, BracketCamera(14), np.random.default_rng(0), EXPOSURES)]


def write_skies(folder: Path) -> None:
    """Write a bracket of a fisheye as DNG, one of a ball, and three brackets of a day."""
    for i, pixels in enumerate(expose_sky("equidistant", SKY_DAY)):
        write_raw(folder / f"exposure_{i}.dng", pixels, EXPOSURES[i])
    for i, pixels in enumerate(expose_sky("ball", SKY_DAY)):
        write_exposure(folder / f"ball_{i}.png", pixels, EXPOSURES[i], SKY_DAY)
    for hours in (0, 3, 6):
        time = SKY_DAY + timedelta(hours=hours)
        bracket = folder / "day" / f"{hours}"
        bracket.mkdir(parents=True)
        for i, pixels in enumerate(expose_sky("equidistant", time)):
            write_exposure(bracket / f"{i}.png", pixels, EXPOSURES[i], time)


def write_exposure(path: Path, pixels: np.ndarray, seconds: float, time: datetime) -> None:
    """Write a picture from 0 to 1 as 16-bit PNG with EXIF of its exposure and time (UTC)."""
    write_png16(path, np.rint(65535 * pixels).astype(np.uint16), taken(seconds, format_local(time)))


def format_local(time: datetime) -> str:
    """A time (UTC) as EXIF has it, by summer time."""
    return f"{time + timedelta(hours=2):%Y:%m:%d %H:%M:%S}"


def write_raw(path: Path, pixels: np.ndarray, seconds: float) -> None:
    """Write a picture as a mosaic of red, green, green and blue, with EXIF of its exposure."""
    mosaic = pixels[..., 1].copy()
    mosaic[::2, ::2], mosaic[1::2, 1::2] = pixels[::2, ::2, 0], pixels[1::2, 1::2, 2]
    path.write_bytes(plain_dng(65535 * mosaic, 65535, taken(seconds, format_local(SKY_DAY))))


def write_day(folder: Path) -> None:
    """Write photos of a ball every ninety minutes, and a mask."""
    (day := folder / "day").mkdir()
    times = np.datetime64("2024-06-21T06:00:00") + np.arange(8) * np.timedelta64(90, "m")
    normals, mask, _ = ball()
    images = photos(normals, mask, clear_skies(sun_directions(times, *RELIEF_PLACE)), Pose(heading=10.0))
    for i, (image, time) in enumerate(zip(images, times.tolist(), strict=True)):
        write_exposure(day / f"{i}.png", np.clip(image, 0, 1), 0.01, time)
    Image.fromarray((255 * mask).astype(np.uint8)).save(day / "mask.png")


MATERIALS: dict[str, Callable[[Path], None]] = {  # by page
    "docs/do/correct-the-sun.md": write_unsure_photo,
    "docs/do/clips.md": write_clips,
    "docs/do/measure-a-sky.md": write_skies,
    "docs/do/photometric-stereo.md": write_day,
    "docs/do/run-the-service.md": write_service_files,
    "docs/do/several-photos.md": write_views,
    "docs/reference/http.md": write_uploads,
}


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
    placeholder = scene.placeholder
    expected = float(wrap_azimuth(scene.lighting.sun_azimuth + 180.0))
    length = placeholder.stick_height / np.tan(np.radians(scene.lighting.sun_elevation))
    camera = (scene.vertical_fov, scene.lighting.camera_elevation, scene.lighting.camera_roll, scene.camera_position)
    ball, foot = scene.spot + placeholder.ball_center, scene.spot + placeholder.stick_foot
    reach = (0.3 * length, 0.9 * length)
    picture = Picture(pixels, *camera, ball, placeholder.ball_radius, foot, reach, np.zeros((0, 4)))
    return float(wrap_azimuth(shadow_azimuth(picture, expected) - expected))
