"""What simulated metadata adds to the network's answers: every subset of the evidence, and false records."""

from collections.abc import Container, Sequence
from dataclasses import replace
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from export.evaluation.intervals import difference_interval
from export.evaluation.metrics import azimuth_error, elevation_error, median, share, sun_error
from export.evaluation.records import Truth, select
from export.evaluation.records import answers as answers_of
from export.evaluation.simulated_metadata import COMPASS_MEDIAN, GROSS, LOCAL_TIME, Taken, only
from export.evaluation.tables import figures_table, interval
from lighting.evidence import (
    ELEVATION_TAIL,
    HEADING_TAIL,
    LENS_RATIO,
    MOST_APART,
    NOTHING_GIVEN,
    Evidence,
    Fused,
    Gravity,
    fuse_photo,
    known,
)
from lighting.geometry import Floats, angles, direction, wrap_azimuth
from lighting.photo import SENSOR_SPREAD, PhotoFacts
from lighting.records import EvidenceKind, Prediction, WarningCode, warning_code

PARTS = (EvidenceKind.TIME_AND_PLACE, EvidenceKind.HEADING, EvidenceKind.FOCAL_LENGTH)
_WITH_HEADING = (EvidenceKind.TIME_AND_PLACE, EvidenceKind.HEADING)
SUBSETS: tuple[tuple[str, ...], ...] = (
    (),
    *(tuple(part for bit, part in enumerate(PARTS) if number >> bit & 1) for number in range(1, 8)),
    (LOCAL_TIME,),
    (LOCAL_TIME, EvidenceKind.HEADING),
)

SIMULATION = fill(
    "Simulated: places and times at which the ephemeris puts the sun as high as it is in the panorama; compasses with "
    f"a median error of {COMPASS_MEDIAN:g}°, {100 * GROSS:.0f} % of them pointing anywhere; the true focal length. A "
    "heading without time and place says nothing about the sun. A time without its zone leaves all zones that the "
    "longitude allows.",
    120,
)
WARNED = fill(
    "Share of photos [%] with a warning of a contradiction, for true records (compass noise, no gross errors) and for "
    f"false ones. A warning is given if the pixels leave the record's sun elevation a tail probability under "
    f"{ELEVATION_TAIL:.1%}, or its heading one under {HEADING_TAIL:.1%}, or if focal lengths differ by a factor over "
    f"{LENS_RATIO:g}, or if gravity lies more than {MOST_APART:g}° from where the network has it.",
    120,
)
ByLens = tuple[Prediction, Prediction]  # of a photo that does not state its lens, and of the same one if it does

WRONG_SUN = 30.0  # deg of elevation by which a false time and place is off
WRONG_GRAVITY = 30.0  # deg of elevation by which a false camera is off


def evidence_report(protocol: str, truth: Truth, said: Sequence[ByLens], taken: Sequence[Taken]) -> str:
    """The tables of one protocol, over scored crops."""
    chosen = np.flatnonzero(truth.scored).tolist()
    scored = select(truth, truth.scored)
    predictions, records = [said[i] for i in chosen], [taken[i] for i in chosen]
    fused = {parts: [_fuse(p, t, parts) for p, t in zip(predictions, records, strict=True)] for parts in SUBSETS}
    rows = {_name(parts): figures(scored, answers, records) for parts, answers in fused.items()}
    return "\n\n".join(
        [
            f"## Metadata, protocol `{protocol}`: {len(chosen)} crops [deg]",
            SIMULATION,
            figures_table(rows),
            _azimuth_sentence(scored, fused[()], fused[(EvidenceKind.TIME_AND_PLACE,)]),
            WARNED,
            figures_table(warning_shares(scored, [without for without, _ in predictions], records)),
        ]
    )


def _fuse(said: ByLens, taken: Taken, parts: tuple[str, ...]) -> Fused:
    return fuse_photo(_own(said, parts), known(only(taken.facts, parts), NOTHING_GIVEN).evidence)


def _own(said: ByLens, parts: Container[str]) -> Prediction:
    """What is said of a photo of which these parts are known."""
    without, with_lens = said
    return with_lens if EvidenceKind.FOCAL_LENGTH in parts else without


def in_view_evidence(truth: Truth, said: Sequence[ByLens], pictures: Sequence[NDArray[np.uint8]]) -> str:
    """What lens, time and place, and gravity add for crops that show the sun: errors of the sun and of the camera.

    `pictures` are the crops' own pixels (h, w, 3), sRGB. Gravity is simulated with a phone's error of 1 deg.
    """
    _, elevation = angles(truth.sun)
    lens = truth.camera[:, 2].tolist()
    sun = [((height, 0.0),) for height in elevation.tolist()]
    known_parts = {
        "pixels": [Evidence()] * len(said),
        "pixels + gravity": _gravity(truth),
        "pixels + focal length": [Evidence(vertical_fov=fov) for fov in lens],
        "pixels + time+place": [Evidence(candidates) for candidates in sun],
        "pixels + time+place + focal length": [Evidence(c, vertical_fov=fov) for c, fov in zip(sun, lens, strict=True)],
    }
    rows = {}
    for name, evidence in known_parts.items():
        own = [_own(by_lens, name) for by_lens in said]
        fused = [fuse_photo(*photo) for photo in zip(own, evidence, pictures, strict=True)]
        error = sun_error(
            truth, answers_of(direction([f.sun.azimuth for f in fused], [f.sun.elevation for f in fused]))
        )
        tilt = np.abs(np.array([f.prediction.camera_elevation for f in fused]) - truth.camera[:, 0])
        rows[name] = {"sun": median(error), "camera elevation": median(tilt), "under 5°": share(tilt < 5)}
    return figures_table(rows)


def _gravity(truth: Truth, off: float = 0.0) -> list[Evidence]:
    """What phones note of gravity, and `off` [deg] that their elevation is wrong besides."""
    noise = np.random.default_rng(0).normal(0.0, SENSOR_SPREAD, (len(truth.camera), 2))
    held = (truth.camera[:, :2] + noise + [off, 0.0]).tolist()
    return [Evidence(gravity=Gravity(elevation, roll, SENSOR_SPREAD)) for elevation, roll in held]


def _name(parts: tuple[str, ...]) -> str:
    return " + ".join(("pixels", *parts)).replace(LOCAL_TIME, "time without zone+place")


def figures(truth: Truth, fused: Sequence[Fused], taken: Sequence[Taken]) -> dict[str, float]:
    """Median errors, and the share of truths inside the regions."""
    said = answers_of(direction([f.sun.azimuth for f in fused], [f.sun.elevation for f in fused]))
    error = sun_error(truth, said)
    fov = np.array([f.prediction.vertical_fov for f in fused])
    tilt = np.array([f.prediction.camera_elevation for f in fused])
    return {
        "sun": median(error),
        "azimuth": median(np.abs(azimuth_error(truth, said))),
        "elevation": median(np.abs(elevation_error(truth, said))),
        "in 50 % region": share(error <= [f.sun.radius_50 for f in fused]),
        "in 90 % region": share(error <= [f.sun.radius_90 for f in fused]),
        "radius 90": median(np.array([f.sun.radius_90 for f in fused])),
        "camera elevation": median(np.abs(tilt - truth.camera[:, 0])),
        "fov": median(np.abs(fov - truth.camera[:, 2])),
        **_heading_figures(fused, np.array([t.heading for t in taken])),
    }


def _heading_figures(fused: Sequence[Fused], heading: Floats) -> dict[str, float]:
    said = [(f.camera_heading.best, f.camera_heading.radius_90) for f in fused if f.camera_heading is not None]
    if len(said) < len(fused):
        return {"heading": float("nan"), "heading in 90 %": float("nan")}
    best, radius = np.array(said).T
    error = np.abs(wrap_azimuth(best - heading))
    return {"heading": median(error), "heading in 90 %": share(error <= radius)}


def _azimuth_sentence(truth: Truth, pixels: Sequence[Fused], timed: Sequence[Fused]) -> str:
    errors = [
        np.abs(azimuth_error(truth, answers_of(direction([f.sun.azimuth for f in fused], 0.0))))
        for fused in (timed, pixels)
    ]
    ends = difference_interval(errors[0], errors[1], truth.panorama)
    return f"Median azimuth error with time and place minus that of the pixels alone: 95 % interval {interval(ends)}."


def warning_shares(truth: Truth, said: Sequence[Prediction], taken: Sequence[Taken]) -> dict[str, dict[str, float]]:
    """How often the pixels contradict each part of the evidence, true and false."""
    rng = np.random.default_rng(0)
    true = [t.facts for t in taken]
    others = [true[i] for i in _others(angles(truth.sun)[1], rng)]
    turned = [replace(t.facts, heading=(t.heading + rng.uniform(90, 270)) % 360.0) for t in taken]
    cropped = [replace(f, vertical_fov=_half(f.vertical_fov or 0.0)) for f in true]
    sound = [(p, t.facts) for p, t in zip(said, taken, strict=True) if not t.gross]
    return {
        f"sun off by {WRONG_SUN:g}° or more": _shares(said, true, others, (EvidenceKind.TIME_AND_PLACE,)),
        "heading off by 90 to 270°": {
            "true": _share(
                [p for p, _ in sound], [f for _, f in sound], _WITH_HEADING, WarningCode.HEADING_CONTRADICTED
            ),
            "false": _share(said, turned, _WITH_HEADING, WarningCode.HEADING_CONTRADICTED),
        },
        "picture cropped to half": _shares(said, true, cropped, (EvidenceKind.FOCAL_LENGTH,)),
        f"camera off by {WRONG_GRAVITY:g}°": {
            "true": _warned(said, _gravity(truth)),
            "false": _warned(said, _gravity(truth, WRONG_GRAVITY)),
        },
    }


def _others(elevation: Floats, rng: np.random.Generator) -> list[int]:
    """For each crop, another one whose sun differs by WRONG_SUN or more."""
    wrong = np.abs(elevation[:, None] - elevation) >= WRONG_SUN
    return [int(rng.choice(np.flatnonzero(row))) if row.any() else i for i, row in enumerate(wrong)]


def _half(vertical_fov: float) -> float:
    return float(2 * np.degrees(np.arctan(np.tan(np.radians(vertical_fov) / 2) / 2)))


def _shares(
    said: Sequence[Prediction], true: Sequence[PhotoFacts], false: Sequence[PhotoFacts], parts: tuple[str, ...]
) -> dict[str, float]:
    return {"true": _share(said, true, parts), "false": _share(said, false, parts)}


def _share(
    said: Sequence[Prediction],
    facts: Sequence[PhotoFacts],
    parts: tuple[str, ...],
    code: WarningCode | None = None,
) -> float:
    """Percentage of photos with a warning, or with one of this code."""
    return _warned(said, [known(only(f, parts), NOTHING_GIVEN).evidence for f in facts], code)


def _warned(said: Sequence[Prediction], evidence: Sequence[Evidence], code: WarningCode | None = None) -> float:
    codes = [map(warning_code, fuse_photo(p, e).warnings) for p, e in zip(said, evidence, strict=True)]
    return share(np.array([any(code in (None, found) for found in own) for own in codes]))
