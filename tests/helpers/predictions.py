"""Facts of a photo and a prediction that several tests of evidence share."""

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from lighting.fusion.estimate import build_estimate
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.single_view import Observations, fuse
from lighting.fusion.user_input import UserInput
from lighting.photo.metadata import HeadingReference, PhotoMetadata
from lighting.records import Lighting, Prediction
from lighting.solar_position import sun_position
from lighting.sun_grid import grid_directions
from tests.conftest import TINY

MORNING = datetime(2024, 6, 1, 7, 10, tzinfo=UTC)


FACTS = PhotoMetadata(
    local_time=datetime(2024, 6, 1, 9, 10),
    utc_offset=2.0,
    utc_time=MORNING,
    latitude=48.14,
    longitude=11.575,
    heading=60.0,
    heading_reference=HeadingReference.TRUE,
    focal_length=26.0,
    vertical_fov=53.0,
)


ZONELESS = replace(FACTS, utc_offset=None, utc_time=None)


def evidence_of(facts: PhotoMetadata = FACTS, **said: Any) -> Observations:
    return observations_from_metadata(facts, UserInput(**said)).observations


def sun_at(time: datetime, latitude: float = 48.14, longitude: float = 11.575) -> Any:
    azimuth, elevation = sun_position(time, latitude, longitude)
    return pytest.approx((float(elevation), float(azimuth)))


def prediction(probability: Any = None) -> Prediction:
    cells = grid_directions(TINY.sun_grid)
    p = np.full(len(cells), 1 / len(cells)) if probability is None else probability
    return Prediction(TINY, p.astype(np.float32), 0.9, 3.0, 0.1, 4.0, -1.0, 50.0)


def answer(facts: PhotoMetadata = FACTS, **said: Any) -> Lighting:
    found = observations_from_metadata(facts, UserInput(**said))
    return build_estimate(fuse(prediction(), found.observations), found).lighting
