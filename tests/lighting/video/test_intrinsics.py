"""A lens that is zoomed while it films."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, zoomed_fov
from lighting.model import Model
from lighting.records import Lighting
from lighting.video.intrinsics import remove_zoom
from lighting.video.observation import observe_shots
from lighting.video.shot import Shot, frame_lights, shot_lighting, solve_shot
from lighting.video.tracking import ClipMetadata, ShotObservations
from tests.helpers.clips import FOV, Pixels, frames, panorama, seen

COUNT = 45
TURNED = np.linspace(0.0, 30.0, COUNT)


def zooms(ratio: float) -> Floats:
    """As it is for a third of the clip, then growing."""
    return ratio ** np.clip((np.arange(COUNT) - 15) / 25.0, 0.0, 1.0)


def filmed(zoom: Floats) -> list[Pixels]:
    """A camera that turns to the right, and nods, while it is zoomed."""
    angles = zip(TURNED.tolist(), (3.0 * np.sin(TURNED / 10.0)).tolist(), zoom.tolist(), strict=True)
    return [seen(panorama(), azimuth, elevation, fov=zoomed_fov(FOV, z)) for azimuth, elevation, z in angles]


@pytest.fixture(scope="module")
def model(network: Path) -> Model:
    return Model.load(network, threads=1)


def watched(pictures: list[Pixels], model: Model) -> ShotObservations:
    (found,) = observe_shots(frames(pictures), model, 0.5)
    return found


def solved(pictures: list[Pixels], model: Model) -> Shot:
    return solve_shot(watched(pictures, model), ClipMetadata())


@pytest.mark.parametrize("ratio", [1.6, 0.7])
def test_a_zoom_is_followed_and_does_not_bend_the_turns(model: Model, ratio: float) -> None:
    shot = solved(filmed(zooms(ratio)), model)
    np.testing.assert_allclose(shot.zoom, zooms(ratio), rtol=0.02)
    assert shot.vertical_fov == pytest.approx(FOV, abs=1.0)  # the network says 50
    np.testing.assert_allclose(shot.path.heading, TURNED, atol=1.0)  # the network's level is 4 deg off
    assert not shot.path.bridged.any()


def test_each_frame_of_a_zoom_has_its_own_field_of_view(model: Model) -> None:
    shot = solved(filmed(zooms(1.6)), model)
    fovs = [line.lighting.vertical_fov for line in frame_lights(shot, 1)]
    assert fovs[0] == pytest.approx(shot.vertical_fov)
    assert fovs[-1] == pytest.approx(zoomed_fov(FOV, 1.6), abs=1.0)


def test_angles_of_records_have_four_digits_behind_the_point(model: Model) -> None:
    shot = solved(filmed(zooms(1.6)), model)
    for light in (shot_lighting(shot), *(line.lighting for line in frame_lights(shot, 1))):
        assert angles(light) == [round(angle, 4) for angle in angles(light)]


def angles(light: Lighting) -> list[float]:
    own = [light.sun_azimuth, light.camera_elevation, light.camera_roll, light.vertical_fov]
    return [*own, light.relative_heading or 0.0, light.camera_heading or 0.0]


def test_a_zoom_by_a_lens_that_is_given_begins_with_it(model: Model) -> None:
    user_input = ClipMetadata(user_input=UserInput(vertical_fov=FOV))
    shot = solve_shot(watched(filmed(zooms(1.6)), model), user_input)
    assert (shot.vertical_fov, shot.fov_std) == (FOV, 0.0)
    assert shot.zoom[-1] == pytest.approx(1.6, rel=0.01)


@pytest.mark.parametrize("ratio", [1.0, 1.6])
def test_a_lens_that_is_given_tells_how_an_unzoomed_camera_was_held(model: Model, ratio: float) -> None:
    user_input, pictures = ClipMetadata(user_input=UserInput(vertical_fov=60.0)), filmed(zooms(ratio))
    plain = watched(pictures, model)
    (by_lens,) = observe_shots(frames(pictures), model, 0.5, vertical_fov=user_input.vertical_fov)
    moved = solve_shot(by_lens, user_input).path.elevation - solve_shot(plain, user_input).path.elevation
    assert bool(np.abs(moved).max() > 0.1) == (ratio == 1.0)


def test_one_lens_is_no_zoom(model: Model) -> None:
    assert remove_zoom(watched(filmed(zooms(1.0)), model), ClipMetadata()) is None
    assert remove_zoom(watched(filmed(zooms(1.02)), model), ClipMetadata()) is None


def test_a_gap_is_bridged_by_the_zoom_of_both_sides(model: Model) -> None:
    pictures = filmed(zooms(1.6))
    pictures[28:31] = [np.zeros((180, 320, 3), np.uint8)] * 3
    shot = solved(pictures, model)
    assert shot.zoom[-1] == pytest.approx(1.6, rel=0.03)
    np.testing.assert_allclose(shot.path.heading, TURNED, atol=1.5)


def test_a_zoom_begins_with_the_lens_that_is_seen_first(model: Model) -> None:
    """The mean of all looks is another lens, from which a zoom by far is lost on the way."""
    (found,) = observe_shots(frames(filmed(zooms(0.5)), 10.0), model, 0.2)
    fovs = {frame: FOV if frame < 12 else 120.0 for frame in found.estimates}
    estimates = {
        f: replace(s, prediction=replace(s.prediction, vertical_fov=fovs[f])) for f, s in found.estimates.items()
    }
    one = remove_zoom(replace(found, estimates=estimates), ClipMetadata())
    assert one is not None
    assert one.zoom[-1] == pytest.approx(0.5, rel=0.01)
    assert one.zoom_share > 0.95


def test_a_zoom_that_is_lost_on_the_way_is_told(model: Model) -> None:
    user_input = ClipMetadata(user_input=UserInput(vertical_fov=95.0))
    shot = solve_shot(watched(filmed(zooms(0.5)), model), user_input)
    assert any("zoom is unknown" in warning for warning in shot.prior.warnings)
    right = solve_shot(watched(filmed(zooms(0.5)), model), ClipMetadata(user_input=UserInput(vertical_fov=FOV)))
    assert not any("zoom is unknown" in warning for warning in right.prior.warnings)
