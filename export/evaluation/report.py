"""Tables of each protocol and of ordinary photos, and the figures that the service returns.

Beside the networks stand answers that look at no pixel, which a network has to beat. Some figures count each
place alike.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

import numpy as np

from export.data.labels import Label
from export.data.panoramas import read_table
from export.evaluation.metrics import (
    DECIMALS,
    Answers,
    Bools,
    Names,
    Truth,
    answers_from_sun,
    auc,
    camera_figures,
    camera_scores,
    difference_interval,
    elevation_error,
    figures_table,
    format_interval,
    markdown_table,
    median,
    median_interval,
    percentage,
    select_crops,
    sun_error,
    sun_figures,
)
from lighting.decoding import candidate_suns, lighting_from_prediction
from lighting.estimator import Estimator
from lighting.geometry import Floats, angle_between, angles, direction, wrap_azimuth
from lighting.model import Model
from lighting.photo.reader import read_photo
from lighting.prediction import Prediction, SunDistribution
from lighting.records import Lighting, Trust
from lighting.sun_grid import grid_directions, weighted_median

CONSTANT = "constant direction"
_MIDDLE_CAMERA = (0.0, 0.0, 51.5)  # deg, elevation, roll and vertical field of view in the middle of the paper's ranges


def baseline_answers(truth: Truth, training: Sequence[Label]) -> dict[str, Answers]:
    """Each baseline's answers; the constants are the best for the training panoramas.

    Args:
        truth: of N crops, of which the number alone counts.
        training: labels of the panoramas of `train`.
    """
    count = len(truth.scored)
    elevation = np.array([label.sun_elevation for label in training if math.isfinite(label.sun_elevation)])
    fitted = [label for label in training if label.fit_ok]
    uniform = np.full(count, math.log(2 * math.pi))
    constants = {
        "camera": np.tile(_MIDDLE_CAMERA, (count, 1)),
        "visibility": np.zeros(count),
        "turbidity": np.full(count, median(np.array([label.turbidity for label in fitted]))),
        "exposure": np.full(count, median(np.array([label.exposure for label in fitted]))),
    }
    azimuth = np.random.default_rng(0).uniform(-180, 180, count)
    constant = np.tile(direction(0.0, _best_constant(elevation)), (count, 1))
    return {
        CONSTANT: answers_from_sun(constant, nll=uniform, **constants),
        "zenith": answers_from_sun(np.tile([0.0, 1.0, 0.0], (count, 1)), nll=uniform),
        "random azimuth": answers_from_sun(direction(azimuth, np.full(count, median(elevation))), nll=uniform),
    }


def _best_constant(elevation: Floats) -> float:
    """Elevation [deg] of the direction with the least median error to suns at these elevations and any azimuth."""
    azimuth = np.linspace(-180, 180, 72, endpoint=False)
    suns = direction(azimuth[None, :], elevation[:, None])
    candidates = np.arange(0.0, 91.0)
    errors = [np.median(angle_between(suns, direction(0.0, candidate))) for candidate in candidates]
    return float(candidates[int(np.argmin(errors))])


def _place_figures(truth: Truth, answers: Answers, heights: dict[str, Bools]) -> dict[str, float]:
    """Sun figures over scored crops by place, and those of each group by its places: deg and %.

    Args:
        truth: of N crops that all have a sun.
        answers: of the same crops.
        heights: (N,) which crops belong to each group of true elevations.
    """
    error, bias, weight = sun_error(truth, answers), elevation_error(truth, answers), _place_weights(truth.place)
    figures = {
        "places": float(len(np.unique(truth.place))),
        "median": weighted_median(error, weight),
        "< 22.5° %": 100 * float(np.sum(weight * (error < 22.5))),
        "< 45° %": 100 * float(np.sum(weight * (error < 45))),
    }
    for name, chosen in heights.items():
        group_weight = _place_weights(truth.place[chosen])
        figures[name] = weighted_median(error[chosen], group_weight)
        figures[f"{name}, bias"] = weighted_median(bias[chosen], group_weight)
    return figures


def _place_weights(places: Names) -> Floats:
    """Weights (N,) of crops that sum to 1, and to the same over each place."""
    _, index, count = np.unique(places, return_inverse=True, return_counts=True)
    return np.asarray(1.0 / (count[index] * max(len(count), 1)))


ELEVATIONS = ((0, 20), (20, 45), (45, 90))  # deg, bins of the true sun
IN_VIEW = ("sun in view", "sky in view", "no sky")


def format_report(protocol: str, truth: Truth, answers: dict[str, Answers], network_answers: dict[str, Answers]) -> str:
    """All tables of one protocol.

    Args:
        protocol: name of the cameras.
        truth: of N crops.
        answers: of each method, ours first.
        network_answers: of the networks alone, without the straight lines that the pictures show.
    """
    ours = next(iter(answers))
    scored = select_crops(truth, truth.scored)
    answered = {name: select_crops(a, truth.scored) for name, a in answers.items()}
    cameras = {name: a for name, a in answers.items() if np.isfinite(a.camera).all()}
    others = [name for name, a in cameras.items() if name != ours and np.isfinite(a.radius_50).all()]
    sections = [
        f"## Protocol `{protocol}`: {len(truth.scored)} crops, {len(scored.sun)} with a sun to score "
        f"({len(np.unique(scored.panorama))} panoramas of {len(np.unique(scored.place))} places)",
        "Sun [deg, nat]",
        figures_table({name: sun_figures(scored, a) for name, a in answered.items()}),
        "Median sun error with 95 % intervals: bootstrap over panoramas and over places",
        _intervals_table(scored, answered),
        "Each place counted alike, however many panoramas it has [deg]",
        _places_table(truth, answers),
        f"`{ours}` by true sun elevation, and by what is in view",
        figures_table(_breakdown(scored, answered[ours])),
        *[f"`{name}` by the same\n\n{figures_table(_breakdown(scored, answered[name]))}" for name in others],
        "Camera and sky, over all crops [deg]",
        figures_table({name: camera_figures(truth, a) for name, a in cameras.items()}),
        "Camera as calibration papers score it: area under the recall of errors, and the horizon [%]",
        figures_table({name: camera_scores(truth, a) for name, a in cameras.items()}),
        "The same by the networks alone, without the straight lines that the pictures show",
        figures_table({name: camera_scores(truth, a) for name, a in network_answers.items()}),
    ]
    return "\n\n".join(sections)


def in_view_report(truth: Truth, answers: dict[str, Answers], evidence: str) -> str:
    """The tables of crops that show the sun: each method, then ours by true elevation and with metadata.

    Args:
        truth: of N crops.
        answers: of each method, ours first.
        evidence: the table of what metadata add.
    """
    ours = next(iter(answers))
    counts = f"{len(truth.sun)} crops of {len(np.unique(truth.panorama))} panoramas"
    rows = {name: sun_figures(truth, a) for name, a in answers.items()}
    heights = {name: figures for name, figures in _breakdown(truth, answers[ours]).items() if name not in IN_VIEW}
    sections = [
        f"## Sun in the picture: {counts} [deg, nat]",
        "Cameras as in training, half near `paper` and half as in `phone`, turned until they see the sun.",
        figures_table(rows),
        f"`{ours}` by true sun elevation",
        figures_table(heights),
        f"`{ours}` with metadata: the sun keeps its pixel through the lens, and its elevation tilts the camera",
        evidence,
    ]
    return "\n\n".join(sections)


def _intervals_table(truth: Truth, answers: dict[str, Answers]) -> str:
    """Each method's median error with its intervals, and those of our median minus that of the method."""
    errors = {name: sun_error(truth, a) for name, a in answers.items()}
    ours, rows = next(iter(errors.values())), []
    for name, error in errors.items():
        row = [name, f"{np.median(error):.1f}"]
        for units in (truth.panorama, truth.place):
            row.append(format_interval(median_interval(error, units)))
            row.append("" if error is ours else format_interval(difference_interval(ours, error, units)))
        rows.append(row)
    return markdown_table(["", "median", "over panoramas", "ours minus this", "over places", "ours minus this"], rows)


def _places_table(truth: Truth, answers: dict[str, Answers]) -> str:
    """Figures of the sun by place, over the crops that are scored, and of visibility over all."""
    scored = select_crops(truth, truth.scored)
    heights = {name: chosen for name, chosen in sun_bins(scored).items() if name not in IN_VIEW}
    known = np.isin(truth.visibility, (0.0, 1.0))
    shining, weight = truth.visibility[known] == 1.0, _place_weights(truth.place[known])
    rows = {}
    for name, answered in answers.items():
        rows[name] = _place_figures(scored, select_crops(answered, truth.scored), heights)
        rows[name]["visibility AUC"] = auc(answered.visibility[known], shining, weight)
    return figures_table(rows)


def _breakdown(truth: Truth, answers: Answers) -> dict[str, dict[str, float]]:
    """Sun figures by true elevation and by what is in view."""
    bins = sun_bins(truth)
    return {n: sun_figures(select_crops(truth, part), select_crops(answers, part)) for n, part in bins.items()}


def sun_bins(truth: Truth) -> dict[str, Bools]:
    """Which crops (N,) belong to each bin of sun elevation and of what is in view, without empty bins.

    Args:
        truth: of N crops that all have a sun.
    """
    elevation = angles(truth.sun)[1]
    groups = {f"sun {low} to {high}°": (elevation >= low) & (elevation < high) for low, high in ELEVATIONS}
    groups |= {name: truth.in_view == name for name in IN_VIEW}
    return {name: chosen for name, chosen in groups.items() if chosen.any()}


# Accuracy on ordinary photos whose true sun is known, as medians over scenes.

_COLUMNS = ("file", "group", "sun_azimuth", "sun_elevation")
HEIGHTS = ((-10, 10), (10, 20), (-10, 20), (20, 45), (45, 90))  # deg, bins of the true sun; refraction lifts some


def photo_report(index: Path, models: dict[str, Model]) -> str:
    """Tables of real photos with a true sun: medians over scenes, with direct sun and of all photos.

    Args:
        index: `photos.csv`, whose files lie beside it.
        models: networks by name.
    """
    rows = [row for row in read_table(index, _COLUMNS) if row["sun_elevation"]]
    elevation = np.array([float(r["sun_elevation"]) for r in rows])
    truth = direction([float(r["sun_azimuth"] or "nan") for r in rows], np.maximum(elevation, 0.0))
    scenes = np.array([r["group"] for r in rows])
    photos = [read_photo(index.parent / r["file"]) for r in rows]
    predicted = {name: list(map(Estimator(model).predict, photos)) for name, model in models.items()}
    suns = {
        name: np.array([lighting_from_prediction(p).sun_direction for p in predictions])
        for name, predictions in predicted.items()
    }
    direct = np.array([r.get("direct") == "yes" for r in rows])
    known = np.isfinite(truth[:, 0])
    parts = {"All that have an azimuth": known, "Direct sun": known & direct}
    sections = [
        f"{name}: {len(np.unique(scenes[chosen]))} scenes, {chosen.sum()} photos\n\n"
        + figures_table({m: photo_figures(truth[chosen], sun[chosen], scenes[chosen]) for m, sun in suns.items()})
        for name, chosen in parts.items()
        if chosen.any()
    ]
    if direct.any():
        sections.append(
            f"Elevation less the true one, direct sun, medians over scenes: {direct.sum()} photos\n\n"
            + figures_table({m: photo_bias(elevation, sun, scenes, direct) for m, sun in suns.items()})
        )
    ours = [p for p, is_known in zip(next(iter(predicted.values())), known, strict=True) if is_known]
    sections.append(trust_report(f"{len(ours)} photos", ours, truth[known]))
    return "\n\n".join(["## Real photos: medians over scenes [deg]", *sections])


def photo_bias(elevation: Floats, sun: Floats, scenes: Names, chosen: Bools) -> dict[str, float]:
    """Median over scenes of how much too high suns are, by true elevation [deg].

    Args:
        elevation: (N,) deg, true.
        sun: (N, 3) answers.
        scenes: (N,) names.
        chosen: (N,) which count.
    """
    error = angles(sun)[1] - elevation
    parts = {(low, high): chosen & (elevation >= low) & (elevation < high) for low, high in HEIGHTS}
    return {f"{max(low, 0):g} to {high:g}°": median_by_scene(error[p], scenes[p]) for (low, high), p in parts.items()}


def photo_figures(truth: Floats, sun: Floats, scenes: Names) -> dict[str, float]:
    """Errors of suns [deg, %], medians over scenes.

    Args:
        truth: (N, 3) unit vectors.
        sun: (N, 3) answers.
        scenes: (N,) names.
    """
    (azimuth, elevation), (true_azimuth, true_elevation) = angles(sun), angles(truth)
    error = angle_between(truth, sun)
    turned, raised = np.abs(wrap_azimuth(azimuth - true_azimuth)), np.abs(elevation - true_elevation)
    errors = {"sun": error, "azimuth": turned, "elevation": raised}
    medians = {key: median_by_scene(value, scenes) for key, value in errors.items()}
    return medians | {"photos < 45° %": percentage(error < 45)}


def median_by_scene(error: Floats, scenes: Names) -> float:
    """Median over scenes of each scene's median.

    Args:
        error: (N,).
        scenes: (N,) names.
    """
    return median(np.array([np.median(error[scenes == scene]) for scene in np.unique(scenes)]))


# What the word of trust in an answer is worth, and how often one of the suns that an answer lists is the true one.

_NEAR, _FAR = 22.5, 45.0  # deg, errors that are small, and that are no gross ones


def trust_report(title: str, predictions: Sequence[Prediction], sun: Floats) -> str:
    """Table of shares by word of trust: of all, near the true sun by the answer and by the best of its suns [%].

    Args:
        title: of what.
        predictions: N, by the pixels alone.
        sun: (N, 3) true directions.
    """
    lights = [lighting_from_prediction(prediction) for prediction in predictions]
    error = np.array([_errors(*each) for each in zip(lights, predictions, sun, strict=True)]).reshape(-1, 3)
    radii = np.array([[light.radius_50, light.radius_90] for light in lights]).reshape(-1, 2)
    words = np.array([light.trust.value for light in lights])
    parts: dict[str, Bools] = {"all": np.ones(len(lights), dtype=bool)}
    parts |= {trust.value: words == trust for trust in Trust}
    rows = {
        name: {
            "crops": float(chosen.sum()),
            "of all": percentage(chosen),
            "within 22.5°": percentage(error[chosen, 0] < _NEAR),
            "best of two": percentage(error[chosen, 1] < _NEAR),
            "best of three": percentage(error[chosen, 2] < _NEAR),
            "within 45°": percentage(error[chosen, 0] < _FAR),
            "in `radius_50`": percentage(error[chosen, 0] <= radii[chosen, 0]),
            "in `radius_90`": percentage(error[chosen, 0] <= radii[chosen, 1]),
        }
        for name, chosen in parts.items()
        if chosen.any()
    }
    return f"Trust and candidates, {title} [%]\n\n{figures_table(rows)}"


def _errors(light: Lighting, prediction: Prediction, sun: Floats) -> Floats:
    """Angles (3,) [deg] to the true sun of the answer, and of the best of its first two and three suns."""
    grid = prediction.spec.sun_grid
    suns = candidate_suns(light, grid_directions(grid), SunDistribution(grid, prediction.sun_probability))
    error = angle_between(direction([s.azimuth for s in suns], [s.elevation for s in suns]), sun)
    return np.array([error[: count + 1].min() for count in range(3)])


# Whether the estimated turbidity beats the best constant.

_TURBIDITY_MEANING = fill(
    "Median absolute error against the skies fitted to the panoramas. The constant is the median of training skies. "
    "The intervals (95 %) are of the network's error minus the constant's. LDR skies count only if their fit "
    "is trusted.",
    120,
)


def turbidity_report(protocol: str, truth: Truth, ours: Answers, constant: Answers, kind: Names) -> str:
    """The table of one protocol, by kind of panorama.

    Args:
        protocol: its name.
        truth: of N crops.
        ours: our network's answers for them.
        constant: those of the best constant.
        kind: (N,) "hdr" or "ldr", the panorama's.
    """
    known = np.isfinite(truth.turbidity)
    rows = {"HDR": known & (kind == "hdr"), "LDR, clean sky": known & (kind == "ldr"), "both": known}
    error, other = (np.abs(answers.turbidity - truth.turbidity) for answers in (ours, constant))
    lines = []
    for name, chosen in rows.items():
        if chosen.any():
            places = [units[chosen] for units in (truth.panorama, truth.place)]
            counts = chosen.sum(), *(len(np.unique(units)) for units in places)
            medians = (f"{np.median(errors[chosen]):.2f}" for errors in (error, other))
            less = (format_interval(difference_interval(error[chosen], other[chosen], units), 2) for units in places)
            lines.append([name, *map(str, counts), *medians, *less])
    header = ["", "crops", "panoramas", "places", "network", "constant", "minus it, panoramas", "minus it, places"]
    return f"## Turbidity, protocol `{protocol}`\n\n{_TURBIDITY_MEANING}\n\n{markdown_table(header, lines)}"


# The figures of a network that the service returns, by names of their own.

Figures = dict[str, float | None]

SUN_COLUMNS = {  # column of the report's table of the sun: name in the file
    "crops": "crops",
    "median": "sun_median",
    "quartile 1": "sun_quartile_1",
    "quartile 3": "sun_quartile_3",
    "azimuth": "sun_azimuth_median",
    "elevation": "sun_elevation_median",
    "< 22.5° %": "within_22_5",
    "< 45° %": "within_45",
    "in 50 % region": "in_50_region",
    "in 90 % region": "in_90_region",
}
CAMERA_AND_SKY = {
    "elevation": "camera_elevation_median",
    "roll": "camera_roll_median",
    "fov": "vertical_fov_median",
    "turbidity": "turbidity_median",
    "exposure, stops": "exposure_median",
}


def stated_figures(truth: Truth, ours: Answers) -> Figures:
    """Our network's figures for one protocol, rounded as the report prints them; None where nothing was measured.

    Args:
        truth: of N crops.
        ours: our network's answers for them.
    """
    sun = sun_figures(select_crops(truth, truth.scored), select_crops(ours, truth.scored))
    measured = ((sun, SUN_COLUMNS), (camera_figures(truth, ours), CAMERA_AND_SKY))
    stated = [(name, values[column], DECIMALS.get(column, 1)) for values, of in measured for column, name in of.items()]
    return {n: round(value, digits or None) if math.isfinite(value) else None for n, value, digits in stated}
