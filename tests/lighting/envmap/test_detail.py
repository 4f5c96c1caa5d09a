"""Detail around a map: what it must leave as it is, and what it adds."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lighting.color import luminance
from lighting.envmap.appearance import PLACE_KINDS
from lighting.envmap.detail import MIN_ROWS, _color_dark, _own_tint
from lighting.envmap.detail_library import (
    FEATURE_CLASSES,
    FEATURE_ROWS,
    FEATURES,
    DetailChoice,
    PhotoFeatures,
    _feature_weights,
    cell_features,
    choose_detail,
    describe_photo,
    load_detail_library,
)
from lighting.envmap.latlong import blur_cells, envmap_irradiance, irradiance_from_rows, row_irradiance, shrink_envmap
from lighting.envmap.library_picture import detail_picture
from lighting.envmap.projection import project_photo
from lighting.envmap.relighting import edit_lighting
from lighting.envmap.surroundings import PhotoContext, render_with_surroundings
from lighting.geometry import angle_between, latlong_angles, latlong_directions
from lighting.map_options import BACKDROPS
from lighting.prediction import SurfaceClass
from lighting.records import Lighting
from tests.helpers.predictions import stated_light

HEIGHT = 128
LIGHT = replace(stated_light(40.0, camera_elevation=0.0), vertical_fov=50.0)


def photo(width: int = 160, height: int = 120) -> np.ndarray:
    """Blue sky over a brown wall with windows, and gray ground."""
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
    assert np.mean(np.abs(detailed / plain - 1)) < 0.025  # 0.032 if it did not


def test_what_is_coarse_stays() -> None:
    plain, detailed = (blur_cells(shrink_envmap(image, 24), 20.0) for image in maps())
    ratio = luminance(detailed) / luminance(plain)
    assert np.abs(np.log(ratio)).max() < 0.35
    assert np.abs(np.log(ratio)).mean() < 0.1


def test_the_photo_stays_where_it_lies() -> None:
    plain, detailed = maps()
    shown = project_photo(LIGHT, photo(), HEIGHT)
    inside = shown.whole.weight[..., 0] > 0.999
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


def test_nothing_at_the_photos_edge_is_seen_twice() -> None:
    pixels = photo()
    pixels[70:100, -12:] = (250, 0, 0)
    _, detailed = maps(pixels, height=256)
    red = (detailed[..., 0] > 0.5) & (detailed[..., 1] < 0.1)
    columns = np.flatnonzero(red.any(axis=0))
    azimuth, _ = latlong_angles(256)
    assert columns.size
    assert azimuth[columns].max() < 32  # of the photo's edge


@pytest.mark.parametrize("shade", [50, 110])
def test_the_map_takes_the_photos_light_beside_its_edges(shade: int) -> None:
    """Ground of one shade goes on beyond the edge, and so does the sky; without it there was a frame."""
    pixels = photo()
    pixels[70:] = shade
    _, detailed = maps(pixels, replace(LIGHT, camera_elevation=-5.0), height=256)
    azimuth, elevation = latlong_angles(256)
    ground = luminance(detailed[(elevation < -12) & (elevation > -20)]).mean(axis=0)
    inside = ground[np.abs(azimuth) < 20].mean()
    beside = ground[(np.abs(azimuth) > 35) & (np.abs(azimuth) < 42)].mean()
    assert abs(np.log2(beside / inside)) < 0.6


def test_a_bank_of_clouds_goes_on_at_its_height() -> None:
    azimuth, elevation = latlong_angles(256)
    bank, below = ((elevation > low) & (elevation < low + 5) for low in (8, 1))
    beside = (azimuth > 34) & (azimuth < 44)
    clouds = photo()
    clouds[:60] = (70, 110, 190)
    clear = clouds.copy()
    clouds[28:42] = 235
    cloudy, plain = (luminance(maps(pixels, height=256)[1]) for pixels in (clouds, clear))
    gain = cloudy / plain
    assert gain[bank][:, beside].mean() > 1.7
    assert gain[below][:, beside].mean() < 1.3


def test_things_at_the_photos_edge_leave_the_sky_beside_it_bright() -> None:
    pixels = photo()
    pixels[:60, -25:] = (20, 30, 20)
    segments = np.zeros((12, 16, len(SurfaceClass)), np.float32)
    segments[:6, :, SurfaceClass.SKY] = 1
    segments[6:, :, SurfaceClass.GROUND] = 1
    beside = []
    for known in (None, segments):
        if known is not None:
            known[:6, -3:] = np.eye(len(SurfaceClass))[SurfaceClass.PLANTS]
        context = PhotoContext(pixels, segments=known, detail=True)
        image = render_with_surroundings(LIGHT, context, 256, disc=False)
        azimuth, elevation = latlong_angles(256)
        sky = luminance(image[(elevation > 5) & (elevation < 20)])
        beside.append(float(sky[:, (azimuth > 34) & (azimuth < 42)].mean()))
    assert beside[1] > 1.1 * beside[0]


def test_what_stands_before_a_glow_is_dark() -> None:
    cells = np.full((48, 96, 3), 0.2, np.float32)
    cells[:24, 40:50] = 2.0
    tint = _own_tint(cells, np.ones_like(cells))
    np.testing.assert_allclose(tint[:, 10], 1.0, atol=0.25)
    assert (tint[:, 45] < 0.2).all()


def choose(target: np.ndarray, weight: np.ndarray, **known: Any) -> Any:
    """The panorama that is chosen for features."""
    return choose_detail(PhotoFeatures(target, weight, **{"sun_azimuth": None, "saturation": 1.0} | known))


def test_a_place_of_the_library_is_recognised_by_a_part_of_it() -> None:
    library = load_detail_library()
    azimuth, elevation = latlong_angles(FEATURE_ROWS)
    level = np.cos(np.radians(elevation))[:, None] * np.ones(len(azimuth))
    seen = level * ((np.abs(elevation) < 30)[:, None] & (np.abs(azimuth) < 40))
    weight = _feature_weights(seen, level)
    for name, turn in (("mfecane_1206", 5), ("mfecane_1228", -11), ("sunset_fairway", 0)):
        index = library.names.index(name)
        target = np.roll(library.features[index], turn, axis=-1)
        found = choose(target, weight)
        assert (found.index, found.flipped, found.yaw) == (index, False, turn * 7.5)
        flipped = choose(target[..., ::-1], weight)
        assert (flipped.index, flipped.flipped) == (index, True)


def test_a_sun_is_put_where_it_stands() -> None:
    library = load_detail_library()
    cells = np.zeros((len(library.features[0]), FEATURE_ROWS, 2 * FEATURE_ROWS), np.float32)
    choice = choose(cells, np.zeros_like(cells), sun_azimuth=75.0)
    side = -1 if choice.flipped else 1
    there = (side * library.sun_azimuth[choice.index] + choice.yaw - 75.0 + 180) % 360 - 180
    assert library.sunlit[choice.index]
    assert abs(there) < 4
    assert not library.sunlit[choose(cells, np.zeros_like(cells)).index]


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
    features = library.features[choose(*shown_classes(building, plants)).index]
    around = {name: features[FEATURES.index(name), 9:13].mean() for name in ("building", "plants")}
    assert around["building"] == pytest.approx(building, abs=0.4 if building else 0.15)
    assert around["plants"] == pytest.approx(plants, abs=0.35 if plants else 0.25)


@pytest.mark.parametrize(
    ("likely", "kinds"), [("city", {"city", "waterfront", "parking"}), ("forest", {"forest"}), ("shore", {"shore"})]
)
def test_the_likeliest_kind_of_place_is_chosen_where_little_is_shown(likely: str, kinds: set[str]) -> None:
    cells = np.zeros((len(FEATURES), FEATURE_ROWS, 2 * FEATURE_ROWS), np.float32)
    certain = np.array([float(name == likely) for name in PLACE_KINDS])
    assert load_detail_library().kind[choose(cells, np.zeros_like(cells), kinds=certain).index] in kinds


@pytest.mark.parametrize("snow", [False, True])
def test_snow_is_for_photos_of_snow(snow: bool) -> None:
    library = load_detail_library()
    for plants in (0.0, 0.9):
        chosen = library.kind[choose(*shown_classes(0.0, plants), snow=snow).index]
        assert (chosen == "snow") == snow


@pytest.mark.parametrize(
    ("building", "water", "kinds"),
    [(0.0, 0.4, {"shore"}), (0.6, 0.2, {"waterfront", "city"}), (0.7, 0.0, {"city"}), (0.0, 0.0, {"meadow", "desert"})],
)
def test_towns_and_shores_are_for_photos_of_them(building: float, water: float, kinds: set[str]) -> None:
    target, weight = shown_classes(building, 0.02)
    target[FEATURES.index("water"), 12:] = water
    assert load_detail_library().kind[choose(target, weight).index] in kinds


def test_a_lawn_does_not_go_on_as_paving() -> None:
    library = load_detail_library()
    target, weight = shown_classes(0.0, 0.2)
    for name, value in (("red", -0.5), ("blue", -1.2)):
        target[FEATURES.index(name)] = value
    weight[: -len(FEATURE_CLASSES)] = weight[-1:] * 1e-6
    chosen = library.features[choose(target, weight).index, :, 14:20].mean(axis=(1, 2))
    assert chosen[FEATURES.index("red")] + chosen[FEATURES.index("blue")] < -0.8


def test_a_cell_tells_of_autumn_and_of_how_much_its_tints_vary() -> None:
    orange, green, gray = np.array([[0.5, 0.25, 0.06], [0.1, 0.2, 0.05], [0.3, 0.3, 0.3]], np.float32)
    colors = np.stack([orange, orange, green, green, gray, gray, orange, green])
    shown, count = cell_features(colors, np.repeat(np.arange(4), 2))
    tints, autumn = (shown[FEATURES.index(name), 0, :4] for name in ("tints", "autumn"))
    assert count[0, :5].tolist() == [2, 2, 2, 2, 0]
    assert autumn.tolist() == [1.0, -1.0, 0.0, 0.0]
    red = np.log(np.array([0.506, 0.106])) - np.log(np.array([0.256, 0.206]))
    np.testing.assert_allclose(np.exp(tints), (0.02, 0.02, 0.02, red.std()), rtol=1e-4)


@pytest.mark.parametrize(("autumn", "tints"), [(-0.6, -2.5), (0.5, -1.4)])
def test_autumn_leaves_lie_around_photos_of_them_alone(autumn: float, tints: float) -> None:
    library = load_detail_library()
    target, weight = shown_classes(0.0, 0.9)
    target[FEATURES.index("plants"), 13:] = 0.1
    target[FEATURES.index("autumn")], target[FEATURES.index("tints")] = autumn, tints
    target[FEATURES.index("red")], target[FEATURES.index("blue")] = (0.4 if autumn > 0 else -0.3), -0.6
    seen = weight[FEATURES.index("plants")]
    weight[: FEATURES.index("broad brightness")] = 1e-6 * seen
    weight[FEATURES.index("autumn")] = seen / 3
    forest = np.array([float(name == "forest") for name in PLACE_KINDS])
    chosen = library.features[choose(target, weight, kinds=forest).index, FEATURES.index("autumn"), 13:20].mean()
    assert (chosen > 0.3) == (autumn > 0)


@pytest.mark.parametrize(("width", "kinds"), [(48, {"city", "waterfront"}), (2, {"meadow", "desert"})])
def test_a_low_skyline_makes_a_town_and_a_single_house_none(width: int, kinds: set[str]) -> None:
    target, weight = shown_classes(0.0, 0.02)
    first = FEATURE_ROWS - width // 2
    target[FEATURES.index("building"), 11, first : first + width] = 0.4
    assert load_detail_library().kind[choose(target, weight).index] in kinds


def test_people_and_things_tell_nothing_of_a_place() -> None:
    segments = np.zeros((18, 24, len(SurfaceClass)), np.float32)
    segments[..., SurfaceClass.GROUND] = 1
    segments[:, 12:] = np.eye(len(SurfaceClass))[SurfaceClass.PERSON]
    around = np.full((FEATURE_ROWS, 2 * FEATURE_ROWS, 3), 0.2, np.float32)
    seen = describe_photo(LIGHT, photo(), around, segments).weight[FEATURES.index("contrast")].sum(axis=0)
    assert seen[:FEATURE_ROWS].sum() == pytest.approx(2.0, abs=0.05)
    assert not seen[FEATURE_ROWS + 1 :].any()


def test_every_panorama_has_a_kind() -> None:
    assert set(load_detail_library().kind) == set(BACKDROPS)


def test_what_is_dark_before_the_sky_has_its_own_color() -> None:
    detail = np.ones((96, 192, 3), np.float32)
    detail[:, ::2] = 0.25
    tint = np.array([1.5, 1.0, 0.5], np.float32)
    tinted = detail.copy()
    _color_dark(tinted, np.broadcast_to(tint - 1, (48, 192, 3)).copy())
    np.testing.assert_array_equal(tinted[48:], detail[48:])
    np.testing.assert_array_equal(tinted[:, 1::2], detail[:, 1::2])
    np.testing.assert_allclose(tinted[:40, ::2] - 0.25 * (1 + (1 - 0.25 / 0.7) * (tint - 1)), 0, atol=1e-4)


def test_pictures_are_rotated_and_flipped() -> None:
    everything = slice(0, 128)
    plain, turned, flipped = (
        detail_picture(choice, 64).columns(everything).astype(int)
        for choice in (DetailChoice(5, False, 0.0), DetailChoice(5, False, 90.0), DetailChoice(5, True, 0.0))
    )
    np.testing.assert_array_equal(np.roll(plain, 32, axis=1), turned)
    assert np.abs(plain[:, ::-1] - flipped).mean() < 1.0
    grey = detail_picture(DetailChoice(5, False, 0.0, saturation=0.0), 64).columns(everything)
    assert (grey[..., 0] == grey[..., 1]).all()


@pytest.mark.parametrize("height", [96, 600])
def test_columns_of_a_picture_are_those_of_the_whole(height: int) -> None:
    picture = detail_picture(DetailChoice(5, False, 100.0), height)
    whole = picture.columns(slice(0, 2 * height))
    assert whole.shape == (height, 2 * height, 3)
    for columns in (slice(0, 64), slice(64, 128), slice(128, 2 * height)):
        np.testing.assert_array_equal(picture.columns(columns), whole[:, columns])


@pytest.mark.parametrize("detail", [True, False])
def test_a_map_in_blocks_is_that_in_one(monkeypatch: pytest.MonkeyPatch, detail: bool) -> None:
    context = PhotoContext(photo(), detail=detail)
    whole = render_with_surroundings(LIGHT, context, HEIGHT)
    monkeypatch.setattr("lighting.envmap.latlong._BLOCK_PIXELS", HEIGHT * 64)
    np.testing.assert_allclose(render_with_surroundings(LIGHT, context, HEIGHT), whole, rtol=2e-6)
