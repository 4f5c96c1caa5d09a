"""Sun and sky labels, agreement report."""

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from export.data.panoramas import (
    DataError,
    Panorama,
    decode_srgb,
    read_index,
    read_linear_panorama,
    read_table,
    write_table,
)
from export.data.rendered_panoramas import render_panorama
from lighting.geometry import angle_between, direction
from lighting.probe.sky_fit import fit_sky
from lighting.probe.sun_detection import ANALYSIS_HEIGHT, DetectedSun, find_sun

# Labels of panoramas, as a CSV file: where the sun is, and the Hosek-Wilkie sky that fits.


@dataclass(frozen=True)
class Label:
    """What training takes from a panorama; NaN where it has no value."""

    name: str
    sun_azimuth: float
    sun_elevation: float
    sun_uncertainty: float  # deg, one sigma
    sun_source: str  # "given" in the index, "found" in the picture, "none" if it has none or none is known
    found_azimuth: float  # what `find_sun` returned, whatever the source
    found_elevation: float
    turbidity: float
    exposure: float
    fit_residual: float
    fit_ok: bool
    direct: str


_COLUMNS = [field.name for field in fields(Label)]


def write_labels(labels: Iterable[Label], path: str | Path) -> None:
    """Write one row per label; the file appears whole or not at all. DataError if it cannot be written."""
    write_table(path, _COLUMNS, ([_text(getattr(label, name)) for name in _COLUMNS] for label in labels))


def read_labels(path: str | Path) -> list[Label]:
    """The labels that `write_labels` wrote; DataError if the file is missing or has another layout."""
    rows = read_table(path, _COLUMNS)
    try:
        return [Label(**{field.name: _value(row[field.name], field.type) for field in fields(Label)}) for row in rows]
    except ValueError as error:
        raise DataError(f"The labels {path} cannot be read: {error}.") from error


def read_labels_of(panoramas: Sequence[Panorama], path: str | Path) -> list[Label]:
    """The label of each panorama, from a file of labels; DataError if one is missing."""
    known = {label.name: label for label in read_labels(path)}
    missing = [p.name for p in panoramas if p.name not in known]
    if missing:
        raise DataError(f"{path} has no label for {missing[0]}; run `python -m export label` again.")
    return [known[p.name] for p in panoramas]


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)


def _value(text: str, kind: Any) -> Any:
    if kind is bool:
        return text == "yes"
    return float(text or "nan") if kind is float else text


# How a panorama gets its label: the sun that is given or found, and the sky fitted around it.

LARGEST_UNCERTAINTY = 12.0  # deg, of a sun around which a fitted sky is trusted
GIVEN_UNCERTAINTY = 5.0  # deg, of a given sun whose uncertainty is not given


def _label_panorama(panorama: Panorama) -> Label:
    """The panorama's label; a sun given in the index wins over the one found in the picture."""
    linear = read_linear_panorama(panorama, ANALYSIS_HEIGHT)
    found = find_sun(linear)
    azimuth, elevation, uncertainty, source = _sun_of(panorama, found)
    fit = None if source == "none" else fit_sky(linear, direction(azimuth, max(elevation, 0.0)))
    return Label(
        name=panorama.name,
        sun_azimuth=azimuth,
        sun_elevation=elevation,
        sun_uncertainty=uncertainty,
        sun_source=source,
        found_azimuth=found.azimuth if found else math.nan,
        found_elevation=found.elevation if found else math.nan,
        turbidity=fit.turbidity if fit else math.nan,
        exposure=fit.exposure if fit else math.nan,
        fit_residual=fit.residual if fit else math.nan,
        fit_ok=bool(fit and fit.ok and uncertainty <= LARGEST_UNCERTAINTY and not panorama.sky_is_altered),
        direct=panorama.direct,
    )


def _sun_of(panorama: Panorama, found: DetectedSun | None) -> tuple[float, float, float, str]:
    """Azimuth, elevation, uncertainty [deg] and source."""
    if panorama.sun_azimuth is not None and panorama.sun_elevation is not None:
        given = panorama.sun_uncertainty
        return panorama.sun_azimuth, panorama.sun_elevation, GIVEN_UNCERTAINTY if given is None else given, "given"
    judged = panorama.sun == "none" or panorama.label  # someone looked and could not tell
    if found is None or judged:
        return math.nan, math.nan, math.nan, "none"
    return found.azimuth, found.elevation, max(2.0, found.radius / 2), "found"


# How good labels are: found suns against given ones, and both fits against rendered panoramas.


@dataclass(frozen=True)
class _Agreement:
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
class _RenderedCheck:
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


def sun_agreement(panoramas: Iterable[Panorama], labels: Iterable[Label]) -> _Agreement:
    """Found suns against given ones, over the panoramas whose sun is given as visible or as none."""
    by_name = {label.name: label for label in labels}
    pairs = [(panorama.sun, by_name[panorama.name]) for panorama in panoramas]
    visible = [label for sun, label in pairs if sun == "visible" and label.sun_source == "given"]
    overcast = [label for sun, label in pairs if sun == "none"]
    errors = np.array([_error(label) for label in visible if not math.isnan(label.found_azimuth)])
    low, median, high = (float(v) for v in np.percentile(errors, [25, 50, 75])) if len(errors) else [math.nan] * 3
    gross = float((errors > 20.0).mean()) if len(errors) else math.nan
    rejected = sum(math.isnan(label.found_azimuth) for label in overcast)
    return _Agreement(len(visible), len(errors), low, median, high, gross, len(overcast), rejected)


def _error(label: Label) -> float:
    given = direction(label.sun_azimuth, label.sun_elevation)
    return float(angle_between(direction(label.found_azimuth, label.found_elevation), given))


def check_rendered(count: int = 60, height: int = 128) -> _RenderedCheck:
    """Label `count` rendered clear skies, clipped to 8 bits like a photo, half of them with buildings and trees."""
    scenes = [render_panorama(seed, height, things=8 * (seed % 2)) for seed in range(count)]
    scenes = [scene for scene in scenes if scene.sun_visible]
    pictures = [decode_srgb(scene.picture) for scene in scenes]
    suns = [direction(scene.sun_azimuth or 0.0, scene.sun_elevation or 0.0) for scene in scenes]
    found = [(find_sun(picture), sun) for picture, sun in zip(pictures, suns, strict=True)]
    fits = [(fit_sky(picture, sun), scene) for picture, sun, scene in zip(pictures, suns, scenes, strict=True)]
    sun_errors = [float(angle_between(one.direction, sun)) for one, sun in found if one]
    turbidity = [abs(fit.turbidity - (scene.turbidity or 0.0)) for fit, scene in fits if fit]
    exposure = [abs(math.log(fit.exposure / scene.exposure)) for fit, scene in fits if fit]
    medians = [float(np.median(errors)) for errors in (sun_errors, turbidity, exposure)]
    return _RenderedCheck(len(scenes), len(sun_errors), medians[0], len(turbidity), medians[1], medians[2])


def label_folder(data: Path, out: Path, workers: int = 2) -> None:
    """Label a folder of panoramas, write the labels and print how accurate they are."""
    panoramas = read_index(data)
    with ProcessPoolExecutor(workers) as pool:
        labels = list(pool.map(_label_panorama, panoramas, chunksize=8))
    write_labels(labels, out)
    trusted = [label for label in labels if label.fit_ok]
    by_eye = [panorama for panorama in panoramas if "machine" not in panorama.label]
    print(f"{out}: {len(labels)} panoramas, {sum(label.sun_source != 'none' for label in labels)} with a sun")
    print(f"found suns against given ones: {sun_agreement(panoramas, labels)}")
    print(f"  against those that people alone gave: {sun_agreement(by_eye, labels)}")
    print(
        f"trusted sky fits: {len(trusted)}; turbidity {_quartiles([label.turbidity for label in trusted])}, "
        f"exposure {_quartiles([label.exposure for label in trusted])}"
    )
    print(f"rendered skies: {check_rendered()}")


def _quartiles(values: Sequence[float]) -> str:
    return "/".join(f"{value:.3g}" for value in np.percentile(values, [25, 50, 75])) if values else "none"
