"""A clip's light: the camera's path from followed points, one sun for each shot; and streams, frame by frame.

It needs the extra `video` (PyAV and OpenCV), which is imported when it is used.
"""

from typing import TYPE_CHECKING

from lighting.lazy import from_homes

if TYPE_CHECKING:
    from lighting.video.clip import Clip, Frame
    from lighting.video.output import FILM, PART, Done, Job, Wanted, check_folder, process
    from lighting.video.records import FrameLight, frame_lights, light_of, world_map
    from lighting.video.run import shots_of
    from lighting.video.shot import Shot
    from lighting.video.tracker import Sighting, Tracker

__all__ = [
    "FILM",
    "PART",
    "Clip",
    "Done",
    "Frame",
    "FrameLight",
    "Job",
    "Shot",
    "Sighting",
    "Tracker",
    "Wanted",
    "check_folder",
    "frame_lights",
    "light_of",
    "process",
    "shots_of",
    "world_map",
]

_HOME = {
    "FILM": "output",
    "PART": "output",
    "Clip": "clip",
    "Done": "output",
    "Frame": "clip",
    "FrameLight": "records",
    "Job": "output",
    "Shot": "shot",
    "Sighting": "tracker",
    "Tracker": "tracker",
    "Wanted": "output",
    "check_folder": "output",
    "frame_lights": "records",
    "light_of": "records",
    "process": "output",
    "shots_of": "run",
    "world_map": "records",
}

__getattr__ = from_homes(__name__, _HOME)
