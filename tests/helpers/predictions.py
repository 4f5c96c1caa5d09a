"""Metadata of a photo, and predictions of the network on a small and on a fine grid."""

from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta
from itertools import product
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
from lighting.prediction import ModelSpec, Prediction
from lighting.records import Lighting
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


SUN_IRRADIANCE, SKY_IRRADIANCE, GROUND_COLOR = (1.9, 1.5, 0.9), (0.4, 0.5, 0.8), (0.12, 0.11, 0.1)

GROUND_ALBEDO = 0.15
SUN_ON_GROUND = np.sin(np.radians(40.0)) * np.array(SUN_IRRADIANCE)  # of stated_light(40.0)
SUNLIT_GROUND = GROUND_ALBEDO / np.pi * (np.array(SKY_IRRADIANCE) + SUN_ON_GROUND)
NORMALS = np.array([n for n in product((-1, 0, 1), repeat=3) if np.abs(n).sum() in (1, 3)])
UNIT_NORMALS = NORMALS / np.linalg.norm(NORMALS, axis=-1, keepdims=True)  # (14, 3), of a cube's faces and corners
SHADED_GROUND = GROUND_ALBEDO / np.pi * np.array(SKY_IRRADIANCE)


def model_light(azimuth: float = -41.2, elevation: float = 33.0, **fields: float) -> Lighting:
    """A light whose irradiances follow from the sky model."""
    values: dict[str, Any] = {"turbidity": 2.6, "exposure": 1.0, **fields}
    return Lighting(sun_azimuth=azimuth, sun_elevation=elevation, **values)


def stated_light(elevation: float = 33.0, **fields: Any) -> Lighting:
    """A light with irradiances of its own."""
    stated = {"sun_irradiance": SUN_IRRADIANCE, "sky_irradiance": SKY_IRRADIANCE, "ground_color": GROUND_COLOR}
    values: dict[str, Any] = {**stated, **fields}
    return Lighting(-41.2, elevation, 2.6, 5.0, **values)


def without_probe(record: dict[str, Any]) -> dict[str, Any]:
    """A JSON record, which must have a light probe, without it."""
    assert len(record["light_probe"]["coefficients"]) == 9
    return {name: value for name, value in record.items() if name != "light_probe"}


def are_equal(one: Prediction, other: Prediction) -> bool:
    """Whether two predictions are the same, their arrays too, which `==` of Python 3.13 does not take."""
    return all(np.array_equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(Prediction))
