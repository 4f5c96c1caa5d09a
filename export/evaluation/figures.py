"""The figures of a network that its model card states and that the service returns, as JSON beside the network."""

import json
import math
from datetime import UTC, datetime
from pathlib import Path

from export.evaluation.metrics import camera_figures, sun_figures
from export.evaluation.records import Answers, Truth, select
from export.evaluation.tables import decimals
from lighting.files import replacing
from lighting.model import figures_path
from lighting.records import ModelSpec

Figures = dict[str, float | None]

SUN = {  # column of the report's table of the sun: name in the file
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
    """Our network's figures for one protocol, rounded as the report prints them; None where nothing was measured."""
    sun = sun_figures(select(truth, truth.scored), select(ours, truth.scored))
    measured = ((sun, SUN), (camera_figures(truth, ours), CAMERA_AND_SKY))
    return {name: _rounded(values[column], column) for values, names in measured for column, name in names.items()}


def _rounded(value: float, column: str) -> float | None:
    return round(value, decimals(column) or None) if math.isfinite(value) else None


def write_figures(spec: ModelSpec, figures: dict[str, Figures], folder: Path) -> Path:
    """Write the figures of each protocol into the network's folder; returns the file's path."""
    record = {
        "name": spec.name,
        "version": spec.version,
        "date": datetime.now(UTC).date().isoformat(),
        "accuracy": {protocol: values for protocol, values in figures.items() if None not in values.values()},
    }
    target = figures_path(spec, folder)
    with replacing(target) as path:
        path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return target
