"""The spec of a network, and what is none."""

import json
import math

import pytest

from lighting.errors import ModelError
from lighting.prediction import ModelSpec
from tests.conftest import TINY


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
