"""Tests of the errors of normals and of the commands of `stereo`."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from click.testing import CliRunner

from export.__main__ import export_cli
from export.stereo.evaluate import SEASONS, TABLES, Trial, _cell, evaluate_normals, normal_angles, run_session
from export.stereo.renders import CaptureDay, Subject, utc_times
from export.stereo.surfaces import rotate_surface, surface_from_height
from lighting.errors import LightingError
from lighting.geometry import angle_between
from lighting.stereo.light_vectors import clear_skies, gray_skies, sun_directions
from lighting.stereo.normal_network import Network
from lighting.stereo.schedule import normals_of_interest
from tests.helpers.noise_study import _estimates, triplet


class Errors:
    """A shape with these errors."""

    def __init__(self, *errors: list[float]) -> None:
        self.angles = tuple(np.array(error) for error in errors)

    def errors(self) -> Any:
        return self.angles


def test_a_cell_holds_median_and_mean_over_all_shapes() -> None:
    shapes = [Errors([1.0, 2.0], [1.0, 1.0]), Errors([3.0, 10.0, 4.0], [1.0, 1.0, 6.0])]
    assert _cell(cast("Any", shapes)) == "3.0 / 4.0, 1.0 / 2.0"


def test_every_table_has_a_name_and_a_folder_without_shapes_is_refused(tmp_path: Path) -> None:
    assert TABLES == ("seasons", "expected")
    with pytest.raises(LightingError, match="no scanned_objects and no meshes"):
        evaluate_normals(tmp_path, cast("Network", None), print)


def test_a_session_of_two_shapes_in_june_meets_the_target_of_the_search() -> None:
    y, x = np.mgrid[:40, :40] - 19.5
    inside = x * x + y * y < 17**2
    ball = surface_from_height(np.sqrt(np.maximum(19.0**2 - x * x - y * y, 1)).astype(np.float32), inside)
    day = CaptureDay(utc_times("2024-06-21", np.arange(9.0, 17.0)), 47.0)
    found: list[Any] = run_session(
        [Subject("a", "b", ball), Subject("c", "b", rotate_surface(ball, 1))], Trial(day), None
    )
    assert [shape.subject.name for shape in found] == ["a", "c"]
    for shape in found:
        search, both = shape.errors()
        assert np.median(search) < 4  # issue: at most 4 in June
        np.testing.assert_array_equal(search, both)


def test_a_photographer_is_told_wrong_what_a_trial_says() -> None:
    day = SEASONS["47° N, June"]
    believed = Trial(day, heading_error=2.0).believed()
    assert believed.pose.heading == day.pose.heading + 2
    assert believed.latitude == day.latitude


def test_angles_are_between_unit_vectors() -> None:
    a, b = np.array([[1.0, 0, 0], [0, 0, 1]]), np.array([[0, 1.0, 0], [0, 0, 1]])
    np.testing.assert_allclose(normal_angles(a, b), [90, 0], atol=1e-5)


def test_the_group_lists_its_commands() -> None:
    listed = CliRunner().invoke(export_cli, ["stereo", "--help"]).stdout
    for name in ("evaluate", "onnx", "train"):
        assert f"  {name} " in listed


def test_tables_are_checked_and_listed() -> None:
    result = CliRunner().invoke(export_cli, ["stereo", "evaluate", "--data", "shapes", "--table", "seasonal"])
    assert result.exit_code == 2
    assert "seasonal is no table; give one of seasons, expected" in result.stderr
    listed = CliRunner().invoke(export_cli, ["stereo", "evaluate", "--help"]).stdout
    assert all(table in listed for table in TABLES)


def test_a_folder_without_shapes_is_named(tmp_path: Path) -> None:
    result = CliRunner().invoke(export_cli, ["stereo", "evaluate", "--data", str(tmp_path)])
    assert result.exit_code != 0
    assert "holds no scanned_objects" in str(result.exception)


def test_triplets_are_two_lights_on_the_plane_and_one_lifted() -> None:
    lights = triplet(30, 20)
    np.testing.assert_allclose(np.linalg.norm(lights, axis=1), 1)
    assert angle_between(lights[0], lights[1]) == pytest.approx(30)
    np.testing.assert_allclose(lights[:, 1], [0, 0, np.sin(np.radians(20))], atol=1e-12)


def test_faint_noise_leaves_normals_nearly_as_they_are() -> None:
    times = np.datetime64("2026-06-21T00:00") + np.arange(8, 17) * np.timedelta64(60, "m")
    skies = gray_skies(clear_skies(sun_directions(times, 47.0, 0.0), height=16))
    normals = normals_of_interest(None)[:10]
    found = _estimates(skies, normals, 1e-6, 2, np.random.default_rng(0))
    assert found.shape == (2, 10, 3)
    np.testing.assert_allclose(found, np.broadcast_to(normals, found.shape), atol=0.01)
