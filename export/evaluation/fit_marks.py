"""What else the errors of shadows that a person marks might be, judged by what the sun's distribution gains."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from export.data.panoramas import read_table
from export.evaluation.metrics import markdown_table
from lighting.fusion.shadows import LitSide, MarkErrors, Shadow, ShadowMark, read_shadow, shadow_likelihood
from lighting.geometry import Floats, Pinhole, direction
from lighting.model import Model
from lighting.photo.reader import read_photo
from lighting.sun_grid import grid_directions, smooth_density

PHOTO_MARKS = Path(__file__).parents[1] / "data" / "photo_marks.csv"
PHOTO_TABLES = {"val": "photos.csv", "train": "photos_train.csv"}  # by split
TRUE_SUN = ("sun_azimuth", "sun_elevation")
DOUBTED_RATES = ((0.2, 0.05), (0.3, 0.1), (0.4, 0.15), (0.6, 0.2), (0.7, 0.3), (0.8, 0.2))  # tried
BORDER_STDS = (15.0, 20.0, 25.0, 30.0, 40.0)  # deg, tried


@dataclass(frozen=True, eq=False)
class _FitMark:
    """A mark with what the network answers without it."""

    mark: ShadowMark
    camera: Pinhole
    probability: NDArray[np.float32]  # (N,) of the sun grid's cells
    layout: str  # of the sun grid
    sun: Floats  # (3,)
    group: str  # such as its place: marks of one group are not independent

    def gain(self, errors: MarkErrors) -> float:
        """By how much [nat] the logarithm of the density at the true sun rises."""
        fused = self.probability * shadow_likelihood(self.mark, self.camera, grid_directions(self.layout), errors)
        before, after = (smooth_density(p, self.sun, self.layout) for p in (self.probability, fused / fused.sum()))
        return float(np.log(after / before))

    def without_border(self) -> "_FitMark":
        """The same lit side of which nobody tells the border."""
        return replace(self, mark=replace(self.mark, border=None)) if isinstance(self.mark, LitSide) else self


def shadow_text(row: dict[str, str]) -> str:
    """Return a shadow as the command line writes it, "doubt:" before it where who marked it was not sure.

    Args:
        row: of `shadows.csv`.
    """
    size = float(row["width"]), float(row["height"])
    ends = [
        min(max(float(row[f"{name}_{axis}"]), 0.0), side)
        for name in ("foot", "tip", "top")
        if row[f"{name}_x"]
        for axis, side in zip("xy", size, strict=True)
    ]
    return f"{'doubt:' * (row['sure'] != 'yes')}{','.join(map(str, ends))}"


def report_mark_errors(model: Model, data: Path) -> str:
    """Print tables in Markdown: what doubted shadows and lit sides gain by their errors' rates and widths.

    Args:
        model: the network to ask.
        data: folder with `shadows.csv` and the tables of photos.

    Raises:
        DataError: a table is missing.
    """
    doubted, lit = list(_doubted_marks(model, data)), list(_lit_marks(model, data))
    photographers = sorted({mark.group for _, mark in lit})
    halves = [f"half {photographers.index(mark.group) % 2 + 1}" for _, mark in lit]
    doubts = {
        f"{coarse:g} and {wrong:g}": [mark.gain(MarkErrors(doubted_rates=(coarse, wrong))) for _, mark in doubted]
        for coarse, wrong in DOUBTED_RATES
    }
    borders = {f"{std:g}°": [mark.gain(MarkErrors(border_std=std)) for _, mark in lit] for std in BORDER_STDS}
    borders["without the border"] = [mark.without_border().gain(MarkErrors()) for _, mark in lit]
    return "\n\n".join(
        [
            "Doubted shadows in crops by the shares that are coarse and wrong, gain [nat]:",
            _gains_table("shares", doubts, [split for split, _ in doubted], [mark.group for _, mark in doubted]),
            "Lit sides with their border by its width, gain [nat], photographers in two halves:",
            _gains_table("width", borders, halves, [mark.group for _, mark in lit]),
        ]
    )


def _gains_table(heading: str, tried: dict[str, list[float]], parts: Sequence[str], groups: Sequence[str]) -> str:
    """A row for each of the errors tried, and one of each group's gain by the errors that are best for the others."""
    gains, part, group = np.array(list(tried.values())), np.array(parts), np.array(groups)
    chosen = np.empty(gains.shape[1])
    for one in np.unique(group):
        best = gains[:, group != one].mean(axis=1).argmax()
        chosen[group == one] = gains[best, group == one]
    named = [*zip(tried, gains, strict=True), ("chosen by the others", chosen)]
    names = sorted(set(parts))
    rows = [[name, *(f"{row[part == one].mean():.2f}" for one in names), f"{row.mean():.2f}"] for name, row in named]
    counts = [f"{one} ({np.sum(part == one)})" for one in names]
    return markdown_table([heading, *counts, f"all ({len(part)})"], rows)


def _doubted_marks(model: Model, data: Path) -> Iterator[tuple[str, _FitMark]]:
    """Those of crops by split, grouped by place."""
    for row in read_table(data / "shadows.csv", ("file", "foot_x", "sure", "place", "split", *TRUE_SUN)):
        if row["sun_azimuth"] and row["panorama"] and row["sure"] != "yes":
            yield row["split"], _fit_mark(model, data, row, read_shadow(shadow_text(row)), row["place"])


def _lit_marks(model: Model, data: Path) -> Iterator[tuple[str, _FitMark]]:
    """Those of photos that have a border, by split, grouped by photographer."""
    rows = {
        row["file"]: (split, row)
        for split, table in PHOTO_TABLES.items()
        for row in read_table(data / table, ("file", "group", *TRUE_SUN))
    }
    for line in read_table(PHOTO_MARKS, ("file", "mark")):
        mark = read_shadow(line["mark"]) if line["mark"] else Shadow((0.0, 0.0), (0.0, 0.0))
        if isinstance(mark, LitSide) and mark.border is not None:
            split, row = rows[line["file"]]
            yield split, _fit_mark(model, data, row, mark, row["group"].partition("_")[0])


def _fit_mark(model: Model, data: Path, row: dict[str, str], mark: ShadowMark, group: str) -> _FitMark:
    photo = read_photo(data / row["file"])
    prediction = model.predict_one(photo)
    tilt = prediction.camera_elevation, prediction.camera_roll
    camera = Pinhole(photo.width, photo.height, prediction.vertical_fov, 0.0, *tilt)
    sun = direction(*(float(row[name]) for name in TRUE_SUN))
    return _FitMark(mark, camera, prediction.sun_probability, prediction.spec.sun_grid, sun, group)
