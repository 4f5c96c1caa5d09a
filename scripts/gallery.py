"""Pictures of what becomes of example photos: README's, which moves, and those of the gallery.

`python -m scripts.make_pictures` writes them.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import lighting.geometry as geometry
from lighting import Estimate, estimate, read_photo
from lighting.envmap.projection import photo_camera
from lighting.ground import object_radius
from lighting.preview.drawing import WHITE, TextStyle, display_srgb, draw_suns, draw_text, sun_mark_color
from lighting.preview.spheres import (
    SphereScene,
    build_sphere_scene,
    draw_sphere_scene,
    insert_balls,
    limit_elevation,
    sphere_centers,
)

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
GALLERY = (
    "brick_street",
    "rome/noon_steps",
    "meadow_edge",
    "garden_windows",
    "park_evening",
    "snow_field",
    "lake_clouds",
    "beach_evening",
    "shore_dusk",
    "beach_storm",
    "rome/afternoon_square",
    "rome/street_in_shade",
)

_MAP_ROWS = 512
_PHOTO_SIDE = 1600  # pixels, of the photo in which balls stand
_GAP = 6  # pixels between panels
_HEIGHT = 258  # of a row of the gallery
_CLOSE = 9.0  # radii of a ball, the width of a close-up


@dataclass(frozen=True)
class _Look:
    """A photo, its light, and three balls in it."""

    pixels: NDArray[np.uint8]  # (H, W, 3)
    estimate: Estimate
    envmap: NDArray[np.float32]
    scene: SphereScene


def _look_at(photo: Path) -> _Look:
    found = estimate(photo)
    envmap, light = found.envmap(_MAP_ROWS), found.lighting
    centers = sphere_centers(4 / 3, limit_elevation(light))
    return _Look(
        read_photo(photo, target=_PHOTO_SIDE).pixels,
        found,
        envmap,
        build_sphere_scene(envmap, light.sun_direction, centers),
    )


def draw_gallery_row(name: str) -> Image.Image:
    """Return an example's photo, its map and three balls in its light, side by side.

    Args:
        name: of the photo in examples/, without its ending.
    """
    look = _look_at(EXAMPLES / f"{name}.jpg")
    photo = _cut(Image.fromarray(look.pixels), (4 * _HEIGHT // 3, _HEIGHT))
    return _side_by_side([photo, _map_panel(look, _HEIGHT), _close_up(look, (4 * _HEIGHT // 3, _HEIGHT))])


def _cut(picture: Image.Image, size: tuple[int, int]) -> Image.Image:
    """The middle of a picture, in another size."""
    scale = max(size[0] / picture.width, size[1] / picture.height)
    width, height = size[0] / scale, size[1] / scale
    left, top = (picture.width - width) / 2, (picture.height - height) / 2
    return picture.resize(size, Image.Resampling.LANCZOS, (left, top, left + width, top + height))


def _map_panel(look: _Look, height: int) -> Image.Image:
    """The map with the sun."""
    picture = Image.fromarray(display_srgb(look.envmap)).resize((2 * height, height), Image.Resampling.LANCZOS)
    light = look.estimate.lighting
    draw_suns(picture, [geometry.latlong_pixel(light.sun_direction, height)], sun_mark_color(light), 5)
    return picture


def _close_up(look: _Look, size: tuple[int, int]) -> Image.Image:
    """Three balls: on the photo's ground, or on a stage where the photo has no spot for them."""
    light = look.estimate.lighting
    if light.spot_direction is None:
        return Image.fromarray(draw_sphere_scene(look.scene, light, *size))
    picture = insert_balls(Image.fromarray(look.pixels), light, look.scene, look.estimate.segments)
    camera = photo_camera(light, picture.width, picture.height)
    spot = np.array(light.spot_direction)
    x, y = geometry.camera_pixel(spot, camera)
    radius = float(object_radius(camera, np.array(-spot[1] / (spot @ camera.axes[2])), light.camera_height))
    width = min(_CLOSE * radius, picture.width)
    height = min(width * size[1] / size[0], picture.height)
    left = float(np.clip(x - width / 2, 0, picture.width - width))
    top = float(np.clip(y - radius - height / 2, 0, picture.height - height))
    return picture.resize(size, Image.Resampling.LANCZOS, (left, top, left + width, top + height))


def _side_by_side(panels: list[Image.Image]) -> Image.Image:
    width = sum(panel.width + _GAP for panel in panels) - _GAP
    row = Image.new("RGB", (width, panels[0].height), WHITE)
    x = 0
    for panel in panels:
        row.paste(panel, (x, 0))
        x += panel.width + _GAP
    return row


# README's picture: a photo, its map, and a teapot that turns in its light, as in the page's first view.

_MOVING = ROOT / "server" / "web" / "src" / "moving"
_MOVING_FRAMES = 36
_PHOTO_SIZE = (688, 516)
_MAP_HEIGHT = 232
_LETTERS = 20


def draw_moving_picture() -> list[Image.Image]:
    """Return the frames of README's picture."""
    look = _look_at(EXAMPLES / "brick_street.jpg")
    width = 2 * _MAP_HEIGHT
    close = (width, _PHOTO_SIZE[1] - _MAP_HEIGHT - _GAP)
    still = Image.new("RGB", (_PHOTO_SIZE[0] + _GAP + width, _PHOTO_SIZE[1]), WHITE)
    still.paste(_cut(Image.fromarray(look.pixels), _PHOTO_SIZE))
    still.paste(_map_panel(look, _MAP_HEIGHT), (_PHOTO_SIZE[0] + _GAP, close[1] + _GAP))
    frames = []
    for turned in _turning_object(close):
        frame = still.copy()
        frame.paste(turned, (_PHOTO_SIZE[0] + _GAP, 0))
        _label_panels(frame, close[1])
        frames.append(frame)
    return frames


def _label_panels(frame: Image.Image, close_height: int) -> None:
    style, right = TextStyle(_LETTERS, WHITE, anchor="ls", shaded=True), _PHOTO_SIZE[0] + _GAP + 12
    for spot, text in (
        ((12, _PHOTO_SIZE[1] - 14), "your photo"),
        ((right, close_height - 12), "any object, in its light"),
        ((right, _PHOTO_SIZE[1] - 14), "its light all around, in HDR"),
    ):
        draw_text(frame, spot, text, style)


def _turning_object(size: tuple[int, int]) -> list[Image.Image]:
    """The part of the page's moving example around its object, a frame for each step of a turn."""
    photo = Image.open(_MOVING / "street.jpg").convert("RGB")
    strip = Image.open(_MOVING / "teapot.webp").convert("RGB")
    shares = {
        name: float(share) / 100
        for name, share in re.findall(r"(left|top): ([\d.]+)%", (_MOVING / "moving.css").read_text(encoding="utf-8"))
    }
    x, y = round(shares["left"] * photo.width), round(shares["top"] * photo.height)
    height = strip.height // _MOVING_FRAMES
    left = x + strip.width / 2 - size[0] / 2
    top = min(y + height / 2 - size[1] / 2, photo.height - size[1])
    frames = []
    for number in range(_MOVING_FRAMES):
        picture = photo.copy()
        picture.paste(strip.crop((0, number * height, strip.width, (number + 1) * height)), (x, y))
        frames.append(picture.crop((round(left), round(top), round(left) + size[0], round(top) + size[1])))
    return frames
