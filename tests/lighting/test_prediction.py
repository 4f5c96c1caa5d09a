"""The spec of a network, what is none, and predictions with another camera."""

import json
import math

import numpy as np
import pytest

from lighting.errors import ModelError
from lighting.prediction import ModelSpec
from lighting.sun_grid import bayes_direction
from tests.conftest import TINY
from tests.helpers.predictions import prediction


def test_the_spec_survives_json() -> None:
    assert ModelSpec.from_json(TINY.to_json()) == TINY


@pytest.mark.parametrize(
    "change",
    [
        {"width": 0},
        {"width": "48"},
        {"height": -3},
        {"height": 4.5},
        {"width": True},
        {"mean": [0.5, 0.5]},
        {"mean": "abc"},
        {"mean": None},
        {"std": [0.2, 0.0, 0.2]},
        {"std": [math.nan, 1.0, 1.0]},
        {"sun_grid": 5},
        {"name": None},
        {"licence": []},
        {"surprise": 1},
    ],
    ids=repr,
)
def test_a_spec_of_another_layout_is_refused(change: dict[str, object]) -> None:
    with pytest.raises(ModelError) as caught:
        ModelSpec.from_json(json.dumps({**json.loads(TINY.to_json()), **change}))
    assert str(caught.value).endswith(".")


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "3", "{}", '{"mean": [1,2,3], "std": [1,2,3]}'])
def test_what_is_no_spec_is_refused(text: str) -> None:
    with pytest.raises(ModelError) as caught:
        ModelSpec.from_json(text)
    assert str(caught.value).endswith(".")


@pytest.mark.parametrize("known", [False, True])
def test_another_camera_leaves_the_sun_where_it_is(known: bool) -> None:
    network = prediction()
    sun = bayes_direction(network.sun_probability, TINY.sun_grid)
    if known:
        assert np.array_equal(network.sun_direction, sun)
    moved = network.with_camera(7.0, 2.0)
    assert (moved.camera_elevation, moved.camera_roll, moved.vertical_fov) == (7.0, 2.0, network.vertical_fov)
    assert network.with_camera(7.0, 2.0, 33.0).vertical_fov == 33.0
    assert np.array_equal(moved.sun_direction, sun)
