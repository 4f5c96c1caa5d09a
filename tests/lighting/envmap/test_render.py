"""Tests of render."""

import itertools
import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import lighting.envmap.latlong as latlong
import lighting.envmap.render as render_module
from lighting.cli import cli
from lighting.envmap.latlong import irradiance_from_rows, row_irradiance
from lighting.envmap.relighting import edit_lighting
from lighting.envmap.render import (
    cap_map,
    clear_irradiance,
    ground_reflectance,
    level_irradiance,
    render,
    sky_irradiance,
    sun_light,
    with_irradiance,
)
from lighting.envmap.surroundings import PhotoContext, render_view
from lighting.errors import ParameterError
from lighting.fields import round_all
from lighting.files import MAP_FORMATS
from lighting.geometry import (
    SUN_RADIUS,
    Floats,
    angle_between,
    direction,
    latlong_angles,
    latlong_directions,
    latlong_solid_angle,
)
from lighting.map_options import MapOptions
from lighting.photo_estimate import render_map
from lighting.record_json import record_with_coefficients
from lighting.records import Lighting
from lighting.sky import SKY_MODELS, Weather, sky_shape
from lighting.sky.clear_sky import SUN_SOLID_ANGLE, sky_radiance, sun_disc_points, sun_disc_radiance, sun_radiance
from tests.conftest import scene
from tests.helpers.predictions import GROUND_COLOR, SKY_IRRADIANCE, SUN_IRRADIANCE, model_light, stated_light

HEIGHTS = (16, 18, 50, 128, 1024)
SUNS = {  # azimuth and elevation, deg
    "ordinary": (-41.2, 33.0),
    "seam": (180.0, 20.0),
    "beside the seam": (-179.9, 5.0),
    "half set": (12.0, 0.0),
    "touching the horizon": (100.0, 0.2),
    "beside the zenith": (70.0, 89.6),
    "over the zenith": (-70.0, 89.85),
    "zenith": (0.0, 90.0),
}
SUN_CASES = pytest.mark.parametrize(("azimuth", "elevation"), SUNS.values(), ids=SUNS.keys())

HALF = 65504.0
TOLERANCE = 0.02  # stops


@lru_cache(maxsize=8)
def disc_of(light: Lighting, height: int) -> Floats:
    """What painting the sun adds above the horizon (H / 2, 2H, 3)."""
    return (render(light, height, sun=True) - render(light, height, sun=False))[: height // 2].astype(np.float64)


def power(light: Lighting, height: int) -> Floats:
    return np.asarray(disc_of(light, height).sum(axis=1).T @ latlong_solid_angle(height)[: height // 2])


def expected_power(light: Lighting) -> Floats:
    points, weight = sun_disc_points(light.sun_direction, rings=100, spokes=400)
    return weight @ sun_disc_radiance(points, light.sun_direction, light.turbidity) * light.exposure


def horizontal_irradiance(image: Floats) -> Floats:
    """The hemisphere integral of radiance x cosine, pixel by pixel."""
    up = np.maximum(np.sin(np.radians(latlong_angles(len(image))[1])), 0)
    return np.asarray(image.sum(axis=1, dtype=np.float64).T @ (up * latlong_solid_angle(len(image))))


# The picture as a whole


@pytest.mark.parametrize("height", [16, 18, 512, np.int64(64)])
def test_shape_type_and_finite_values(height: int) -> None:
    image = render(model_light(), height)
    assert image.shape == (height, 2 * height, 3)
    assert image.dtype == np.float32
    assert np.isfinite(image).all()
    assert image.min() >= 0


@pytest.mark.parametrize("height", [0, 14, 17, 511, 4098, -512, 512.0, True, "512"])
def test_other_heights_are_one_sentence(height: Any) -> None:
    with pytest.raises(ParameterError, match=r"^height is .*; it must be an even number from 16 to 4096\.$"):
        render(model_light(), height)


@pytest.mark.slow
def test_the_largest_height() -> None:
    light = model_light(*SUNS["seam"])
    image = render(light, 4096)
    assert image.shape == (4096, 8192, 3)
    azimuth, elevation = latlong_angles(4096)
    directions = direction(azimuth[::8], elevation[:2048:64, None])
    away = angle_between(directions, light.sun_direction) > 1
    expected = sky_radiance(directions[away], light.sun_direction, 2.6, 0.3)
    np.testing.assert_allclose(image[:2048:64, ::8][away], expected, rtol=1e-3)
    rows = np.abs(elevation - light.sun_elevation) < 0.4
    around = np.roll(image[rows], 20, axis=1)[:, :40]
    columns = np.roll(azimuth, 20)[:40]
    disc = around - sky_radiance(direction(columns, elevation[rows, None]), light.sun_direction, 2.6, 0.3)
    assert disc.sum(axis=1).T @ latlong_solid_angle(4096)[rows] == pytest.approx(expected_power(light), rel=0.01)


def test_exposure_scales_everything() -> None:
    np.testing.assert_allclose(render(model_light(exposure=0.02), 64), 0.02 * render(model_light(), 64), rtol=1e-5)


# Sky


@pytest.mark.parametrize("turbidity", [1.0, 2.2, 10.0])
@pytest.mark.parametrize("elevation", [0.0, 3.0, 33.0, 90.0])
@pytest.mark.parametrize("height", [16, 256])
def test_sky_pixels_hold_the_sky_model(height: int, elevation: float, turbidity: float) -> None:
    light = model_light(25.0, elevation, turbidity=turbidity, ground_albedo=0.6)
    sky = render(light, height, sun=False)[: height // 2]
    expected = sky_radiance(latlong_directions(height)[: height // 2], light.sun_direction, turbidity, 0.6)
    strongest = expected.max(axis=-1, keepdims=True)
    assert (np.abs(sky - expected) / strongest).max() < 1e-3


# Sun


@pytest.mark.parametrize(("azimuth", "elevation"), [(-41.2, 33.0), (180.0, 20.0), (-179.9, 5.0), (0.0, 90.0)])
def test_the_power_asked_for_is_painted(azimuth: float, elevation: float) -> None:
    power = (300.0, 200.0, 100.0)
    light = replace(stated_light(elevation), sun_azimuth=azimuth, sun_irradiance=power, ground_color=(0.0, 0.0, 0.0))
    sun = render(light, 32, sun=True) - render(light, 32, sun=False)
    assert sun.sum(axis=1).T @ latlong_solid_angle(32) == pytest.approx(power, rel=1e-4)


def test_level_ground_receives_the_power_by_the_suns_height() -> None:
    power, ground = sun_light(model_light(elevation=30.0))
    assert ground == pytest.approx(power / 2, rel=1e-3)


@SUN_CASES
@pytest.mark.parametrize("height", HEIGHTS)
def test_sun_power_is_the_same_at_every_height(azimuth: float, elevation: float, height: int) -> None:
    light = model_light(azimuth, elevation)
    expected = expected_power(light)
    assert np.abs(power(light, height) - expected).max() < 0.01 * expected.max()


@SUN_CASES
def test_the_disc_is_where_the_sun_is(azimuth: float, elevation: float) -> None:
    light, height = model_light(azimuth, elevation), 512
    disc = disc_of(light, height)[..., 0]
    directions = latlong_directions(height)[: height // 2]
    pixel_diagonal = 2**0.5 * 180 / height
    assert angle_between(directions[disc > 0], light.sun_direction).max() < SUN_RADIUS + pixel_diagonal / 2
    center = np.tensordot(disc * latlong_solid_angle(height)[: height // 2, None], directions, axes=2)
    assert angle_between(center, light.sun_direction) < (0.02 if elevation > 0.3 else SUN_RADIUS)


@pytest.mark.parametrize(("rows", "columns"), [(0, 0), (2, 0), (0, 2), (-3, 0), (6, 0)])
def test_large_maps_resolve_the_disc_and_its_limb(rows: int, columns: int) -> None:
    height, row, column = 2048, 568, 2048
    azimuth, elevation = latlong_angles(height)
    light = model_light(azimuth[column], elevation[row])
    painted = disc_of(light, height)[row + rows, column + columns]
    inside = (np.arange(64) + 0.5) / 64 * (180 / height) - 90 / height
    points = direction(azimuth[column + columns] + inside, elevation[row + rows] + inside[:, None])
    model = sun_disc_radiance(points, light.sun_direction, light.turbidity).mean(axis=(0, 1))
    assert painted == pytest.approx(model, rel=0.01, abs=0.03 * sun_radiance(light.sun_direction, 2.6).max())


def test_half_of_a_setting_sun_is_painted() -> None:
    set_, whole = model_light(30.0, 0.0), model_light(30.0, 0.3)
    assert disc_of(set_, 512).sum() > 0
    radiance = sun_radiance(set_.sun_direction, set_.turbidity) * SUN_SOLID_ANGLE / 2
    assert power(set_, 512) == pytest.approx(radiance, rel=0.01)
    assert power(set_, 512)[0] < 0.6 * power(whole, 512)[0]


@pytest.mark.parametrize(("visibility", "painted"), [(0.49, False), (0.5, True), (1.0, True)])
def test_visibility_decides_about_the_disc(visibility: float, painted: bool) -> None:
    light = model_light(sun_visibility=visibility)
    np.testing.assert_array_equal(render(light, 32), render(light, 32, sun=painted))
    assert (render(light, 32, sun=True) > render(light, 32, sun=False)).any()


# Ground


@pytest.mark.parametrize("sun", [False, True])
@pytest.mark.parametrize("elevation", [4.0, 33.0, 90.0])
@pytest.mark.parametrize("albedo", [0.3, 1.0])
def test_ground_reflects_the_hemisphere_integral(albedo: float, elevation: float, sun: bool) -> None:
    light = model_light(60.0, elevation, ground_albedo=albedo)
    image = render(light, 512, sun=sun)
    assert (image[256:] == image[256, 0]).all()
    assert image[-1, 0] == pytest.approx(albedo / np.pi * horizontal_irradiance(image), rel=0.01)


def test_ground_is_the_same_at_every_height() -> None:
    expected = render(model_light(), 1024)[-1, 0]
    for height in HEIGHTS:
        np.testing.assert_array_equal(render(model_light(), height)[-1, 0], expected)


def test_black_ground_is_black() -> None:
    assert not render(model_light(ground_albedo=0.0), 32)[16:].any()


# Given irradiances


def test_what_is_no_lighting_is_named() -> None:
    with pytest.raises(ParameterError, match="A Lighting is needed, not dict; an estimate has one as `lighting`"):
        render({"sun_azimuth": 3.0})  # type: ignore[arg-type]


@pytest.mark.parametrize("cover", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("elevation", [0.3, 33.0, 89.0])
@pytest.mark.parametrize("height", [16, 128])
def test_the_integrals_are_those_given(cover: float, elevation: float, height: int) -> None:
    light = stated_light(elevation, sky_cover=cover)
    assert power(light, height) == pytest.approx(SUN_IRRADIANCE, rel=1e-4)
    image = render(light, height)
    up = np.sin(np.radians(elevation))
    assert image[-1, 0] == pytest.approx(
        np.array(GROUND_COLOR) / np.pi * (np.array(SKY_IRRADIANCE) + up * np.array(SUN_IRRADIANCE)), rel=1e-5
    )
    fine = render(light, 512, sun=False)
    assert horizontal_irradiance(fine) == pytest.approx(SKY_IRRADIANCE, rel=2e-4)
    assert fine[-1, 0] == pytest.approx(np.array(GROUND_COLOR) / np.pi * np.array(SKY_IRRADIANCE), rel=1e-5)


def test_a_covered_sun_fades_by_its_irradiance_whatever_its_visibility() -> None:
    faint = Lighting(
        0.0, 40.0, 3.0, 1.0, sun_visibility=0.1, sun_irradiance=(0.1, 0.1, 0.1), sky_irradiance=SKY_IRRADIANCE
    )
    assert power(faint, 64) == pytest.approx([0.1] * 3, rel=1e-4)
    assert not faint.sun_painted
    assert not faint.sun_shines


def test_without_a_colour_the_given_ground_is_dark_grey_and_the_old_one_its_albedo() -> None:
    plain = Lighting(0.0, 40.0, 3.0, 1.0, sun_irradiance=(0.0, 0.0, 0.0), sky_irradiance=SKY_IRRADIANCE)
    assert render(plain, 32)[-1, 0] == pytest.approx(0.12 / np.pi * np.array(SKY_IRRADIANCE), rel=1e-5)
    red = Lighting(0.0, 40.0, 3.0, 1.0, ground_color=(0.6, 0.3, 0.3))
    assert render(red, 32)[-1, 0] == pytest.approx(render(model_light(0.0, 40.0, turbidity=3.0), 32)[-1, 0] * [2, 1, 1])


def test_stated_irradiances_are_those_of_the_model() -> None:
    old = model_light()
    stated = with_irradiance(old)
    assert sun_light(stated)[0] == pytest.approx(sun_light(old)[0])
    assert sky_irradiance(stated) == pytest.approx(sky_irradiance(old))
    np.testing.assert_allclose(render(stated, 128, sun=False), render(old, 128, sun=False), rtol=2e-3)
    assert with_irradiance(stated) is stated
    assert with_irradiance(model_light(sun_visibility=0.2)).sun_irradiance == (0.0, 0.0, 0.0)


def test_a_sun_that_haze_has_put_out_is_painted_in_its_given_colour() -> None:
    light = Lighting(10.0, 0.0, 10.0, 1.0, sun_irradiance=SUN_IRRADIANCE, sky_irradiance=SKY_IRRADIANCE)
    assert power(light, 64) == pytest.approx(SUN_IRRADIANCE, rel=1e-4)


def test_a_painted_sky_has_the_models_irradiance() -> None:
    light = model_light()
    upper = render(light, 256, sun=False)[:128]
    assert irradiance_from_rows(row_irradiance(256)[:128], upper) == pytest.approx(clear_irradiance(light), rel=1e-3)


def test_a_table_is_that_of_its_own_sky() -> None:
    first, other, again = (render(model_light(turbidity=turbidity), 32) for turbidity in (2.6, 8.0, 2.6))
    assert not np.array_equal(first, other)
    assert np.array_equal(again, first)


HEIGHT = 32


def upper(**fields: Any) -> np.ndarray:
    return render(replace(stated_light(), **fields), HEIGHT, sun=False)[: HEIGHT // 2]


@pytest.mark.parametrize("model", SKY_MODELS)
def test_every_model_gives_the_irradiance_asked_for(model: str) -> None:
    sky = upper(sky_model=model, sky_cover=0.3)
    assert irradiance_from_rows(row_irradiance(HEIGHT)[: HEIGHT // 2], sky) == pytest.approx(SKY_IRRADIANCE, rel=1e-4)
    assert sky.min() >= 0


def test_an_overcast_sky_is_the_cies_and_knows_no_sun() -> None:
    sky = upper(sky_cover=1.0)
    assert np.ptp(sky, axis=1).max() == 0
    assert sky[0, 0] / sky[-1, 0] == pytest.approx(3.0, rel=0.1)
    np.testing.assert_allclose(sky, upper(sky_model="cie-overcast", sky_cover=0.0), rtol=1e-4)


def test_cover_blends_the_two_skies() -> None:
    np.testing.assert_allclose(upper(sky_cover=0.25), 0.75 * upper() + 0.25 * upper(sky_cover=1.0), rtol=1e-5)


@pytest.mark.parametrize("model", ["hosek-wilkie", "preetham"])
@pytest.mark.parametrize(("elevation", "turbidity"), [(0.0, 1.0), (0.0, 10.0), (2.0, 10.0), (90.0, 1.0), (90.0, 10.0)])
def test_no_model_leaves_a_channel_dark(model: str, elevation: float, turbidity: float) -> None:
    """Each channel keeps the shape that the model gives it, however its irradiance is scaled."""
    weather = Weather(turbidity, ground_albedo=0.0, beam=1.0, diffuse=100.0)
    shape = sky_shape(model, latlong_directions(HEIGHT), direction(0.0, elevation), weather)
    level = irradiance_from_rows(row_irradiance(HEIGHT)[: HEIGHT // 2], shape[: HEIGHT // 2])
    assert level.min() > 0.2 * level.max()
    sky = upper(sky_model=model, sun_elevation=elevation, turbidity=turbidity)
    assert np.isfinite(sky).all()
    assert sky.max() < 100


@pytest.mark.parametrize("elevation", [0.0, 4.0, 40.0, 90.0])
def test_tables_by_angle_paint_what_the_model_says(elevation: float) -> None:
    light = replace(stated_light(), sky_painted="prague", sun_elevation=elevation, sky_cover=0.0)
    sky = render(light, 64, sun=False)[:32]
    weather = Weather(light.turbidity, light.ground_albedo, 0.0, 0.0)  # this sky takes turbidity and ground alone
    expected = sky_shape("prague", latlong_directions(64)[:32], light.sun_direction, weather)
    ratio = sky / expected
    np.testing.assert_allclose(ratio, np.broadcast_to(ratio.mean(axis=(0, 1)), ratio.shape), rtol=3e-3)


@pytest.mark.parametrize("stated", [True, False])
def test_a_sun_below_the_horizon_leaves_the_sky_of_twilight(stated: bool) -> None:
    light = stated_light(sky_cover=0.0) if stated else model_light()
    dusk = edit_lighting(replace(light, sky_painted="prague"), {"sun_elevation": -3.0})
    image, level = render(dusk, 64), sky_irradiance(dusk)
    assert not sun_light(dusk)[0].any()
    assert irradiance_from_rows(row_irradiance(64)[:32], image[:32]) == pytest.approx(level, rel=5e-3)
    assert all(level < 0.05 * sky_irradiance(edit_lighting(light, {"sun_elevation": 5.0})))
    np.testing.assert_array_equal(image, render(dusk, 64, sun=True))
    np.testing.assert_array_equal(image, render(replace(dusk, sky_painted=None), 64))
    assert image[40, 0] == pytest.approx(ground_reflectance(dusk) * level / np.pi, rel=1e-3)
    glow, zenith = image[:32].max(axis=(0, 1)), image[0, 0]
    assert glow[0] / glow[2] > 3 * zenith[0] / zenith[2]


@pytest.mark.parametrize("model", ["hosek-wilkie", "preetham", "perez", "lalonde-matthews", "cie-12"])
def test_skies_that_need_a_sun_refuse_one_below_the_horizon(model: str) -> None:
    with pytest.raises(
        ParameterError, match=r"^The sun (is below the horizon; the|elevation is -3; the sky model covers)"
    ):
        render(replace(stated_light(), sun_elevation=-3.0, sky_painted=model), 32)


def test_the_record_of_a_sun_below_the_horizon_has_the_coefficients_of_one_on_it() -> None:
    dusk = replace(stated_light(), sun_elevation=-3.0)
    record = record_with_coefficients(dusk)
    assert Lighting.from_dict(record) == dusk
    expected = record_with_coefficients(replace(dusk, sun_elevation=0.0))["sky"]["coefficients"]
    assert record["sky"]["coefficients"] == expected


@pytest.mark.parametrize("model", ["prague", "preetham", "perez", "cie-12"])
def test_without_irradiances_another_model_has_those_of_hosek_and_wilkie(model: str) -> None:
    ours, other = (render(replace(model_light(), sky_model=name), 64, sun=False) for name in ("hosek-wilkie", model))
    level = [irradiance_from_rows(row_irradiance(64)[:32], image[:32]) for image in (ours, other)]
    assert level[1] == pytest.approx(level[0], rel=5e-3)
    assert not np.allclose(ours, other, rtol=0.05)


def test_the_sun_of_lalonde_and_matthews_is_a_lobe_of_the_power_asked_for() -> None:
    black: dict[str, Any] = {"sun_irradiance": (300.0, 200.0, 100.0), "ground_color": (0.0, 0.0, 0.0)}
    light = replace(stated_light(40.0), sky_model="lalonde-matthews", **black)
    image = render(light, 128, sun=True) - render(light, 128, sun=False)
    assert image.sum(axis=1).T @ latlong_solid_angle(128) == pytest.approx([300.0, 200.0, 100.0], rel=1e-4)
    assert np.count_nonzero(image[..., 0] > 0.1 * image.max()) > 4
    light = replace(stated_light(), sky_model="lalonde-matthews")
    assert render(light, 64).max() < render(stated_light(), 64).max()


def light_of(elevation: float, exposure: float, **fields: Any) -> Lighting:
    return Lighting(
        sun_azimuth=37.3, sun_elevation=elevation, turbidity=3.0, exposure=exposure, camera_elevation=0.0,
        camera_roll=0.0, vertical_fov=60.0, sun_visibility=1.0, **fields,
    )  # fmt: skip


def irradiances(image: Floats, light: Lighting) -> Floats:
    """(2, 3) of a surface that faces the sun, and of level ground from above."""
    directions, weight = latlong_directions(len(image)), latlong_solid_angle(len(image))[:, None]
    cosines = np.maximum(np.stack([directions @ light.sun_direction, directions[..., 1]]), 0.0) * weight
    return np.tensordot(cosines, image.astype(np.float64), 2)


def unlimited(light: Lighting, height: int, monkeypatch: pytest.MonkeyPatch) -> Floats:
    """The map as it was before values ended."""
    with monkeypatch.context() as patch:
        for module in (latlong, render_module):
            patch.setattr(module, "MAX_RADIANCE", float("inf"))
        return render(light, height)


CASES = list(itertools.product((64, 256, 512), (0.1, 2.0, 12.0, 45.0, 89.8), (4.0, 300.0, 4000.0)))


@pytest.mark.parametrize(("height", "elevation", "exposure"), CASES)
def test_no_value_is_over_a_half_float_and_irradiances_stay(
    height: int, elevation: float, exposure: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    light = light_of(elevation, exposure)
    image, before = render(light, height), unlimited(light, height, monkeypatch)
    assert image.max() <= HALF
    assert np.isfinite(image.astype(np.float16)).all()
    assert image.min() >= 0
    change = np.log2(irradiances(image, light) / irradiances(before, light))
    assert np.abs(change).max() < TOLERANCE
    if before.max() <= HALF:
        assert np.array_equal(image, before)


def test_large_maps_hold_a_wider_sun(monkeypatch: pytest.MonkeyPatch) -> None:
    light = with_irradiance(light_of(40.0, 20.0))
    image, before = render(light, 2048), unlimited(light, 2048, monkeypatch)
    assert before.max() > HALF >= image.max() > 0.8 * HALF
    assert np.abs(np.log2(irradiances(image, light) / irradiances(before, light))).max() < 0.002
    wide = latlong_directions(2048)[(image - render(light, 2048, disc=False)).max(axis=-1) > 1.0]
    assert 0.3 < angle_between(wide, light.sun_direction).max() < 1.0


@pytest.mark.parametrize("sky", ["lalonde-matthews", "prague", "cie-12"])
def test_other_skies_end_there_too(sky: str) -> None:
    assert sky in SKY_MODELS
    light = with_irradiance(light_of(35.0, 900.0))
    image = render_map(light, MapOptions(256, sky=sky)).image
    assert image.max() <= HALF
    level = irradiances(image, light)[1]
    expected = np.array(light.sky_irradiance) + np.array(light.sun_irradiance) * light.sun_direction[1]
    assert np.abs(np.log2(level / expected)).max() < (0.3 if sky == "lalonde-matthews" else 0.05)  # a glow is wide


def test_surroundings_and_turned_maps_end_there_too() -> None:
    light = with_irradiance(light_of(35.0, 40.0))
    context = PhotoContext(scene(96, 64))
    image, _ = render_view(light, 512, context=context, yaw=33.3)
    assert 0.5 * HALF < image.max() <= HALF


@pytest.mark.parametrize("stated", [False, True])
def test_a_light_that_no_map_holds_is_refused(stated: bool) -> None:
    light = light_of(35.0, 9e5)
    if stated:
        light = light_of(35.0, 4.0, sun_irradiance=(1e6,) * 3, sky_irradiance=(1e6,) * 3)
    with pytest.raises(ParameterError, match=r"too bright for a map, whose values end at 65280") as caught:
        render(light, 64)
    assert caught.value.field == "exposure"


def test_a_bright_sky_keeps_its_irradiance() -> None:
    levels = latlong.row_irradiance(64)[:32]
    image = np.full((64, 128, 3), 20_000.0, np.float32)
    rows = image[:32]
    rows[10:14, 40:50] = (2e5, 1e5, 3e4)
    before = latlong.irradiance_from_rows(levels, rows)
    cap_map(image, light_of(40.0, 900.0))
    assert rows.max() <= HALF
    assert latlong.irradiance_from_rows(levels, rows) == pytest.approx(before, rel=2e-3)
    with pytest.raises(ParameterError, match="too bright"):
        cap_map(image * np.float32(5), light_of(40.0, 900.0))


@pytest.mark.parametrize("name", ["sky.exr", "sky.hdr"])
def test_the_command_writes_such_a_map(tmp_path: Path, name: str) -> None:
    record = tmp_path / "light.json"
    record.write_text(json.dumps(with_irradiance(light_of(40.0, 20.0)).to_dict()))
    arguments = ["render", str(record), "--height", "512", "-o", str(tmp_path / name)]
    assert CliRunner().invoke(cli, arguments).exit_code == 0
    read = MAP_FORMATS[name[-3:]].read
    assert read is not None
    assert 0.5 * HALF < read((tmp_path / name).read_bytes()).max() <= HALF


LIGHTS = Path(__file__).with_name("sun_light.json")  # what the page follows
IRRADIANCES: dict[str, Any] = {"sun_irradiance": (2.1, 1.8, 1.3), "sky_irradiance": (0.5, 0.6, 0.9), "sky_cover": 0.3}
RECORDS = [
    Lighting(-41.2, 33.0, 3.4, 5.0),
    Lighting(100.0, 6.0, 7.5, 2.0, ground_color=(0.2, 0.15, 0.1)),
    Lighting(10.0, 62.0, 2.0, 1.0, **IRRADIANCES, ground_color=(0.3, 0.3, 0.25)),
    Lighting(-150.0, 12.0, 5.0, 0.5, **IRRADIANCES, ground_color=(0.1, 0.2, 0.05)),
    Lighting(30.0, -2.0, 3.0, 4.0, ground_color=(0.12, 0.12, 0.12)),
]


def lights() -> list[dict[str, object]]:
    """Records, and what sun, sky and ground are by them."""
    return [
        {
            "record": light.to_dict(),
            "sun": round_all(sun_light(light)[0]),
            "sky": round_all(sky_irradiance(light)),
            "ground": round_all(ground_reflectance(light) / np.pi * level_irradiance(light)),
        }
        for light in RECORDS
    ]


def test_the_lights_that_the_page_follows_are_up_to_date() -> None:
    """`python -m tests.lighting.envmap.test_render` writes them anew."""
    assert json.loads(LIGHTS.read_text()) == json.loads(json.dumps(lights()))


@pytest.mark.parametrize("light", RECORDS)
def test_the_ground_is_lit_by_the_sun_that_is_painted(light: Lighting, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every reader of the sun's light follows `sun_light`."""
    facing, level = sun_light(light)
    assert level == pytest.approx(facing * max(light.sun_direction[1], 0.0), rel=0.01)
    before, edited = render(light, 32, sun=True)[-1, 0], edit_lighting(light, {"sun_azimuth": 3.0})
    monkeypatch.setattr(render_module, "sun_light", lambda one: tuple(2 * part for part in sun_light(one)))
    added = render(light, 32, sun=True)[-1, 0] - before
    assert added == pytest.approx(ground_reflectance(light) / np.pi * level, rel=1e-3, abs=1e-7)
    assert edited.sun_irradiance == light.sun_irradiance


if __name__ == "__main__":
    LIGHTS.write_text(json.dumps(lights(), indent=1) + "\n")
