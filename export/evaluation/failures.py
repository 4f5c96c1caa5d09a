"""The worst crops, sorted by cause: as counts, as a CSV file and as a sheet of pictures.

The sheet shows pictures of the data: it is for looking at failures, and never published.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from export.data.panoramas import write_table
from export.evaluation.metrics import FLIP, Answers, Truth, azimuth_error, elevation_error, markdown_table, sun_error
from lighting.files import atomic_write
from lighting.geometry import Floats, angle_between, angles, direction

MAX_FAILURES = 50  # crops
MAX_EACH = 3  # of one panorama, so that one odd picture does not fill the list
_WIDE_RADIUS = 30.0  # deg of radius_50 from which the network is not sure
_NEAR_ERROR = 22.5  # deg, an error that is no failure
_SUNSHINE = {1.0: "yes", 0.5: "partly", 0.0: "no"}


@dataclass(frozen=True)
class Failure:
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


def _is_mirrored(f: Failure) -> bool:
    return float(angle_between(direction(-f.estimate[0], f.estimate[1]), direction(*f.sun))) < _NEAR_ERROR


CAUSES: dict[str, tuple[str, Callable[[Failure], bool]]] = {  # the first that holds is the cause
    "no sky": ("under a tenth of the frame looks above the horizon", lambda f: f.in_view == "no sky"),
    "sun not shining": ("direct sunlight reaches the scene partly or not", lambda f: f.direct in ("partly", "no")),
    "wide distribution": (
        f"`radius_50` over {_WIDE_RADIUS:g}°: the network is not sure",
        lambda f: f.radius_50 > _WIDE_RADIUS,
    ),
    "front-back flip": (f"azimuth off by more than {FLIP:g}°", lambda f: abs(f.azimuth_error) > FLIP),
    "left-right mirror": (f"within {_NEAR_ERROR:g}° once left and right are exchanged", _is_mirrored),
    "elevation alone": (f"azimuth within {_NEAR_ERROR:g}°", lambda f: abs(f.azimuth_error) < _NEAR_ERROR),
    "confident and wrong": ("none of the above", lambda _: True),
}


def find_worst_crops(truth: Truth, answers: Answers) -> list[Failure]:
    """The MAX_FAILURES scored crops, beginning with the largest error; at most MAX_EACH of a panorama.

    Args:
        truth: of N crops.
        answers: of the same crops.
    """
    errors = [of(truth, answers) for of in (sun_error, azimuth_error, elevation_error)]
    ranking = np.argsort(-np.where(truth.scored, errors[0], -np.inf), kind="stable")[: np.count_nonzero(truth.scored)]
    count: Counter[str] = Counter()
    failures: list[Failure] = []
    for i in ranking.tolist():
        panorama, in_view = str(truth.panorama[i]), str(truth.in_view[i])
        count[panorama] += 1
        if count[panorama] <= MAX_EACH and len(failures) < MAX_FAILURES:
            sun, estimate = ((float(a), float(e)) for a, e in (angles(of.sun[i]) for of in (truth, answers)))
            direct, radius = _SUNSHINE.get(float(truth.visibility[i]), ""), float(answers.radius_50[i])
            numbers = (float(error[i]) for error in errors)
            failures.append(Failure(i, panorama, in_view, direct, sun, estimate, radius, *numbers))
    return failures


def failures_report(failures: Sequence[Failure]) -> str:
    """A table with the number of failures by cause.

    Args:
        failures: one at least, the worst first.
    """
    counts = Counter(f.cause for f in failures)
    panoramas = {name: len({f.panorama for f in failures if f.cause == name}) for name in CAUSES}
    rows = [[name, rule, str(counts[name]), str(panoramas[name])] for name, (rule, _) in CAUSES.items()]
    table = markdown_table(["", "rule", "crops", "panoramas"], rows)
    flips = sum(abs(f.azimuth_error) > FLIP for f in failures)
    summary = fill(
        f"The {len(failures)} worst crops of the `paper` protocol, at most {MAX_EACH} of a panorama "
        f"({len({f.panorama for f in failures})} panoramas): sun errors of {failures[-1].error:.0f} to "
        f"{failures[0].error:.0f}°. Each counts under the first rule that holds: the rules ask what could be seen, "
        f"then how sure the network was, then how it erred. In {flips} of them, whatever the cause, the sun is on the "
        "wrong side, front for back.",
        120,
    )
    return "\n\n".join(["## Where it fails", summary, table])


def write_failures(path: Path, failures: Sequence[Failure], azimuth: Floats) -> None:
    """Write one line per failure.

    Args:
        path: CSV file to write.
        failures: of the N crops.
        azimuth: (N,) deg, where each crop's camera points in its panorama.
    """
    header = ["panorama", "azimuth", "error", "azimuth_error", "elevation_error", "in_view", "direct", "cause"]
    rows = []
    for f in failures:
        numbers = (f"{value:.1f}" for value in (azimuth[f.index], f.error, f.azimuth_error, f.elevation_error))
        rows.append([f.panorama, *numbers, f.in_view, f.direct, f.cause])
    write_table(path, header, rows)


_ACROSS = 5  # crops in a row of the sheet
_DIAL = (0.8, 0.02, 0.18, 0.24)  # of a picture's width and height: its left, its bottom, its size


def draw_contact_sheet(failures: Sequence[Failure], pictures: Sequence[NDArray[np.uint8]], path: Path) -> None:
    """Draw the failures, each with three lines over it, and with a dial of the true sun (gold) and the estimate (blue).

    The dial shows them from above: the zenith in the middle, the camera's azimuth at the top.

    Args:
        failures: to show.
        pictures: (h, w, 3) sRGB of each.
        path: PNG file to write.
    """
    from matplotlib.figure import Figure

    rows = -(-len(failures) // _ACROSS)
    figure = Figure(figsize=(4 * _ACROSS, 4 * rows), layout="constrained")
    for number, (one, picture) in enumerate(zip(failures, pictures, strict=True), 1):
        panel = figure.add_subplot(rows, _ACROSS, number)
        panel.imshow(picture)
        panel.set_axis_off()
        panel.set_title("\n".join(_lines(number, one)), fontsize=9, loc="left")
        dial = panel.inset_axes(_DIAL, projection="polar", theta_offset=np.pi / 2, theta_direction=-1)
        dial.set(ylim=(0, 90), xticks=[], yticks=[])
        for (azimuth, elevation), color in ((one.sun, "gold"), (one.estimate, "tab:blue")):
            dial.plot(np.radians(azimuth), 90 - elevation, "o", color=color)
    with atomic_write(path) as temporary:
        figure.savefig(temporary, format="png", dpi=80)


def _lines(number: int, f: Failure) -> tuple[str, str, str]:
    return (
        f"{number}: {f.error:.0f}° {f.panorama}",
        f"true {f.sun[0]:.0f}, {f.sun[1]:.0f}   said {f.estimate[0]:.0f}, {f.estimate[1]:.0f} ± {f.radius_50:.0f}",
        f"{f.cause}; {f.in_view}; direct {f.direct or 'unknown'}",
    )
