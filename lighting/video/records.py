"""The record of each frame: the shot's one light, as that frame's camera sees it."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace

from lighting.envmap import Image, brighten, view
from lighting.evidence import estimate_of
from lighting.files import full_record
from lighting.geometry import Floats, wrap_azimuth
from lighting.records import Lighting
from lighting.strength import with_ground
from lighting.video.shot import Shot
from lighting.video.zoom import zoomed_fov


@dataclass(frozen=True)
class FrameLight:
    """One frame's answer."""

    shot: int  # counted from 1
    frame: int  # counted from 0 in the clip
    time: float  # s from the clip's first frame
    lighting: Lighting  # as this frame's camera sees it; `relative_heading` is against the shot's first frame
    gain: tuple[float, float, float]  # linear red, green and blue against the shot's first frame
    bridged: bool  # whether the camera's angles follow from its neighbours, because nothing could be followed

    def to_line(self, name: str) -> str:
        """One line of JSON about the frame of the clip `name`."""
        told = {"file": name, "shot": self.shot, "frame": self.frame, "time": round(self.time, 6)}
        told |= {"gain": list(self.gain), "bridged": self.bridged, "lighting": full_record(self.lighting)}
        return json.dumps(told, allow_nan=False)


def light_of(shot: Shot) -> Lighting:
    """The shot's light as its first camera sees it."""
    light = with_ground(estimate_of(shot.fused, shot.known).lighting, shot.ground)
    return replace(
        light,
        camera_elevation=rounded_angle(shot.path.elevation[0]),
        camera_roll=rounded_angle(wrap_azimuth(shot.path.roll[0])),
        camera_heading=None if shot.north is None else rounded_compass(shot.north),
    )


def frame_lights(shot: Shot, number: int) -> Iterator[FrameLight]:
    """One answer a frame."""
    base = light_of(shot)
    for i, frame in enumerate(shot.frames.tolist()):
        red, green, blue = (round(float(g), 5) for g in shot.gains[i])
        yield FrameLight(
            number,
            frame,
            float(shot.path.time[i]),
            _in_frame(base, shot, i),
            (red, green, blue),
            bool(shot.path.bridged[i]),
        )


def _in_frame(base: Lighting, shot: Shot, i: int) -> Lighting:
    """The shot's light as the camera of its frame `i`, counted in the shot, sees it."""
    heading = float(shot.path.heading[i])
    return replace(
        brighten(base, shot.gains[i]),
        sun_azimuth=rounded_angle(wrap_azimuth(base.sun_azimuth - heading)),
        camera_elevation=rounded_angle(shot.path.elevation[i]),
        camera_roll=rounded_angle(wrap_azimuth(shot.path.roll[i])),
        vertical_fov=rounded_angle(zoomed_fov(base.vertical_fov, float(shot.zoom[i]))),
        camera_heading=None if shot.north is None else rounded_compass(shot.north + heading),
        camera_heading_probability=(),
        relative_heading=rounded_compass(heading),
    )


def world_map(shot: Shot, height: int, sun: bool | None = None) -> tuple[Image, Lighting]:
    """The shot's map with true north at its centre, or, where that is unknown, where its first frame points."""
    light = light_of(shot)
    return view(light, height, sun=sun, yaw=light.camera_heading or 0.0)


def rounded_angle(degrees: Floats | float) -> float:
    """To four digits behind the point."""
    return round(float(degrees), 4)


def rounded_compass(degrees: float) -> float:
    """The same from 0 up to 360."""
    return rounded_angle(degrees % 360.0) % 360.0
