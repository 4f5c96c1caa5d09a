"""Turning a probe to the world: by one sun, which tells the yaw, or by several, which tell tilt and lens as well.

One sun leaves the mirror image of a picture as likely as the picture, and a wrong lens shows in the elevation alone.
Suns of several hours are points on the sphere that the camera and the ephemeris both name; the rotation between them is
the one of least squares (Kabsch 1976), for each of the lenses tried.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ProbeError
from lighting.geometry import Floats, angle_between, wrap_azimuth
from lighting.probe.lens import Lens, lens_directions

LEAST_SUNS = 3  # that a series needs
LEAST_ARC = 15.0  # deg, that the suns of a series must span
SUNS_FOR_LENS = 4  # and
ARC_FOR_LENS = 40.0  # deg, from which on the field of view is fitted too
_FOV_REACH, _FOV_STEPS = 0.2, (0.02, 0.004, 0.001)  # of the field of view: how far it is sought, and in what steps
_OUTLIER = 4.0  # medians of the residuals
_LEAST_OUTLIER = 1.0  # deg


@dataclass(frozen=True, eq=False)
class Alignment:
    """How a camera stood and what its lens is."""

    rotation: Floats  # (3, 3), takes column vectors of the camera to the world's
    lens: Lens
    residuals: Floats  # (N,) deg, between each sun found and the ephemeris
    used: NDArray[np.bool_]  # (N,), suns that were not left out as wrong

    @property
    def residual(self) -> float:
        """Root mean square over the suns used [deg]."""
        return float(np.sqrt(np.mean(self.residuals[self.used] ** 2)))

    @property
    def tilt(self) -> float:
        """Angle [deg] between the camera's upward direction, by its pitch, and the zenith."""
        return float(angle_between(self.rotation @ np.array([0.0, 1.0, 0.0]), [0.0, 1.0, 0.0]))


def yaw_rotation(yaw: float) -> Floats:
    """The rotation (3, 3) that adds `yaw` [deg] to every azimuth."""
    c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def align_one(lens: Lens, found: tuple[float, float], truth: tuple[float, float]) -> Alignment:
    """Yaw alone, from azimuth and elevation [deg] of one sun in the camera's frame and by the ephemeris."""
    rotation = yaw_rotation(float(wrap_azimuth(truth[0] - found[0])))
    return Alignment(rotation, lens, np.array([abs(truth[1] - found[1])]), np.array([True]))


def align_series(lens: Lens, pixels: Floats, truth: Floats) -> Alignment:
    """Rotation, mirror sense and, where the suns allow it, field of view, of pixels (N, 2) and true directions (N, 3).

    Raises ProbeError for fewer than three suns or suns too near each other.
    """
    arc = float(max(angle_between(truth[:, None], truth[None]).max(), 0.0))
    if len(truth) < LEAST_SUNS or arc < LEAST_ARC:
        raise ProbeError(
            f"A series needs the sun in {LEAST_SUNS} probes or more over {LEAST_ARC:g} deg of its path; "
            f"it was found in {len(truth)}, over {arc:.0f} deg."
        )
    senses = [lens, replace(lens, mirrored=not lens.mirrored)]
    return min((_fitted(sense, pixels, truth, arc) for sense in senses), key=_typical)


def _fitted(lens: Lens, pixels: Floats, truth: Floats, arc: float) -> Alignment:
    if len(truth) < SUNS_FOR_LENS or arc < ARC_FOR_LENS or lens.kind in ("ball", "latlong"):
        return _rotated(lens, pixels, truth)
    best, reach = _rotated(lens, pixels, truth), _FOV_REACH
    for step in _FOV_STEPS:
        factors = np.arange(-reach, reach + step / 2, step)
        best = _best(best, (_rotated(_with_fov(best.lens, factor), pixels, truth) for factor in factors))
        reach = step
    return best


def _best(first: Alignment, others: Iterable[Alignment]) -> Alignment:
    return min([first, *others], key=_typical)


def _typical(alignment: Alignment) -> float:
    """What is made small: the root mean square with the worst suns counted as outliers."""
    worst = np.maximum(_OUTLIER * np.median(alignment.residuals), _LEAST_OUTLIER)
    return float(np.sqrt(np.mean(np.minimum(alignment.residuals, worst) ** 2)))


def _with_fov(lens: Lens, factor: float) -> Lens:
    return replace(lens, fov=min(lens.fov * (1 + factor), 359.0))


def _rotated(lens: Lens, pixels: Floats, truth: Floats) -> Alignment:
    """The rotation of least squares, twice: the second time without suns that are far off."""
    seen = lens_directions(lens, pixels)
    shown = np.asarray(np.isfinite(seen).all(axis=-1))
    seen, used = np.where(shown[:, None], seen, [0.0, 1.0, 0.0]), shown
    for _ in range(2):
        rotation = _kabsch(seen[used], truth[used])
        residuals = np.where(shown, angle_between(seen @ rotation.T, truth), 180.0)
        limit = max(_OUTLIER * float(np.median(residuals)), _LEAST_OUTLIER)
        kept = residuals <= limit
        used = kept if kept.sum() >= LEAST_SUNS else used
    return Alignment(rotation, lens, residuals, used)


def _kabsch(seen: Floats, truth: Floats) -> Floats:
    """The rotation (3, 3) with rotation @ seen nearest to truth."""
    u, _, v = np.linalg.svd(seen.T @ truth)
    turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))])
    return np.asarray((u @ turn @ v).T)
