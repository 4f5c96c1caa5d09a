"""A photo's scene: its camera, sun, map and ground, and a placeholder for the user's object.

The frame is that of geometry.py in meters: +Y up, and the camera looks along -Z at azimuth 0. The ground is y = 0, and
the camera stands over its origin at its height. Light is in the map's units, `exposure` x the sky model's radiance,
which are the photo's linear values: a white diffuse surface under irradiance pi shows as 1.

No light counts twice. The sun's disc is left out of the map and is a light of its own. Below the horizon the map holds
the ground under sky and sun. A renderer that traces rays sees the ground plane there instead, which has the same
radiance. One that shades by the map alone takes its bounced light from there.
"""

import zlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

import lighting.geometry as geometry
from lighting.envmap.projection import photo_camera
from lighting.envmap.render import ground_reflectance, render, sky_irradiance, sun_light
from lighting.envmap.shadow_mask import ground_shadow_mask, shadow_receivers
from lighting.envmap.surroundings import PhotoContext, render_with_surroundings
from lighting.fields import describe_fields
from lighting.geometry import Floats, Pinhole
from lighting.ground import find_sunny_ground, is_in_sun, max_object_meters, spot_warnings
from lighting.light_probe import main_light, project_latlong
from lighting.photo.reader import Photo, check_photo
from lighting.prediction import Segments
from lighting.preview.spheres import DIFFUSE_REFLECTANCE
from lighting.records import Lighting, LightProbe, check_lighting

SUN_ANGLE = 2 * geometry.SUN_RADIUS  # deg
SENSOR_HEIGHT = 24.0  # mm, of the 35 mm format; with the focal length it determines the field of view
GROUND_RADIUS = 500.0  # m; beyond it the map shows the same ground
NEAR, FAR = 0.05, 2000.0  # m, the camera's clipping distances

_MAP_HEIGHT = 512  # rows of the environment map
_BALL = 0.08  # radius of the placeholder's ball on the spot, in picture heights
PLACEHOLDER_ALBEDO = DIFFUSE_REFLECTANCE  # of ball and stick: that of the previews' gray ball
PLATE_SIDE = 3840  # pixels, least length of the plate's longer side if the photo has as many

_MIN_DESCENT = 0.05  # slope of the line from camera to a stage, for cameras that are level or look up
_SHADED_SPOT = "The object is in the photo's shade: the scene keeps the sun off it."
_HIDDEN_SPOT = "The object would stand {:.0f} m ahead, below the picture's edge."


@dataclass(frozen=True, eq=False)
class _Placeholder:
    """What is on the spot until the user puts an object there: a ball and, to its right, an upright stick.

    Lengths in meters, points (3,) from the scene's spot, +Y up.
    """

    ball_radius: float
    ball_center: Floats  # the ball rests on the spot
    stick_foot: Floats  # the middle of the stick's lower end
    stick_center: Floats  # halfway up the stick
    stick_height: float
    stick_radius: float


@dataclass(frozen=True, eq=False)
class Scene:
    """A photo as the plate behind a scene, the camera that took it, and the light: sun, map and ground."""

    lighting: Lighting
    """The light and the camera."""
    plate: NDArray[np.uint8]
    """(h, w, 3) 8-bit sRGB, 0 to 255: the photo."""
    environment: NDArray[np.float32]
    """(H, 2H, 3) linear Rec.709, 0 or more: the map, the sun's disc left out."""
    sun_irradiance: Floats
    """(3,) RGB, 0 or more, on a surface that faces the sun; 0 where no direct sun reaches."""
    sky_irradiance: Floats
    """(3,) RGB, 0 or more, on open level ground, without the sun."""
    lit_ground: NDArray[np.float32]
    """(H, W), 0 to 1, of the plate's aspect: 0 where its ground lies in shade, 1 elsewhere."""
    segments: Segments | None = None
    """(R, C, K) probabilities, 0 to 1, of what the plate shows. None: unknown."""
    photo_size: tuple[int, int] | None = None
    """Columns and rows of the upright photo, pixels, of which the plate may have fewer. None: the plate's own."""

    @cached_property
    def photo_name(self) -> str:
        """ "photo-" and eight hexadecimal digits: the same for the same plate, whatever the light."""
        return f"photo-{zlib.crc32(np.ascontiguousarray(self.plate).data):08x}"

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
        """Of the camera, deg."""
        return self.lighting.vertical_fov

    @property
    def sensor_width(self) -> float:
        """Of the camera in mm, for square pixels on a sensor of SENSOR_HEIGHT."""
        return SENSOR_HEIGHT * self.width / self.height

    @property
    def focal_length(self) -> float:
        """Of the camera, mm."""
        return geometry.focal_length(SENSOR_HEIGHT, self.vertical_fov)

    @property
    def camera_axes(self) -> Floats:
        """The camera's right, up and forward unit vectors as rows (3, 3)."""
        return geometry.camera_axes(0.0, self.lighting.camera_elevation, self.lighting.camera_roll)

    @property
    def camera_position(self) -> Floats:
        """(3,) meters; the camera is over the origin."""
        return np.array([0.0, self.lighting.camera_height, 0.0])

    @property
    def camera_matrix(self) -> Floats:
        """Camera to world (4, 4) for column vectors; the camera looks along its own -Z with +Y up and +X right."""
        right, up, forward = self.camera_axes
        matrix = np.eye(4)
        matrix[:3] = np.stack([right, up, -forward, self.camera_position], axis=1)
        return matrix

    @property
    def sun_direction(self) -> Floats:
        """Unit vector (3,) towards the sun."""
        return self.lighting.sun_direction

    @property
    def sun_matrix(self) -> Floats:
        """Sun to world (4, 4) for column vectors; the sun shines along its own -Z, from the origin."""
        return _sun_to_world(self.lighting)

    @property
    def shadow(self) -> Floats:
        """(3,) the share of open ground's light that remains in the sun's shadow, 0 to 1."""
        direct = self.sun_irradiance * max(float(self.sun_direction[1]), 0.0)
        level = self.sky_irradiance + direct
        return np.divide(self.sky_irradiance, level, out=np.ones(3), where=level > 0.0)

    @property
    def ground(self) -> Floats:
        """Reflectance (3,) of the ground."""
        return ground_reflectance(self.lighting)

    @cached_property
    def light_probe(self) -> LightProbe:
        """The map's light probe, and the sun as the main light."""
        return LightProbe(
            project_latlong(self.environment), main_light(self.lighting, sun=bool(self.sun_irradiance.any()))
        )

    @cached_property
    def spot(self) -> Floats:
        """Where the user's object goes: the point (3,) on the ground in the direction of the record's spot.

        Without one it is the point that the lower middle of the picture shows, on a stage of the object's own.
        """
        if self.lighting.spot_direction is not None:
            sight = np.array(self.lighting.spot_direction)
            return np.asarray(self.camera_position + sight * (self.lighting.camera_height / -sight[1])) * [1, 0, 1]
        _, up, forward = self.camera_axes
        sight = forward - geometry.OBJECT_POSITION * np.tan(np.radians(self.vertical_fov) / 2) * up
        ahead = np.array([sight[0], 0.0, sight[2]])
        slope = max(-sight[1] / max(float(np.linalg.norm(ahead)), 1e-3), _MIN_DESCENT)
        return np.asarray(ahead / max(float(np.linalg.norm(ahead)), 1e-3) * self.lighting.camera_height / slope)

    @property
    def placeholder(self) -> _Placeholder:
        """What stands on the spot; it takes up the same part of each picture where that is no giant."""
        distance = float(np.linalg.norm(self.spot - self.camera_position))
        radius = 2 * _BALL * distance * float(np.tan(np.radians(self.vertical_fov) / 2))
        ball = min(radius, max_object_meters(self.lighting.camera_height))
        aside, height = 2.5 * ball, 2.5 * ball
        ball_center, foot, center = np.array([[0.0, ball, 0.0], [aside, 0.0, 0.0], [aside, height / 2, 0.0]])
        return _Placeholder(ball, ball_center, foot, center, stick_height=height, stick_radius=0.06 * ball)

    @cached_property
    def spot_in_shade(self) -> bool:
        """Whether what stands on the spot is in shade, by the rule of `envmap.shadow_mask`."""
        foot = geometry.camera_pixel(self._sight, self._camera) / [self.width, self.height]
        return not is_in_sun(find_sunny_ground(self.lit_ground, self.lighting), foot)

    @cached_property
    def shadow_receivers(self) -> NDArray[np.float32]:
        """Where (H, W) of the plate the sun's shadow of an object may fall, 0 to 1: on lit ground alone.

        It falls nowhere where the object stands on a stage of its own.
        """
        if self.lighting.ground_visible is not None and self.lighting.spot_pixel is None:
            return np.zeros_like(self.lit_ground)
        return shadow_receivers(self.lit_ground, self.segments)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Those of the light, why no object stands in the photo, and one where it stands in shade."""
        shaded = (_SHADED_SPOT,) if self.spot_in_shade else ()
        return (*self.lighting.warnings, *(spot_warnings(self.lighting) or self._hidden_warnings()), *shaded)

    def _hidden_warnings(self) -> tuple[str, ...]:
        """A sentence where the spot lies out of the picture, as one may of a record that does not state it."""
        x, y = geometry.camera_pixel(self._sight, self._camera)
        in_view = 0 <= x <= self.width and 0 <= y <= self.height
        return () if in_view else (_HIDDEN_SPOT.format(float(np.linalg.norm(self.spot))),)

    @property
    def _camera(self) -> Pinhole:
        return photo_camera(self.lighting, self.width, self.height)

    @property
    def _sight(self) -> Floats:
        """The spot (3,) from the camera."""
        return self.spot - self.camera_position


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """How the camera of a clip moves in a scene: N frames of one shot."""

    matrices: Floats
    """(N, 4, 4) camera to world for column vectors, in meters of the scene's frame."""
    focal_lengths: Floats
    """(N,) mm, over 0, as `Scene.focal_length`."""
    frames: Floats
    """(N,) frames, 0 or more, from the shot's first, by time: not whole where the clip's frame rate varies."""
    frame_rate: float
    """Hz, over 0."""
    first_frame: int
    """First frame of the shot, 0 or more, counted in the clip."""
    clip: str
    """The clip's file, from the scene's folder; empty where the plate stands in its place."""


@dataclass(frozen=True, eq=False)
class SunPath:
    """How the sun of a day moves in a scene: N times, from the first to the last."""

    hours: Floats
    """(N,) hours since midnight."""
    lights: tuple[Lighting, ...]
    """(N,) of the times."""
    maps: dict[float, str]
    """Names of map files without the sun's disc, by hours since midnight."""

    @property
    def matrices(self) -> Floats:
        """(N, 4, 4) sun to world, as `Scene.sun_matrix`."""
        return np.stack([_sun_to_world(light) for light in self.lights])

    @property
    def irradiances(self) -> Floats:
        """(N, 3) RGB, 0 or more, on a surface that faces the sun."""
        return np.stack([sun_light(light)[0] for light in self.lights])


def _sun_to_world(lighting: Lighting) -> Floats:
    side = geometry.camera_axes(lighting.sun_azimuth, 0.0, 0.0)[0]
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([side, np.cross(lighting.sun_direction, side), lighting.sun_direction], axis=1)
    return matrix


describe_fields(Scene, CameraMotion, SunPath)


def make_scene(
    photo: Photo,
    lighting: Lighting,
    *,
    map_height: int = _MAP_HEIGHT,
    sun: bool | None = None,
    context: PhotoContext | None = None,
    segments: Segments | None = None,
) -> Scene:
    """The scene of a photo under its lighting.

    Args:
        photo: the plate.
        lighting: its light and camera.
        map_height: rows of the environment map.
        sun: whether direct sunlight reaches the scene; None leaves that to `Lighting.sun_painted`.
        context: what the map shows of the place; None for sky and ground alone.
        segments: what the photo shows, `Estimate.segments`; None: unknown.

    Raises:
        ParameterError: `lighting`, `map_height` or `context` is none.
        PhotoError: `photo` is none.
    """
    check_lighting(lighting)
    check_photo(photo)
    shines = lighting.sun_painted if sun is None else sun
    if context is None:
        environment = render(lighting, map_height, sun=shines, disc=False)
    else:
        environment = render_with_surroundings(lighting, context, map_height, sun=shines, disc=False)
    direct = sun_light(lighting)[0] if shines else np.zeros(3)
    light = context.light_at_exposure(lighting) if context else lighting
    has_shade = shines and (context is None or context.light is None or context.light.sun_painted)
    lit = ground_shadow_mask(photo.pixels, light, sun=has_shade, segments=segments)
    size = photo.width, photo.height
    return Scene(lighting, photo.pixels, environment, direct, sky_irradiance(lighting), lit, segments, size)
