"""Pixels that something hides from the sun in some of the photos.

A cast shadow leaves a pixel with the sky's light alone, which no normal under the open sun explains. Where the search
leaves much of the images unexplained, it is repeated with every normal in every pattern of a shadow that ends or begins
during the day. Shadows that come and go between are not among the patterns.
"""

from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from lighting.cpus import available_cpus
from lighting.stereo.mean_light import Skies
from lighting.stereo.normals.frame import Pose
from lighting.stereo.normals.search import Answer, Candidates, Progress, candidates, quiet, search

Image = NDArray[np.float32]

POOR = 2.0  # times the noise, the residual from which on shadows are thought of

_GRID = 700  # normals, 5.4 deg apart
_SHADOW, _MOMENT = 3.0, 0.3  # how unlikely a shadow is, and each photo more that it lasts, as logarithms
_LEAST = 3  # photos in the sun, for a normal
_PATTERNS = 16  # at most


def shadowed(skies: Skies, pose: Pose) -> Candidates | None:
    """Normals of a grid in every pattern of shadow, without one first; None where too few photos are left for any."""
    lit = patterns(len(skies))
    if len(lit) < 2:
        return None
    sunny = candidates(skies, pose, _GRID)
    shade = candidates(replace(skies, sun_irradiance=np.zeros_like(skies.sun_irradiance)), pose, _GRID)
    light = np.where(lit[:, None, :, None, None], sunny.light, shade.light)
    brightness = np.where(lit[None, :, None, :], sunny.brightness[:, None], shade.brightness[:, None])
    hidden = (~lit).sum(axis=1)
    prior = sunny.prior - np.where(hidden > 0, _SHADOW + _MOMENT * hidden, 0)[:, None]
    return Candidates(
        np.tile(sunny.normals, (len(lit), 1)),
        light.reshape(-1, *light.shape[2:]),
        brightness.reshape(len(brightness), -1, len(skies)),
        prior.ravel().astype(np.float32),
        sunny.spacing,
    )


def patterns(moments: int) -> NDArray[np.bool_]:
    """Which photos (M, T) the sun reaches: all, all but the first few, all but the last few."""
    longest = moments - _LEAST
    some = range(1, longest + 1, max(1, -(-2 * longest // _PATTERNS)))
    number = np.arange(moments)
    rows = [number >= 0, *(number >= hidden for hidden in some), *(number < moments - hidden for hidden in some)]
    return np.stack(rows)


def search_shadowed(
    images: Image, table: Candidates, shaded: Candidates | None, noise: float, progress: Progress = quiet
) -> Answer:
    """The search of pixels (P, T, C), repeated with shadows where it leaves POOR times the noise."""
    first = search(images, table, noise, progress, available_cpus())
    poor = np.flatnonzero(first.residual > POOR * noise)
    if shaded is None or not len(poor):
        return first
    second = search(images[poor], shaded, noise, progress, available_cpus())
    better = second.residual < first.residual[poor]
    for field in fields(Answer):
        getattr(first, field.name)[poor[better]] = getattr(second, field.name)[better]
    return first
