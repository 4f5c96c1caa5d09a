"""The camera scored as calibration papers score it: the area under the recall of errors up to a few degrees.

AUC of errors as in GeoCalib (Veicht et al., ECCV 2024); the horizon's error and its AUC as in HLW (Workman et al.,
BMVC 2016): the largest distance between the true and the estimated horizon inside the picture, over its height.
"""

import numpy as np

from export.evaluation.metrics import median, share
from export.evaluation.records import Answers, Truth
from lighting.geometry import Floats

ANGLES = {"elevation": 0, "roll": 1, "fov": 2}  # columns of a camera
UP_TO = (1.0, 5.0, 10.0)  # deg
HORIZON_UP_TO = 0.25  # of the picture's height
NOTICED = 0.05  # of the picture's height; most people see a horizon that is further off


def camera_scores(truth: Truth, said: Answers) -> dict[str, float]:
    """Figures of all crops, in percent; the horizon's median error in percent of the picture's height."""
    errors = np.abs(said.camera - truth.camera)
    found = {
        f"{name} AUC {limit:g}°": recall_area(errors[:, column], limit)
        for name, column in ANGLES.items()
        for limit in UP_TO
    }
    horizon = np.abs(horizon_ends(said.camera, truth.aspect) - horizon_ends(truth.camera, truth.aspect)).max(axis=1)
    return {
        **found,
        "horizon AUC": recall_area(horizon, HORIZON_UP_TO),
        "horizon off %": 100 * median(horizon),
        f"horizon < {100 * NOTICED:g} %": share(horizon < NOTICED),
    }


def recall_area(errors: Floats, limit: float) -> float:
    """Area [%] under the share of errors (N,) below a threshold, over thresholds from 0 to `limit`."""
    return float(100 * np.mean(np.clip(1 - errors / limit, 0, 1)))


def horizon_ends(camera: Floats, aspect: Floats) -> Floats:
    """Heights (N, 2) of the horizon at the picture's left and right edge, in picture heights above its centre.

    `camera` (N, 3) holds elevation, roll and vertical field of view in deg, `aspect` (N,) width over height.
    """
    elevation, roll, fov = np.radians(camera).T
    focal = 0.5 / np.tan(fov / 2)
    sides = np.stack([-aspect / 2, aspect / 2], axis=1)
    return np.asarray((np.sin(roll)[:, None] * sides - (focal * np.tan(elevation))[:, None]) / np.cos(roll)[:, None])
