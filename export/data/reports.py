"""How good labels are: found suns against given ones, and both fits against rendered panoramas."""

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.data.labelling import label_panorama
from export.data.labels import Label, write_labels
from export.data.panoramas import Panorama, read_index
from export.data.pictures import decode
from export.data.synthetic import render_panorama
from lighting.geometry import angle_between, direction
from lighting.probe.sky_fit import fit_sky
from lighting.probe.sun_finder import find_sun


@dataclass(frozen=True)
class Agreement:
    """How `find_sun` agrees with suns that are given."""

    visible: int  # panoramas whose sun is given and in the picture
    found: int  # of these, a sun was found
    error_25: float  # deg, quartiles of the angle between found and given
    error_50: float
    error_75: float
    gross: float  # share of the found ones that are more than 20 deg off
    overcast: int  # panoramas without a sun
    rejected: int  # of these, none was found

    def __str__(self) -> str:
        return (
            f"sun found in {self.found} of {self.visible}, off by {self.error_50:.2f} deg in the median "
            f"(quartiles {self.error_25:.2f} and {self.error_75:.2f}), {self.gross:.1%} by more than 20 deg; "
            f"no sun found in {self.rejected} of {self.overcast} without one"
        )


@dataclass(frozen=True)
class RenderedCheck:
    """How labels of rendered panoramas agree with what they were rendered from."""

    rendered: int  # panoramas with a visible sun
    found: int
    sun_error: float  # deg, median
    fitted: int  # with the true sun
    turbidity_error: float  # median of the absolute
    exposure_error: float  # median of |log|

    def __str__(self) -> str:
        return (
            f"sun found in {self.found} of {self.rendered}, off by {self.sun_error:.2f} deg in the median; "
            f"sky fitted in {self.fitted}, turbidity off by {self.turbidity_error:.3f} "
            f"and exposure by {self.exposure_error:.2%} in the median"
        )


def agreement(panoramas: Iterable[Panorama], labels: Iterable[Label]) -> Agreement:
    """Found suns against given ones, over the panoramas whose sun is given as visible or as none."""
    by_name = {label.name: label for label in labels}
    pairs = [(panorama.sun, by_name[panorama.name]) for panorama in panoramas]
    visible = [label for sun, label in pairs if sun == "visible" and label.sun_source == "given"]
    overcast = [label for sun, label in pairs if sun == "none"]
    errors = np.array([_error(label) for label in visible if not math.isnan(label.found_azimuth)])
    low, median, high = (float(v) for v in np.percentile(errors, [25, 50, 75])) if len(errors) else [math.nan] * 3
    gross = float((errors > 20.0).mean()) if len(errors) else math.nan
    rejected = sum(math.isnan(label.found_azimuth) for label in overcast)
    return Agreement(len(visible), len(errors), low, median, high, gross, len(overcast), rejected)


def _error(label: Label) -> float:
    given = direction(label.sun_azimuth, label.sun_elevation)
    return float(angle_between(direction(label.found_azimuth, label.found_elevation), given))


def check_rendered(count: int = 60, height: int = 128) -> RenderedCheck:
    """Label `count` rendered clear skies, clipped to 8 bits like a photo, half of them with buildings and trees."""
    scenes = [render_panorama(seed, height, things=8 * (seed % 2)) for seed in range(count)]
    scenes = [scene for scene in scenes if scene.sun_visible]
    pictures = [decode(scene.picture) for scene in scenes]
    suns = [direction(scene.sun_azimuth or 0.0, scene.sun_elevation or 0.0) for scene in scenes]
    found = [(find_sun(picture), sun) for picture, sun in zip(pictures, suns, strict=True)]
    fits = [(fit_sky(picture, sun), scene) for picture, sun, scene in zip(pictures, suns, scenes, strict=True)]
    sun_errors = [float(angle_between(one.direction, sun)) for one, sun in found if one]
    turbidity = [abs(fit.turbidity - (scene.turbidity or 0.0)) for fit, scene in fits if fit]
    exposure = [abs(math.log(fit.exposure / scene.exposure)) for fit, scene in fits if fit]
    medians = [float(np.median(errors)) for errors in (sun_errors, turbidity, exposure)]
    return RenderedCheck(len(scenes), len(sun_errors), medians[0], len(turbidity), medians[1], medians[2])


def run(data: Path, out: Path, workers: int = 2) -> None:
    """Label a folder of panoramas, write the labels and print how accurate they are."""
    panoramas = read_index(data)
    with ProcessPoolExecutor(workers) as pool:
        labels = list(pool.map(label_panorama, panoramas, chunksize=8))
    write_labels(labels, out)
    trusted = [label for label in labels if label.fit_ok]
    by_eye = [panorama for panorama in panoramas if "machine" not in panorama.label]
    print(f"{out}: {len(labels)} panoramas, {sum(label.sun_source != 'none' for label in labels)} with a sun")
    print(f"found suns against given ones: {agreement(panoramas, labels)}")
    print(f"  against those that people alone gave: {agreement(by_eye, labels)}")
    print(
        f"trusted sky fits: {len(trusted)}; turbidity {_quartiles([label.turbidity for label in trusted])}, "
        f"exposure {_quartiles([label.exposure for label in trusted])}"
    )
    print(f"rendered skies: {check_rendered()}")


def _quartiles(values: Sequence[float]) -> str:
    return "/".join(f"{value:.3g}" for value in np.percentile(values, [25, 50, 75])) if values else "none"
