"""Fits of the errors of marks: what gains is told, and a group is judged by what the others choose."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import DataError
from export.evaluation.fit_marks import _FitMark, _gains_table, report_mark_errors, shadow_text
from lighting.fusion.shadows import LitSide, MarkErrors, OwnShadow, read_shadow
from lighting.geometry import Pinhole, camera_pixel, direction
from lighting.model import Model
from lighting.sun_grid import grid_directions

ROW = {"width": "64", "height": "48", "foot_x": "20", "foot_y": "40", "tip_x": "70", "tip_y": "44"}
CAMERA = Pinhole(640, 480, 60.0, 0.0, -20.0, 0.0)
LAYOUT = "fibonacci:512"
SUN = direction(170.0, 20.0)


@pytest.mark.parametrize(
    ("sure", "top", "text"),
    [
        ("yes", ("", ""), "20.0,40.0,64.0,44.0"),
        ("yes", ("21", "9"), "20.0,40.0,64.0,44.0,21.0,9.0"),
        ("no", ("", ""), "doubt:20.0,40.0,64.0,44.0"),
    ],
)
def test_a_row_is_a_mark_inside_of_its_picture(sure: str, top: tuple[str, str], text: str) -> None:
    assert shadow_text({**ROW, "sure": sure, "top_x": top[0], "top_y": top[1]}) == text
    read_shadow(text)


def fit_mark() -> _FitMark:
    """The camera's own shadow of a sun of which the network knows nothing."""
    cells = grid_directions(LAYOUT)
    x, y = camera_pixel(-SUN, CAMERA)
    even = np.full(len(cells), 1 / len(cells), dtype=np.float32)
    return _FitMark(OwnShadow((float(x), float(y))), CAMERA, even, LAYOUT, SUN, "a")


def test_a_right_mark_gains_and_a_wrong_one_loses() -> None:
    assert fit_mark().gain(MarkErrors()) > 2.0
    assert replace(fit_mark(), sun=direction(-10.0, 20.0)).gain(MarkErrors()) < -1.0


def test_without_its_border_a_lit_side_is_half_a_plane() -> None:
    side = LitSide((200.0, 300.0), (300.0, 300.0), (250.0, 300.0))
    assert replace(fit_mark(), mark=side).without_border().mark == LitSide(side.shaded, side.lit)


def test_a_group_is_judged_by_what_the_others_choose() -> None:
    tried = {"narrow": [1.0, 1.0, -5.0], "wide": [0.5, 0.5, 0.5]}
    table = _gains_table("width", tried, ["train", "train", "val"], ["a", "b", "c"]).splitlines()
    assert table[0] == "| width | train (2) | val (1) | all (3) |"
    assert table[-1] == "| chosen by the others | 0.50 | -5.00 | -1.33 |"


def test_a_folder_without_the_table_is_told_of_by_the_fit(tmp_path: Path, network: Path) -> None:
    with pytest.raises(DataError, match=r"shadows\.csv"):
        report_mark_errors(Model.load(network), tmp_path)
