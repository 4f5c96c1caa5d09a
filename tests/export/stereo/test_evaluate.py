"""Tables of errors."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from export.stereo.evaluate import TABLES, _cell, _trial, evaluate
from export.stereo.trials import SEASONS, Found
from lighting.errors import LightingError
from lighting.stereo.normals.network import Network


class Errors:
    """A shape whose errors are told."""

    def __init__(self, *errors: list[float]) -> None:
        self.told = tuple(np.array(error) for error in errors)

    def errors(self) -> Any:
        return self.told


def test_a_cell_holds_median_and_mean_over_all_shapes() -> None:
    shapes = [Errors([1.0, 2.0], [1.0, 1.0]), Errors([3.0, 10.0, 4.0], [1.0, 1.0, 6.0])]
    assert _cell(cast(list[Found], shapes)) == "3.0 / 4.0, 1.0 / 2.0"


def test_a_row_changes_its_season() -> None:
    plain = _trial(1, {})
    assert plain.day is list(SEASONS.values())[1]
    few = _trial(1, {"count": 3, "sky": 4.0, "turbidity_error": -1.0})
    assert len(few.day.times) == 3
    assert (few.day.times[0], few.day.times[-1]) == (plain.day.times[0], plain.day.times[-1])
    assert few.day.turbidity == 4
    assert few.told().turbidity == 3


def test_every_table_has_a_name_and_a_folder_without_shapes_is_refused(tmp_path: Path) -> None:
    assert TABLES == ("seasons", "wrong", "photos", "heading", "turbidity", "gloss")
    with pytest.raises(LightingError, match="no scanned_objects and no meshes"):
        evaluate(tmp_path, cast(Network, None), print)
