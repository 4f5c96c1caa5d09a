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
        camera_elevation=_rounded(shot.path.elevation[0]),
        camera_roll=_rounded(wrap_azimuth(shot.path.roll[0])),
        camera_heading=None if shot.north is None else _compass(shot.north),
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
    path, fov = shot.path, zoomed_fov(base.vertical_fov, float(shot.zoom[i]))
    angles = float(path.heading[i]), float(path.elevation[i]), float(path.roll[i])
    return as_turned(brighten(base, shot.gains[i]), angles, fov, shot.north)


def as_turned(light: Lighting, angles: tuple[float, float, float], fov: float, north: float | None) -> Lighting:
    """A light as a camera sees it that is turned by heading, elevation and roll [deg] and has a field of view [deg].

    `north` is where azimuth 0 of the light points, deg clockwise from true north; None where that is not known.
    """
    heading, elevation, roll = angles
    return replace(
        light,
        sun_azimuth=_rounded(wrap_azimuth(light.sun_azimuth - heading)),
        camera_elevation=_rounded(elevation),
        camera_roll=_rounded(wrap_azimuth(roll)),
        vertical_fov=_rounded(fov),
        camera_heading=None if north is None else _compass(north + heading),
        camera_heading_probability=(),
        relative_heading=_compass(heading),
    )


def world_map(shot: Shot, height: int, sun: bool | None = None) -> tuple[Image, Lighting]:
    """The shot's map with true north at its centre, or, where that is unknown, where its first frame points."""
    light = light_of(shot)
    return view(light, height, sun=sun, yaw=light.camera_heading or 0.0)


def _rounded(degrees: Floats | float) -> float:
    """To four digits behind the point."""
    return round(float(degrees), 4)


def _compass(degrees: float) -> float:
    """The same from 0 up to 360."""
    return _rounded(degrees % 360.0) % 360.0
