"""From the primaries and the white that an EXR names to those of Rec.709.

Source: SMPTE RP 177, from chromaticities to XYZ; whites are adapted by Bradford's matrix, as ICC profiles have it.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats

CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # Rec.709 red, green, blue and D65, as x and y

_SAME = 1e-3  # of x and y, by which names of the same primaries differ
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def chromaticities_to_rec709(chromaticities: Sequence[float]) -> NDArray[np.float32] | None:
    """The matrix (3, 3) that takes red, green and blue of these primaries to Rec.709's; None where they are the same.

    ValueError where they span no colours.
    """
    said, wanted = (np.array(xy, dtype=np.float64).reshape(4, 2) for xy in (chromaticities, CHROMATICITIES))
    if np.allclose(said, wanted, rtol=0.0, atol=_SAME):
        return None
    if not (np.isfinite(said).all() and (np.abs(said[:, 1]) > _SAME).all()):
        raise ValueError("no chromaticities")
    here, there = (_BRADFORD @ _xyz(xy[3]) for xy in (said, wanted))
    adapted = np.linalg.inv(_BRADFORD) @ np.diag(there / here) @ _BRADFORD
    matrix = np.linalg.inv(_to_xyz(wanted)) @ adapted @ _to_xyz(said)
    if not np.isfinite(matrix).all():
        raise ValueError("no colours")
    return np.asarray(matrix, dtype=np.float32)


def _to_xyz(xy: Floats) -> Floats:
    """The matrix (3, 3) from red, green and blue to XYZ, of the primaries and the white (4, 2); white has Y = 1."""
    columns = np.stack([_xyz(primary) for primary in xy[:3]], axis=1)
    return np.asarray(columns * np.linalg.solve(columns, _xyz(xy[3])))


def _xyz(xy: Floats) -> Floats:
    """XYZ (3,) of a chromaticity (2,), Y = 1."""
    return np.array([xy[0] / xy[1], 1.0, (1.0 - xy[0] - xy[1]) / xy[1]])
