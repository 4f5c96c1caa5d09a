"""The turbidity of a day from the photos themselves: the one whose skies explain them best.

Haze dims a low sun more than a high one, which changes the brightnesses over a day as much as normals do. So a wrong
turbidity bends all of them, and few photographers know it.
"""

from collections.abc import Callable

import numpy as np

from lighting.stereo.normals.solve import Session, session_noise

TURBIDITIES = (2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.5)  # tried, from very clear to hazy


def fitted_turbidity(session_at: Callable[[float], Session]) -> float:
    """The turbidity whose session leaves least of the photos unexplained; between those tried by a parabola."""
    left = np.array([session_noise(session_at(turbidity)) for turbidity in TURBIDITIES])
    best = int(np.clip(left.argmin(), 1, len(left) - 2))
    around = slice(best - 1, best + 2)
    curve = np.polyfit(TURBIDITIES[around], left[around] ** 2, 2)
    if curve[0] <= 0:
        return TURBIDITIES[int(left.argmin())]
    return float(np.clip(-curve[1] / (2 * curve[0]), TURBIDITIES[best - 1], TURBIDITIES[best + 1]))
