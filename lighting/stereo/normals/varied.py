"""Whether the light of a day's photos changed in more than its strength, which tells normals apart."""

import numpy as np
from numpy.typing import NDArray

_LEAST = 0.02  # share of the brightest, below which what differs may be noise; an hour of clear sky leaves 0.025
_BRIGHTEST = 0.999  # quantile of the values that counts as the brightest
_PROBE = 20_000  # pixels that are looked at


def is_varied(images: NDArray[np.float32], mask: NDArray[np.bool_]) -> bool:
    """Whether pixels of a mask (H, W) in images (T, H, W, C) brighten and darken in different ways.

    It is so where one picture times one strength for each photo leaves more than noise (root mean square).
    """
    rows, columns = np.nonzero(mask)
    step = max(1, len(rows) // _PROBE)
    values = images[:, rows[::step], columns[::step]].mean(axis=-1, dtype=np.float64)  # (T, P)
    brightest = float(np.quantile(values, _BRIGHTEST)) if values.size else 0.0
    powers = np.linalg.eigvalsh(values @ values.T)  # rising; the last one is that of one picture alone
    rest = np.sqrt(max(float(powers[:-1].sum()), 0.0) / max(values.size, 1))
    return bool(rest > _LEAST * brightest)
