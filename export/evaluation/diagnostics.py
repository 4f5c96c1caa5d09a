"""The report's sections after the figures: reliability of the probabilities, turbidity, the worst crops by cause.

Reliability is how often the true sun lies in the region that holds a probability. Two regions are tested: the cells of
highest density, and the cone around the answer, whose radii are `radius_50` and `radius_90`.

The contact sheet of the worst crops shows pictures of the data: it is for looking at failures, and never published.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from export.crops.crops import crop_panorama
from export.data.panoramas import write_table
from export.evaluation.metrics import (
    FLIP,
    Answers,
    Bools,
    Names,
    Truth,
    answers_from_estimates,
    azimuth_error,
    difference_interval,
    elevation_error,
    figures_table,
    format_interval,
    markdown_table,
    percentage,
    select_crops,
    sun_error,
    sun_figures,
)
from export.evaluation.multi_view import place_halves
from export.evaluation.predictions import MIN_DENSITY, View, sun_nll
from export.evaluation.report import CONSTANT, IN_VIEW, sun_bins
from lighting.color import tone_map
from lighting.decoding import sun_from_prediction
from lighting.files import atomic_write
from lighting.geometry import Floats, angle_between, angles, direction
from lighting.prediction import Prediction
from lighting.sun_grid import cumulative_by_angle, grid_directions, grid_solid_angle, temper

RELIABILITY_FILE = "reliability.png"


@dataclass(frozen=True)
class ScoredCrops:
    """The answers for the crops of one protocol."""

    views: Sequence[View]
    truth: Truth
    predictions: Sequence[Prediction]  # of our network
    with_lens: Sequence[Prediction]  # the same, of photos that state their lens
    answers: dict[str, Answers]  # of each method, our network first
    network_answers: dict[str, Answers]  # of each network without what else the pictures show

    @property
    def ours(self) -> str:
        """The name of our network."""
        return next(iter(self.answers))


def diagnostic_sections(scored: dict[str, ScoredCrops], out: Path, *, failures: bool) -> list[str]:
    """The sections about the protocols that have a sun to score; writes reliability.png.

    Args:
        scored: by protocol.
        out: folder for the pictures.
        failures: write failures.csv and failures.png as well.
    """
    levels = {protocol: _reliability_curves(crops.truth, crops.predictions) for protocol, crops in scored.items()}
    sections = [_reliability_report(protocol, curves) for protocol, curves in levels.items()]
    sections += [_temperature_report(protocol, crops.truth, crops.predictions) for protocol, crops in scored.items()]
    if levels:
        _draw_reliability(levels, out / RELIABILITY_FILE)
    if "paper" in scored:
        sections += _paper_sections(scored["paper"], out, failures=failures)
    return sections


def _paper_sections(scored: ScoredCrops, out: Path, *, failures: bool) -> list[str]:
    kind = np.array([source.panorama.kind for source, _ in scored.views])
    ours = scored.answers[scored.ours]
    worst = _worst_crops(scored.truth, ours)
    if failures:
        _write_failures(out / "failures.csv", worst, np.array([camera.azimuth for _, camera in scored.views]))
        spec = scored.predictions[0].spec
        pictures = [tone_map(crop_panorama(*scored.views[failure.index], spec).linear) for failure in worst]
        with atomic_write(out / "failures.png") as temporary:
            _contact_sheet(worst, pictures).save(temporary, "PNG")
    return [_turbidity_report("paper", scored.truth, ours, scored.answers[CONSTANT], kind), _failures_report(worst)]


# The worst crops, sorted by cause: as counts and as a CSV file.

MAX_FAILURES = 50  # crops
MAX_EACH = 3  # of one panorama, so that one odd picture does not fill the list
WIDE_RADIUS = 30.0  # deg of radius_50 from which the network is not sure
NEAR_ERROR = 22.5  # deg, an error that is no failure
SUNSHINE = {1.0: "yes", 0.5: "partly", 0.0: "no"}


@dataclass(frozen=True)
class _Failure:
    """One of the worst crops; angles in deg, azimuths relative to the camera."""

    index: int  # of the crop
    panorama: str
    in_view: str
    direct: str  # direct sunlight reaches the scene: "yes", "partly", "no" or "" where not known
    sun: tuple[float, float]  # true azimuth and elevation
    estimate: tuple[float, float]
    radius_50: float
    error: float
    azimuth_error: float
    elevation_error: float

    @property
    def cause(self) -> str:
        """The first of CAUSES that holds."""
        return next(name for name, (_, holds) in CAUSES.items() if holds(self))


def _is_mirrored(f: _Failure) -> bool:
    return float(angle_between(direction(-f.estimate[0], f.estimate[1]), direction(*f.sun))) < NEAR_ERROR


CAUSES: dict[str, tuple[str, Callable[[_Failure], bool]]] = {  # the first that holds is the cause
    "no sky": ("under a tenth of the frame looks above the horizon", lambda f: f.in_view == "no sky"),
    "sun not shining": ("direct sunlight reaches the scene partly or not", lambda f: f.direct in ("partly", "no")),
    "wide distribution": (
        f"`radius_50` over {WIDE_RADIUS:g}°: the network is not sure",
        lambda f: f.radius_50 > WIDE_RADIUS,
    ),
    "front-back flip": (f"azimuth off by more than {FLIP:g}°", lambda f: abs(f.azimuth_error) > FLIP),
    "left-right mirror": (f"within {NEAR_ERROR:g}° once left and right are exchanged", _is_mirrored),
    "elevation alone": (f"azimuth within {NEAR_ERROR:g}°", lambda f: abs(f.azimuth_error) < NEAR_ERROR),
    "confident and wrong": ("none of the above", lambda _: True),
}


def _worst_crops(truth: Truth, answers: Answers) -> list[_Failure]:
    """The MAX_FAILURES scored crops, beginning with the largest error; at most MAX_EACH of a panorama."""
    error = np.where(truth.scored, sun_error(truth, answers), -np.inf)
    count: Counter[str] = Counter()
    chosen: list[int] = []
    for i in np.argsort(-error, kind="stable")[: np.count_nonzero(truth.scored)]:
        count[truth.panorama[i]] += 1
        if count[truth.panorama[i]] <= MAX_EACH:
            chosen.append(int(i))
    return [_make_failure(truth, answers, i) for i in chosen[:MAX_FAILURES]]


def _make_failure(truth: Truth, answers: Answers, index: int) -> _Failure:
    """One crop as a failure."""
    sun, estimate = ((float(a), float(e)) for a, e in (angles(of.sun[index]) for of in (truth, answers)))
    errors = [float(of(truth, answers)[index]) for of in (sun_error, azimuth_error, elevation_error)]
    direct, radius = SUNSHINE.get(float(truth.visibility[index]), ""), float(answers.radius_50[index])
    panorama, in_view = str(truth.panorama[index]), str(truth.in_view[index])
    return _Failure(index, panorama, in_view, direct, sun, estimate, radius, *errors)


def _failures_report(failures: Sequence[_Failure]) -> str:
    """A table with the number of failures by cause."""
    counts = Counter(f.cause for f in failures)
    panoramas = {name: len({f.panorama for f in failures if f.cause == name}) for name in CAUSES}
    rows = [[name, rule, str(counts[name]), str(panoramas[name])] for name, (rule, _) in CAUSES.items()]
    table = markdown_table(["", "rule", "crops", "panoramas"], rows)
    return "\n\n".join(["## Where it fails", _summary(failures), table])


def _summary(failures: Sequence[_Failure]) -> str:
    panoramas = len({f.panorama for f in failures})
    flips = sum(abs(f.azimuth_error) > FLIP for f in failures)
    return fill(
        f"The {len(failures)} worst crops of the `paper` protocol, at most {MAX_EACH} of a panorama ({panoramas} "
        f"panoramas): sun errors of {failures[-1].error:.0f} to {failures[0].error:.0f}°. Each counts under the first "
        "rule that holds: the rules ask what could be seen, then how sure the network was, then how it erred. In "
        f"{flips} of them, whatever the cause, the sun is on the wrong side, front for back.",
        120,
    )


def _write_failures(path: Path, failures: Sequence[_Failure], azimuth: Floats) -> None:
    """One line per failure; `azimuth` (N,) is where each crop's camera points in its panorama."""
    header = ["panorama", "azimuth", "error", "azimuth_error", "elevation_error", "in_view", "direct", "cause"]
    rows = []
    for f in failures:
        numbers = (f"{value:.1f}" for value in (azimuth[f.index], f.error, f.azimuth_error, f.elevation_error))
        rows.append([f.panorama, *numbers, f.in_view, f.direct, f.cause])
    write_table(path, header, rows)


# A contact sheet of failures: each crop with its true and its estimated sun, in numbers and on a dial.

ACROSS = 5  # crops in a row
THUMBNAIL = (320, 240)  # pixels
_TEXT, _LINE = 13, 16  # pixels, height of letters and of lines
DIAL = 26  # pixels, radius
TRUE_COLOR, ESTIMATE_COLOR = (255, 200, 0), (90, 180, 255)


def _contact_sheet(failures: Sequence[_Failure], pictures: Sequence[NDArray[np.uint8]]) -> Image.Image:
    """The failures in rows of ACROSS, each picture (h, w, 3) with three lines under it."""
    height = THUMBNAIL[1] + 3 * _LINE + 6
    whole = Image.new("RGB", (ACROSS * (THUMBNAIL[0] + 4), -(-len(failures) // ACROSS) * height), "white")
    for i, (one, picture) in enumerate(zip(failures, pictures, strict=True)):
        corner = (i % ACROSS * (THUMBNAIL[0] + 4), i // ACROSS * height)
        whole.paste(_with_dial(Image.fromarray(picture).resize(THUMBNAIL), one), corner)
        text = "\n".join(_lines(i + 1, one))
        font = ImageFont.load_default(_TEXT)
        ImageDraw.Draw(whole).multiline_text((corner[0] + 2, corner[1] + THUMBNAIL[1]), text, "black", font, spacing=2)
    return whole


def _lines(number: int, f: _Failure) -> tuple[str, str, str]:
    return (
        f"{number}: {f.error:.0f}° {f.panorama}",
        f"true {f.sun[0]:.0f}, {f.sun[1]:.0f}   said {f.estimate[0]:.0f}, {f.estimate[1]:.0f} ± {f.radius_50:.0f}",
        f"{f.cause}; {f.in_view}; direct {f.direct or 'unknown'}",
    )


def _with_dial(picture: Image.Image, f: _Failure) -> Image.Image:
    """The picture with a dial of the suns from above: the zenith in the middle, the camera's azimuth at the top."""
    draw = ImageDraw.Draw(picture)
    middle = np.array(picture.size) - DIAL - 4
    draw.ellipse([*(middle - DIAL), *(middle + DIAL)], fill=(60, 60, 60), outline="white")
    draw.line([*middle, middle[0], middle[1] - DIAL], fill="white")
    for (azimuth, elevation), color in ((f.sun, TRUE_COLOR), (f.estimate, ESTIMATE_COLOR)):
        angle, reach = np.radians(azimuth), DIAL * (1 - elevation / 90)
        spot = middle + reach * np.array([np.sin(angle), -np.cos(angle)])
        draw.ellipse([*(spot - 4), *(spot + 4)], fill=color)
    return picture


# Whether the estimated turbidity beats the best constant.

MEANING = fill(
    "Median absolute error against the skies fitted to the panoramas. The constant is the median of training skies. "
    "The intervals (95 %) are of the network's error minus the constant's. LDR skies count only if their fit "
    "is trusted.",
    120,
)


def _turbidity_report(protocol: str, truth: Truth, ours: Answers, constant: Answers, kind: Names) -> str:
    """The table of one protocol; `kind` (N,) is "hdr" or "ldr", the panorama's."""
    known = np.isfinite(truth.turbidity)
    rows = {"HDR": known & (kind == "hdr"), "LDR, clean sky": known & (kind == "ldr"), "both": known}
    lines = []
    for name, chosen in rows.items():
        if chosen.any():
            answers = (select_crops(of, chosen) for of in (ours, constant))
            lines.append(_turbidity_row(name, select_crops(truth, chosen), *answers))
    header = ["", "crops", "panoramas", "places", "network", "constant", "minus it, panoramas", "minus it, places"]
    return f"## Turbidity, protocol `{protocol}`\n\n{MEANING}\n\n{markdown_table(header, lines)}"


def _turbidity_row(name: str, truth: Truth, ours: Answers, constant: Answers) -> list[str]:
    error, other = (np.abs(answers.turbidity - truth.turbidity) for answers in (ours, constant))
    counts = (len(error), len(np.unique(truth.panorama)), len(np.unique(truth.place)))
    less = [format_interval(difference_interval(error, other, units), 2) for units in (truth.panorama, truth.place)]
    return [name, *map(str, counts), f"{np.median(error):.2f}", f"{np.median(other):.2f}", *less]


# How often the true sun lies in the region that holds a probability.

LEVELS = tuple(range(5, 100, 5))  # %, drawn
QUOTED = (10, 25, 50, 75, 90, 95)  # %, in the table
DENSEST, CONE = "all", "all, cone around the answer"
RELIABILITY_MEANING = fill(
    "Share [%] of true suns inside the region that holds p of the probability. The region is the cells of highest "
    "density; in the last row it is the cone around the answer, of `radius_50` or `radius_90`. A calibrated "
    "distribution has p in the column p. `largest gap` is the largest difference over p = 5 to 95 %, in "
    "percentage points.",
    120,
)


def _density_levels(predictions: Sequence[Prediction], sun: Floats) -> Floats:
    """Probability (N,) of the region of highest density that just reaches each true sun (N, 3).

    It holds all cells that are denser than the sun's own, and half of those that are equally dense.
    """
    cells, area = (of(predictions[0].spec.sun_grid) for of in (grid_directions, grid_solid_angle))
    sun_cell = np.argmax(sun @ cells.T, axis=1)
    probability = np.array([p.sun_probability for p in predictions], dtype=np.float64)
    density = probability / area
    at_sun = density[np.arange(len(sun_cell)), sun_cell][:, None]
    denser = probability * ((density > at_sun) + 0.5 * (density == at_sun))
    return np.asarray(denser.sum(axis=1) / probability.sum(axis=1))


def _cone_level(prediction: Prediction, sun: Floats) -> float:
    """Probability of the cone around the answer that just reaches the true sun (3,)."""
    probability, cells = prediction.sun_probability, grid_directions(prediction.spec.sun_grid)
    answer = prediction.sun_direction
    return float(np.interp(angle_between(sun, answer), *cumulative_by_angle(probability, cells, answer)))


def _reliability_curves(truth: Truth, predictions: Sequence[Prediction]) -> dict[str, Floats]:
    """Probabilities (n,) of the regions that reach the true sun: of all scored crops, of each bin, and of the cones.

    Args:
        truth: of N crops.
        predictions: N, of the same crops.
    """
    scored = select_crops(truth, truth.scored)
    predictions = list(compress(predictions, truth.scored))
    levels = _density_levels(predictions, scored.sun)
    cones = np.array([_cone_level(p, sun) for p, sun in zip(predictions, scored.sun, strict=True)])
    by_group = {name: levels[chosen] for name, chosen in sun_bins(scored).items()}
    return {DENSEST: levels, **by_group, CONE: cones}


def _inside(levels: Floats, expected: Sequence[float]) -> Floats:
    """Share [%] of the suns inside the regions of each probability [%]."""
    return np.array([percentage(levels <= p / 100) for p in expected])


def _reliability_report(protocol: str, curves: dict[str, Floats]) -> str:
    """The table of one protocol.

    Args:
        protocol: its name.
        curves: of `_reliability_curves`.
    """
    rows = {
        name: {
            "crops": float(len(levels)),
            **{f"{p} %": float(value) for p, value in zip(QUOTED, _inside(levels, QUOTED), strict=True)},
            "largest gap": float(np.abs(_inside(levels, LEVELS) - LEVELS).max()),
        }
        for name, levels in curves.items()
    }
    title = f"## Reliability of the sun's distribution, protocol `{protocol}`"
    return f"{title}\n\n{RELIABILITY_MEANING}\n\n{figures_table(rows)}"


def _draw_reliability(protocols: dict[str, dict[str, Floats]], path: Path) -> None:
    """Plot the share inside against p: one column per protocol, by elevation above, by what is in view below.

    Args:
        protocols: the curves of each.
        path: PNG file to write.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6 * len(protocols), 9.2), layout="compressed")
    panels = figure.subplots(2, len(protocols), sharex=True, sharey=True, squeeze=False)
    for column, (protocol, curves) in zip(panels.T, protocols.items(), strict=True):
        column[0].set_title(f"protocol {protocol}")
        column[1].set_xlabel("probability of the region [%]")
        for panel, views in zip(column, (False, True), strict=True):
            _draw_panel(panel, {n: v for n, v in curves.items() if n in (DENSEST, CONE) or (n in IN_VIEW) == views})
    for panel in panels[:, 0]:
        panel.set_ylabel("true suns inside [%]")
    with atomic_write(path) as temporary:
        figure.savefig(temporary, format="png", dpi=100, pil_kwargs={"optimize": True})


STYLES: dict[str, dict[str, Any]] = {
    DENSEST: {"color": "black", "linewidth": 2.2},
    CONE: {"color": "black", "linestyle": ":"},
}


def _draw_panel(panel: Any, curves: dict[str, Floats]) -> None:
    panel.plot([0, 100], [0, 100], color="0.7", linewidth=1)
    for name, levels in curves.items():
        inside = np.concatenate([[0.0], _inside(levels, LEVELS), [100.0]])
        panel.plot([0, *LEVELS, 100], inside, label=f"{name} ({len(levels)})", **STYLES.get(name, {}))
    panel.set(xlim=(0, 100), ylim=(0, 100), aspect="equal")
    panel.grid(alpha=0.25)
    panel.legend(frameon=False, fontsize=8)


TEMPERATURES = [round(0.5 * 1.02**i, 3) for i in range(90)]  # 0.5 to 3
_COLUMNS = {"NLL": "NLL", "in 50 %": "in 50 % region", "in 90 %": "in 90 % region", "median": "median"}
TEMPERATURE_MEANING = fill(
    "Temperature T of the sun's probabilities, p^(1/T), in addition to the network's own. It is fitted by NLL on one "
    "half of the places and tested on the other (`all`: fitted and tested on all). Regions are cones around the "
    "answer. The network ships with the right temperature if T is near 1 in both halves and changes little.",
    120,
)


def _temperature_report(protocol: str, truth: Truth, predictions: Sequence[Prediction]) -> str:
    """The table of one protocol.

    Args:
        protocol: its name.
        truth: of N crops.
        predictions: N, of the same crops.
    """
    halves = place_halves(truth)
    half = np.array([halves.get(str(place), -1) for place in truth.place])
    rows = {}
    for name, fit, measured in (("half A", 0, 1), ("half B", 1, 0), ("all", None, None)):
        learning, tested = (truth.scored if h is None else truth.scored & (half == h) for h in (fit, measured))
        if learning.any() and tested.any():
            rows[name] = _temperature_row(truth, predictions, learning, tested)
    return f"## Temperature, protocol `{protocol}`\n\n{TEMPERATURE_MEANING}\n\n{figures_table(rows)}"


def _temperature_row(
    truth: Truth, predictions: Sequence[Prediction], learning: Bools, tested: Bools
) -> dict[str, float]:
    fitted = _fit_temperature(list(compress(predictions, learning)), truth.sun[learning])
    test_predictions, test_truth = list(compress(predictions, tested)), select_crops(truth, tested)
    row = {"fitted to": float(np.count_nonzero(learning)), "temperature": fitted, "crops": float(len(test_predictions))}
    before, after = (_tempered_figures(test_truth, [_tempered(p, t) for p in test_predictions]) for t in (1.0, fitted))
    figures = {"before": before, "after": after}
    return row | {f"{name}, {when}": of[name] for name in _COLUMNS for when, of in figures.items()}


def _fit_temperature(predictions: Sequence[Prediction], sun: Floats) -> float:
    """The one of TEMPERATURES under which the true suns (N, 3) are most likely."""
    cells, area = (of(predictions[0].spec.sun_grid) for of in (grid_directions, grid_solid_angle))
    sun_cell = np.argmax(sun @ cells.T, axis=1)
    log = np.log(np.maximum([p.sun_probability for p in predictions], MIN_DENSITY * area))
    costs = {t: _mean_nll(log / t, sun_cell) for t in TEMPERATURES}
    return min(costs, key=costs.__getitem__)


def _mean_nll(log: Floats, cell: NDArray[np.intp]) -> float:
    """Mean negative log probability of the cells `cell` (N,), from unnormalised logarithms (N, G)."""
    highest = log.max(axis=1, keepdims=True)
    total = np.log(np.exp(log - highest).sum(axis=1)) + highest[:, 0]
    return float(np.mean(total - log[np.arange(len(cell)), cell]))


def _tempered(prediction: Prediction, temperature: float) -> Prediction:
    """The prediction with its sun's logits divided by another temperature."""
    return replace(prediction, sun_probability=temper(prediction.sun_probability, temperature))


def _tempered_figures(truth: Truth, predictions: Sequence[Prediction]) -> dict[str, float]:
    """COLUMNS over crops that all have a sun."""
    suns = [sun_from_prediction(p) for p in predictions]
    figures = sun_figures(truth, answers_from_estimates(suns, nll=sun_nll(predictions, truth.sun)))
    return {name: figures[column] for name, column in _COLUMNS.items()}
