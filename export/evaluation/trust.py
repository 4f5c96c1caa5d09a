"""What the word of trust in an answer is worth, and how often one of the suns that an answer lists is the true one."""

from collections.abc import Sequence

import numpy as np

from export.evaluation.metrics import Bools, figures_table, percentage
from lighting.decoding import candidate_suns, lighting_from_prediction
from lighting.geometry import Floats, angle_between, direction
from lighting.prediction import Prediction, SunDistribution
from lighting.records import Lighting, Trust
from lighting.sun_grid import grid_directions

_NEAR, _FAR = 22.5, 45.0  # deg, errors that are small, and that are no gross ones


def trust_report(title: str, predictions: Sequence[Prediction], sun: Floats) -> str:
    """Table of shares by word of trust: of all, near the true sun by the answer and by the best of its suns [%].

    Args:
        title: of what.
        predictions: N, by the pixels alone.
        sun: (N, 3) true directions.
    """
    lights = [lighting_from_prediction(prediction) for prediction in predictions]
    error = np.array([_errors(*each) for each in zip(lights, predictions, sun, strict=True)]).reshape(-1, 3)
    radii = np.array([[light.radius_50, light.radius_90] for light in lights]).reshape(-1, 2)
    words = np.array([light.trust.value for light in lights])
    parts: dict[str, Bools] = {"all": np.ones(len(lights), dtype=bool)}
    parts |= {trust.value: words == trust for trust in Trust}
    rows = {
        name: {
            "crops": float(chosen.sum()),
            "of all": percentage(chosen),
            "within 22.5°": percentage(error[chosen, 0] < _NEAR),
            "best of two": percentage(error[chosen, 1] < _NEAR),
            "best of three": percentage(error[chosen, 2] < _NEAR),
            "within 45°": percentage(error[chosen, 0] < _FAR),
            "in `radius_50`": percentage(error[chosen, 0] <= radii[chosen, 0]),
            "in `radius_90`": percentage(error[chosen, 0] <= radii[chosen, 1]),
        }
        for name, chosen in parts.items()
        if chosen.any()
    }
    return f"Trust and candidates, {title} [%]\n\n{figures_table(rows)}"


def _errors(light: Lighting, prediction: Prediction, sun: Floats) -> Floats:
    """Angles (3,) [deg] to the true sun of the answer, and of the best of its first two and three suns."""
    grid = prediction.spec.sun_grid
    suns = candidate_suns(light, grid_directions(grid), SunDistribution(grid, prediction.sun_probability))
    error = angle_between(direction([s.azimuth for s in suns], [s.elevation for s in suns]), sun)
    return np.array([error[: count + 1].min() for count in range(3)])
