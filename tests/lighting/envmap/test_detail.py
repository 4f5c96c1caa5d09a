"""Detail around a map: what it must leave as it is, and what it adds."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.color import luminance
from lighting.envmap.detail import MIN_ROWS, _color_dark, _continuation_cells, _match_continuation
from lighting.envmap.detail_library import (
    FEATURE_CLASSES,
    FEATURE_ROWS,
    FEATURES,
    _choose_detail,
    _detail_picture,
    _DetailChoice,
    _feature_weights,
    load_detail_library,
)
from lighting.envmap.latlong import blur_cells, envmap_irradiance, irradiance_from_rows, row_irradiance, shrink_envmap
from lighting.envmap.projection import ProjectedPhoto, project_photo
from lighting.envmap.relighting import edit_lighting
from lighting.envmap.surroundings import PhotoContext, render_with_surroundings
from lighting.geometry import angle_between, latlong_angles, latlong_directions
from lighting.records import Lighting
from lighting.segmentation import SurfaceClass
from tests.helpers.predictions import stated_light

HEIGHT = 128
LIGHT = replace(stated_light(40.0, camera_elevation=0.0), vertical_fov=50.0)


def photo(width: int = 160, height: int = 120) -> np.ndarray:
    """Blue sky over a brown wall with windows, and grey ground."""
    pixels = np.empty((height, width, 3), np.uint8)
    pixels[: height // 3] = (90, 130, 200)
    pixels[height // 3 : height // 2] = (120, 90, 60)
    pixels[height // 3 : height // 2, ::7] = (30, 30, 40)
    pixels[height // 2 :] = (110, 110, 105)
    pixels[height // 2 :, ::9] = (90, 95, 100)
    return pixels


def maps(
    pixels: np.ndarray | None = None, light: Lighting = LIGHT, height: int = HEIGHT, sun: bool | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """A map without and one with detail."""
    context = PhotoContext(photo() if pixels is None else pixels)
    return (
        render_with_surroundings(light, replace(context, detail=False), height, sun=sun, disc=False),
        render_with_surroundings(light, replace(context, detail=True), height, sun=sun, disc=False),
    )


def fine_contrast(image: np.ndarray) -> float:
    """Mean difference of neighboring columns in the logarithm, behind the camera."""
    log = np.log(luminance(image) + 1e-3)
    width = log.shape[1]
    behind = np.concatenate([log[:, -width // 4 :], log[:, : width // 4]], axis=1)
    return float(np.abs(np.diff(behind, axis=1)).mean())


def test_there_is_detail_all_around() -> None:
    plain, detailed = maps()
    assert fine_contrast(detailed) > 4 * fine_contrast(plain)
    assert np.isfinite(detailed).all()
    assert (detailed >= 0).all()


@pytest.mark.parametrize("sun", [True, False])
def test_level_ground_keeps_its_irradiance_from_above_and_below(sun: bool) -> None:
    levels = row_irradiance(HEIGHT)
    for half in (slice(0, HEIGHT // 2), slice(HEIGHT // 2, HEIGHT)):
        plain, detailed = (irradiance_from_rows(levels[half], image[half]) for image in maps(sun=sun))
        np.testing.assert_allclose(detailed, plain, rtol=1e-4)


def test_matte_objects_look_the_same() -> None:
    plain, detailed = (envmap_irradiance(image, latlong_directions(8).reshape(-1, 3)) for image in maps())
    np.testing.assert_allclose(detailed, plain, rtol=0.03)
    assert np.mean(np.abs(detailed / plain - 1)) < 0.01


def test_matte_objects_look_the_same_where_the_photo_is_clipped() -> None:
    """There the map shows through, and the detail under the photo counts as the rest does."""
    pixels = photo()
    pixels[:60, 20:] = 255
    sky = tuple(4 * np.array(LIGHT.sky_irradiance))
    light = replace(LIGHT, vertical_fov=80.0, camera_elevation=15.0, sky_irradiance=sky)
    plain, detailed = (envmap_irradiance(one, latlong_directions(8).reshape(-1, 3)) for one in maps(pixels, light))
    assert np.mean(np.abs(detailed / plain - 1)) < 0.02  # 0.032 if it did not


def test_what_is_coarse_stays() -> None:
    plain, detailed = (blur_cells(shrink_envmap(image, 24), 20.0) for image in maps())
    ratio = luminance(detailed) / luminance(plain)
    assert np.abs(np.log(ratio)).max() < 0.35
    assert np.abs(np.log(ratio)).mean() < 0.1


def test_the_photo_stays_where_it_lies() -> None:
    plain, detailed = maps()
    shown = project_photo(LIGHT, photo(), HEIGHT)
    inside = shown.whole.weight > 0.999
    window = np.s_[shown.rows, shown.columns]
    np.testing.assert_allclose(detailed[window][inside], plain[window][inside], rtol=0.02)


def test_the_same_photo_has_the_same_detail() -> None:
    np.testing.assert_array_equal(maps()[1], maps()[1])


def test_the_seam_is_no_edge() -> None:
    _, detailed = maps(height=256)
    log = np.log(luminance(detailed) + 1e-3)
    across = np.abs(log[:, 0] - log[:, -1]).mean()
    beside = np.abs(np.diff(log[:, :40], axis=1)).mean()
    assert across < 2 * beside


def test_the_detail_stays_when_the_sun_is_moved() -> None:
    context = PhotoContext(photo(), exposure=LIGHT.exposure, light=LIGHT, detail=True)
    moved = edit_lighting(LIGHT, {"sun_azimuth": LIGHT.sun_azimuth + 120})
    images = [render_with_surroundings(light, context, HEIGHT, disc=False) for light in (LIGHT, moved)]
    below = [np.log(luminance(image[70:120])) for image in images]
    behind = [np.diff(one[:, :60], axis=1).ravel() for one in below]
    assert np.corrcoef(behind[0], behind[1])[0, 1] > 0.9


@pytest.mark.parametrize("height", [MIN_ROWS, 50, 94, 130])
def test_any_height_that_has_room_gets_detail(height: int) -> None:
    plain, detailed = maps(height=height)
    assert detailed.shape == (height, 2 * height, 3)
    assert fine_contrast(detailed) > 2 * fine_contrast(plain)


@pytest.mark.parametrize("height", [16, MIN_ROWS - 2])
def test_a_tiny_map_stays_as_it_is(height: int) -> None:
    plain, detailed = maps(height=height)
    np.testing.assert_array_equal(detailed, plain)


@pytest.mark.parametrize(("width", "height"), [(12, 160), (160, 12), (1, 1), (40, 40)])
def test_narrow_and_tiny_photos_work(width: int, height: int) -> None:
    pixels = np.asarray(np.resize(photo(), (height, width, 3)))
    plain, detailed = maps(pixels)
    assert np.isfinite(detailed).all()
    assert fine_contrast(detailed) > 3 * fine_contrast(plain)


@pytest.mark.parametrize("value", [0, 128, 255])
def test_a_photo_of_one_grey_gets_grey_detail(value: int) -> None:
    _, detailed = maps(np.full((60, 80, 3), value, np.uint8))
    assert np.isfinite(detailed).all()
    red, green, blue = np.moveaxis(np.log(detailed[80:120, :60]), -1, 0)
    fine = [float(np.abs(np.diff(values, axis=1)).mean()) for values in (green, red - blue)]
    assert fine[1] < 0.2 * fine[0]
    assert np.std(green) > 0.05


def test_no_second_sun() -> None:
    plain, detailed = maps(height=256)
    sky = latlong_directions(64)[:32]
    away = angle_between(sky, LIGHT.sun_direction) > 20
    before, after = (luminance(shrink_envmap(image, 64)[:32])[away].max() for image in (plain, detailed))
    assert after < 1.4 * before


def continued_pixels(pixels: np.ndarray, segments: np.ndarray) -> ProjectedPhoto:
    return project_photo(LIGHT, pixels, 256, continued=True, segments=segments).whole


def test_people_are_not_repeated() -> None:
    """A red patch at the photo's edge goes on beside it, unless a mask says that it must not."""
    pixels = photo()
    pixels[70:100, -12:] = (250, 0, 0)
    segments = np.zeros((12, 16, len(SurfaceClass)), np.float32)
    segments[..., SurfaceClass.GROUND] = 1
    everything = continued_pixels(pixels, segments)
    segments[6:11, -2:] = np.eye(len(SurfaceClass))[SurfaceClass.PERSON]
    masked = continued_pixels(pixels, segments)
    azimuth, _ = latlong_angles(256)
    beyond = (azimuth[masked.columns] > 33) & np.ones((masked.share.shape[0], 1), bool)
    red = (masked.linear[..., 0] > 0.8) & (masked.linear[..., 1] < 0.1) & beyond & (masked.weight == 0)
    assert (red & (everything.share > 0.3)).any()
    assert not (red & (masked.share > 0)).any()
    assert (masked.share[masked.weight > 0] == 1).all()


def test_only_sky_and_plants_go_on_upwards() -> None:
    segments = np.zeros((12, 16, len(SurfaceClass)), np.float32)
    segments[..., SurfaceClass.BUILDING] = 1
    segments[:, :8] = np.eye(len(SurfaceClass))[SurfaceClass.SKY]
    continued = continued_pixels(photo(), segments)
    azimuth, elevation = latlong_angles(256)
    above = (elevation[continued.rows] > 26)[:, None] & (continued.weight == 0) & (continued.share > 0)
    left, right = (above & (sign * azimuth[continued.columns] > 3) for sign in (-1, 1))
    inside = np.abs(azimuth[continued.columns]) < 25
    assert (left & inside).any()
    assert not (right & inside).any()


def test_a_place_of_the_library_is_recognised_by_a_part_of_it() -> None:
    library = load_detail_library()
    azimuth, elevation = latlong_angles(FEATURE_ROWS)
    level = np.cos(np.radians(elevation))[:, None] * np.ones(len(azimuth))
    seen = level * ((np.abs(elevation) < 30)[:, None] & (np.abs(azimuth) < 40))
    weight = _feature_weights(seen, level)
    for index, turn in ((3, 5), (20, -11), (40, 0)):
        target = np.roll(library.features[index], turn, axis=-1)
        assert _choose_detail(target, weight, None) == _DetailChoice(index, False, turn * 7.5)
        flipped = _choose_detail(target[..., ::-1], weight, None)
        assert (flipped.index, flipped.flipped) == (index, True)


def test_a_sun_is_put_where_it_stands() -> None:
    library = load_detail_library()
    cells = np.zeros((len(library.features[0]), FEATURE_ROWS, 2 * FEATURE_ROWS), np.float32)
    choice = _choose_detail(cells, np.zeros_like(cells), 75.0)
    side = -1 if choice.flipped else 1
    there = (side * library.sun_azimuth[choice.index] + choice.yaw - 75.0 + 180) % 360 - 180
    assert library.sunlit[choice.index]
    assert abs(there) < 4
    assert not library.sunlit[_choose_detail(cells, np.zeros_like(cells), None).index]


def shown_classes(building: float, plants: float) -> tuple[np.ndarray, np.ndarray]:
    """Features of a photo of which only what it shows is known, and their weights."""
    azimuth, elevation = latlong_angles(FEATURE_ROWS)
    seen = ((np.abs(elevation) < 25)[:, None] & (np.abs(azimuth) < 35)).astype(np.float64)
    target = np.zeros((len(FEATURES), *seen.shape), np.float32)
    target[FEATURES.index("building")], target[FEATURES.index("plants")] = building, plants
    weight = _feature_weights(seen, np.ones_like(seen))
    weight[: -len(FEATURE_CLASSES)] = 0
    return target, weight


@pytest.mark.parametrize(("building", "plants"), [(0.0, 0.0), (0.0, 0.9), (0.9, 0.0)])
def test_places_have_what_the_photo_shows_all_around(building: float, plants: float) -> None:
    library = load_detail_library()
    features = library.features[_choose_detail(*shown_classes(building, plants), None).index]
    around = {name: features[FEATURES.index(name), 9:13].mean() for name in ("building", "plants")}
    assert around["building"] == pytest.approx(building, abs=0.4 if building else 0.15)
    assert around["plants"] == pytest.approx(plants, abs=0.35 if plants else 0.25)


@pytest.mark.parametrize("snow", [False, True])
def test_snow_is_for_photos_of_snow(snow: bool) -> None:
    library = load_detail_library()
    assert 0 < library.snow.sum() < len(library.snow) / 4
    for plants in (0.0, 0.9):
        assert library.snow[_choose_detail(*shown_classes(0.0, plants), None, snow).index] == snow


def test_what_is_dark_before_the_sky_has_its_own_color() -> None:
    detail = np.ones((96, 192, 3), np.float32)
    detail[:, ::2] = 0.25
    tint = np.array([1.5, 1.0, 0.5], np.float32)
    tinted = detail.copy()
    _color_dark(tinted, np.broadcast_to(tint - 1, (48, 192, 3)).copy())
    np.testing.assert_array_equal(tinted[48:], detail[48:])
    np.testing.assert_array_equal(tinted[:, 1::2], detail[:, 1::2])
    np.testing.assert_allclose(tinted[:40, ::2] - 0.25 * (1 + 0.75 * (tint - 1)), 0, atol=1e-4)


def test_the_photo_goes_on_as_bright_as_the_library() -> None:
    library = np.ones((48, 96, 3), np.float32) * np.linspace(1.5, 0.5, 96, dtype=np.float32)[:, None]
    factors = _match_continuation(_continuation_cells(LIGHT, np.full((60, 80, 3), 128, np.uint8), None), library)
    grey = 0.2158605 + 0.006  # of 128 in sRGB, and the offset
    shown = np.s_[22:26, 40:56]
    np.testing.assert_allclose(factors[shown] * grey, library[shown], rtol=0.05)


def test_pictures_are_rotated_and_flipped() -> None:
    everything = slice(0, 128)
    plain, turned, flipped = (
        _detail_picture(choice, 64).columns(everything).astype(int)
        for choice in (_DetailChoice(5, False, 0.0), _DetailChoice(5, False, 90.0), _DetailChoice(5, True, 0.0))
    )
    np.testing.assert_array_equal(np.roll(plain, 32, axis=1), turned)
    assert np.abs(plain[:, ::-1] - flipped).mean() < 1.0
    grey = _detail_picture(_DetailChoice(5, False, 0.0), 64, saturation=0.0).columns(everything)
    assert (grey[..., 0] == grey[..., 1]).all()


@pytest.mark.parametrize("height", [96, 600])
def test_columns_of_a_picture_are_those_of_the_whole(height: int) -> None:
    picture = _detail_picture(_DetailChoice(5, False, 100.0), height)
    whole = picture.columns(slice(0, 2 * height))
    assert whole.shape == (height, 2 * height, 3)
    for columns in (slice(0, 64), slice(64, 128), slice(128, 2 * height)):
        np.testing.assert_array_equal(picture.columns(columns), whole[:, columns])


@pytest.mark.parametrize(
    ("detail", "name", "pixels"),
    [(True, "_BLOCK_PIXELS", HEIGHT * 64), (False, "_BLOCK_PIXELS", HEIGHT * 64), (True, "_SHARED_PIXELS", 0)],
)
def test_a_map_in_blocks_is_that_in_one(monkeypatch: pytest.MonkeyPatch, detail: bool, name: str, pixels: int) -> None:
    context = PhotoContext(photo(), detail=detail)
    whole = render_with_surroundings(LIGHT, context, HEIGHT)
    monkeypatch.setattr(f"lighting.envmap.latlong.{name}", pixels)
    np.testing.assert_allclose(render_with_surroundings(LIGHT, context, HEIGHT), whole, rtol=2e-6)
