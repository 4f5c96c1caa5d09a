"""How a camera that photographs the sky stood, by the suns that its pictures show and the ephemeris.

One sun leaves the mirror image of a picture as likely as the picture, and a wrong lens shows in the elevation alone.
Suns of several hours are points on the sphere that the camera and the ephemeris both name. The rotation between them is
the one of least squares (Kabsch 1976), for each of the lenses tried.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ProbeError
from lighting.geometry import Floats, angle_between, wrap_azimuth
from lighting.probe.fisheye import Lens, unproject_from_lens
from lighting.registration.rotations import nearest_rotation

_MIN_SUNS = 3  # that a series needs
_MIN_ARC = 15.0  # deg, that the suns of a series must span
_MIN_SUNS_FOR_FOV = 4  # and
_MIN_ARC_FOR_FOV = 40.0  # deg, from which on the field of view is fitted too
_FOV_REACH, _FOV_STEPS = 0.2, (0.02, 0.004, 0.001)  # of the field of view: how far it is sought, and in what steps
_OUTLIER_MEDIANS = 4.0  # medians of the residuals
_MIN_OUTLIER = 1.0  # deg


@dataclass(frozen=True, eq=False)
class Alignment:
    """How a camera stood and what its lens is."""

    rotation: Floats
    """(3, 3), takes column vectors of the camera to the world's."""
    lens: Lens
    """The lens that fits."""
    residuals: Floats
    """(N,) deg, between each sun found and the ephemeris."""
    used: NDArray[np.bool_]
    """(N,), suns that were not left out as wrong."""

    @property
    def residual(self) -> float:
        """Root mean square over the suns used [deg]."""
        return float(np.sqrt(np.mean(self.residuals[self.used] ** 2)))

    @property
    def tilt(self) -> float:
        """Angle [deg] between the camera's upward direction, by its elevation, and the zenith."""
        return float(angle_between(self.rotation @ np.array([0.0, 1.0, 0.0]), [0.0, 1.0, 0.0]))


def yaw_rotation(yaw: float) -> Floats:
    """Return the rotation (3, 3) that adds a yaw to every azimuth.

    Args:
        yaw: deg, clockwise seen from above.
    """
    c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def align_by_sun(lens: Lens, observed: tuple[float, float], expected: tuple[float, float]) -> Alignment:
    """Align one camera by one sun: its yaw alone.

    Args:
        lens: the camera's projection.
        observed: deg, azimuth and elevation of the sun in the camera's frame.
        expected: deg, azimuth and elevation by the ephemeris.
    """
    rotation = yaw_rotation(float(wrap_azimuth(expected[0] - observed[0])))
    return Alignment(rotation, lens, np.array([abs(expected[1] - observed[1])]), np.array([True]))


def align_series(lens: Lens, pixels: Floats, suns: Floats) -> Alignment:
    """Align one camera by the suns of several hours: rotation, mirror sense and, with enough of them, field of view.

    Args:
        lens: the projection as the user states it.
        pixels: (N, 2) x and y of the suns in the pictures.
        suns: (N, 3) unit vectors to the suns in the world, by the ephemeris.

    Raises:
        ProbeError: fewer than _MIN_SUNS suns, or suns too near each other.

    References:
        [1] Kabsch, A solution for the best rotation to relate two sets of vectors, Acta Cryst. A32, 1976.
    """
    arc = float(max(angle_between(suns[:, None], suns[None]).max(), 0.0))
    if len(suns) < _MIN_SUNS or arc < _MIN_ARC:
        raise ProbeError(
            f"A series needs the sun in {_MIN_SUNS} probes or more over {_MIN_ARC:g} deg of its path; "
            f"it was found in {len(suns)}, over {arc:.0f} deg."
        )
    senses = [lens, replace(lens, mirrored=not lens.mirrored)]
    return min((_fit_series(sense, pixels, suns, arc) for sense in senses), key=_robust_rms)


def _fit_series(lens: Lens, pixels: Floats, suns: Floats, arc: float) -> Alignment:
    if len(suns) < _MIN_SUNS_FOR_FOV or arc < _MIN_ARC_FOR_FOV or lens.kind in ("ball", "latlong"):
        return _fit_rotation(lens, pixels, suns)
    best, reach = _fit_rotation(lens, pixels, suns), _FOV_REACH
    for step in _FOV_STEPS:
        factors = np.arange(-reach, reach + step / 2, step)
        lenses = [replace(best.lens, fov=min(best.lens.fov * (1 + factor), 359.0)) for factor in factors]
        best = min([best, *(_fit_rotation(each, pixels, suns) for each in lenses)], key=_robust_rms)
        reach = step
    return best


def _robust_rms(alignment: Alignment) -> float:
    """What is made small: the root mean square with the worst suns counted as outliers."""
    worst = np.maximum(_OUTLIER_MEDIANS * np.median(alignment.residuals), _MIN_OUTLIER)
    return float(np.sqrt(np.mean(np.minimum(alignment.residuals, worst) ** 2)))


def _fit_rotation(lens: Lens, pixels: Floats, suns: Floats) -> Alignment:
    """The rotation of least squares, twice: the second time without suns that are far off."""
    observed = unproject_from_lens(lens, pixels)
    visible = np.asarray(np.isfinite(observed).all(axis=-1))
    observed, used = np.where(visible[:, None], observed, [0.0, 1.0, 0.0]), visible
    for _ in range(2):
        rotation = nearest_rotation(observed[used].T @ suns[used]).T  # Kabsch
        residuals = np.where(visible, angle_between(observed @ rotation.T, suns), 180.0)
        limit = max(_OUTLIER_MEDIANS * float(np.median(residuals)), _MIN_OUTLIER)
        is_inlier = residuals <= limit
        used = is_inlier if is_inlier.sum() >= _MIN_SUNS else used
    return Alignment(rotation, lens, residuals, used)
