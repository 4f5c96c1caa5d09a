"""Three balls lit by maps of crops, by the protocol that DiffusionLight [1] made usual.

Maps of HEIGHT rows are taken to the power 1 / _GAMMA and scaled to a median of one half, without clipping. So one reads
them as pictures, not as light. They light a diffuse, a matte silver and a mirror ball, seen from _VIEW meters away and
above. Figures: the error after the best scale (SI-RMSE), and the angle between RGB vectors. Linear light has larger
errors: never compare the two.

References:
    [1] Phongthawee et al., DiffusionLight: light probes for free by painting a chrome ball, CVPR 2024.
    [2] Walter et al., Microfacet models for refraction through rough surfaces, EGSR 2007.
"""

import math
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from export.data.panoramas import Panorama, linearize, read_index, read_picture
from export.evaluation.metrics import figures_table
from export.evaluation.relighting import HEIGHT, picture_plane, pool_map, rgb_angle
from export.reports.map_detail import crop_view, exposure_gain
from lighting.color import tone_map
from lighting.envmap.latlong import shrink_envmap
from lighting.envmap.relighting import rotate_envmap
from lighting.estimator import Estimator
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, latlong_directions, latlong_solid_angle
from lighting.map_options import MapOptions
from lighting.model import Model
from lighting.photo.reader import photo_from_array

_GAMMA = 2.4
_VIEW = 16.0, 2.0  # m from the ball, and above it
_ALBEDO = 0.8
_ROUGHNESS = 0.5  # of matte silver; the square is alpha of GGX [2]
_BALLS = ("diffuse", "matte", "mirror")

_AZIMUTHS = 0.0, 180.0  # deg, of the two level crops of a panorama
_FOV = 60.0  # deg, vertical
_MAP_ROWS = 512
_SIDE = 40  # pixels of a ball's picture
_EPSILON = 1e-9


def report_light_balls(data: Path, model: Model, count: int | None = None) -> str:
    """A table in Markdown for the HDR panoramas of `val`: the maps of crops, and the mean map of `train` beside them.

    Args:
        data: folder of panoramas.
        model: the network to ask.
        count: panoramas, the first; None: all.
    """
    mean = np.mean([_views(p)[0][1].mean(axis=1, keepdims=True) for p in _hdr_rows(data, "train")], axis=0)
    constant = mean.repeat(2 * HEIGHT, axis=1)
    scores: list[list[Floats]] = []  # of each map and the mean map
    sunny: list[bool] = []
    estimator = Estimator(model)
    for panorama in _hdr_rows(data, "val")[:count]:
        for photo, truth in _views(panorama):
            estimate = estimator(photo_from_array(photo), UserInput(vertical_fov=_FOV))
            lit = pool_map(estimate.render(MapOptions(_MAP_ROWS)).image)
            scores.append([_score_map(light, truth) for light in (lit, constant)])
            sunny.append(panorama.sun == "visible" and panorama.direct == "yes")
    chosen, errors = np.array(sunny), np.array(scores)
    rows = {
        f"{name}, {part} ({np.count_nonzero(which)} crops)": _figures(errors[which, number])
        for part, which in (("all", np.ones_like(chosen)), ("in the sun", chosen))
        for number, name in enumerate(("map", "mean map"))
        if which.any()
    }
    return "\n\n".join(["## Three balls, by the public protocol", __doc__.split("\n\n")[1], figures_table(rows, 3)])


def _score_map(light: Floats, truth: Floats) -> Floats:
    """The errors of a map (balls, 2): after the best scale, and of angles [deg].

    Args:
        light: (HEIGHT, 2 HEIGHT, 3) linear.
        truth: as `light`.
    """
    errors, maps = [], [_developed(one).reshape(-1, 3) for one in (light, truth)]
    for matrix in _ball_matrices():
        lit, true = (matrix @ one for one in maps)
        scale = float(np.sum(lit * true) / max(float(np.sum(lit**2)), _EPSILON))
        errors.append([np.sqrt(np.mean((scale * lit - true) ** 2)), rgb_angle(lit, true).mean()])
    return np.array(errors, dtype=np.float64)


def _developed(light: Floats) -> Floats:
    """A map to the power 1 / _GAMMA, of median one half."""
    power = np.maximum(light, 0.0) ** (1 / _GAMMA)
    return np.asarray(power * (0.5 / max(float(np.median(power)), _EPSILON)))


def _figures(errors: Floats) -> dict[str, float]:
    """Means of errors (N, balls, 2), by ball."""
    names = [f"{ball} {what}" for ball in _BALLS for what in ("SI-RMSE", "angle")]
    return dict(zip(names, errors.mean(axis=0).ravel().tolist(), strict=True))


@lru_cache(maxsize=1)
def _ball_matrices() -> list[NDArray[np.float32]]:
    """How much (P, 2 HEIGHT²) each pixel of a map is seen in each pixel of _BALLS."""
    normal, view = _ball_points()
    rays = latlong_directions(HEIGHT).reshape(-1, 3)
    solid_angle = np.repeat(latlong_solid_angle(HEIGHT), 2 * HEIGHT)
    cosine = np.maximum(normal @ rays.T, 0)
    diffuse = cosine * solid_angle * (_ALBEDO / math.pi)
    half = rays[None] + view[:, None]
    half /= np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), _EPSILON)
    facing = np.maximum(np.einsum("pri,pi->pr", half, normal), 0)
    alpha2 = _ROUGHNESS**4
    density = alpha2 / (math.pi * (facing**2 * (alpha2 - 1) + 1) ** 2)
    seen = np.maximum(np.sum(normal * view, axis=1, keepdims=True), _EPSILON)
    matte = _ALBEDO * density * _unmasked(cosine, alpha2) * _unmasked(seen, alpha2) / (4 * seen) * (cosine > 0)
    reflected = 2 * seen * normal - view
    mirror = np.zeros_like(diffuse)
    mirror[np.arange(len(normal)), np.argmax(reflected @ rays.T, axis=1)] = _ALBEDO
    return [np.asarray(m, dtype=np.float32) for m in (diffuse, matte * solid_angle, mirror)]


def _unmasked(cosine: Floats, alpha2: float) -> Floats:
    """The share of GGX's facets that are not hidden, by the cosine of a direction to the normal [2]."""
    return np.asarray(2 * cosine / np.maximum(cosine + np.sqrt(alpha2 + (1 - alpha2) * cosine**2), _EPSILON))


def _ball_points() -> tuple[Floats, Floats]:
    """Normals (P, 3) of a ball of 1 m that a camera sees which looks at it, and directions (P, 3) to the camera."""
    back, up = np.array([0.0, _VIEW[1], _VIEW[0]]), np.array([0.0, 1.0, 0.0])
    distance = float(np.linalg.norm(back))
    forward = -back / distance
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    upward = np.cross(right, forward)
    x, y = picture_plane(_SIDE)
    reach = 1 / math.sqrt(distance**2 - 1)  # slope of the rays that touch the ball
    rays = forward + reach * (x[..., None] * right + y[..., None] * upward)[x**2 + y**2 < 0.98]
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    along = rays @ back
    depth = -along - np.sqrt(np.maximum(along**2 - distance**2 + 1, 0))
    return np.asarray(back + depth[:, None] * rays), np.asarray(-rays)


def _hdr_rows(data: Path, split: str) -> list[Panorama]:
    return [p for p in read_index(data, split) if p.kind == "hdr"]


def _views(panorama: Panorama) -> list[tuple[NDArray[np.uint8], Floats]]:
    """Two level photos of a panorama at one exposure, and the map around each, at HEIGHT rows."""
    linear = linearize(panorama, read_picture(panorama))
    crops = [crop_view(linear, azimuth, 0.0) for azimuth in _AZIMUTHS]
    gain = exposure_gain(np.concatenate(crops))
    rows = HEIGHT * (len(linear) // HEIGHT)
    maps = [pool_map(shrink_envmap(rotate_envmap(linear, -azimuth), rows)) for azimuth in _AZIMUTHS]
    return [(tone_map(crop * gain), light * gain) for crop, light in zip(crops, maps, strict=True)]
