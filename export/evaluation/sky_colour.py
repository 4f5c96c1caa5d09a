"""How far the sky's colour in a photo may be trusted for the whole sky: the fit of lighting/envmap/sky_colour.py."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.crops import augment, generator, irradiance_of, load_sources, paper_camera, take, training_camera
from export.data import DataError, read_index
from export.evaluation.light import by_network
from export.evaluation.tables import table
from lighting.envmap.sky_colour import sky_ratio
from lighting.errors import ModelError
from lighting.geometry import Floats, angle_between
from lighting.model import Model
from lighting.photo import Photo

CAMERAS = (paper_camera, training_camera) * 2  # of each panorama's crops
COVERS = ((0.0, 0.2), (0.2, 0.6), (0.6, 1.01))  # ranges of cover, 0 clear to 1 overcast, told apart
_ROUNDS = 20  # of least squares, weighted so that it comes near to least absolute errors
_SMALL = 0.1  # nat, error from which a crop counts for less


@dataclass(frozen=True, eq=False)
class Skies:
    """Crops whose sky's power is known, in the colours of many cameras."""

    ratio: Floats  # (N, 3) of the sky in the picture to the map, green 1; NaN where none is seen
    cover: Floats  # (N,)
    said: Floats  # (N, 3) the sky's irradiance by the network
    true: Floats  # (N, 3)

    @property
    def seen(self) -> "Skies":
        """Those whose picture shows sky."""
        there = np.isfinite(self.ratio[:, 0])
        return Skies(self.ratio[there], self.cover[there], self.said[there], self.true[there])


def look(model: Model, data: Path, labels: Path, part: str) -> Skies:
    """Crops of all panoramas of a split that tell the power of their sky, by the pixels alone.

    DataError if there is none, ModelError if the network states no light.
    """
    rows = list(_rows(model, data, labels, part))
    if not rows:
        raise DataError(f"No panorama of {data} in `{part}` tells the power of its sky.")
    return Skies(*(np.array(column, dtype=np.float64) for column in zip(*rows, strict=True)))


def _rows(model: Model, data: Path, labels: Path, part: str) -> Iterator[tuple[Floats, float, Floats, Floats]]:
    for source in load_sources(read_index(data, part), labels):
        true = irradiance_of(source).sky
        if not np.isfinite(true).all():
            continue
        for number, camera in enumerate(CAMERAS):
            rng = generator(source.panorama.name, number, "colour of the sky")
            crop = take(source, camera(rng), model.spec)
            pixels, gains, _ = augment(crop, rng)
            height, width = pixels.shape[:2]
            light = by_network(model, Photo(pixels, width, height, "PIXELS")).lighting
            if light.sky_irradiance is None:
                raise ModelError("The network states no light.")
            ratio = sky_ratio(pixels, light)
            yield (
                np.full(3, np.nan) if ratio is None else ratio,
                light.sky_cover or 0.0,
                np.array(light.sky_irradiance),
                true * gains * crop.gain,
            )


def fit_trust(skies: Skies) -> Floats:
    """The power (2,) of the ratio under a clear sky, and what the square of the cover adds to it."""
    shift, wanted = (_chroma(values) for values in (skies.ratio, skies.true / skies.said))
    terms = (np.stack([np.ones_like(skies.cover), skies.cover**2], axis=1)[:, None] * shift[..., None]).reshape(-1, 2)
    weight = np.ones(len(terms))
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)
        trust = np.linalg.lstsq(terms * root[:, None], wanted.ravel() * root, rcond=None)[0]
        weight = 1 / np.maximum(np.abs(wanted.ravel() - terms @ trust), _SMALL)
    return np.asarray(trust)


def errors(skies: Skies, trust: Floats) -> Floats:
    """Angle [deg] (N,) between the colours of the sky's irradiance, said and true, with that trust in the picture."""
    said = skies.said * skies.ratio ** (trust[0] + trust[1] * skies.cover**2)[:, None]
    return angle_between(said, skies.true)


def sky_report(model: Model, data: Path, labels: Path) -> str:
    """The fit on `train`, and errors of the sky's colour in both splits, by the cover that the network says."""
    parts = {part: look(model, data, labels, part) for part in ("train", "val")}
    trust = fit_trust(parts["train"].seen)
    rows = []
    for part, skies in parts.items():
        seen = skies.seen
        before, after = errors(seen, np.zeros(2)), errors(seen, trust)
        for low, high in COVERS:
            here = (seen.cover >= low) & (seen.cover < high)
            if not here.any():
                continue
            medians = [f"{np.median(error[here]):.1f}" for error in (before, after)]
            means = [f"{error[here].mean():.2f}" for error in (before, after)]
            rows.append([part, f"{low:g} to {min(high, 1):g}", str(here.sum()), *medians, *means])
    shown = sum(len(skies.seen.cover) for skies in parts.values()) / sum(len(skies.cover) for skies in parts.values())
    header = ["split", "cover", "crops", "network, median [deg]", "with the photo", "network, mean", "with the photo"]
    fit = (
        f"Power of the ratio: {trust[0]:.2f} + {trust[1]:.2f} cover^2; sky is seen in {100 * shown:.0f} % of the crops."
    )
    return f"{fit}\n\n{table(header, rows)}"


def _chroma(values: Floats) -> Floats:
    """Log of red and blue over green (N, 2) of colours (N, 3)."""
    logs = np.log(np.maximum(values, 1e-9))
    return np.asarray(logs[:, ::2] - logs[:, 1:2])
