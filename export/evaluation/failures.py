"""The report's sections after the figures: reliability of the probabilities, turbidity, the worst crops by cause.

The contact sheet of the worst crops shows pictures of the data: it is for looking at failures, and never published.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from export.crops.crops import crop_panorama
from export.data.panoramas import write_table
from export.evaluation.baselines import CONSTANT
from export.evaluation.metrics import (
    FLIP,
    Answers,
    Names,
    Truth,
    azimuth_error,
    difference_interval,
    elevation_error,
    format_interval,
    markdown_table,
    select_crops,
    sun_error,
)
from export.evaluation.predictions import View
from export.evaluation.reliability import draw_reliability, reliability_curves, reliability_report, temperature_report
from lighting.color import tone_map
from lighting.files import atomic_write
from lighting.geometry import Floats, angle_between, angles, direction
from lighting.records import Prediction

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
    levels = {protocol: reliability_curves(crops.truth, crops.predictions) for protocol, crops in scored.items()}
    sections = [reliability_report(protocol, curves) for protocol, curves in levels.items()]
    sections += [temperature_report(protocol, crops.truth, crops.predictions) for protocol, crops in scored.items()]
    if levels:
        draw_reliability(levels, out / RELIABILITY_FILE)
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
TEXT, LINE = 13, 16  # pixels, height of letters and of lines
DIAL = 26  # pixels, radius
TRUE_COLOR, ESTIMATE_COLOR = (255, 200, 0), (90, 180, 255)


def _contact_sheet(failures: Sequence[_Failure], pictures: Sequence[NDArray[np.uint8]]) -> Image.Image:
    """The failures in rows of ACROSS, each picture (h, w, 3) with three lines under it."""
    height = THUMBNAIL[1] + 3 * LINE + 6
    whole = Image.new("RGB", (ACROSS * (THUMBNAIL[0] + 4), -(-len(failures) // ACROSS) * height), "white")
    for i, (one, picture) in enumerate(zip(failures, pictures, strict=True)):
        corner = (i % ACROSS * (THUMBNAIL[0] + 4), i // ACROSS * height)
        whole.paste(_with_dial(Image.fromarray(picture).resize(THUMBNAIL), one), corner)
        text = "\n".join(_lines(i + 1, one))
        font = ImageFont.load_default(TEXT)
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
