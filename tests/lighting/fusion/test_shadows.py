"""Shadows that a person marks: the sun that casts them is the likeliest, and what says nothing is refused."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.errors import ParameterError, warning_code
from lighting.fusion.marks import (
    LitSide,
    OwnShadow,
    Shadow,
    ShadowLine,
    ShadowMark,
    check_marks,
    move_drawn,
    read_shadow,
)
from lighting.fusion.shadows import fuse_shadows, implied_azimuth, shadow_likelihood
from lighting.fusion.single_view import Observations, fuse_single_view
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, Pinhole, angle_between, camera_pixel, direction, wrap_azimuth
from lighting.prediction import Prediction
from lighting.sun_grid import bayes_direction, grid_directions
from tests.conftest import TINY

CAMERA = Pinhole(1200, 900, 55.0, 0.0, -9.0, 6.0)
GRID = "fibonacci:4096"
CELLS = grid_directions(GRID)
SUNS = [(-110.0, 25.0), (30.0, 40.0), (150.0, 18.0), (95.0, 55.0)]


def pixel(point: Floats) -> tuple[float, float]:
    """The pixel of a point (3,) of the scene, in meters from the camera."""
    x, y = camera_pixel(point, CAMERA)
    return float(x), float(y)


def cast(sun: tuple[float, float], length: float = 1.2) -> Shadow:
    """The shadow of a stick of 1 m that stands 5 m before a camera 1.6 m high, cut where it leaves the picture."""
    foot = np.array([0.4, -1.6, -5.0])
    toward = direction(sun[0], 0.0)
    reach = 1.0 / np.tan(np.radians(sun[1]))
    tip, top = foot - min(reach, length) * toward, foot + np.array([0.0, 1.0, 0.0])
    return Shadow(pixel(foot), pixel(tip), pixel(top) if reach <= length else None)


def likeliest(mark: ShadowMark) -> Floats:
    return np.asarray(CELLS[np.argmax(shadow_likelihood(mark, CAMERA, CELLS))])


@pytest.mark.parametrize("sun", SUNS)
def test_the_sun_that_casts_a_shadow_is_the_likeliest(sun: tuple[float, float]) -> None:
    whole = cast(sun, length=9.0)
    assert angle_between(likeliest(whole), direction(*sun)) < 3.0
    assert implied_azimuth(whole, CAMERA) == pytest.approx(sun[0], abs=0.01)


@pytest.mark.parametrize("sun", SUNS)
def test_a_shadow_that_is_cut_tells_the_azimuth_alone(sun: tuple[float, float]) -> None:
    mark = replace(cast(sun, length=0.5), top=None)
    likelihood = shadow_likelihood(mark, CAMERA, direction(sun[0], np.array([5.0, 30.0, 70.0])))
    assert np.ptp(likelihood) < 1e-9 * likelihood[0]
    away = shadow_likelihood(mark, CAMERA, direction(sun[0] + 90.0, np.array([30.0])))
    assert likelihood[0] > 5 * away[0]


def test_of_a_shadow_across_the_view_the_far_one_says_less() -> None:
    def sharpness(distance: float) -> float:
        foot, tip = np.array([-0.5, -1.6, -distance]), np.array([0.5, -1.6, -distance])
        likelihood = shadow_likelihood(Shadow(pixel(foot), pixel(tip)), CAMERA, direction(np.arange(360.0), 30.0))
        return float(likelihood.max() / likelihood.mean())

    assert sharpness(4.0) > 1.5 * sharpness(25.0)


def test_the_camera_shadow_lies_opposite_the_sun() -> None:
    sun = direction(170.0, 22.0)
    mark = OwnShadow(pixel(-sun))
    assert angle_between(likeliest(mark), sun) < 2.5
    of_head = shadow_likelihood(replace(mark, is_head=True), CAMERA, direction(170.0, np.array([10.0, 50.0])))
    assert of_head[0] == pytest.approx(of_head[1])
    assert implied_azimuth(mark, CAMERA) == pytest.approx(170.0, abs=0.01)


def test_a_line_of_shadow_leaves_two_azimuths_open() -> None:
    whole = cast((30.0, 40.0), length=9.0)
    azimuths = np.arange(-180.0, 180.0)
    for mark in (ShadowLine(whole.foot, whole.tip), ShadowLine(whole.tip, whole.foot)):
        likelihood = shadow_likelihood(mark, CAMERA, direction(azimuths, 40.0))
        both = azimuths[np.argsort(likelihood)[-2:]]
        assert sorted(both) == pytest.approx([-150.0, 30.0], abs=1.0)
        assert implied_azimuth(mark, CAMERA) is None


@pytest.mark.parametrize(("lit_right", "azimuth"), [(True, 90.0), (False, -90.0)])
def test_a_lit_side_tells_half_of_the_azimuths(lit_right: bool, azimuth: float) -> None:
    left, right = (500.0, 450.0), (700.0, 450.0)
    mark = LitSide(left, right) if lit_right else LitSide(right, left)
    there, opposite = shadow_likelihood(mark, CAMERA, direction(np.array([azimuth, -azimuth]), 30.0))
    assert there > 10 * opposite
    ahead, behind = shadow_likelihood(mark, CAMERA, direction(np.array([azimuth - 60, azimuth + 60]), 30.0))
    assert ahead == pytest.approx(behind, rel=0.1)


@pytest.mark.parametrize("behind", [35.0, 90.0, 140.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_border_of_a_round_post_tells_how_far_behind_the_camera_the_sun_is(behind: float, side: float) -> None:
    """The border is where the surface turns away from the sun, as of a moon's phase."""
    axis, radius = np.array([1.5, -0.4, -8.0]), 0.2
    toward_camera = np.degrees(np.arctan2(-axis[0], axis[2]))  # the azimuth from the post to the camera
    azimuth = float(wrap_azimuth(toward_camera - side * behind))

    def at(turned: float) -> tuple[float, float]:
        return pixel(axis + radius * direction(azimuth + turned, 0.0))

    edges = sorted(pixel(axis + radius * direction(toward_camera + turn, 0.0)) for turn in (-90.0, 90.0))
    shaded, lit = edges if side > 0 else edges[::-1]
    mark = LitSide(shaded, lit, at(side * 90.0))
    azimuths = np.arange(-180.0, 180.0)
    likelihood = shadow_likelihood(mark, CAMERA, direction(azimuths, 30.0))
    assert abs(wrap_azimuth(azimuths[np.argmax(likelihood)] - azimuth)) < 5.0
    assert likelihood.min() > 0.001 * likelihood.max()


def test_a_border_beside_the_thing_is_refused() -> None:
    with pytest.raises(ParameterError, match="between the two edges"):
        shadow_likelihood(LitSide((500.0, 450.0), (700.0, 450.0), (720.0, 450.0)), CAMERA, CELLS)


def test_a_doubted_shadow_says_less_than_a_sure_one() -> None:
    sure = cast((40.0, 30.0), 9.0)
    suns = direction(np.array([40.0, 75.0]), 30.0)
    for mark in (sure, replace(sure, top=None)):
        likely, beside = shadow_likelihood(mark, CAMERA, suns)
        doubted, doubted_beside = shadow_likelihood(replace(mark, is_doubted=True), CAMERA, suns)
        assert likely / beside > 2 * doubted / doubted_beside > 2


def test_a_mark_hardly_moves_a_sure_answer_that_contradicts_it() -> None:
    """A share of the marks is wrong altogether."""
    true = direction(-40.0, 30.0)
    sure = np.exp(400.0 * (CELLS @ true - 1.0))
    fused = fuse_shadows((sure / sure.sum()).astype(np.float32), [cast((140.0, 30.0), 9.0)], CAMERA, CELLS)
    assert angle_between(bayes_direction(fused, GRID), true) < 3.0
    assert fused.sum() == pytest.approx(1.0, abs=1e-5)


def test_a_coarse_mark_is_likelier_than_a_wrong_one() -> None:
    """A foot that is guessed moves the azimuth by some widths; far from there all directions are alike."""
    mark = replace(cast((40.0, 30.0), 9.0), top=None)
    near, coarse, wrong, opposite = shadow_likelihood(
        mark, CAMERA, direction(np.array([40.0, 65.0, 130.0, 220.0]), 30.0)
    )
    assert near > 20 * coarse > 20 * 5 * wrong
    assert wrong == pytest.approx(opposite, rel=0.05)


def predict(sun: tuple[float, float]) -> Prediction:
    cells = grid_directions(TINY.sun_grid)
    p = np.exp(4.0 * (cells @ direction(*sun) - 1.0))
    return Prediction(TINY, (p / p.sum()).astype(np.float32), 0.9, 3.0, 1.0, CAMERA.elevation, CAMERA.roll, 55.0)


def test_a_shadow_is_evidence_and_a_contradicting_one_is_told() -> None:
    size = (CAMERA.width, CAMERA.height)
    with_it = fuse_single_view(
        predict((20.0, 40.0)), Observations(shadows=(cast((30.0, 40.0), 9.0),), picture_size=size)
    )
    assert with_it.used == ("pixels", "shadow")
    assert with_it.warnings == ()
    against = fuse_single_view(
        predict((-140.0, 40.0)), Observations(shadows=(cast((30.0, 40.0), 9.0),), picture_size=size)
    )
    (warning,) = against.warnings
    assert warning_code(warning) == "shadow-contradicted"
    assert abs(wrap_azimuth(with_it.sun.azimuth - 30.0)) < abs(wrap_azimuth(20.0 - 30.0)) + 15.0


def test_a_contradicting_shadow_of_the_camera_has_a_question_of_its_own() -> None:
    own = OwnShadow(tuple(map(float, camera_pixel(-direction(180.0, 8.0), CAMERA))))  # type: ignore[arg-type]
    observed = Observations(shadows=(own,), picture_size=(CAMERA.width, CAMERA.height))
    (warning,) = fuse_single_view(predict((10.0, 40.0)), observed).warnings
    assert warning.endswith("is it the camera's own?")


@pytest.mark.parametrize(
    ("mark", "sentence"),
    [
        (Shadow((600.0, 50.0), (600.0, 700.0)), "horizon"),
        (Shadow((600.0, 700.0), (-40.0, 800.0)), "outside of the photo, which has 1200 x 900"),
        (OwnShadow((600.0, 20.0)), "horizon"),
    ],
)
def test_a_mark_where_no_ground_is_gets_one_sentence(mark: ShadowMark, sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence) as caught:
        shadow_likelihood(mark, CAMERA, CELLS)
    assert caught.value.field == "shadows"


@pytest.mark.parametrize("marks", [([],), (Shadow((5.0, 5.0), (6.0, 5.0)),), (OwnShadow((float("nan"), 1.0)),)])
def test_what_is_no_mark_is_refused(marks: tuple[ShadowMark, ...]) -> None:
    with pytest.raises(ParameterError):
        check_marks(marks)


def test_marks_are_read_from_text() -> None:
    texts = ["1,2,30,4", "1,2,30,4,5,6", "doubt:1,2,30,4", "own:7,8", "head:7,8", "line:1,2,30,4", "lit:1,2,30,4"]
    stated = UserInput(shadows=[*texts, "lit:1,2,30,4,20,3"])
    assert stated.shadows == (
        Shadow((1.0, 2.0), (30.0, 4.0)),
        Shadow((1.0, 2.0), (30.0, 4.0), (5.0, 6.0)),
        Shadow((1.0, 2.0), (30.0, 4.0), is_doubted=True),
        OwnShadow((7.0, 8.0)),
        OwnShadow((7.0, 8.0), is_head=True),
        ShadowLine((1.0, 2.0), (30.0, 4.0)),
        LitSide((1.0, 2.0), (30.0, 4.0)),
        LitSide((1.0, 2.0), (30.0, 4.0), (20.0, 3.0)),
    )
    for text in ("", "1,2", "1,2,3", "x:1,2", "own:1,2,3,4", ":1,2,3,4", "1,2,3,4,5,6,7,8"):
        with pytest.raises(ParameterError, match="is no shadow such as"):
            read_shadow(text)


def test_a_mark_moves_with_all_of_its_points() -> None:
    assert move_drawn(Shadow((1.0, 2.0), (30.0, 4.0)), 10.0, -1.0) == Shadow((11.0, 1.0), (40.0, 3.0))
