"""The worst crops, sorted by cause: as counts and as a CSV file."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill

import numpy as np

from export.data import write_table
from export.evaluation.metrics import FLIP, azimuth_error, elevation_error, sun_error
from export.evaluation.records import Answers, Truth
from export.evaluation.tables import table
from lighting.geometry import Floats, angle_between, angles, direction

WORST = 50  # crops shown
MOST_EACH = 3  # of one panorama, so that one odd picture does not fill the list
WIDE = 30.0  # deg of radius_50 from which the network is not sure
NEAR = 22.5  # deg, an error that is no failure
SUNSHINE = {1.0: "yes", 0.5: "partly", 0.0: "no"}


@dataclass(frozen=True)
class Failure:
    """One of the worst crops; angles in deg, azimuths relative to the camera."""

    index: int  # of the crop
    panorama: str
    in_view: str
    direct: str  # direct sunlight reaches the scene: "yes", "partly", "no" or "" where not known
    sun: tuple[float, float]  # true azimuth and elevation
    said: tuple[float, float]
    radius_50: float
    error: float
    azimuth_error: float
    elevation_error: float

    @property
    def cause(self) -> str:
        """The first of CAUSES that holds."""
        return next(name for name, (_, holds) in CAUSES.items() if holds(self))


def _mirrored(f: Failure) -> bool:
    return float(angle_between(direction(-f.said[0], f.said[1]), direction(*f.sun))) < NEAR


CAUSES: dict[str, tuple[str, Callable[[Failure], bool]]] = {  # the first that holds is the cause
    "no sky": ("under a tenth of the frame looks above the horizon", lambda f: f.in_view == "no sky"),
    "sun not shining": ("direct sunlight reaches the scene partly or not", lambda f: f.direct in ("partly", "no")),
    "wide distribution": (
        f"`radius_50` over {WIDE:g}°: the network is not sure",
        lambda f: f.radius_50 > WIDE,
    ),
    "front-back flip": (f"azimuth off by more than {FLIP:g}°", lambda f: abs(f.azimuth_error) > FLIP),
    "left-right mirror": (f"within {NEAR:g}° once left and right are exchanged", _mirrored),
    "elevation alone": (f"azimuth within {NEAR:g}°", lambda f: abs(f.azimuth_error) < NEAR),
    "confident and wrong": ("none of the above", lambda _: True),
}


def worst(truth: Truth, said: Answers) -> list[Failure]:
    """The WORST scored crops, beginning with the largest error; at most MOST_EACH of a panorama."""
    error = np.where(truth.scored, sun_error(truth, said), -np.inf)
    taken: Counter[str] = Counter()
    chosen: list[int] = []
    for i in np.argsort(-error, kind="stable")[: np.count_nonzero(truth.scored)]:
        taken[truth.panorama[i]] += 1
        if taken[truth.panorama[i]] <= MOST_EACH:
            chosen.append(int(i))
    return [failure(truth, said, i) for i in chosen[:WORST]]


def failure(truth: Truth, said: Answers, index: int) -> Failure:
    """One crop as a failure."""
    (azimuth, elevation), (said_azimuth, said_elevation) = (angles(of.sun[index]) for of in (truth, said))
    return Failure(
        index=index,
        panorama=str(truth.panorama[index]),
        in_view=str(truth.in_view[index]),
        direct=SUNSHINE.get(float(truth.visibility[index]), ""),
        sun=(float(azimuth), float(elevation)),
        said=(float(said_azimuth), float(said_elevation)),
        radius_50=float(said.radius_50[index]),
        error=float(sun_error(truth, said)[index]),
        azimuth_error=float(azimuth_error(truth, said)[index]),
        elevation_error=float(elevation_error(truth, said)[index]),
    )


def failures_report(found: Sequence[Failure]) -> str:
    """A table with the number of failures by cause."""
    counts = Counter(f.cause for f in found)
    rows = [
        [name, rule, str(counts[name]), str(len({f.panorama for f in found if f.cause == name}))]
        for name, (rule, _) in CAUSES.items()
    ]
    return "\n\n".join(["## Where it fails", _summary(found), table(["", "rule", "crops", "panoramas"], rows)])


def _summary(found: Sequence[Failure]) -> str:
    panoramas = len({f.panorama for f in found})
    flips = sum(abs(f.azimuth_error) > FLIP for f in found)
    return fill(
        f"The {len(found)} worst crops of the `paper` protocol, at most {MOST_EACH} of a panorama ({panoramas} "
        f"panoramas): sun errors of {found[-1].error:.0f} to {found[0].error:.0f}°. Each counts under the first rule "
        "that holds: the rules ask what could be seen, then how sure the network was, then how it erred. In "
        f"{flips} of them, whatever the cause, the sun is on the wrong side, front for back.",
        120,
    )


def write_failures(path: Path, found: Sequence[Failure], azimuth: Floats) -> None:
    """One line per failure; `azimuth` (N,) is where each crop's camera points in its panorama."""
    header = ["panorama", "azimuth", "error", "azimuth_error", "elevation_error", "in_view", "direct", "cause"]
    rows = []
    for f in found:
        numbers = (f"{value:.1f}" for value in (azimuth[f.index], f.error, f.azimuth_error, f.elevation_error))
        rows.append([f.panorama, *numbers, f.in_view, f.direct, f.cause])
    write_table(path, header, rows)
