"""Labels of panoramas, as a CSV file: where the sun is, and the Hosek-Wilkie sky that fits around it.

How good they are is reported too: suns of the picture against suns of the index, and both fits against rendered skies.
"""

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields, replace
from multiprocessing import get_context
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

_MAX_STD = 12.0  # deg, of a sun around which a fitted sky is trusted
_INDEX_STD = 5.0  # deg, of a sun of the index that states no uncertainty
_OUTLIER = 20.0  # deg
_RENDERED_SKIES, _RENDERED_ROWS = 60, 128  # that are labeled to see how well that goes


@dataclass(frozen=True)
class Label:
    """What training takes from a panorama; NaN where it has no value."""

    name: str
    sun_azimuth: float = math.nan  # deg, 0 = center column, positive to the right
    sun_elevation: float = math.nan  # deg above the horizon
    sun_uncertainty: float = math.nan  # deg, one standard deviation
    sun_source: str = "none"  # "given" in the index, "found" in the picture, "none" if it has none or none is known
    found_azimuth: float = math.nan  # deg, what `find_sun` returned, whatever the source
    found_elevation: float = math.nan  # deg
    turbidity: float = math.nan  # 1 to 10
    exposure: float = math.nan  # linear values / sky radiance
    fit_residual: float = math.nan  # of `fit_sky`
    fit_ok: bool = False  # turbidity and exposure may be trained on
    direct: str = ""  # whether direct sunlight reaches the scene: "yes", "partly", "no" or ""


_COLUMNS = [field.name for field in fields(Label)]


def write_labels(labels: Iterable[Label], path: str | Path) -> None:
    """Write one row per label; the file appears whole or not at all. DataError if it cannot be written.

    Args:
        labels: in the order of the rows.
        path: the CSV file.
    """
    write_table(path, _COLUMNS, ([_format_value(getattr(label, name)) for name in _COLUMNS] for label in labels))


def read_labels(path: str | Path) -> list[Label]:
    """The labels that `write_labels` wrote; DataError if the file is missing or has another layout.

    Args:
        path: the CSV file.
    """
    rows = read_table(path, _COLUMNS)
    try:
        return [Label(**{f.name: _parse_value(row[f.name], f.type) for f in fields(Label)}) for row in rows]
    except ValueError as error:
        raise DataError(f"The labels {path} cannot be read: {error}.") from error


def read_labels_of(panoramas: Sequence[Panorama], path: str | Path) -> list[Label]:
    """The label of each panorama; DataError if one is missing.

    Args:
        panoramas: rows of the index.
        path: the CSV file of labels.
    """
    by_name = {label.name: label for label in read_labels(path)}
    try:
        return [by_name[p.name] for p in panoramas]
    except KeyError as error:
        raise DataError(f"{path} has no label for {error.args[0]}; run `python -m export label` again.") from error


def _format_value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)


def _parse_value(text: str, kind: Any) -> Any:
    if kind is bool:
        return text == "yes"
    return float(text or "nan") if kind is float else text


def label_panorama(panorama: Panorama) -> Label:
    """The panorama's label; a sun of the index wins over the one in the picture.

    Args:
        panorama: a row of the index.
    """
    linear = read_linear_panorama(panorama, ANALYSIS_HEIGHT)
    detected = find_sun(linear)
    azimuth, elevation, std, source = _choose_sun(panorama, detected)
    fit = None if source == "none" else fit_sky(linear, direction(azimuth, max(elevation, 0.0)))
    label = Label(panorama.name, azimuth, elevation, std, source, direct=panorama.direct)
    if detected:
        label = replace(label, found_azimuth=detected.azimuth, found_elevation=detected.elevation)
    if fit is None:
        return label
    fit_ok = bool(fit.ok and std <= _MAX_STD and not panorama.sky_is_altered)
    return replace(label, turbidity=fit.turbidity, exposure=fit.exposure, fit_residual=fit.residual, fit_ok=fit_ok)


def _choose_sun(panorama: Panorama, detected: DetectedSun | None) -> tuple[float, float, float, str]:
    """Azimuth, elevation, standard deviation [deg] and source."""
    if panorama.sun_azimuth is not None and panorama.sun_elevation is not None:
        std = panorama.sun_uncertainty
        return panorama.sun_azimuth, panorama.sun_elevation, _INDEX_STD if std is None else std, "given"
    judged = panorama.sun == "none" or panorama.label  # someone looked and could not tell
    if detected is None or judged:
        return math.nan, math.nan, math.nan, "none"
    return detected.azimuth, detected.elevation, max(2.0, detected.radius / 2), "found"


def _sun_agreement(panoramas: Iterable[Panorama], labels: Iterable[Label]) -> str:
    """Detected suns against those of the index, over the panoramas whose sun it states as visible or as none."""
    by_name = {label.name: label for label in labels}
    pairs = [(panorama.sun, by_name[panorama.name]) for panorama in panoramas]
    visible = [label for sun, label in pairs if sun == "visible" and label.sun_source == "given"]
    overcast = [label for sun, label in pairs if sun == "none"]
    errors = np.array([_sun_error(label) for label in visible if not math.isnan(label.found_azimuth)])
    low, median, high = (float(v) for v in np.percentile(errors, [25, 50, 75])) if len(errors) else [math.nan] * 3
    outlier_rate = float((errors > _OUTLIER).mean()) if len(errors) else math.nan
    rejected = sum(math.isnan(label.found_azimuth) for label in overcast)
    return (
        f"sun found in {len(errors)} of {len(visible)}, off by {median:.2f} deg in the median "
        f"(quartiles {low:.2f} and {high:.2f}), {outlier_rate:.1%} by more than 20 deg. "
        f"No sun found in {rejected} of {len(overcast)} without one"
    )


def _sun_error(label: Label) -> float:
    true = direction(label.sun_azimuth, label.sun_elevation)
    return float(angle_between(direction(label.found_azimuth, label.found_elevation), true))


def _check_rendered() -> str:
    """How labels of rendered clear skies agree with the truth: clipped to 8 bits, half with buildings and trees."""
    scenes = [render_panorama(seed, _RENDERED_ROWS, things=8 * (seed % 2)) for seed in range(_RENDERED_SKIES)]
    scenes = [scene for scene in scenes if scene.sun_visible]
    sun_errors, turbidity, exposure = [], [], []
    for scene in scenes:
        picture, sun = decode_srgb(scene.picture), direction(scene.sun_azimuth or 0.0, scene.sun_elevation or 0.0)
        if detected := find_sun(picture):
            sun_errors.append(float(angle_between(detected.direction, sun)))
        if fit := fit_sky(picture, sun):
            turbidity.append(abs(fit.turbidity - (scene.turbidity or 0.0)))
            exposure.append(abs(math.log(fit.exposure / scene.exposure)))
    return (
        f"sun found in {len(sun_errors)} of {len(scenes)}, off by {np.median(sun_errors):.2f} deg in the median; "
        f"sky fitted in {len(turbidity)}, turbidity off by {np.median(turbidity):.3f} "
        f"and exposure by {np.median(exposure):.2%} in the median"
    )


def check_labels(data: Path, labels: Path) -> tuple[str, ...]:
    """Sentences about how well suns and skies that are found agree with known ones.

    Args:
        data: folder of panoramas.
        labels: CSV file of `label`.
    """
    return (
        f"Given suns: {_sun_agreement(read_index(data), read_labels(labels))}",
        f"Skies that the project renders: {_check_rendered()}",
    )


def label_folder(data: Path, out: Path, workers: int = 2) -> None:
    """Label a folder of panoramas, write the labels and print how accurate they are.

    Args:
        data: folder with `panoramas.csv`.
        out: CSV file to write.
        workers: processes.
    """
    panoramas = read_index(data)
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:  # a fork beside threads may wait for ever
        labels = list(pool.map(label_panorama, panoramas, chunksize=8))
    write_labels(labels, out)
    trusted = [label for label in labels if label.fit_ok]
    by_eye = [panorama for panorama in panoramas if "machine" not in panorama.label]
    print(f"{out}: {len(labels)} panoramas, {sum(label.sun_source != 'none' for label in labels)} with a sun")
    print(f"found suns against given ones: {_sun_agreement(panoramas, labels)}")
    print(f"  against those that people alone gave: {_sun_agreement(by_eye, labels)}")
    print(
        f"trusted sky fits: {len(trusted)}; turbidity {_quartiles([label.turbidity for label in trusted])}, "
        f"exposure {_quartiles([label.exposure for label in trusted])}"
    )
    print(f"rendered skies: {_check_rendered()}")


def _quartiles(values: Sequence[float]) -> str:
    return "/".join(f"{value:.3g}" for value in np.percentile(values, [25, 50, 75])) if values else "none"
