"""Labels of a panorama: where the sun is, and the turbidity and exposure of the Hosek-Wilkie sky that fits it."""

import csv
import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from export.data.panoramas import DataError, Panorama, read_linear
from export.data.regions import HEIGHT
from export.data.sky_fit import fit_sky
from export.data.sun_finder import Sun, find_sun
from lighting.files import replacing
from lighting.geometry import direction

WEAKEST_SUN = 12.0  # deg; a sun less certain than this gives no fit to be trusted


@dataclass(frozen=True)
class Label:
    """What training takes from a panorama; NaN where it has no value."""

    name: str
    sun_azimuth: float
    sun_elevation: float
    sun_uncertainty: float  # deg, one sigma
    sun_source: str  # "given" in the index, "found" in the picture, "none" where it has none or none is known
    found_azimuth: float  # what `find_sun` says, whatever the source
    found_elevation: float
    turbidity: float
    exposure: float
    fit_residual: float
    fit_ok: bool
    direct: str


def label_panorama(panorama: Panorama) -> Label:
    """The panorama's label; a sun given in the index wins over the one found in the picture."""
    linear = read_linear(panorama, HEIGHT)
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
        fit_ok=bool(fit and fit.ok and uncertainty <= WEAKEST_SUN and not panorama.sky_is_altered),
        direct=panorama.direct,
    )


def _sun_of(panorama: Panorama, found: Sun | None) -> tuple[float, float, float, str]:
    """Azimuth, elevation, uncertainty [deg] and source."""
    if panorama.sun_azimuth is not None and panorama.sun_elevation is not None:
        uncertainty = 5.0 if panorama.sun_uncertainty is None else panorama.sun_uncertainty
        return panorama.sun_azimuth, panorama.sun_elevation, uncertainty, "given"
    judged = panorama.sun == "none" or panorama.label  # someone looked and could not tell
    if found is None or judged:
        return math.nan, math.nan, math.nan, "none"
    return found.azimuth, found.elevation, max(2.0, found.radius / 2), "found"


def write_labels(labels: Iterable[Label], path: str | Path) -> None:
    """One row a label; the file appears whole or not at all. DataError if it cannot be written."""
    names = [field.name for field in fields(Label)]
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(names)
            writer.writerows([_text(getattr(label, name)) for name in names] for label in labels)
    except OSError as error:
        raise DataError(f"The labels cannot be written to {path}: {error}.") from error


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)


def read_labels(path: str | Path) -> list[Label]:
    """What `write_labels` wrote; DataError if the file is missing or of another layout."""
    try:
        with Path(path).open(newline="", encoding="utf-8") as file:
            return [
                Label(**{field.name: _value(row[field.name], field.type) for field in fields(Label)})
                for row in csv.DictReader(file, restval="")
            ]
    except KeyError as error:
        raise DataError(f"The labels {path} have no column {error}.") from error
    except (OSError, ValueError, csv.Error) as error:
        raise DataError(f"The labels {path} cannot be read: {error}.") from error


def _value(text: str, kind: Any) -> Any:
    if kind is bool:
        return text == "yes"
    return float(text or "nan") if kind is float else text
