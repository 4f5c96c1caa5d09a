"""Whether pixels and metadata contradict each other more than chance explains.

A contradiction is a p-value of what the metadata says under the network's own distribution. The network is not
perfectly calibrated. So the thresholds are those that one true record in a hundred passes on unseen panoramas.
`python -m export evaluate --with-metadata` prints how often each fires on true and on false records.
"""

from collections.abc import Iterator

import numpy as np

from lighting.calibration import MAX_LENS_RATIO, lens_ratio
from lighting.errors import CodedWarning, WarningCode
from lighting.geometry import Floats, angles
from lighting.prediction import Prediction
from lighting.sun_grid import HEADINGS, blur_headings, grid_directions

MIN_ELEVATION_P_VALUE = 0.004  # by the pixels, under which the elevation of time and place is contradicted
MIN_HEADING_P_VALUE = 0.008  # the same of a compass heading
_CELL_SCALE = 2.2  # deg, of the logistic curve that smooths a cell's elevation: 4 deg of standard deviation


def consistency_warnings(
    prediction: Prediction,
    candidates: Floats,
    likelihood: Floats,
    compass: tuple[float, float] | None,
    vertical_fov: float | None,
    subject: str = "photo",
) -> Iterator[CodedWarning]:
    """One sentence for each observation that the pixels almost exclude.

    Args:
        prediction: of the network.
        candidates: (K, 2) elevation and compass azimuth [deg] of suns above the horizon; K may be 0.
        likelihood: (K, 360) density of the pixels at each candidate, for each of HEADINGS.
        compass: a heading and its standard deviation [deg]; None without a compass.
        vertical_fov: deg, by what is known of the lens; None where nothing is.
        subject: what the sentences call the pixels' source.
    """
    if len(candidates) and _elevation_p_value(prediction, candidates[:, 0]) < MIN_ELEVATION_P_VALUE:
        yield CodedWarning(
            f"The {subject} contradicts the sun's elevation by time and place, {_format_range(candidates[:, 0])}: "
            "check both.",
            WarningCode.ELEVATION_CONTRADICTED,
        )
    if len(candidates) and compass is not None and _heading_p_value(likelihood, *compass) < MIN_HEADING_P_VALUE:
        sentence = f"The {subject} contradicts the heading of {compass[0]:.0f}°: check the compass."
        yield CodedWarning(sentence, WarningCode.HEADING_CONTRADICTED)
    if vertical_fov is not None and lens_ratio(prediction.vertical_fov, vertical_fov) > MAX_LENS_RATIO:
        wider = vertical_fov > prediction.vertical_fov  # which a crop makes it
        cause = "it may be cropped" if wider else "check the focal length"
        yield CodedWarning(
            f"The lens sees {vertical_fov:.0f}° vertically, the {subject} "
            f"shows {prediction.vertical_fov:.0f}°: {cause}.",
            WarningCode.LENS_CONTRADICTED,
        )


def _elevation_p_value(prediction: Prediction, elevation: Floats) -> float:
    """Two-sided p-value (0 to 1) of the likeliest of elevations (K,) [deg] under the pixels' distribution.

    A sun on the horizon stands for those of twilight: it is as likely as that the sun is there or below.
    """
    cells = angles(grid_directions(prediction.spec.sun_grid))[1]
    below = _logistic(elevation[:, None] - cells) - _logistic(-elevation[:, None] - cells)  # cells end at the horizon
    probability = np.asarray(prediction.sun_probability, dtype=np.float64)
    lower = np.maximum(below @ probability, _logistic(-cells) @ probability)
    return float(np.max(2.0 * np.minimum(lower, 1.0 - lower)))


def _logistic(angle: Floats) -> Floats:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(angle / _CELL_SCALE, -50.0, 50.0))))


def _heading_p_value(likelihood: Floats, heading: float, heading_std: float) -> float:
    """Probability (0 to 1) of headings at most as likely as this one, by the pixels' density (K, 360) over HEADINGS."""
    total = likelihood.sum(axis=0)
    expected = blur_headings(total / total.sum(), heading_std)
    at_heading = np.interp(heading % 360.0, [*HEADINGS, 360.0], [*expected, expected[0]])
    return float(expected[expected <= at_heading].sum())


def _format_range(elevation: Floats) -> str:
    low, high = elevation.min(), elevation.max()
    if high == 0.0:  # suns of twilight, which are put on the horizon
        return "at most 0°"
    return f"{low:.0f}°" if high - low < 1.0 else f"{low:.0f} to {high:.0f}°"
