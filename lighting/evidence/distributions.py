"""One view's distribution of the sun as a turned camera, an elevation or an uncertain heading has it."""

import numpy as np

from lighting.circular import HEADINGS, blur
from lighting.geometry import Floats, angles, direction
from lighting.records import Prediction
from lighting.sun_grid import grid_directions, grid_solid_angle, smooth_density

ELEVATION_SPREAD = 4.0  # deg, kernel of an elevation's density: the size of a cell

_BLUR_STEPS = (-1.5, -0.75, 0.0, 0.75, 1.5)  # in spreads, over which a noisy heading is averaged on the grid
_HIDDEN = 1.5  # deg, errors of a heading that do not show beside the 4 deg between cells


def seen_from(probability: Floats, turn: float, layout: str) -> Floats:
    """The density (N,) at the cells of a camera that is turned by `turn` [deg] clockwise from the probability's."""
    azimuth, elevation = angles(grid_directions(layout))
    return smooth_density(probability, direction(azimuth + turn, elevation), layout)


def ring_of(prediction: Prediction, elevation: float, turn: float) -> Floats:
    """The density (360,) along an elevation [deg], by azimuth from 0 to 359, as `seen_from` gives that of the cells."""
    suns = direction(HEADINGS + turn, elevation)
    return smooth_density(prediction.sun_probability, suns, prediction.spec.sun_grid)


def elevation_density(prediction: Prediction, elevation: Floats) -> Floats:
    """Density [1/sr] (N,) at elevations (N,) [deg], averaged over azimuth."""
    layout = prediction.spec.sun_grid
    cells = angles(grid_directions(layout))[1]
    weight = np.exp(-0.5 * ((elevation[:, None] - cells) / ELEVATION_SPREAD) ** 2)
    return np.asarray(weight @ prediction.sun_probability / (weight @ grid_solid_angle(layout)))


def noisy_cells(prediction: Prediction, noise: float, useless: float) -> Floats:
    """Probabilities (N,) over the cells after an error of the heading [deg], gross in a `useless` share of cases."""
    if not noise:
        return prediction.sun_probability
    layout = prediction.spec.sun_grid
    anywhere = elevation_density(prediction, angles(grid_directions(layout))[1]) * grid_solid_angle(layout)
    return np.asarray((1 - useless) * _turned_about(prediction, noise) + useless * anywhere)


def _turned_about(prediction: Prediction, noise: float) -> Floats:
    """Probabilities (N,) over the cells, averaged over a normal error of the heading [deg] that cells can show."""
    if noise < _HIDDEN:
        return prediction.sun_probability
    layout, weight = prediction.spec.sun_grid, np.exp(-0.5 * np.square(_BLUR_STEPS))
    seen = [seen_from(prediction.sun_probability, noise * step, layout) for step in _BLUR_STEPS]
    return np.asarray(weight @ np.array(seen) / weight.sum() * grid_solid_angle(layout))


def noisy_rings(density: Floats, noise: float, useless: float) -> Floats:
    """Densities (K, 360) after an error of the heading [deg], gross in a `useless` share of cases."""
    if not noise:
        return density
    anywhere = density.mean(axis=1, keepdims=True)
    return np.asarray((1 - useless) * blur(density, noise) + useless * anywhere)
