"""What `lighting video` writes: a record a frame, a map a shot, and on request scenes, a map a frame and a film.

Records are written as shots end, under the name lighting.jsonl.part, which becomes lighting.jsonl when the clip is
over: what was done before an interruption stays.
"""

import json
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

from lighting.envmap import render
from lighting.errors import VideoError
from lighting.evidence import Given
from lighting.files import write_envmap
from lighting.model import Model
from lighting.scene.files import remove_scene
from lighting.video.camera import SHOT_FILES
from lighting.video.clip import Clip
from lighting.video.records import FrameLight, frame_lights, world_map
from lighting.video.run import around, shots_of
from lighting.video.shot import Shot
from lighting.video.watch import EVERY

RECORDS, PART, FILM, FRAMES = "lighting.jsonl", "lighting.jsonl.part", "preview.mp4", "frames"
_SCENE, _FRAME = re.compile(r"shot-\d+-(blender|usd)"), re.compile(r"\d{6,}\.exr")  # names of results
_MAP_OR_FILM = re.compile(r"shot-\d+\.exr|preview\.mp4")
PLATE_SIDE = 3840  # pixels that a scene's plate has along its longer side at most


@dataclass(frozen=True)
class Wanted:
    """What to write beside the records."""

    height: int = 512  # rows of the maps
    sun: bool | None = None  # whether their sun's disc is painted; None where it likely shines
    tool: str | None = None  # "blender" or "usd"
    frames_exr: bool = False  # a map a frame
    film: bool = False


@dataclass
class Done:
    """What became of a clip."""

    shots: list[Shot | VideoError] = field(default_factory=list)
    damage: str = ""  # a sentence, where part of the clip was lost

    @property
    def failed(self) -> bool:
        """Whether something of the clip has no answer."""
        return bool(self.damage) or any(isinstance(shot, VideoError) for shot in self.shots)


@dataclass(frozen=True)
class Job:
    """A clip, where its light goes, and what is known."""

    source: Path
    folder: Path
    given: Given = field(default_factory=Given)
    every: float = EVERY  # s between the frames that the network sees
    wanted: Wanted = field(default_factory=Wanted)


def shot_map(number: int) -> str:
    """The name of a shot's map; shots are counted from 1."""
    return f"shot-{number}.exr"


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Raise a one-sentence VideoError where the results cannot or must not be written."""
    if folder.exists() and not folder.is_dir():
        raise VideoError(f"{folder} is a file; the results need a folder.")
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        raise VideoError(f"{folder} is not empty; --overwrite replaces the results in it.")
    if not folder.absolute().parent.is_dir():
        raise VideoError(f"There is no folder {folder.absolute().parent}.")


def process(job: Job, model: Model, progress: Callable[[float], Any] | None = None) -> Done:
    """Write all that is wanted of a clip.

    Raises VideoError, MissingExtraError, ModelError, SceneError, EnvironmentMapError, ParameterError or OSError.
    """
    done, lights = Done(), list[FrameLight]()
    with Clip(job.source) as clip:
        around(clip, job.given).known_at(0.0)  # what cannot be is refused before anything is written
        job.folder.mkdir(exist_ok=True)
        with (job.folder / PART).open("w", encoding="utf-8") as lines:
            for shot in shots_of(clip, model, job.given, job.every, progress):
                done.shots.append(shot)
                lights += _write(job, shot, len(done.shots), lines)
                lines.flush()
        done.damage, rate = clip.damage, clip.info.frame_rate
    (job.folder / PART).replace(job.folder / RECORDS)
    _remove_others(job, done, {light.frame for light in lights})
    if job.wanted.tool is not None:
        _write_scenes(job, done.shots, rate)
    if job.wanted.film:
        from lighting.video.film import by_frame, write_film

        write_film(job.source, by_frame(lights), job.folder / FILM)
    return done


def _write(job: Job, shot: Shot | VideoError, number: int, lines: TextIO) -> list[FrameLight]:
    """The lines and maps of one shot."""
    name = str(job.source)
    if isinstance(shot, VideoError):
        lines.write(json.dumps({"file": name, "shot": number, "error": str(shot)}) + "\n")
        return []
    lights = list(frame_lights(shot, number))
    lines.writelines(light.to_line(name) + "\n" for light in lights)
    write_envmap(job.folder / shot_map(number), *world_map(shot, job.wanted.height, job.wanted.sun))
    if job.wanted.frames_exr:
        (job.folder / FRAMES).mkdir(exist_ok=True)
        for light in lights:
            picture = render(light.lighting, job.wanted.height, sun=job.wanted.sun)
            write_envmap(job.folder / FRAMES / f"{light.frame:06d}.exr", picture, light.lighting)
    return lights


def _remove_others(job: Job, done: Done, frames: set[int]) -> None:
    """Remove the results of an earlier clip that were not replaced."""
    shots = [number for number, shot in enumerate(done.shots, 1) if isinstance(shot, Shot)]
    kept = {shot_map(number) for number in shots} | {f"shot-{number}-{job.wanted.tool}" for number in shots}
    kept |= {f"{frame:06d}.exr" for frame in frames if job.wanted.frames_exr} | ({FILM} if job.wanted.film else set())
    for path in [*job.folder.iterdir(), *(job.folder / FRAMES).glob("*")]:
        if path.name in kept:
            continue
        if path.is_dir() and _SCENE.fullmatch(path.name):
            remove_scene(path, *SHOT_FILES)
        elif path.is_file() and (_FRAME if path.parent.name == FRAMES else _MAP_OR_FILM).fullmatch(path.name):
            path.unlink()
    with suppress(OSError):  # it holds files that are none of ours, or is not there
        (job.folder / FRAMES).rmdir()


def _write_scenes(job: Job, shots: Sequence[Shot | VideoError], rate: float) -> None:
    from lighting.video.camera import write_shot

    assert job.wanted.tool is not None
    first = {int(shot.frames[0]): (n, shot) for n, shot in enumerate(shots, 1) if isinstance(shot, Shot)}
    with Clip(job.source, PLATE_SIDE) as clip:
        for frame in clip.frames(first):
            number, shot = first[frame.index]
            folder = job.folder / f"shot-{number}-{job.wanted.tool}"
            write_shot(shot, frame.pixels, job.wanted.tool, folder, str(job.source), rate)
