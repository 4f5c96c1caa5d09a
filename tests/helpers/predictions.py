"""Metadata of a photo, and predictions of the network on a small and on a fine grid."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.fusion.estimate import build_estimate
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.single_view import Observations, fuse
from lighting.fusion.user_input import UserInput
from lighting.geometry import direction
from lighting.photo.metadata import HeadingReference, PhotoMetadata
from lighting.records import Lighting, ModelSpec, Prediction
from lighting.solar_position import sun_position
from lighting.sun_grid import grid_directions, grid_solid_angle, soft_label
from tests.conftest import TINY

MORNING = datetime(2024, 6, 1, 7, 10, tzinfo=UTC)
METADATA = PhotoMetadata(
    local_time=datetime(2024, 6, 1, 9, 10),
    utc_offset=2.0,
    latitude=48.14,
    longitude=11.575,
    heading=60.0,
    heading_reference=HeadingReference.TRUE,
    focal_length=26.0,
    vertical_fov=53.0,
)
ZONELESS = replace(METADATA, utc_offset=None)

GRID = "fibonacci:1024"
SPEC = ModelSpec("test", "0", 32, 32, (0.5, 0.5, 0.5), (0.2, 0.2, 0.2), GRID)
UNIFORM = grid_solid_angle(GRID) / (2 * np.pi)  # probabilities of a sun that may be anywhere


def grid_prediction(probability: NDArray[np.floating]) -> Prediction:
    """A prediction on GRID."""
    return Prediction(SPEC, probability.astype(np.float32), 0.9, 3.0, 0.1, 2.0, 0.5, 50.0)


def lobe_prediction(azimuth: float, elevation: float, concentration: float = 40.0) -> Prediction:
    """A prediction on GRID of a sun [deg] that is known to 1 / sqrt(concentration) [rad]."""
    return grid_prediction(soft_label(direction(azimuth, elevation), concentration, GRID))


def clock(time: datetime) -> datetime:
    """The local time that METADATA's camera shows."""
    return (time + timedelta(hours=2)).replace(tzinfo=None)


def observations_of(metadata: PhotoMetadata = METADATA, **stated: Any) -> Observations:
    return observations_from_metadata(metadata, UserInput(**stated)).observations


def sun_at(time: datetime, latitude: float = 48.14, longitude: float = 11.575) -> Any:
    azimuth, elevation = sun_position(time, latitude, longitude)
    return pytest.approx((float(elevation), float(azimuth)))


def prediction(probability: Any = None) -> Prediction:
    cells = grid_directions(TINY.sun_grid)
    p = np.full(len(cells), 1 / len(cells)) if probability is None else probability
    return Prediction(TINY, p.astype(np.float32), 0.9, 3.0, 0.1, 4.0, -1.0, 50.0)


def answer(metadata: PhotoMetadata = METADATA, /, **stated: Any) -> Lighting:
    prior = observations_from_metadata(metadata, UserInput(**stated))
    return build_estimate(fuse(prediction(), prior.observations), prior).lighting
