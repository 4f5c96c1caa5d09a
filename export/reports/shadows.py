"""How near the sun is with one shadow that a person marked, beside the network alone (`shadows.csv`)."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.data.panoramas import DataError
from lighting.errors import ParameterError
from lighting.estimator import Estimator
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, angle_between, angles, direction, wrap_azimuth
from lighting.model import Model
from lighting.photo.reader import read_photo

_HEADINGS = (
    *("marks", "n", "azimuth: median", "90 %", "whole: median", "90 %"),
    *("network: azimuth: median", "90 %", "whole: median", "90 %", "50 and 90 % regions hold"),
)


@dataclass(frozen=True)
class _MarkedAnswer:
    """What one mark makes of an answer; errors in degrees."""

    group: str
    azimuth: float
    whole: float
    network_azimuth: float
    network_whole: float
    in_regions: tuple[bool, bool]  # of 50 and 90 %


def report_shadows(model: Model, data: Path) -> str:
    """Print a table in Markdown of the sun's errors with one mark each, by kind of picture and how sure the mark is.

    Args:
        model: the network to ask.
        data: folder with `shadows.csv`.

    Raises:
        DataError: the table is missing.
    """
    table = data / "shadows.csv"
    if not table.is_file():
        raise DataError(f"{data} holds no shadows.csv.")
    estimator = Estimator(model)
    with table.open(encoding="utf-8") as lines:
        rows = [row for row in csv.DictReader(lines) if row["sun_azimuth"]]
    answers = [answer for row in rows if (answer := _answer(estimator, data, row)) is not None]
    text = [f"{len(rows) - len(answers)} marks were refused.", "", f"| {' | '.join(_HEADINGS)} |"]
    text.append("|---" * len(_HEADINGS) + "|")
    groups = {
        f"all {sure} ones in crops": [answer for answer in answers if answer.group.startswith(f"crops, {sure}")]
        for sure in ("sure", "doubtful")
    }
    for answer in answers:
        groups.setdefault(answer.group, []).append(answer)
    return "\n".join([*text, *(_row(name, members) for name, members in sorted(groups.items()) if members)])


def _answer(estimator: Estimator, data: Path, row: dict[str, str]) -> _MarkedAnswer | None:
    photo, size = read_photo(data / row["file"]), (float(row["width"]), float(row["height"]))

    def point(name: str) -> str:
        x, y = (min(max(float(row[f"{name}_{axis}"]), 0.0), side) for axis, side in zip("xy", size, strict=True))
        return f"{x},{y}"

    mark = ",".join(point(name) for name in ("foot", "tip", "top") if row[f"{name}_x"])
    sun = direction(float(row["sun_azimuth"]), float(row["sun_elevation"]))
    alone = estimator(photo, UserInput(metadata=False)).lighting.sun_direction
    try:
        light = estimator(photo, UserInput(metadata=False, shadows=[mark])).lighting
    except ParameterError:
        return None
    whole = float(angle_between(light.sun_direction, sun))
    kind, sure = "crops" if row["panorama"] else "photos", "sure" if row["sure"] == "yes" else "doubtful"
    return _MarkedAnswer(
        f"{kind}, {sure}, {row['split']}",
        _azimuth_error(light.sun_direction, sun),
        whole,
        _azimuth_error(alone, sun),
        float(angle_between(alone, sun)),
        (whole <= light.radius_50, whole <= light.radius_90),
    )


def _azimuth_error(answer: Floats, sun: Floats) -> float:
    return abs(float(wrap_azimuth(angles(answer)[0] - angles(sun)[0])))


def _row(name: str, answers: Sequence[_MarkedAnswer]) -> str:
    azimuth, whole = [a.azimuth for a in answers], [a.whole for a in answers]
    alone = [a.network_azimuth for a in answers], [a.network_whole for a in answers]
    figures = [figure for errors in (azimuth, whole, *alone) for figure in np.percentile(errors, [50, 90])]
    inside = " / ".join(f"{100 * share:.0f} %" for share in np.mean([a.in_regions for a in answers], axis=0))
    return f"| {name} | {len(answers)} | {' | '.join(f'{figure:.1f}°' for figure in figures)} | {inside} |"
