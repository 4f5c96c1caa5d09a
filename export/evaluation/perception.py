"""How many people notice a wrong camera in a composite, after a study of Hold-Geoffroy et al. [1].

In the study, people saw two pictures of an object in a photo, one with the true camera and one with another. The share
that prefers the true one is 50 % where nobody notices and 100 % where all do. Lines are fitted here to the study's
shares: each error adds to 50 % in proportion, by a slope that depends on the true value.

References:
    [1] Hold-Geoffroy et al., A perceptual measure for deep single image camera calibration, CVPR 2018.
"""

import numpy as np

from lighting.geometry import Floats

_HORIZON_SLOPE = 0.8  # % of people for each % of the picture's height, wherever the horizon lies
_LEVEL_ROLL_SLOPE = 3.5  # % of people for each deg, of a camera that is level
_ROLLED = 11.0  # deg, of a rolled camera, whose slopes are:
_TOO_LEVEL_SLOPE, _TOO_ROLLED_SLOPE = 2.8, 1.1  # % of people for each deg
_FOVS = (55.0, 75.0)  # deg, of the horizontal fields of view whose slopes are:
_TOO_NARROW_SLOPES, _TOO_WIDE_SLOPES = (0.81, 0.465), (0.0, 0.17)  # % of people for each deg


def horizon_noticed(error: Floats) -> Floats:
    """Share (N,) [%] of people who prefer the true horizon, 50 to 100.

    Args:
        error: (N,) distance between the horizons, in picture heights; of any sign.
    """
    return _share(_HORIZON_SLOPE * 100 * np.abs(error))


def roll_noticed(true: Floats, estimate: Floats) -> Floats:
    """Share (N,) [%] of people who prefer the true roll, 50 to 100.

    Args:
        true: (N,) roll [deg].
        estimate: (N,) roll [deg].
    """
    is_too_level = np.abs(estimate) < np.abs(true)
    rolled = np.where(is_too_level, _TOO_LEVEL_SLOPE, _TOO_ROLLED_SLOPE)
    way = np.clip(np.abs(true) / _ROLLED, 0.0, 1.0)
    slope = _LEVEL_ROLL_SLOPE + way * (rolled - _LEVEL_ROLL_SLOPE)
    return _share(slope * np.abs(estimate - true))


def fov_noticed(true: Floats, estimate: Floats) -> Floats:
    """Share (N,) [%] of people who prefer the true field of view, 50 to 100.

    Args:
        true: (N,) horizontal field of view [deg].
        estimate: (N,) horizontal field of view [deg].
    """
    narrow, wide = (np.interp(true, _FOVS, slopes) for slopes in (_TOO_NARROW_SLOPES, _TOO_WIDE_SLOPES))
    return _share(np.where(estimate < true, narrow, wide) * np.abs(estimate - true))


def _share(beyond_chance: Floats) -> Floats:
    return np.asarray(np.clip(50.0 + beyond_chance, 50.0, 100.0))
