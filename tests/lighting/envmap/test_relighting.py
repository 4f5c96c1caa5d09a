"""Tests of relighting."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.cli.options import parse_exposure
from lighting.color import luminance
from lighting.envmap.relighting import (
    adjust_lighting,
    edit_lighting,
    edit_photo_light,
    light_of_map,
    rotate_envmap,
    rotate_lighting,
    scale_exposure,
)
from lighting.envmap.render import render, sky_irradiance, sun_light
from lighting.errors import ParameterError
from lighting.geometry import wrap_azimuth
from lighting.map_options import Adjustments, MapOptions, parse_sun
from lighting.records import Lighting, SunCandidate
from tests.helpers.predictions import model_light, stated_light

PLAIN = Lighting(sun_azimuth=30.0, sun_elevation=40.0, turbidity=3.0, exposure=4.0)
STATED = replace(PLAIN, sun_irradiance=(6.0, 4.0, 2.0), sky_irradiance=(1.0, 2.0, 3.0), sky_cover=0.25)
CHANGES = {"sun_elevation": 8.0, "turbidity": 6.0, "exposure": 9.0}


def test_a_light_without_irradiances_is_only_replaced() -> None:
    assert edit_lighting(PLAIN, CHANGES) == replace(PLAIN, sun_elevation=8.0, turbidity=6.0, exposure=9.0)


@pytest.mark.parametrize("changes", [{}, {"sun_azimuth": 31.0}, {"camera_elevation": 5.0}])
def test_what_moves_no_power_leaves_every_digit(changes: dict[str, float]) -> None:
    light = replace(STATED, sun_irradiance=(9.60513, 10.5285, 9.32128), sky_irradiance=(0.760374, 1.24752, 1.99918))
    assert edit_lighting(light, changes) == replace(light, **changes)  # type: ignore[arg-type]


def test_exposure_scales_both() -> None:
    twice = edit_lighting(STATED, {"exposure": 8.0})
    np.testing.assert_allclose(sun_light(twice)[0], (12, 8, 4), rtol=1e-5)
    np.testing.assert_allclose(sky_irradiance(twice), (2, 4, 6), rtol=1e-5)


def test_the_sun_keeps_its_ratio_to_the_models() -> None:
    changed, model = edit_lighting(STATED, CHANGES), edit_lighting(PLAIN, CHANGES)
    before = sun_light(STATED)[0] / sun_light(PLAIN)[0]
    np.testing.assert_allclose(sun_light(changed)[0] / sun_light(model)[0], before, rtol=1e-5)


@pytest.mark.parametrize(("cover", "spread"), [(0.0, 0.0), (1.0, 1.0)])
def test_an_overcast_sky_changes_in_grey_alone(cover: float, spread: float) -> None:
    """A clear sky's color follows the model; the ratio of an overcast one's channels stays."""
    stated = replace(STATED, sky_cover=cover)
    gain = sky_irradiance(edit_lighting(stated, CHANGES)) / sky_irradiance(stated)
    model = sky_irradiance(edit_lighting(PLAIN, CHANGES)) / sky_irradiance(PLAIN)
    np.testing.assert_allclose(np.ptp(gain) / np.ptp(model), 1 - spread, atol=1e-5)


def test_what_is_stated_anew_counts_as_it_is() -> None:
    power: dict[str, Any] = {"sun_irradiance": (3.9, 4.3, 3.4), "sky_irradiance": (0.3, 0.6, 1.1)}
    light: dict[str, Any] = {**CHANGES, **power, "sky_cover": 0.5, "ground_color": (0.1, 0.2, 0.3)}
    assert edit_lighting(STATED, light) == replace(STATED, **light)
    assert edit_lighting(PLAIN, power) == replace(PLAIN, **power)


def test_a_value_out_of_range_is_refused() -> None:
    with pytest.raises(ParameterError, match="turbidity"):
        edit_lighting(STATED, {"turbidity": 30.0})


@pytest.mark.parametrize("turbidity", [2.0, 6.0, 10.0])
def test_a_low_sun_that_is_raised_becomes_an_ordinary_one(turbidity: float) -> None:
    """The model's sun at 1° has no blue and little green; what is stated of it must not be multiplied by thousands."""
    low = replace(STATED, sun_elevation=1.0, turbidity=turbidity, sun_irradiance=(15.0, 10.0, 1.5))
    high = edit_lighting(low, {"sun_elevation": 35.0})
    gain = sun_light(high)[0] / sun_light(low)[0]
    assert 1.0 < gain.min() <= gain.max() < 25.0
    np.testing.assert_allclose(sun_light(edit_lighting(high, {"sun_elevation": 1.0}))[0], (15.0, 10.0, 1.5), rtol=1e-6)


SMALL = render(model_light(), 16)


@given(st.integers(-100, 100))
def test_whole_pixels_turn_exactly(columns: int) -> None:
    np.testing.assert_array_equal(rotate_envmap(SMALL, columns * 360 / 32), np.roll(SMALL, columns, axis=1))


@pytest.mark.parametrize("yaw", [46.0, -100.0, 170.0, 522.0])
def test_turning_the_map_turns_the_sun(yaw: float) -> None:
    turned = rotate_envmap(render(model_light(0.0), 90), yaw)
    azimuth = (yaw + 180) % 360 - 180
    np.testing.assert_allclose(turned, render(model_light(azimuth), 90), rtol=2e-3)


@given(st.floats(-1000, 1000))
def test_turning_keeps_the_energy_and_interpolates(yaw: float) -> None:
    turned = rotate_envmap(SMALL, yaw)
    assert turned.dtype == np.float32
    np.testing.assert_allclose(turned.sum(axis=1), SMALL.sum(axis=1), rtol=1e-4)
    assert turned.max() <= SMALL.max() * (1 + 1e-6)


def test_half_a_pixel_is_the_mean_of_neighbours() -> None:
    image = np.zeros((8, 16, 3), dtype=np.float32)
    image[:, 15] = 2.0
    turned = rotate_envmap(image, 360 / 16 / 2)
    assert turned[0, :, 0].tolist() == [1.0, *[0.0] * 14, 1.0]


@pytest.mark.parametrize("yaw", [float("nan"), float("inf")])
def test_a_yaw_is_finite(yaw: float) -> None:
    with pytest.raises(ParameterError, match=r"^yaw must be a finite number"):
        rotate_envmap(SMALL, yaw)


def test_a_turned_record_keeps_the_suns_compass_azimuth() -> None:
    known = replace(
        model_light(0.0), camera_heading=350.0, camera_heading_probability=(0.0,) * 350 + (1.0,) + (0.0,) * 9
    )
    turned = rotate_lighting(known, -30.0)
    assert turned.sun_azimuth == pytest.approx(wrap_azimuth(known.sun_azimuth - 30.0))
    assert turned.camera_heading == pytest.approx(20.0)
    assert np.argmax(turned.camera_heading_probability) == 20
    assert rotate_lighting(turned, 30.0) == known
    assert rotate_lighting(model_light(0.0), 30.0).camera_heading is None


def test_turned_angles_have_no_digits_of_rounding() -> None:
    known = replace(model_light(0.0), sun_azimuth=57.5527, camera_heading=142.67, relative_heading=33.4)
    assert rotate_lighting(known, 360.0) == known
    turned = rotate_lighting(known, 123.456)
    assert (turned.sun_azimuth, turned.camera_heading, turned.relative_heading) == (-178.9913, 19.214, 269.944)
    assert rotate_lighting(replace(known, camera_heading=30.0), 30.0 + 1e-9).camera_heading == 0.0


def test_a_brightened_record_renders_a_brightened_map() -> None:
    gain = np.array([2.0, 2.0, 2.0])
    for light in (model_light(), stated_light(sky_cover=0.3)):
        np.testing.assert_allclose(render(scale_exposure(light, gain), 32), 2 * render(light, 32), rtol=1e-5)


def test_a_tint_changes_the_irradiances_alone() -> None:
    tinted = scale_exposure(stated_light(), np.array([2.0, 1.0, 0.5]))
    assert tinted.sky_irradiance == pytest.approx((0.8, 0.5, 0.4))
    assert scale_exposure(model_light(), np.ones(3)).sky_irradiance is None


def test_a_turned_record_turns_its_heading_against_other_photos() -> None:
    known = replace(model_light(0.0), relative_heading=20.0)
    assert rotate_lighting(known, 30.0).relative_heading == pytest.approx(350.0)
    assert rotate_lighting(rotate_lighting(known, 30.0), -30.0) == known


# Adjustments by hand


def test_no_adjustment_changes_no_digit() -> None:
    for light in (model_light(), stated_light(sky_cover=0.3)):
        assert adjust_lighting(light, Adjustments()) == light


def test_a_sun_set_by_hand_stands_there_with_the_power_of_its_height() -> None:
    light = replace(stated_light(33.0), radius_50=9.0, radius_90=30.0)
    moved = adjust_lighting(light, Adjustments(sun=(270.0, 8.0)))
    assert (moved.sun_azimuth, moved.sun_elevation, moved.radius_50, moved.radius_90) == (-90.0, 8.0, 0.0, 0.0)
    expected = edit_lighting(light, {"sun_azimuth": -90.0, "sun_elevation": 8.0})
    assert (moved.sun_irradiance, moved.sky_irradiance) == (expected.sun_irradiance, expected.sky_irradiance)


@pytest.mark.parametrize("light", [model_light(), stated_light(33.0)])
def test_a_sun_set_below_the_horizon_does_not_shine(light: Lighting) -> None:
    dark = None if light.sun_irradiance is None else (0.0, 0.0, 0.0)
    for moved in (adjust_lighting(light, Adjustments(sun=(40.0, -3.0))), edit_lighting(light, {"sun_elevation": -3.0})):
        assert (moved.sun_visibility, moved.sun_irradiance) == (0.0, dark)
    stated = {"sun_elevation": -3.0, "sun_visibility": 0.25, "sun_irradiance": (1.0,) * 3, "sky_irradiance": (2.0,) * 3}
    assert edit_lighting(light, stated) == replace(light, **stated)  # type: ignore[arg-type]
    horizon = adjust_lighting(light, Adjustments(sun=(40.0, 0.0)))
    assert horizon.sun_visibility == light.sun_visibility


@pytest.mark.parametrize("ev", [-1.0, 0.5, 3.0])
def test_an_exposure_in_ev_is_a_gain_of_the_map(ev: float) -> None:
    for light in (model_light(), stated_light(sky_cover=0.3)):
        adjusted = adjust_lighting(light, Adjustments(exposure=ev))
        np.testing.assert_allclose(render(adjusted, 32), 2.0**ev * render(light, 32), rtol=1e-5)


def test_haze_is_the_turbidity() -> None:
    assert adjust_lighting(STATED, Adjustments(haze=8.0)) == edit_lighting(STATED, {"turbidity": 8.0})


def test_an_overcast_sky_is_gray_and_has_no_sun() -> None:
    light = stated_light(sky_cover=0.0)
    gray = adjust_lighting(light, Adjustments(overcast=True))
    assert (gray.sun_visibility, gray.sun_irradiance, gray.sky_cover) == (0.0, (0.0, 0.0, 0.0), 1.0)
    level = float(np.array([0.2126, 0.7152, 0.0722]) @ sky_irradiance(light))
    np.testing.assert_allclose(sky_irradiance(gray), 0.25 / 0.3 * level, rtol=1e-4)  # Kasten and Czeplak, 1980
    sky = render(gray, 32)[:16]
    np.testing.assert_allclose(sky, np.broadcast_to(sky[:, :1, :1], sky.shape), rtol=1e-4)
    covered = stated_light(sky_cover=1.0)
    np.testing.assert_allclose(
        sky_irradiance(adjust_lighting(covered, Adjustments(overcast=True))), sky_irradiance(covered), rtol=1e-5
    )


def test_a_record_without_irradiances_becomes_overcast_over_the_same_ground() -> None:
    gray = adjust_lighting(model_light(), Adjustments(overcast=True))
    assert gray.sky_cover == 1.0
    assert gray.ground_color == (0.3, 0.3, 0.3)
    assert render(gray, 32).max() < 0.2 * render(model_light(), 32).max()


@pytest.mark.parametrize(
    ("adjusted", "field"),
    [
        ({"sun": (40.0, 91.0)}, "sun"),
        ({"sun": (400.0, 20.0)}, "sun"),
        ({"sun": (40.0,)}, "sun"),
        ({"sun": (float("nan"), 20.0)}, "sun"),
        ({"exposure": 21.0}, "exposure"),
        ({"exposure": "1"}, "exposure"),
        ({"haze": 0.5}, "haze"),
        ({"overcast": 1}, "overcast"),
    ],
)
def test_an_adjustment_out_of_range_names_its_field(adjusted: dict[str, Any], field: str) -> None:
    with pytest.raises(ParameterError) as caught:
        Adjustments(**adjusted)
    assert caught.value.field == field


def test_adjustments_are_read_from_texts() -> None:
    assert parse_sun("40,25") == (40.0, 25.0)
    assert parse_sun(" -120.5, 3") == (-120.5, 3.0)
    assert [parse_exposure(text) for text in ("+0.5", "-1ev", "2 EV")] == [0.5, -1.0, 2.0]
    for text in ("40", "40,25,3", "", "north,25"):
        with pytest.raises(ParameterError, match="such as 40,25"):
            parse_sun(text)
    with pytest.raises(ValueError, match="bright"):
        parse_exposure("bright")


def _listed(**values: Any) -> Lighting:
    suns = (SunCandidate(-41.2, 33.0, 0.6), SunCandidate(120.0, 25.0, 0.4))
    return replace(stated_light(radius_50=20.0, radius_90=80.0), sun_candidates=suns, **values)


def test_a_picked_sun_is_one_of_the_listed() -> None:
    light = adjust_lighting(_listed(), Adjustments(pick=2))
    assert (light.sun_azimuth, light.sun_elevation) == (120.0, 25.0)
    assert (light.radius_90, light.sun_candidates) == (0.0, ())
    assert light == adjust_lighting(_listed(), Adjustments(sun=(120.0, 25.0)))


@pytest.mark.parametrize("listed", [_listed(), replace(_listed(), sun_candidates=())])
def test_a_sun_that_is_not_listed_cannot_be_picked(listed: Lighting) -> None:
    with pytest.raises(ParameterError, match=r"^pick is 3, and the answer lists (2 suns|no suns)\."):
        adjust_lighting(listed, Adjustments(pick=3))


def test_a_sun_is_picked_or_set() -> None:
    with pytest.raises(ParameterError, match="pick"):
        Adjustments(sun=(1.0, 2.0), pick=2)
    with pytest.raises(ParameterError, match="pick"):
        Adjustments(pick=4)


def test_candidates_turn_with_the_map() -> None:
    turned = rotate_lighting(_listed(), 90.0)
    assert [sun.azimuth for sun in turned.sun_candidates] == pytest.approx([48.8, -150.0])


DIM = _listed(sun_visibility=0.1, sun_irradiance=(1e-5, 1e-5, 1e-5), sky_cover=0.9)


def test_a_sun_that_is_set_by_hand_or_turned_on_shines() -> None:
    """It is as strong against the sky as the model's, which it tells by its color; the sky lets it through."""
    assert not DIM.sun_painted
    sun = DIM.sun_azimuth, DIM.sun_elevation
    moved, turned_on = adjust_lighting(DIM, Adjustments(sun=sun)), light_of_map(DIM, MapOptions(sun=True))
    assert (moved.sun_irradiance, moved.sky_irradiance) == (turned_on.sun_irradiance, turned_on.sky_irradiance)
    model = edit_lighting(replace(DIM, sun_irradiance=None, sky_irradiance=None, sky_cover=None), {})
    ratio, expected = (
        luminance(sun_light(light)[0]) / luminance(sky_irradiance(light)) for light in (turned_on, model)
    )
    assert ratio == pytest.approx(expected, rel=0.01)
    assert (turned_on.sun_visibility, turned_on.sky_cover) == (1.0, 0.5)
    assert turned_on.sky_irradiance == DIM.sky_irradiance
    assert adjust_lighting(DIM, Adjustments(exposure=1.0)).sun_visibility == 0.1


def test_only_a_sun_that_did_not_shine_is_turned_on() -> None:
    for sun in (None, False):
        assert light_of_map(DIM, MapOptions(sun=sun)) == DIM
    sunny, set_ = replace(DIM, sun_visibility=0.6), replace(DIM, sun_elevation=-2.0)
    assert [light_of_map(light, MapOptions(sun=True)) for light in (sunny, set_)] == [sunny, set_]


def test_a_raised_sun_leaves_the_photo_exposed() -> None:
    """The sky over a dusk doubles at most, and the sun keeps its ratio to it; other changes brighten it as before."""
    dusk = replace(STATED, sun_elevation=1.0)
    free, held = (edit(dusk, {"sun_elevation": 30.0, "exposure": 8.0}) for edit in (edit_lighting, edit_photo_light))
    levels = [float(luminance(sky_irradiance(light))) for light in (dusk, free, held)]
    assert levels[1] > 5 * levels[0]
    assert levels[2] == pytest.approx(2 * 2 * levels[0], rel=1e-4)  # the exposure is twice that of before
    for light in (sun_light(held)[0] / sun_light(free)[0], sky_irradiance(held) / sky_irradiance(free)):
        np.testing.assert_allclose(light, levels[2] / levels[1], rtol=1e-4)
    for changes in ({"sun_elevation": 0.5}, {"exposure": 40.0}, {"sun_elevation": 50.0, "sky_irradiance": (9.0,) * 3}):
        assert edit_photo_light(dusk, changes) == edit_lighting(dusk, changes)  # type: ignore[arg-type]
