"""A clip's light: the camera's path from followed points, one sun for each shot; and streams, frame by frame.

It needs the extra `video` (PyAV and OpenCV), which is imported when it is used.
"""

from typing import TYPE_CHECKING

from lighting.lazy import from_homes

if TYPE_CHECKING:
    from lighting.video.clip import Clip, Frame
    from lighting.video.records import FrameLight, frame_lights, world_map
    from lighting.video.run import shots_of
    from lighting.video.shot import Shot
    from lighting.video.tracker import Sighting, Tracker

__all__ = ["Clip", "Frame", "FrameLight", "Shot", "Sighting", "Tracker", "frame_lights", "shots_of", "world_map"]

_HOME = {
    "Clip": "clip",
    "Frame": "clip",
    "FrameLight": "records",
    "frame_lights": "records",
    "world_map": "records",
    "shots_of": "run",
    "Shot": "shot",
    "Sighting": "tracker",
    "Tracker": "tracker",
}

__getattr__ = from_homes(__name__, _HOME)
