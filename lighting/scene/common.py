"""What a scene is made of, computed once and in one frame for every tool.

The frame is that of geometry.py in metres: +Y up, the camera looks along -Z at azimuth 0, the ground is y = 0 and the
camera stands over its origin at EYE_HEIGHT. Light is in the map's units, `exposure` x the sky model's radiance, which
are the photo's linear values: a white diffuse surface under irradiance pi shows as 1.

No light counts twice. The sun's disc is left out of the map and is a light of its own. Below the horizon the map holds
the ground under sky and sun; a renderer that traces rays sees the ground plane there instead, which has the same albedo
and so the same radiance, and one that shades by the map alone takes its bounced light from there.
"""

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lighting.envmap import render, sky_irradiance, sun_irradiance
from lighting.files import encode_envmap, encode_png, full_record
from lighting.geometry import SUN_RADIUS, camera_axes, focal_length
from lighting.photo import Photo
from lighting.records import Lighting

Floats = NDArray[np.floating[Any]]

SUN_ANGLE = 2 * SUN_RADIUS  # deg
EYE_HEIGHT = 1.6  # m, where photos are commonly taken from; it sets the scene's scale
SENSOR_HEIGHT = 24.0  # mm, of the 35 mm format; with the focal length it says the field of view
GROUND_RADIUS = 500.0  # m; beyond it the map shows the same ground
NEAR, FAR = 0.05, 2000.0  # m, the camera's clipping distances

PLATE, ENVIRONMENT, RECORD = "plate.png", "environment.exr", "lighting.json"
MAP_HEIGHT = 512  # rows of the environment map
PLATE_SIDE = 3840  # pixels that the plate's longer side keeps at least, if the photo has them

PLACEHOLDER_ALBEDO = 0.5  # of the ball and the stick
_SPOT_IN_PICTURE = 0.6  # how far below the picture's centre the spot lies, 0 = centre, 1 = lower edge
_LEAST_DESCENT = 0.05  # the slope of the steepest sight line to a spot that a level or rising camera cannot see
_BALL_IN_PICTURE = 0.16  # the ball's radius / half the picture's height


@dataclass(frozen=True, eq=False)
class Scene:
    """Camera, plate, sun, map, ground and a placeholder object: a ball and, to its right, an upright stick."""

    lighting: Lighting
    plate: NDArray[np.uint8]  # (h, w, 3) sRGB, the photo
    environment: NDArray[np.float32]  # (H, 2H, 3), the sun's disc left out
    sun_irradiance: Floats  # (3,) linear Rec.709 on a surface that faces the sun; 0 where no direct sun reaches
    sky_irradiance: Floats  # (3,) on open level ground, without the sun

    # --- camera

    @property
    def width(self) -> int:
        """Of the plate, pixels."""
        return int(self.plate.shape[1])

    @property
    def height(self) -> int:
        """Of the plate, pixels."""
        return int(self.plate.shape[0])

    @property
    def vertical_fov(self) -> float:
        """Degrees."""
        return self.lighting.vertical_fov

    @property
    def sensor_width(self) -> float:
        """Millimetres, for square pixels on a sensor of SENSOR_HEIGHT."""
        return SENSOR_HEIGHT * self.width / self.height

    @property
    def focal_length(self) -> float:
        """Millimetres."""
        return focal_length(SENSOR_HEIGHT, self.vertical_fov)

    @property
    def camera_axes(self) -> Floats:
        """The camera's right, up and forward unit vectors as rows (3, 3)."""
        return camera_axes(0.0, self.lighting.camera_elevation, self.lighting.camera_roll)

    @property
    def camera_position(self) -> Floats:
        return np.array([0.0, EYE_HEIGHT, 0.0])

    @property
    def camera_matrix(self) -> Floats:
        """Camera to world (4, 4) for column vectors; the camera looks along its own -Z with +Y up and +X right."""
        right, up, forward = self.camera_axes
        matrix = np.eye(4)
        matrix[:3] = np.stack([right, up, -forward, self.camera_position], axis=1)
        return matrix

    # --- light

    @property
    def sun_direction(self) -> Floats:
        """Unit vector (3,) towards the sun."""
        return self.lighting.sun_direction

    @property
    def sun_matrix(self) -> Floats:
        """Sun to world (4, 4) for column vectors; the sun shines along its own -Z, from the origin."""
        side = camera_axes(self.lighting.sun_azimuth, 0.0, 0.0)[0]
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([side, np.cross(self.sun_direction, side), self.sun_direction], axis=1)
        return matrix

    @property
    def shadow(self) -> Floats:
        """(3,) what remains of open ground's light where the sun is hidden, 0 to 1."""
        direct = self.sun_irradiance * max(float(self.sun_direction[1]), 0.0)
        return np.asarray(self.sky_irradiance / (self.sky_irradiance + direct))

    # --- placeholder

    @cached_property
    def spot(self) -> Floats:
        """Where one's own object goes: the point (3,) on the ground that the lower middle of the picture shows."""
        _, up, forward = self.camera_axes
        sight = forward - _SPOT_IN_PICTURE * np.tan(np.radians(self.vertical_fov) / 2) * up
        ahead = np.array([sight[0], 0.0, sight[2]])
        slope = max(-sight[1] / max(float(np.linalg.norm(ahead)), 1e-3), _LEAST_DESCENT)
        return np.asarray(ahead / max(float(np.linalg.norm(ahead)), 1e-3) * EYE_HEIGHT / slope)

    @property
    def ball_radius(self) -> float:
        """Metres; always the same part of the picture."""
        distance = float(np.linalg.norm(self.spot - self.camera_position))
        return _BALL_IN_PICTURE * distance * float(np.tan(np.radians(self.vertical_fov) / 2))

    @property
    def ball_centre(self) -> Floats:
        """(3,), the ball rests on the spot."""
        return np.asarray(self.spot + np.array([0.0, self.ball_radius, 0.0]))

    @property
    def stick_foot(self) -> Floats:
        """(3,), the middle of the stick's lower end, to the right of the ball."""
        return np.asarray(self.spot + np.array([2.5 * self.ball_radius, 0.0, 0.0]))

    @property
    def stick_height(self) -> float:
        """Metres."""
        return 2.5 * self.ball_radius

    @property
    def stick_radius(self) -> float:
        """Metres, of the upright cylinder."""
        return 0.06 * self.ball_radius


class File(Protocol):
    """A file to be written, in a folder or an archive."""

    def write_bytes(self, data: bytes, /) -> object: ...

    def write_text(self, text: str, /, encoding: str) -> object: ...


class Folder(Protocol):
    """Where a tool's files go: a Path, or an archive in memory."""

    def __truediv__(self, name: str, /) -> File: ...


def make_scene(photo: Photo, lighting: Lighting, *, map_height: int = MAP_HEIGHT, sun: bool | None = None) -> Scene:
    """The scene of a photo under its lighting.

    `sun` says whether direct sunlight reaches it; None takes it when `sun_visibility` is at least 0.5. Raises
    ParameterError for a `map_height` that `envmap.render` refuses.
    """
    shines = lighting.sun_shines if sun is None else sun
    environment = render(lighting, map_height, sun=shines, disc=False)
    direct = sun_irradiance(lighting) if shines else np.zeros(3)
    return Scene(lighting, photo.pixels, environment, direct, sky_irradiance(lighting))


def to_z_up(vector: Floats) -> Floats:
    """Vectors (..., 3) of our frame where +Z is up and the camera looks along +Y."""
    x, y, z = np.moveaxis(np.asarray(vector), -1, 0)
    return np.stack([x, -z, y], axis=-1)


def colour_and_strength(irradiance: Floats) -> tuple[Floats, float]:
    """A colour (3,) in [0, 1] whose brightest channel is 1, and what it is multiplied by; white for no light."""
    strength = float(irradiance.max())
    return (irradiance / strength if strength > 0 else np.ones(3)), strength


def plate_png(scene: Scene) -> bytes:
    """The plate as PNG."""
    return encode_png(scene.plate, compress_level=3)


def write_shared_files(scene: Scene, folder: Folder) -> None:
    """PLATE, ENVIRONMENT and RECORD."""
    (folder / PLATE).write_bytes(plate_png(scene))
    (folder / ENVIRONMENT).write_bytes(encode_envmap(scene.environment, scene.lighting))
    (folder / RECORD).write_text(json.dumps(full_record(scene.lighting), indent=2) + "\n", encoding="utf-8")
