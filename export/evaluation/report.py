"""The tables that `python -m export evaluate` prints, in Markdown."""

import math

import numpy as np

from export.evaluation.metrics import (
    Answers,
    Bools,
    Truth,
    camera_figures,
    difference_interval,
    median_interval,
    select,
    sun_error,
    sun_figures,
    table,
)
from lighting.geometry import angles

ELEVATIONS = ((0, 20), (20, 45), (45, 90))  # deg, bins of the true sun
IN_VIEW = ("sun in view", "sky in view", "no sky")
DECIMALS = {  # 1 in all other columns
    "crops": 0,
    "fitted to": 0,
    "temperature": 2,
    "NLL": 2,
    "NLL, before": 2,
    "NLL, after": 2,
    "visibility AUC": 2,
}


def report(protocol: str, truth: Truth, said: dict[str, Answers], ours: str) -> str:
    """All tables of one protocol."""
    scored = select(truth, truth.scored)
    answered = {name: select(a, truth.scored) for name, a in said.items()}
    return "\n\n".join(
        [
            f"## Protocol `{protocol}`: {len(truth.scored)} crops, {len(scored.sun)} with a sun to score "
            f"({len(np.unique(scored.panorama))} panoramas of {len(np.unique(scored.place))} places)",
            "Sun [deg, nat]",
            figures_table({name: sun_figures(scored, a) for name, a in answered.items()}),
            "Median sun error: 95 % intervals, drawing panoramas and drawing places",
            intervals_table(scored, answered, ours),
            f"`{ours}` by true sun elevation, and by what is in view",
            figures_table(breakdown(scored, answered[ours])),
            "Camera and sky, over all crops [deg]",
            figures_table({n: camera_figures(truth, a) for n, a in said.items() if np.isfinite(a.camera).all()}),
        ]
    )


def in_view_report(truth: Truth, said: dict[str, Answers]) -> str:
    """The tables of crops that hold the sun: each method's, then ours, which is the first, by true elevation."""
    ours = next(iter(said))
    counts = f"{len(truth.sun)} crops of {len(np.unique(truth.panorama))} panoramas"
    rows = {name: sun_figures(truth, a) for name, a in said.items()}
    heights = {name: figures for name, figures in breakdown(truth, said[ours]).items() if name not in IN_VIEW}
    return "\n\n".join(
        [
            f"## Sun in the picture: {counts} [deg, nat]",
            "Views as in training, half of them near `paper` and half as in `phone`, turned until they hold the sun.",
            figures_table(rows),
            f"`{ours}` by true sun elevation",
            figures_table(heights),
        ]
    )


def figures_table(rows: dict[str, dict[str, float]]) -> str:
    """One row a method or a group, one column a figure."""
    columns = list(next(iter(rows.values())))
    return table(["", *columns], [[name, *(number(row[c], c) for c in columns)] for name, row in rows.items()])


def number(value: float, column: str) -> str:
    """A figure as people read it."""
    if not math.isfinite(value):
        return "-"
    decimals = DECIMALS.get(column, 1)
    return f"{value:.{decimals}f}"


def intervals_table(truth: Truth, said: dict[str, Answers], ours: str) -> str:
    """Each method's median with its interval, and that of our median less its."""
    errors = {name: sun_error(truth, a) for name, a in said.items()}
    rows = []
    for name, error in errors.items():
        row = [name, f"{np.median(error):.1f}"]
        for units in (truth.panorama, truth.place):
            row.append(interval(median_interval(error, units)))
            row.append("" if name == ours else interval(difference_interval(errors[ours], error, units)))
        rows.append(row)
    return table(["", "median", "panoramas", "ours less it", "places", "ours less it"], rows)


def interval(ends: tuple[float, float], decimals: int = 1) -> str:
    """Both ends of an interval."""
    return f"{ends[0]:.{decimals}f} to {ends[1]:.{decimals}f}"


def breakdown(truth: Truth, said: Answers) -> dict[str, dict[str, float]]:
    """Sun figures by true elevation and by what is in view."""
    return {n: sun_figures(select(truth, chosen), select(said, chosen)) for n, chosen in groups(truth).items()}


def groups(truth: Truth) -> dict[str, Bools]:
    """Which crops (N,) have their sun at each height, and which have what in view; none is empty."""
    elevation = angles(truth.sun)[1]
    found = {f"sun {low} to {high}°": (elevation >= low) & (elevation < high) for low, high in ELEVATIONS}
    found |= {name: truth.in_view == name for name in IN_VIEW}
    return {name: chosen for name, chosen in found.items() if chosen.any()}
