"""A clip with its light drawn in: the horizon, the sun or an arrow to it, and three balls lit as the place is."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture

from lighting.color import luminance
from lighting.envmap.latlong import Image
from lighting.envmap.relighting import rotate_envmap, scale_exposure
from lighting.envmap.render import add_sun, render
from lighting.files import atomic_write
from lighting.geometry import wrap_azimuth
from lighting.preview.drawing import (
    SUN,
    WHITE,
    TextStyle,
    display_srgb,
    draw_horizon,
    draw_sun,
    draw_text,
    rounded_mask,
    text_width,
)
from lighting.preview.spheres import render_spheres
from lighting.records import Lighting
from lighting.tracing import trace_step
from lighting.video.decode import Clip, local_address
from lighting.video.shot import FrameLight

FILM_SIDE = 768  # pixels of the longer side
BALL_STEP = 6.0  # deg of heading between renderings of the balls; between them they are blended
FILM_MAP_HEIGHT = 128  # rows of the map that lights the balls
_TIME_BASE = 90_000  # 1/s, of the film's times
_FONT_SIZE, _LINE_HEIGHT = 17, 1.3  # of the font, pixels; of a line, in sizes of the font
_MARGIN = 12  # pixels between the balls and the picture's edges
_GAP = "   "  # between words
_LONGEST_TEXT = ("00000.0 s", "sun +000.0°, 00.0° high", "heading 000.0° (bridged)")


@dataclass(frozen=True, eq=False)
class ShotSky:
    """What a shot's film shows of the place."""

    image: Image
    """(FILM_MAP_HEIGHT, 2 FILM_MAP_HEIGHT, 3) linear, without the sun's disc, as the shot's first frame exposes it."""
    heading: float
    """Of the camera that sees it, deg from azimuth 0 of the shot."""


@dataclass(frozen=True)
class _Balls:
    """The balls in the shot's light for cameras at multiples of STEP, rendered when they are needed."""

    size: tuple[int, int]
    pictures: dict[tuple[int, int], NDArray[np.float32]]
    skies: Mapping[int, ShotSky]

    def at(self, light: FrameLight) -> NDArray[np.float32]:
        """Linear (h, w, 3), blended between the two nearest headings."""
        step = (light.lighting.relative_heading or 0.0) / BALL_STEP
        low = int(np.floor(step))
        share = np.float32(step - low)
        first, second = (self._rendered(light, low + step) for step in (0, 1))
        return (1 - share) * first + share * second

    def _rendered(self, light: FrameLight, step: int) -> NDArray[np.float32]:
        step %= round(360.0 / BALL_STEP)
        if (light.shot, step) not in self.pictures:
            lighting = light.lighting
            rotation = step * BALL_STEP - (lighting.relative_heading or 0.0)
            azimuth = (lighting.sun_azimuth - rotation + 180.0) % 360.0 - 180.0
            unexposed = scale_exposure(lighting, np.full(3, 1 / _gain(light)))
            turned = replace(unexposed, sun_azimuth=azimuth, camera_elevation=-8.0)
            image = self._render_map(light.shot, turned, step * BALL_STEP)
            linear = render_spheres(image, turned, *self.size, supersampling=2)
            self.pictures[light.shot, step] = linear.reshape(self.size[1], 2, self.size[0], 2, 3).mean(axis=(1, 3))
        return self.pictures[light.shot, step]

    def _render_map(self, shot: int, lighting: Lighting, heading: float) -> Image:
        """The map (H, 2H, 3) that a camera at a heading [deg] sees."""
        if shot not in self.skies:
            return render(lighting, FILM_MAP_HEIGHT)
        sky = self.skies[shot]
        image = rotate_envmap(sky.image, sky.heading - heading)
        if lighting.sun_painted:
            add_sun(image, lighting)
        return image


def _gain(light: FrameLight) -> float:
    return float(luminance(light.gain))


def write_film(
    source: Path, lights: Mapping[int, FrameLight], target: Path, skies: Mapping[int, ShotSky] | None = None
) -> None:
    """Write a clip with its light drawn in, as H.264 in MP4; frames without a light stay as they are.

    Args:
        source: the clip.
        lights: of frames by their index.
        target: the film, replaced at the end.
        skies: what the balls show of the place, by the shots' numbers; None: sky and ground alone.

    Raises:
        VideoError: the clip cannot be read.
        OSError: the film cannot be written.
    """
    with Clip(source, FILM_SIDE) as clip, atomic_write(target) as temporary:
        _encode(_film_frames(clip, lights, skies or {}), clip.info.frame_rate, temporary)


def _film_frames(
    clip: Clip, lights: Mapping[int, FrameLight], skies: Mapping[int, ShotSky]
) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    balls: _Balls | None = None
    for frame in clip.frames():
        height, width = (side // 2 * 2 for side in frame.pixels.shape[:2])
        picture = frame.pixels[:height, :width]
        if balls is None:
            width_of_balls = round(0.32 * max(width, height)) if width > height else round(0.6 * width)
            balls = _Balls((width_of_balls, round(width_of_balls * 0.42)), {}, skies)
        light = lights.get(frame.index)
        yield frame.time, picture if light is None else _draw_overlay(picture, light, balls.at(light))


def _draw_overlay(pixels: NDArray[np.uint8], light: FrameLight, balls: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Draw one frame's light into it.

    Args:
        pixels: (h, w, 3) sRGB.
        light: the frame's.
        balls: (H, W, 3) linear, as the shot's first frame exposes them.
    """
    picture = Picture.fromarray(pixels)
    draw_horizon(picture, light.lighting)
    draw_sun(picture, light.lighting)
    panel = Picture.fromarray(display_srgb(balls * np.float32(_gain(light))))
    layout = _fit_layout(picture.width, panel.width)
    picture.paste(panel, (_MARGIN, picture.height - panel.height - layout.below), rounded_mask(panel.size, 10))
    texts, color = _frame_text(light), SUN if light.lighting.sun_shines else WHITE
    style = TextStyle(layout.size, color, anchor="rs", shaded=True)
    for i, line in enumerate(reversed(layout.lines)):
        corner = (picture.width - 14.0, picture.height - 12.0 - i * _LINE_HEIGHT * layout.size)
        draw_text(picture, corner, _GAP.join(texts[k] for k in line), style)
    return np.asarray(picture)


@dataclass(frozen=True)
class _Layout:
    """Where words and balls go, for all frames of a film alike."""

    size: int  # pixels of the font
    lines: tuple[tuple[int, ...], ...]  # which of the words stand in each
    below: int  # pixels under the balls


def _fit_layout(width: int, panel: int) -> _Layout:
    """The layout of a picture and of balls of these widths [pixels]: they share a line where the longest words fit."""
    width_left = width - 28.0
    longest = max(text_width(word, _FONT_SIZE) for word in _LONGEST_TEXT)
    size = max(1, min(_FONT_SIZE, int(_FONT_SIZE * width_left / longest)))
    if text_width(_GAP.join(_LONGEST_TEXT), size) <= width_left - panel - _MARGIN:
        return _Layout(size, (tuple(range(len(_LONGEST_TEXT))),), _MARGIN)
    lines: list[tuple[int, ...]] = []
    for i in range(len(_LONGEST_TEXT)):
        longer = (*lines[-1], i) if lines else (i,)
        fits = text_width(_GAP.join(_LONGEST_TEXT[k] for k in longer), size) <= width_left
        lines = [*lines[:-1], longer] if lines and fits else [*lines, (i,)]
    return _Layout(size, tuple(lines), _MARGIN + round(_LINE_HEIGHT * size * len(lines)))


def _frame_text(light: FrameLight) -> tuple[str, str, str]:
    """What is told of a frame, none longer than that of _LONGEST."""
    lighting = light.lighting
    relative = round(float(wrap_azimuth(lighting.relative_heading or 0.0)), 1)
    absolute = lighting.camera_heading
    heading = f"turned {relative or 0.0:+.1f}°" if absolute is None else f"heading {absolute:.1f}°"
    bridged = " (bridged)" if light.bridged else ""
    sun = f"sun {lighting.sun_azimuth:+.1f}°, {lighting.sun_elevation:.1f}° high"
    return f"{light.time:5.1f} s", sun, heading + bridged


def _encode(pictures: Iterator[tuple[float, NDArray[np.uint8]]], rate: float, target: Path) -> None:
    import av

    codec = next(name for name in ("libx264", "libopenh264", "mpeg4") if name in av.codec.codecs_available)
    with av.open(local_address(target), "w", format="mp4") as film:
        stream: Any = None
        for time, picture in pictures:
            if stream is None:
                stream = film.add_stream(codec, rate=Fraction(rate or 30.0).limit_denominator(1001))
                stream.width, stream.height, stream.pix_fmt = picture.shape[1], picture.shape[0], "yuv420p"
                stream.codec_context.time_base = Fraction(1, _TIME_BASE)
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = round(time * _TIME_BASE), Fraction(1, _TIME_BASE)
            with trace_step("encode"):
                film.mux(stream.encode(frame))
        film.mux(stream.encode())
