"""Where the shadow points, where the ball is brightest and how dark the shade is, measured in a picture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.color import luminance
from lighting.geometry import Floats, Pinhole, camera_directions, camera_pixel, direction, wrap_azimuth

AROUND = 25.0  # deg, to both sides of the direction in which a shadow is looked for


@dataclass(frozen=True, eq=False)
class Picture:
    """A linear picture of a ball and perhaps a stick on level ground, and where the camera stood."""

    pixels: Floats  # (h, w, 3)
    vertical_fov: float
    elevation: float
    roll: float
    position: Floats  # (3,)
    ball: Floats  # (3,) its center
    radius: float  # of the ball
    caster: Floats  # (3,) the foot of what casts the shadow whose direction is measured
    reach: tuple[float, float]  # distances from it where the shadow is looked at
    obstacles: Floats  # (N, 4) spheres, center and radius, that may hide ground from the camera

    @property
    def foot(self) -> Floats:
        """Where the ball stands (3,)."""
        return np.asarray(self.ball - [0.0, self.radius, 0.0])

    def light(self, points: Floats) -> Floats:
        """Luminance (...) that the picture shows at points (..., 3), bilinear."""
        height, width = self.pixels.shape[:2]
        pixel = camera_pixel(
            points - self.position, Pinhole(width, height, self.vertical_fov, elevation=self.elevation, roll=self.roll)
        )
        x, y = np.clip(pixel[..., 0] - 0.5, 0, width - 1.001), np.clip(pixel[..., 1] - 0.5, 0, height - 1.001)
        column, row = x.astype(int), y.astype(int)
        u, v, values = x - column, y - row, luminance(self.pixels)
        top = values[row, column] * (1 - u) + values[row, column + 1] * u
        return np.asarray(top * (1 - v) + (values[row + 1, column] * (1 - u) + values[row + 1, column + 1] * u) * v)


def shadow_azimuth(picture: Picture, expected: float) -> float:
    """Azimuth [deg] in which the caster's shadow points: the darkness' centroid on arcs around its foot.

    The arcs reach AROUND to both sides of the `expected` azimuth; NaN where nothing on them is dark.
    """
    offset_angle = np.linspace(-AROUND, AROUND, 1001)
    reach = np.linspace(*picture.reach, 60)[:, None]
    ring = picture.caster + reach[..., None] * direction(expected + offset_angle, 0.0)
    light = picture.light(ring)
    open_ground = np.percentile(light, 90, axis=1, keepdims=True)
    dark = np.clip(1 - light / open_ground - 0.15, 0, None)
    if dark.max() < 0.1:
        return float("nan")
    return float(wrap_azimuth(expected + (dark * offset_angle).sum() / dark.sum()))


def brightest_normal(normals: Floats, values: Floats) -> Floats:
    """The unit normal (3,) at which a quadratic fitted to the brighter of (N, 3) normals with luminance (N,) peaks."""
    bright = values > 0.7 * np.percentile(values, 99)
    x, y, z = normals[bright].T
    terms = np.stack([np.ones_like(x), x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1], axis=1)
    fitted = terms @ np.linalg.lstsq(terms, values[bright], rcond=None)[0]
    mean = normals[bright][fitted >= np.percentile(fitted, 99)].mean(axis=0)
    return np.asarray(mean / np.linalg.norm(mean))


def ball(picture: Picture) -> tuple[Floats, Floats]:
    """Normals (N, 3) and luminance (N,) of the ball's pixels, its rim aside."""
    height, width = picture.pixels.shape[:2]
    rays = camera_directions(
        Pinhole(width, height, picture.vertical_fov, elevation=picture.elevation, roll=picture.roll)
    )
    towards = picture.ball - picture.position
    along = rays @ towards
    inside = along**2 - towards @ towards + picture.radius**2
    visible = (inside > (0.3 * picture.radius) ** 2) & (along > 0)
    distance = along[visible] - np.sqrt(inside[visible])
    normals = (rays[visible] * distance[:, None] - towards) / picture.radius
    return normals, luminance(picture.pixels[visible])


def shade_region(sun: Floats) -> Floats:
    """Points (N, 3) in a ball's umbra, in ball radii from where it stands.

    They lie 0.3 to 0.9 of the way from there to the shadow's tip, up to 0.2 to either side of the shadow's axis.
    """
    level = np.hypot(sun[0], sun[2])
    away = np.array([-sun[0], 0.0, -sun[2]]) / level
    tip = (1 + level) / sun[1]
    along, aside = np.meshgrid(np.linspace(0.3, 0.9, 61) * tip, np.linspace(-0.2, 0.2, 9))
    return np.asarray(along.reshape(-1, 1) * away + aside.reshape(-1, 1) * _across(sun))


def unhidden(picture: Picture, points: Floats) -> NDArray[np.bool_]:
    """Which of points (N, 3), in ball radii from where it stands, lie in the picture with no object before them."""
    sight = picture.foot + picture.radius * points - picture.position
    distance = np.linalg.norm(sight, axis=1, keepdims=True)
    centers = picture.obstacles[:, :3] - picture.position
    along = np.clip(sight / distance @ centers.T, 0, distance)
    gap = np.linalg.norm(sight[:, None] / distance[:, None] * along[..., None] - centers, axis=-1)
    height, width = picture.pixels.shape[:2]
    pixel = camera_pixel(
        sight, Pinhole(width, height, picture.vertical_fov, elevation=picture.elevation, roll=picture.roll)
    )
    inside = np.all((pixel > 1) & (pixel < [width - 1, height - 1]), axis=1)
    return np.asarray(inside & np.all(gap > picture.obstacles[:, 3] + 0.05 * picture.radius, axis=1))


def sunlit_over_shaded(picture: Picture, sun: Floats, shaded: Floats) -> float:
    """Luminance of open ground / mean luminance of points (N, 3), in ball radii from where it stands.

    The open ground is a patch 3.5 radii aside, on the brighter side, which no stick or other ball shades.
    """
    sides = [_patch(picture, picture.foot + side * 3.5 * picture.radius * _across(sun)) for side in (-1, 1)]
    return float(max(sides) / picture.light(picture.foot + picture.radius * shaded).mean())


def _across(sun: Floats) -> Floats:
    """Unit vector (3,) on the ground across the shadow."""
    return np.asarray(np.array([-sun[2], 0.0, sun[0]]) / np.hypot(sun[0], sun[2]))


def _patch(picture: Picture, point: Floats) -> float:
    """Mean luminance of a small patch of ground."""
    offset_angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)[:, None]
    reach = picture.radius * np.linspace(0.02, 0.15, 6)[:, None, None]
    offsets = reach * np.concatenate([np.cos(offset_angle), np.zeros_like(offset_angle), np.sin(offset_angle)], axis=1)
    return float(picture.light(point + offsets).mean())
