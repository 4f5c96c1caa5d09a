"""How far the network's ground all around tells the brightness of the ground better than the photo's own pixels do.

The fit of lighting/envmap/ground.py, over crops of panoramas, which tell all the ground. A network knows the places
that it learnt from, so the fit needs one that never saw those it is asked about.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.data import DataError, read_index
from export.evaluation.light import WEATHER, estimates, judged_of
from export.evaluation.records import Names
from export.evaluation.tables import table
from lighting.colour import luminance
from lighting.envmap import level_irradiance
from lighting.envmap.ground import brightness_below, photo_ground
from lighting.errors import ModelError
from lighting.geometry import Floats
from lighting.model import Model

SHARES = np.linspace(0.0, 1.0, 11)  # of the network's ground under a clear sky, tried
DARKER = np.linspace(0.0, 0.6, 7)  # stops by which it is too dark, tried
_BLACK = 1e-6  # luminance that stands for none


@dataclass(frozen=True, eq=False)
class Grounds:
    """Log2 of the ground's luminance in crops that show ground."""

    photo: Floats  # (N,) by the photo's pixels
    around: Floats  # (N,) by the network
    true: Floats  # (N,) of all the ground that the panorama shows
    cover: Floats  # (N,) of the sky, 0 clear to 1 overcast, by the network
    weather: Names  # (N,)
    place: Names  # (N,)

    def errors(self, share: float, darker: float) -> Floats:
        """Sizes (N,) of the errors [stops] where the network's ground counts for that share, less under cloud."""
        share_here = share * (1 - self.cover)
        return np.abs(self.photo + share_here * (self.around + darker - self.photo) - self.true)


def look(model: Model, data: Path, labels: Path, part: str, seen: Path | None = None) -> Grounds:
    """The grounds of a split's panoramas of WEATHER, of 8 bits as well, at places that the folder `seen` has not.

    DataError where there are none or their crops show no ground, ModelError if the network states no light.
    """
    known = {panorama.place for panorama in read_index(seen)} if seen else set()
    panoramas = [p for p in read_index(data, part) if (p.sun, p.direct) in WEATHER and p.place not in known]
    shown = judged_of(panoramas, labels, model.spec)
    found: list[tuple[float, ...]] = []
    kinds: list[tuple[str, str]] = []
    answers = estimates(model, shown.crops)
    for (estimate, place), truth, weather, (source, _) in zip(
        answers, shown.truth, shown.sunny, shown.views, strict=True
    ):
        light = estimate.lighting
        if light.sky_irradiance is None:
            raise ModelError("The network states no light.")
        reflectance = photo_ground(place.photo, light)
        if reflectance is None or place.around is None:
            continue
        radiance = float(luminance(reflectance * level_irradiance(light))) / np.pi
        levels = radiance, brightness_below(place.around), max(float(luminance(truth.ground)), _BLACK)
        found.append((*np.log2(levels), light.sky_cover or 0.0))
        kinds.append((str(weather), source.panorama.place))
    if not found:
        raise DataError(f"No crop of the panoramas of {part} that are sunny or overcast shows ground.")
    return Grounds(*np.array(found).T, *np.array(kinds).T)


def fit(grounds: Grounds) -> tuple[float, float]:
    """The smallest share, with its stops, that is no worse than the best one by more than a standard error.

    The error is that of their difference in the mean, for the same crops judge both, over places, for the crops of one
    are not independent.
    """
    errors = np.array([[grounds.errors(share, darker) for darker in DARKER] for share in SHARES])
    darker = errors.mean(axis=-1).argmin(axis=1)  # the best stops of each share
    at_best = errors[np.arange(len(SHARES)), darker]
    best = at_best[at_best.mean(axis=1).argmin()]
    good = (at_best - best).mean(axis=1) <= [standard_error(row - best, grounds.place) for row in at_best]
    share = int(np.flatnonzero(good)[0])
    return float(SHARES[share]), float(DARKER[darker[share]])


def standard_error(values: Floats, places: Names) -> float:
    """The standard error of the mean of values (N,), of which those of one place are not independent."""
    _, index = np.unique(places, return_inverse=True)
    return float(np.sqrt(np.sum(np.bincount(index, values - values.mean()) ** 2)) / len(values))


def ground_report(model: Model, data: Path, labels: Path, seen: Path | None = None) -> str:
    """The fit on places of `train` that the folder `seen` has not, both weathers alike, and errors in both splits."""
    parts = {"train": look(model, data, labels, "train", seen), "val": look(model, data, labels, "val")}
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
    first = f"Share of the network: {share:.1f} x (1 - cover), {darker:.1f} stops brighter"
    return f"{first}\n\n{table(header, rows)}"


def _balanced(grounds: Grounds) -> Grounds:
    """The same with the rarer weather repeated, so that both count alike."""
    kinds, counts = np.unique(grounds.weather, return_counts=True)
    chosen = np.concatenate([
        np.resize(np.flatnonzero(grounds.weather == kind), int(counts.max())) for kind in kinds
    ])  # fmt: skip
    known = (grounds.photo, grounds.around, grounds.true, grounds.cover, grounds.weather, grounds.place)
    return Grounds(*(values[chosen] for values in known))
