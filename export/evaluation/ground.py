"""How far the network's ground all around tells the brightness of the ground better than the photo's own pixels do.

The fit of lighting/envmap/ground.py, over crops of the HDR panoramas, whose ground is known.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.data import DataError
from export.evaluation.light import estimates, judged
from export.evaluation.records import Names
from export.evaluation.tables import table
from lighting.colour import luminance
from lighting.envmap import level_irradiance
from lighting.envmap.ground import brightness_below, photo_ground
from lighting.geometry import Floats
from lighting.model import Model

SHARES = np.linspace(0.0, 1.0, 11)  # of the network's ground, tried
DARKER = np.linspace(0.0, 0.6, 7)  # stops by which it is too dark, tried


@dataclass(frozen=True, eq=False)
class Grounds:
    """Log2 of the ground's luminance in crops that show ground."""

    photo: Floats  # (N,) by the photo's pixels
    around: Floats  # (N,) by the network
    true: Floats  # (N,) of all the ground that the panorama shows
    weather: Names  # (N,)

    def errors(self, share: float, darker: float) -> Floats:
        """Sizes (N,) of the errors [stops] where the network's ground counts for that share."""
        return np.abs(self.photo + share * (self.around + darker - self.photo) - self.true)


def look(model: Model, data: Path, labels: Path, part: str) -> Grounds:
    """The grounds of a split's HDR panoramas; DataError where their crops show none."""
    shown = judged(data, labels, model.spec, part)
    found: list[tuple[float, float, float]] = []
    kinds: list[str] = []
    for (estimate, place), truth, weather in zip(estimates(model, shown.crops), shown.truth, shown.sunny, strict=True):
        reflectance = photo_ground(place.photo, estimate.lighting)
        if reflectance is None or place.around is None:
            continue
        radiance = float(luminance(reflectance * level_irradiance(estimate.lighting))) / np.pi
        found.append((radiance, brightness_below(place.around), float(luminance(truth.ground))))
        kinds.append(str(weather))
    if not found:
        raise DataError(f"No crop of the HDR panoramas of {part} shows ground.")
    photo, around, true = np.log2(np.array(found)).T
    return Grounds(photo, around, true, np.array(kinds))


def fit(grounds: Grounds) -> tuple[float, float]:
    """The smallest share, with its stops, whose mean error is within a standard error of the least one.

    The network has seen the places of `train`; of others it knows less.
    """
    means = np.array([[grounds.errors(share, darker).mean() for darker in DARKER] for share in SHARES])
    row, column = np.unravel_index(np.argmin(means), means.shape)
    spread = grounds.errors(SHARES[row], DARKER[column]).std() / np.sqrt(len(grounds.true))
    share = int(np.flatnonzero(means.min(axis=1) <= means.min() + spread)[0])
    return float(SHARES[share]), float(DARKER[np.argmin(means[share])])


def ground_report(model: Model, data: Path, labels: Path) -> str:
    """The fit on `train`, both weathers counting alike, and errors in both splits."""
    parts = {part: look(model, data, labels, part) for part in ("train", "val")}
    share, darker = fit(_balanced(parts["train"]))
    rows = []
    for part, grounds in parts.items():
        for weather in np.unique(grounds.weather):
            here = grounds.weather == weather
            before, after = grounds.errors(0.0, 0.0)[here], grounds.errors(share, darker)[here]
            figures = [f"{size(error):.2f}" for size in (np.median, np.mean) for error in (before, after)]
            rows.append([part, str(weather), str(here.sum()), *figures])
    header = [
        "split",
        "weather",
        "crops",
        "photo, median [stops]",
        "with the network",
        "photo, mean",
        "with the network",
    ]
    return f"Share of the network: {share:.1f}, {darker:.1f} stops brighter\n\n{table(header, rows)}"


def _balanced(grounds: Grounds) -> Grounds:
    """The same with the rarer weather repeated, so that both count alike."""
    kinds, counts = np.unique(grounds.weather, return_counts=True)
    chosen = np.concatenate([
        np.resize(np.flatnonzero(grounds.weather == kind), int(counts.max())) for kind in kinds
    ])  # fmt: skip
    return Grounds(*(values[chosen] for values in (grounds.photo, grounds.around, grounds.true, grounds.weather)))
