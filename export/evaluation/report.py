"""The tables that `python -m export evaluate` prints, in Markdown."""

import numpy as np

from export.evaluation.camera_scores import camera_scores
from export.evaluation.intervals import difference_interval, median_interval
from export.evaluation.metrics import camera_figures, sun_error, sun_figures
from export.evaluation.places import place_figures, visibility_by_place
from export.evaluation.records import Answers, Bools, Truth, select
from export.evaluation.tables import figures_table, interval, table
from lighting.geometry import angles

ELEVATIONS = ((0, 20), (20, 45), (45, 90))  # deg, bins of the true sun
IN_VIEW = ("sun in view", "sky in view", "no sky")


def report(protocol: str, truth: Truth, said: dict[str, Answers], alone: dict[str, Answers], ours: str) -> str:
    """All tables of one protocol; `said` has each method's answers, `alone` those of the networks without lines."""
    scored = select(truth, truth.scored)
    answered = {name: select(a, truth.scored) for name, a in said.items()}
    cameras = {name: a for name, a in said.items() if np.isfinite(a.camera).all()}
    others = [name for name, a in cameras.items() if name != ours and np.isfinite(a.radius_50).all()]
    return "\n\n".join(
        [
            f"## Protocol `{protocol}`: {len(truth.scored)} crops, {len(scored.sun)} with a sun to score "
            f"({len(np.unique(scored.panorama))} panoramas of {len(np.unique(scored.place))} places)",
            "Sun [deg, nat]",
            figures_table({name: sun_figures(scored, a) for name, a in answered.items()}),
            "Median sun error with 95 % intervals: bootstrap over panoramas and over places",
            intervals_table(scored, answered, ours),
            "Each place counted alike, however many panoramas it has [deg]",
            places_table(truth, said),
            f"`{ours}` by true sun elevation, and by what is in view",
            figures_table(breakdown(scored, answered[ours])),
            *[f"`{name}` by the same\n\n{figures_table(breakdown(scored, answered[name]))}" for name in others],
            "Camera and sky, over all crops [deg]",
            figures_table({name: camera_figures(truth, a) for name, a in cameras.items()}),
            "Camera as calibration papers score it: area under the recall of errors, and the horizon [%]",
            figures_table({name: camera_scores(truth, a) for name, a in cameras.items()}),
            "The same by the networks alone, without the straight lines that the pictures show",
            figures_table({name: camera_scores(truth, a) for name, a in alone.items()}),
        ]
    )


def in_view_report(truth: Truth, said: dict[str, Answers], known: str) -> str:
    """The tables of crops that show the sun: each method, then the first one, ours, by true elevation and as `known`.

    `known` is the table of what metadata add.
    """
    ours = next(iter(said))
    counts = f"{len(truth.sun)} crops of {len(np.unique(truth.panorama))} panoramas"
    rows = {name: sun_figures(truth, a) for name, a in said.items()}
    heights = {name: figures for name, figures in breakdown(truth, said[ours]).items() if name not in IN_VIEW}
    return "\n\n".join(
        [
            f"## Sun in the picture: {counts} [deg, nat]",
            "Cameras as in training, half near `paper` and half as in `phone`, turned until they see the sun.",
            figures_table(rows),
            f"`{ours}` by true sun elevation",
            figures_table(heights),
            f"`{ours}` with metadata: the sun keeps its pixel through the lens, and its elevation tilts the camera",
            known,
        ]
    )


def intervals_table(truth: Truth, said: dict[str, Answers], ours: str) -> str:
    """Each method's median error with its intervals, and those of our median minus that of the method."""
    errors = {name: sun_error(truth, a) for name, a in said.items()}
    rows = []
    for name, error in errors.items():
        row = [name, f"{np.median(error):.1f}"]
        for units in (truth.panorama, truth.place):
            row.append(interval(median_interval(error, units)))
            row.append("" if name == ours else interval(difference_interval(errors[ours], error, units)))
        rows.append(row)
    return table(["", "median", "over panoramas", "ours minus this", "over places", "ours minus this"], rows)


def places_table(truth: Truth, said: dict[str, Answers]) -> str:
    """Figures of the sun by place, over the crops that are scored, and of visibility over all."""
    scored = select(truth, truth.scored)
    heights = {name: chosen for name, chosen in bins(scored).items() if name not in IN_VIEW}
    rows = {}
    for name, answered in said.items():
        rows[name] = place_figures(scored, select(answered, truth.scored), heights)
        rows[name]["visibility AUC"] = visibility_by_place(truth, answered)
    return figures_table(rows)


def breakdown(truth: Truth, said: Answers) -> dict[str, dict[str, float]]:
    """Sun figures by true elevation and by what is in view."""
    return {n: sun_figures(select(truth, chosen), select(said, chosen)) for n, chosen in bins(truth).items()}


def bins(truth: Truth) -> dict[str, Bools]:
    """Which crops (N,) belong to each bin of sun elevation and of what is in view; empty bins are left out."""
    elevation = angles(truth.sun)[1]
    found = {f"sun {low} to {high}°": (elevation >= low) & (elevation < high) for low, high in ELEVATIONS}
    found |= {name: truth.in_view == name for name in IN_VIEW}
    return {name: chosen for name, chosen in found.items() if chosen.any()}
