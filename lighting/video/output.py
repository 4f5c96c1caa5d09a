"""What `lighting video` writes: a record a frame, a map a shot, and on request scenes, a map a frame and a film.

Records are written as shots end, under the name lighting.jsonl.part, which becomes lighting.jsonl when the clip is
over: what was finished before an interruption stays.

A scene is that of the shot's first frame, as `lighting scene` writes it. Beside it lies what moves the camera, as the
tool's entry of EXPORTERS has it; the sun stands still, and the map has no disc.

All maps of a shot show its light, and the place as the same frame shows it, with the same detail, so that nothing
changes from one to the next. That frame was kept while the clip was read, or it is decoded again, by a second reader
that follows the first. The picture behind a scene's camera is read so, too, in full size.

The film is the clip with its light drawn in: the horizon, the sun or an arrow to it, and three balls lit as the place
is.
"""

import json
import os
import re
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture

from lighting.color import Curve, luminance
from lighting.envmap.latlong import Image
from lighting.envmap.relighting import radiance_gain, rotate_envmap, rotate_lighting, scale_exposure
from lighting.envmap.render import add_sun, cap_map, render
from lighting.envmap.surroundings import PhotoContext, render_view
from lighting.errors import ErrorCode, SceneError, VideoError
from lighting.files import atomic_write, escape_undecodable, is_own_map, write_envmap, write_file
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, camera_axes, wrap_azimuth
from lighting.light_probe import compute_light_probe
from lighting.map_options import DEFAULT_MAP, MAX_WHOLE_HEIGHT, Around, MapOptions, check_height
from lighting.model import Model
from lighting.photo.reader import Photo, photo_from_array
from lighting.photo_estimate import RenderedMap, render_map
from lighting.prediction import photo_segments
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
from lighting.scene import EXPORTERS
from lighting.scene.records import CameraMotion, Scene, make_scene
from lighting.scene.writer import write_scene
from lighting.tracing import trace_step
from lighting.video.decode import VIEW_SIDE, Clip, Frame, local_address
from lighting.video.framing import ClipForm
from lighting.video.observation import NETWORK_INTERVAL
from lighting.video.shot import FrameLight, Shot, analyze_shots, frame_lights, lighting_in_frame, shot_lighting
from lighting.video.tracking import ClipMetadata

FILM_SIDE = 768  # pixels of the longer side
BALL_STEP = 6.0  # deg of heading between renderings of the balls; between them they are blended
FILM_MAP_HEIGHT = 128  # rows of the map that lights the balls
_TIME_BASE = 90_000  # 1/s, of the film's times
_FONT_SIZE, _LINE_HEIGHT = 17, 1.3  # of the font, pixels; of a line, in sizes of the font
_MARGIN = 12  # pixels between the balls and the picture's edges
_GAP = "   "  # between words
_LONGEST_TEXT = ("00000.0 s", "sun +000.0°, 00.0° high", "heading 000.0° (bridged)")


@dataclass(frozen=True, eq=False)
class _ShotSky:
    """What a shot's film shows of the place."""

    image: Image
    """(FILM_MAP_HEIGHT, 2 FILM_MAP_HEIGHT, 3) linear, without the sun's disc, as the shot's first frame exposes it."""
    heading: float
    """Of the camera that sees it, deg from azimuth 0 of the shot."""


@dataclass(frozen=True)
class _Balls:
    """The balls in the shot's light for cameras at multiples of BALL_STEP, rendered when they are needed."""

    size: tuple[int, int]
    pictures: dict[tuple[int, int], NDArray[np.float32]]
    skies: Mapping[int, _ShotSky]

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
            unexposed = scale_exposure(lighting, np.full(3, 1 / luminance(light.gain)))
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


def _film_frames(
    clip: Clip, lights: Mapping[int, FrameLight], skies: Mapping[int, _ShotSky]
) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Times [s] and pictures (h, w, 3) of a clip, the lights of its frames drawn in; others stay as they are."""
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
    panel = Picture.fromarray(display_srgb(balls * np.float32(luminance(light.gain))))
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
    """What is told of a frame, none longer than that of _LONGEST_TEXT."""
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


@contextmanager
def _read_frames(path: Path, side: int, form: ClipForm) -> Iterator[Callable[[int], NDArray[np.uint8] | None]]:
    """A second reader of a clip, opened at the first frame that is asked for; each must be later than the one before.

    It returns pixels (h, w, 3) sRGB, the longer side `side` at most; None where the clip ends before.
    """
    wanted = set[int]()

    def follow() -> Generator[Frame, None, None]:
        with Clip(path, side, form=form) as clip:
            yield from clip.frames(wanted)

    with closing(follow()) as frames:

        def read(index: int) -> NDArray[np.uint8] | None:
            wanted.add(index)
            frame = next(frames, None)
            return None if frame is None else frame.pixels

        yield read


def _map_shot(
    shot: Shot, clip: Clip, read_again: Callable[[int], NDArray[np.uint8] | None], model: Model, options: MapOptions
) -> "_ShotMap":
    """What a shot's maps show: the place as one frame shows it, which is read again unless the open clip kept it."""
    view, pixels = None if options.around == Around.PLAIN else shot.view, None
    if view is not None:
        frame = int(shot.frames[view.index])
        pixels = clip.kept_pixels(frame)
        pixels = read_again(frame) if pixels is None else pixels
    if view is None or pixels is None:
        return _ShotMap(replace(shot, view=None), None, options)
    light = lighting_in_frame(shot, view.index, scale_exposure(shot_lighting(shot), shot.gains[view.index]))
    photo, detail = photo_from_array(pixels), options.around != Around.PHOTO
    with trace_step("network"):
        segments = photo_segments(model.predict_one(photo).segments, photo.width, photo.height)
    context = PhotoContext(pixels, view.coarse_panorama, light.exposure, light, segments, detail=detail)
    return _ShotMap(shot, context, options)


@dataclass(frozen=True, eq=False)
class _ShotMap:
    """The light of a shot, and what its maps show."""

    shot: Shot
    """A solved one, without a view where its maps show sky and ground alone."""
    context: PhotoContext | None
    """By the frame of its view; None without one."""
    view: MapOptions
    """Of OutputOptions."""

    @property
    def heading(self) -> float:
        """Of the camera that the place is seen by, deg from azimuth 0; of sky and ground alone it is 0."""
        return 0.0 if self.shot.view is None else float(self.shot.path.heading[self.shot.view.index])

    def render_world(self) -> RenderedMap:
        """Render the map with true north at its center, or else the first frame's heading, and the light so."""
        light = self.light
        north = light.camera_heading or 0.0
        yaw, adjusted = float(wrap_azimuth(north + self.heading)), DEFAULT_MAP.adjustments  # the light is already
        rendered = render_map(self._light_seen, replace(self.view, adjustments=adjusted, yaw=yaw), self.context)
        return replace(rendered, lighting=rotate_lighting(light, north) if north else light)

    @cached_property
    def light(self) -> Lighting:
        """The shot's light as the user adjusts it, for its first camera."""
        return shot_lighting(self.shot, self.view.adjustments)

    def frame_lights(self, number: int) -> Iterator[FrameLight]:
        """The records of the frames, their light probes those of light and place; shots are numbered from 1."""
        view = self.view
        probe = compute_light_probe(self._light_seen, self.context, sun=view.sun, yaw=self.heading)
        return frame_lights(self.shot, number, view.adjustments, view.sun, probe.coefficients)

    @cached_property
    def sky(self) -> Image:
        """What `render_sky` returns at the height of the maps."""
        return self.render_sky(self.view.height)

    def render_sky(self, height: int) -> Image:
        """Render the map (H, 2H, 3) as the camera at `heading` sees it, without the sun's disc.

        Args:
            height: H, rows of the map.
        """
        return render_view(self._light_seen, height, sun=self.view.sun, context=self.context, disc=False)[0]

    def render_frame(self, frame: FrameLight) -> Image:
        """Render the map (H, 2H, 3) of one frame.

        Args:
            frame: its light.
        """
        light = frame.lighting
        if self.context is None:
            return render(light, self.view.height, sun=self.view.sun)
        gain = np.asarray(radiance_gain(light, np.array(frame.gain)), dtype=np.float32)
        image = rotate_envmap(self.sky, self.heading - (light.relative_heading or 0.0)) * gain
        cap_map(image, light)
        if light.sun_painted if self.view.sun is None else self.view.sun:
            add_sun(image, light)
        return image

    @cached_property
    def _light_seen(self) -> Lighting:
        """The light as the camera at `heading` sees it."""
        shot = self.shot
        return self.light if shot.view is None else lighting_in_frame(shot, shot.view.index, self.light)


RECORDS_FILE, PARTIAL_FILE, FILM_FILE, FRAMES_FOLDER = "lighting.jsonl", "lighting.jsonl.part", "preview.mp4", "frames"
_SHOT_MAP_NAME, _FRAME_MAP_NAME = re.compile(r"shot-\d+\.exr"), re.compile(r"\d{6,}\.exr")
MAX_PLATE_SIDE = 3840  # pixels that a scene's plate has along its longer side at most


@dataclass(frozen=True)
class OutputOptions:
    """What to write beside the records. Maps of over 4096 rows are a ParameterError."""

    view: MapOptions = DEFAULT_MAP
    """Of the maps: height, sun, what is around, and adjustments as the shot's first camera sees the light."""
    tool: str | None = None
    """One of `animated_tools`."""
    frames_exr: bool = False
    """A map a frame."""
    film: bool = False
    """Whether the clip is drawn with its light."""

    def __post_init__(self) -> None:
        check_height(self.view.height, MAX_WHOLE_HEIGHT)


@dataclass
class VideoResult:
    """What became of a clip."""

    shots: list[Shot | VideoError] = field(default_factory=list)
    """Each shot, or why it has no answer."""
    damage: str = ""
    """A sentence, where part of the clip was lost."""
    scene_warnings: dict[int, tuple[str, ...]] = field(default_factory=dict)
    """Of scenes, the light's too: sentences for people, by the number of the shot, from 1."""
    removed: tuple[str, ...] = ()
    """Maps of an earlier run that were removed, relative to the folder."""

    @property
    def failed(self) -> bool:
        """Whether something of the clip has no answer."""
        return bool(self.damage) or any(isinstance(shot, VideoError) for shot in self.shots)

    @property
    def lights(self) -> list[Lighting]:
        """The lights of the shots that have one."""
        return [shot_lighting(shot) for shot in self.shots if isinstance(shot, Shot)]

    def warnings(self, number: int) -> tuple[str, ...]:
        """Return the warnings of a shot and of its scene.

        Args:
            number: the shot, counted from 1.
        """
        shot = self.shots[number - 1]
        of_light = () if isinstance(shot, VideoError) else shot_lighting(shot).warnings
        return self.scene_warnings.get(number, of_light)


@dataclass(frozen=True)
class VideoJob:
    """A clip, where its light goes, and what is known."""

    source: Path
    """The clip's file."""
    folder: Path
    """Of the results."""
    user_input: UserInput = field(default_factory=UserInput)
    """What the user states of the clip."""
    every: float = NETWORK_INTERVAL
    """Seconds between the frames that the network sees."""
    options: OutputOptions = field(default_factory=OutputOptions)
    """What is written."""
    curve: Curve | None = None
    """By which the clip is coded; None: as its files say."""


def process_video(job: VideoJob, model: Model, progress: Callable[[float], object] | None = None) -> VideoResult:
    """Process a clip and write all that the job asks for.

    Args:
        job: the clip, its folder, what is known and what to write.
        model: the network.
        progress: called with the time [s] of each frame; None is not called.

    Raises:
        VideoError: the clip cannot be read.
        MissingExtraError: PyAV or OpenCV is not installed.
        ModelError: the network fails.
        SceneError: a scene cannot be written.
        EnvironmentMapError: a map cannot be written.
        ParameterError: the user's time and place are of night.
        OSError: a file cannot be read or written.
    """
    result, lights, skies = VideoResult(), dict[int, FrameLight](), dict[int, _ShotSky]()
    scene_error: SceneError | VideoError | OSError | None = None  # is raised when the records are whole
    name, options, view = escape_undecodable(str(job.source)), job.options, job.options.view
    with Clip(job.source, curve=job.curve) as clip:
        ClipMetadata.of_clip(clip, job.user_input).prior_at(0.0)  # what cannot be is refused before anything is written
        job.folder.mkdir(exist_ok=True)
        lettered = replace(clip.form, overlay=None)
        with (
            (job.folder / PARTIAL_FILE).open("w", encoding="utf-8") as lines,
            _read_frames(job.source, VIEW_SIDE, clip.form) as read_view,
            _read_frames(job.source, MAX_PLATE_SIDE, lettered) as read_plate,
        ):
            for number, shot in enumerate(analyze_shots(clip, model, job.user_input, job.every, progress), 1):
                result.shots.append(shot)
                if isinstance(shot, VideoError):
                    error = escape_undecodable(str(shot))
                    lines.write(json.dumps({"file": name, "shot": number, "error": error}) + "\n")
                    continue
                shot_map = _map_shot(shot, clip, read_view, model, view)
                of_shot = list(shot_map.frame_lights(number))
                lines.writelines(light.to_line(name) + "\n" for light in of_shot)
                lines.flush()
                lights |= {light.frame: light for light in of_shot}
                shot_map.render_world().write(job.folder / f"shot-{number}.exr")
                if options.frames_exr:
                    _write_frame_maps(job, shot_map, of_shot)
                if options.tool is not None and scene_error is None:
                    try:
                        if (plate := read_plate(int(shot.frames[0]))) is not None:
                            result.scene_warnings[number] = _write_scene(job, number, shot_map, plate, clip)
                    except (SceneError, VideoError, OSError) as error:
                        scene_error = error.with_traceback(None)  # which would keep the map
                if options.film and shot_map.context is not None:
                    skies[number] = _ShotSky(shot_map.render_sky(FILM_MAP_HEIGHT), shot_map.heading)
                del shot_map  # which holds a map as large as those written
        result.damage = clip.damage
    (job.folder / PARTIAL_FILE).replace(job.folder / RECORDS_FILE)
    if scene_error is not None:
        raise scene_error
    if options.film:
        with Clip(job.source, FILM_SIDE, form=lettered) as clip, atomic_write(job.folder / FILM_FILE) as film:
            _encode(_film_frames(clip, lights, skies), clip.info.frame_rate, film)
    result.removed = _remove_old_maps(job, result, set(lights))
    return result


def _write_frame_maps(job: VideoJob, shot_map: _ShotMap, lights: Sequence[FrameLight]) -> None:
    """Write a map a frame; all show the same place."""
    folder = job.folder / FRAMES_FOLDER
    folder.mkdir(exist_ok=True)
    for light in lights:
        with trace_step("map"):
            picture = shot_map.render_frame(light)
        with trace_step("encode"):
            write_envmap(folder / f"{light.frame:06d}.exr", picture, light.lighting, probe=light.probe)


def _remove_old_maps(job: VideoJob, result: VideoResult, frames: set[int]) -> tuple[str, ...]:
    """Remove the maps of an earlier run that this one has not replaced; returns their names in the folder.

    Each says in its header that it is ours.
    """
    shots = {f"shot-{number}.exr" for number, shot in enumerate(result.shots, 1) if isinstance(shot, Shot)}
    written = {f"{frame:06d}.exr" for frame in frames if job.options.frames_exr}
    named = [p for p in job.folder.glob("shot-*.exr") if _SHOT_MAP_NAME.fullmatch(p.name)]
    named += [p for p in (job.folder / FRAMES_FOLDER).glob("*.exr") if _FRAME_MAP_NAME.fullmatch(p.name)]
    old = [p for p in sorted(named) if p.name not in shots | written and p.is_file() and not p.is_symlink()]
    old = [path for path in old if is_own_map(path.open("rb"))]
    for path in old:
        path.unlink()
    with suppress(OSError):  # it holds files that are none of ours, or is not there
        (job.folder / FRAMES_FOLDER).rmdir()
    return tuple(path.relative_to(job.folder).as_posix() for path in old)


@trace_step("encode")
def _write_scene(
    job: VideoJob, number: int, shot_map: _ShotMap, plate: NDArray[np.uint8], clip: Clip
) -> tuple[str, ...]:
    """Write a shot's scene, replacing one that is there; the scene's warnings.

    `plate` (h, w, 3) is the shot's first frame. Raises SceneError where it cannot be written, and for a tool whose
    cameras stand still.
    """
    tool = job.options.tool
    animate = EXPORTERS[tool].animate if tool in EXPORTERS else None
    if tool is None or animate is None:
        raise SceneError(f"There is no scene with a moving camera for {tool!r}.", "tool", ErrorCode.UNKNOWN)
    height, width = plate.shape[:2]
    shot, view, folder = shot_map.shot, job.options.view, job.folder / f"shot-{number}-{tool}"
    scene = make_scene(Photo(plate, width, height, "PNG"), shot_map.light, map_height=view.height, sun=view.sun)
    scene = replace(scene, lit_ground=np.ones_like(scene.lit_ground))  # the first frame's would not move with the rest
    if shot_map.context is not None:
        scene = replace(scene, environment=rotate_envmap(shot_map.sky, shot_map.heading))
    write_scene(scene, tool, folder, overwrite=True)
    rate = clip.info.frame_rate or 30.0
    behind = os.path.relpath(job.source, folder) if clip.form.crop is None else ""  # with a border it would lie askew
    matrices, focal_lengths = _camera_matrices(shot, scene), scene.focal_length * shot.zoom
    frames, first_frame = (shot.path.time - shot.path.time[0]) * rate, int(shot.frames[0])
    motion = CameraMotion(matrices, focal_lengths, frames, rate, first_frame, behind)
    for name, text in animate(motion).items():
        write_file(folder / name, text.encode())
    return scene.warnings


def _camera_matrices(shot: Shot, scene: Scene) -> Floats:
    """Camera to world (N, 4, 4) for column vectors, in the scene's frame."""
    matrices = np.tile(np.eye(4), (len(shot.frames), 1, 1))
    path = shot.path
    for matrix, *angle in zip(matrices, path.heading, path.elevation, path.roll, strict=True):
        right, up, forward = camera_axes(*map(float, angle))
        matrix[:3] = np.stack([right, up, -forward, scene.camera_position], axis=1)
    return matrices
