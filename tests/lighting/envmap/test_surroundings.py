"""Tests of surroundings."""

import base64
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lighting.photo_estimate as photo_estimate
from lighting.color import srgb_decode
from lighting.envmap.detail_library import load_detail_library
from lighting.envmap.latlong import irradiance_from_rows, row_irradiance
from lighting.envmap.projection import extrapolate_edges
from lighting.envmap.relighting import edit_lighting, rotate_envmap
from lighting.envmap.render import render
from lighting.envmap.surroundings import (
    PhotoContext,
    _move_glow,
    render_strips,
    render_view,
    render_with_surroundings,
    surroundings_gain,
)
from lighting.errors import ParameterError
from lighting.files.exr import read_exr
from lighting.geometry import angle_between, latlong_directions
from lighting.map_options import MapOptions
from lighting.photo.reader import Photo
from lighting.photo_estimate import Estimate
from lighting.prediction import EstimatedLight, SunDistribution, SurfaceClass
from lighting.records import Lighting
from tests.helpers.predictions import SKY_IRRADIANCE, model_light, stated_light

ROWS = 24
AHEAD = slice(22, 26)  # columns that a view of 60° by 45° shows for certain
RED, BLUE = (200, 40, 30), (60, 90, 200)
LIGHT = replace(model_light(), camera_elevation=0.0, camera_roll=0.0, vertical_fov=45.0)


def cells(value: float = 0.2) -> np.ndarray:
    return np.full((ROWS, 2 * ROWS, 3), value, np.float32)


def photo(above: tuple[int, int, int], below: tuple[int, int, int]) -> np.ndarray:
    pixels = np.empty((90, 120, 3), np.uint8)
    pixels[:45], pixels[45:] = above, below
    return pixels


def linear(colour: tuple[int, int, int]) -> np.ndarray:
    return np.asarray(srgb_decode(np.array(colour) / 255.0))


def test_the_cells_that_a_photo_shows_become_its_own() -> None:
    there = extrapolate_edges(cells(), photo(BLUE, RED), LIGHT) * cells()
    np.testing.assert_allclose(there[10:12, AHEAD], np.broadcast_to(linear(BLUE), (2, 4, 3)), rtol=1e-3)
    np.testing.assert_allclose(there[12:14, AHEAD], np.broadcast_to(linear(RED), (2, 4, 3)), rtol=1e-3)


def test_beside_it_they_fade_with_the_distance_on_their_side_of_the_horizon() -> None:
    factors = extrapolate_edges(cells(), photo(BLUE, RED), LIGHT)
    above, below = (np.log(factors[row, :24] / factors[row, :24, 1:2]) for row in (11, 12))
    for line, strongest in ((above, 2), (below, 0)):
        assert (np.diff(line[:, strongest]) >= -1e-6).all()  # from behind, at column 0, to ahead
        assert 0.3 * line[23, strongest] > line[0, strongest] > 0.0
        assert line[18, strongest] > 0.7 * line[23, strongest]
    assert (above[:, 2] > 0).all() and (above[:, 0] < 0).all() and (below[:, 0] > 0).all()  # noqa: PT018


def test_a_tree_at_the_edge_goes_on_at_its_own_height() -> None:
    pixels = photo((128, 128, 128), (128, 128, 128))
    pixels[20:45, 100:] = 10  # at the right, up to 15°
    factors = extrapolate_edges(cells(), pixels, LIGHT)[..., 1]
    assert factors[11, 30] < 0.3 * factors[11, 17]
    assert factors[4, 30] > 0.8 * factors[4, 17]


@pytest.mark.parametrize("passing", [SurfaceClass.PERSON, SurfaceClass.VEHICLE, SurfaceClass.OBJECT])
def test_people_and_things_do_not_go_on(passing: SurfaceClass) -> None:
    pixels = photo(BLUE, BLUE)
    pixels[:, 60:] = RED
    segments = np.zeros((18, 24, len(SurfaceClass)), np.float32)
    segments[:, :12, SurfaceClass.GROUND] = segments[:, 12:, passing] = 1
    alone, with_thing = (
        extrapolate_edges(cells(), p, LIGHT, segments=s) for p, s in ((pixels, None), (pixels, segments))
    )
    ratio = with_thing[..., 0] / with_thing[..., 2]
    assert (alone[12, 26:30, 0] > alone[12, 26:30, 2]).all()
    assert (ratio[11:13] < 1).all()


def test_white_pixels_darken_nothing() -> None:
    factors = extrapolate_edges(cells(3.0), photo((255, 255, 255), (255, 255, 255)), LIGHT)
    np.testing.assert_allclose(factors, 1.0, rtol=1e-5)


def test_no_factor_leaves_its_range() -> None:
    dark, light = (
        extrapolate_edges(cells(50.0), photo(RED, RED), LIGHT),
        extrapolate_edges(cells(1e-6), photo(RED, RED), LIGHT),
    )
    assert dark.min() == pytest.approx(0.05)
    assert light.max() == pytest.approx(4.0)


@pytest.mark.parametrize(("change", "same"), [({"vertical_fov": 1.0}, False), ({"camera_elevation": 80.0}, True)])
def test_the_half_that_a_photo_does_not_show_stays(change: dict[str, Any], same: bool) -> None:
    factors = extrapolate_edges(cells(), photo(RED, RED), replace(LIGHT, **change))
    assert np.isfinite(factors).all()
    assert bool((factors[12:] == 1).all()) == same


HEIGHT = 96
CASE = Path(__file__).with_name("surroundings.json")  # what the page follows
PHOTO = np.random.default_rng(3).integers(0, 256, (60, 80, 3)).astype(np.uint8)


def coarse_panorama(light: Lighting) -> np.ndarray:
    """The bare map at 12 x 24 cells."""
    return np.asarray(render(light, 48, sun=False).reshape(12, 4, 24, 4, 3).mean(axis=(1, 3)), dtype=np.float32)


def level(image: np.ndarray, below: bool = False) -> np.ndarray:
    half = slice(HEIGHT // 2, None) if below else slice(0, HEIGHT // 2)
    return irradiance_from_rows(row_irradiance(HEIGHT)[half], image[half])


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("pitch", [0.0, 40.0, -60.0])
def test_the_irradiances_stay(known: bool, pitch: float) -> None:
    light = replace(stated_light(sky_cover=0.2), camera_elevation=pitch)
    wild = np.random.default_rng(1).uniform(0.01, 3, (12, 24, 3)).astype(np.float32)
    image = render_with_surroundings(light, PhotoContext(PHOTO, wild if known else None), HEIGHT, disc=False)
    assert level(image) == pytest.approx(SKY_IRRADIANCE, rel=1e-4)
    assert level(image, below=True) == pytest.approx(level(render(light, HEIGHT), below=True), rel=1e-4)


def test_the_sun_is_painted_once_and_last() -> None:
    light = stated_light()
    context = PhotoContext(PHOTO, coarse_panorama(light))
    with_disc, without = (
        render_with_surroundings(light, context, HEIGHT),
        render_with_surroundings(light, context, HEIGHT, disc=False),
    )
    disc = with_disc - without
    np.testing.assert_allclose(disc.max(), (render(light, HEIGHT) - render(light, HEIGHT, disc=False)).max(), rtol=1e-3)
    assert without.max() < 0.05 * with_disc.max()
    assert (render_with_surroundings(light, context, HEIGHT, sun=False) <= without + 1).all()


@pytest.mark.parametrize("factor", [0.1, 8.0])
def test_a_light_that_is_exposed_otherwise_brightens_its_place_with_it(factor: float) -> None:
    light = stated_light(sky_cover=0.2)
    brighter = edit_lighting(light, {"exposure": factor * light.exposure})
    context = PhotoContext(
        PHOTO, coarse_panorama(light) * np.linspace(0.3, 1.5, 24, dtype=np.float32)[:, None], light.exposure
    )
    expected = factor * render_with_surroundings(light, context, HEIGHT, disc=False)
    np.testing.assert_allclose(render_with_surroundings(brighter, context, HEIGHT, disc=False), expected, rtol=2e-3)


@pytest.mark.parametrize("moved", [180.0, -90.0])
def test_the_skys_bright_side_follows_a_sun_that_is_moved(moved: float) -> None:
    light = replace(stated_light(sky_cover=0.1), vertical_fov=20.0, camera_elevation=-40.0)  # the photo shows ground
    context = PhotoContext(PHOTO, coarse_panorama(light), light.exposure, light, detail=True)
    there = (light.sun_azimuth + moved + 180.0) % 360.0 - 180.0
    sky = render_with_surroundings(edit_lighting(light, {"sun_azimuth": there}), context, HEIGHT, disc=False)[
        : HEIGHT // 2, :, 1
    ]
    brightest = (sky.sum(axis=0).argmax() + 0.5) / (2 * HEIGHT) * 360.0 - 180.0
    assert abs((brightest - there + 180.0) % 360.0 - 180.0) < 20.0


def test_dark_cells_are_dark_and_the_rest_pays_for_them() -> None:
    light = stated_light()
    cells = coarse_panorama(light)
    cells[4:6, :6] *= 0.2  # trees to the left
    image = render_with_surroundings(light, PhotoContext(np.zeros((32, 32, 3), np.uint8), cells), HEIGHT, disc=False)
    bare = render(light, HEIGHT, disc=False)
    row = HEIGHT // 2 - HEIGHT // 12
    assert image[row, 20, 1] < 0.65 * bare[row, 20, 1]
    assert image[row, 150, 1] > bare[row, 150, 1]


@pytest.mark.parametrize("half", [slice(0, 6), slice(6, 12)])
def test_the_place_differs_less_from_the_bare_map_than_the_network_says(half: slice) -> None:
    light = replace(stated_light(), camera_elevation=-80.0, vertical_fov=10.0)  # the photo hides little
    cells, nothing = coarse_panorama(light), np.zeros((32, 32, 3), np.uint8)
    plain = surroundings_gain(light, PhotoContext(nothing, cells))
    cells[half, :12] *= np.float32(4.0)
    there = (surroundings_gain(light, PhotoContext(nothing, cells)) / plain)[2 * half.start + 1]
    assert there[4] / there[40] == pytest.approx([4.0**0.7] * 3, rel=1e-3)


@pytest.mark.parametrize(("half", "kept"), [(slice(0, 6), 1.0), (slice(6, 12), 0.7)])
def test_colours_of_the_place_are_weaker_below_the_horizon(half: slice, kept: float) -> None:
    light = replace(stated_light(), camera_elevation=-80.0, vertical_fov=10.0)
    cells, nothing = coarse_panorama(light), np.zeros((32, 32, 3), np.uint8)
    plain = surroundings_gain(light, PhotoContext(nothing, cells))
    cells[half, :12] *= np.array([1.5, 1.0, 0.75], np.float32)
    there = (surroundings_gain(light, PhotoContext(nothing, cells)) / plain)[2 * half.start + 1]
    assert there[4, 0] / there[4, 2] / (there[40, 0] / there[40, 2]) == pytest.approx(2.0**kept, rel=1e-3)


def test_the_photo_lies_ahead_in_its_own_values() -> None:
    light = stated_light()
    grey = np.full((60, 80, 3), 100, np.uint8)
    image = render_with_surroundings(light, PhotoContext(grey, coarse_panorama(light)), HEIGHT)
    assert image[HEIGHT // 2 - 3, HEIGHT] == pytest.approx([0.127] * 3, rel=0.02)
    assert image[HEIGHT // 2 + 3, HEIGHT] == pytest.approx([0.127] * 3, rel=0.02)


def test_a_light_without_irradiances_keeps_those_of_its_map() -> None:
    light = model_light()
    image = render_with_surroundings(light, PhotoContext(PHOTO), HEIGHT, disc=False)
    assert level(image) == pytest.approx(level(render(light, HEIGHT, disc=False)), rel=1e-4)
    assert image[:, HEIGHT // 8] == pytest.approx(image[:, HEIGHT // 8])


def test_the_same_cells_as_the_bare_map_change_little_beside_the_photo() -> None:
    light = replace(stated_light(), camera_elevation=-80.0, vertical_fov=10.0)
    bare = render(light, HEIGHT, disc=False)
    image = render_with_surroundings(light, PhotoContext(PHOTO, coarse_panorama(light)), HEIGHT, disc=False)
    upper = slice(0, HEIGHT // 2)
    assert np.median(np.abs(image[upper] / bare[upper] - 1)) < 0.05


def estimate(cells: np.ndarray | None) -> Estimate:
    light = EstimatedLight(stated_light(), SunDistribution("rings:1x1", np.ones(1, np.float32)), cells)
    return Estimate.of_photo(Photo(PHOTO, PHOTO.shape[1], PHOTO.shape[0], "PIXELS"), light)


@pytest.mark.parametrize(("height", "asked"), [(96, []), (512, [1000]), (4096, [1000])])
def test_a_photo_is_read_again_only_where_the_map_shows_more_of_it(
    height: int, asked: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    sides: list[int] = []
    shown: list[PhotoContext | None] = []

    def reread(photo: Photo, side: int) -> Photo:
        sides.append(side)
        return replace(photo, pixels=PHOTO.repeat(2, axis=0).repeat(2, axis=1))

    monkeypatch.setattr(Photo, "reread", reread)
    monkeypatch.setattr(photo_estimate, "render_map", lambda _light, _options, context: shown.append(context))
    estimate(coarse_panorama(stated_light())).render(MapOptions(height))
    (context,) = shown
    assert context is not None
    assert sides == asked
    assert (context.photo is PHOTO) == (not asked)


@pytest.mark.parametrize(
    ("known", "around", "shows"),
    [(True, None, True), (False, None, False), (False, "place", True), (True, "plain", False)],
)
def test_the_place_is_shown_where_it_is_known_or_wanted(known: bool, around: str | None, shows: bool) -> None:
    answer = estimate(coarse_panorama(stated_light()) if known else None)
    assert (answer.context(MapOptions(around=around)) is not None) == shows
    assert answer.context(MapOptions(around="photo")) is not None


def test_the_detail_is_chosen_once_for_all_resolutions() -> None:
    answer = estimate(coarse_panorama(stated_light()))
    place, finer = answer.context(), answer.context(pixels=np.full((600, 800, 3), 60, np.uint8))
    assert place is not None
    assert finer is not None
    assert place is answer.context()
    assert finer.own_choice != place.own_choice  # by its own pixels it would be another
    assert finer.first is place
    image = render_with_surroundings(stated_light(), finer, 64)
    assert not np.array_equal(image, render_with_surroundings(stated_light(), replace(finer, first=None), 64))


def test_a_stated_backdrop_is_the_place_around_the_photo() -> None:
    answer = estimate(coarse_panorama(stated_light()))
    library = load_detail_library()
    for kind in ("forest", "snow", "city"):
        context = answer.context(MapOptions(backdrop=kind), np.full((60, 80, 3), 90, np.uint8))
        assert context is not None
        assert context.first is not None
        assert library.kind[context.first.own_choice.index] == kind
    with pytest.raises(ParameterError, match='backdrop is for around "place"'):
        MapOptions(around="plain", backdrop="city")
    with pytest.raises(ParameterError, match="moon"):
        MapOptions(backdrop="moon")


def test_what_the_photo_shows_at_its_edge_goes_on_beside_it() -> None:
    light = replace(stated_light(), camera_elevation=0.0)
    dark, red = np.full((60, 80, 3), 40, np.uint8), np.full((60, 80, 3), (160, 40, 40), np.uint8)
    maps = [
        render_with_surroundings(light, PhotoContext(photo, coarse_panorama(light)), HEIGHT, disc=False)
        for photo in (dark, red)
    ]
    beside, behind = (slice(40, 46), slice(HEIGHT + 26, HEIGHT + 30)), (slice(40, 46), slice(0, 4))
    tints = [[float((m[at][..., 0] / m[at][..., 1]).mean()) for at in (beside, behind)] for m in maps]
    assert tints[1][0] > 2 * tints[0][0]
    assert tints[1][1] < 1.5 * tints[0][1]


def case() -> dict[str, Any]:
    """A photo in its surroundings, for those who lay it around the camera in another language."""
    light = replace(stated_light(sky_cover=0.3), camera_elevation=8.0, camera_roll=-3.0, vertical_fov=50.0)
    y, x = np.mgrid[:48, :64]
    photo = np.stack([120 + x, 200 - 2 * y, np.where(y < 20, 250, 60)], axis=-1).astype(np.uint8)
    cells = coarse_panorama(light) * (1 + 0.6 * np.sin(np.arange(24) / 3)[:, None]).astype(np.float32)
    context = PhotoContext(photo, cells, light.exposure, light)
    moved = edit_lighting(light, {"sun_azimuth": 150.0, "sun_elevation": 20.0})
    return {
        "camera": {"elevation": 8.0, "roll": -3.0, "vertical_fov": 50.0},
        "photo": base64.b64encode(photo.tobytes()).decode(),
        "factors": base64.b64encode(surroundings_gain(light, context).tobytes()).decode(),
        "maps": [
            {
                "sun": [one.sun_azimuth, one.sun_elevation],
                "bare": base64.b64encode(render(one, 32, disc=False).tobytes()).decode(),
                "map": base64.b64encode(render_with_surroundings(one, context, 32, disc=False).tobytes()).decode(),
            }
            for one in (light, moved)
        ],
    }


def test_the_case_that_others_follow_is_up_to_date() -> None:
    """`python -m tests.lighting.envmap.test_surroundings` writes it anew."""
    stored, now = json.loads(CASE.read_text()), case()
    assert stored["camera"] == now["camera"]
    assert stored["photo"] == now["photo"]
    assert [one["sun"] for one in stored["maps"]] == [one["sun"] for one in now["maps"]]
    for then, today in zip(floats(stored), floats(now), strict=True):
        np.testing.assert_allclose(then, today, rtol=1e-3, atol=1e-4)


def floats(found: dict[str, Any]) -> list[np.ndarray]:
    texts = [found["factors"], *(one[name] for one in found["maps"] for name in ("bare", "map"))]
    return [np.frombuffer(base64.b64decode(text), np.float32) for text in texts]


def test_where_a_sun_was_nothing_is_left_of_its_glow_and_far_off_the_place_stays() -> None:
    light = stated_light()
    factors = np.full((24, 48, 3), 0.8, np.float32)
    angle = angle_between(latlong_directions(24), light.sun_direction)
    factors[angle < 15] = 0.1
    factors[8:12, :6] = 0.3  # a wall elsewhere
    assert _move_glow(factors, light, light) == pytest.approx(factors)
    gone = _move_glow(factors, light, edit_lighting(light, {"sun_azimuth": light.sun_azimuth + 120.0}))
    assert gone[angle < 8].min() > 0.5
    far = angle > 100
    assert gone[far] == pytest.approx(factors[far], rel=1e-2)
    assert gone[12:] == pytest.approx(factors[12:])


if __name__ == "__main__":
    CASE.write_text(json.dumps(case()))

CLOUDY_LIGHT = stated_light(sky_cover=0.2)
CONTEXT = PhotoContext(np.full((40, 60, 3), 90, np.uint8))


@pytest.mark.parametrize("context", [None, CONTEXT, PhotoContext(PHOTO, detail=True)])
@pytest.mark.parametrize(("sky", "yaw"), [("prague", 0.0), ("hosek-wilkie", 33.3), ("lalonde-matthews", 0.0)])
def test_strips_are_the_rows_of_the_whole_map(context: PhotoContext | None, sky: str, yaw: float) -> None:
    light = replace(CLOUDY_LIGHT, sky_painted=sky)
    options: dict[str, Any] = {"sun": True, "yaw": yaw, "context": context}
    whole, _ = render_view(light, 128, **options)
    strips = list(render_strips(light, 128, plan_height=128, strip=32, **options))
    assert [strip.shape for strip in strips] == 4 * [(32, 256, 3)]
    np.testing.assert_array_equal(np.concatenate(strips), whole)


def test_strips_planned_by_fewer_rows_keep_the_light() -> None:
    context = PhotoContext(photo(BLUE, RED), detail=True)
    image = np.concatenate(list(render_strips(CLOUDY_LIGHT, 500, plan_height=256, strip=64, context=context)))
    bare, levels = render(CLOUDY_LIGHT, 500), row_irradiance(500)
    assert image.shape == bare.shape
    for half in (slice(0, 250), slice(250, 500)):
        light, expected = (irradiance_from_rows(levels[half], rows[half]) for rows in (image, bare))
        np.testing.assert_allclose(light, expected, rtol=0.01)


def test_so_much_light_that_a_map_is_capped_makes_no_strips() -> None:
    light = edit_lighting(CLOUDY_LIGHT, {"sky_irradiance": (900.0, 900.0, 900.0)})
    with pytest.raises(ParameterError, match="too bright for a map of over 4096 rows"):
        next(render_strips(light, 128, plan_height=128, strip=32))


def test_a_tall_map_is_written_by_its_strips(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photo_estimate, "MAX_WHOLE_HEIGHT", 64)
    answer = estimate(None)
    rendered = answer.render(MapOptions(512, yaw=90.0))
    shapes = {rows.shape for rows in rendered.strips()}
    assert shapes == {(256, 1024, 3)}
    answer.save(tmp_path / "map.exr", 512, yaw=90.0)
    image, light = read_exr(tmp_path / "map.exr")
    np.testing.assert_allclose(image, rendered.image, rtol=5e-4)
    assert light == rendered.lighting
    assert light is not None
    assert light.sun_azimuth == pytest.approx(answer.lighting.sun_azimuth + 90.0)


def test_a_view_is_the_map_of_its_record() -> None:
    image, light = render_view(CLOUDY_LIGHT, 32)
    assert light is CLOUDY_LIGHT
    np.testing.assert_array_equal(image, render(CLOUDY_LIGHT, 32))


def painted(light: Lighting, sky: str) -> tuple[np.ndarray, Lighting]:
    rendered = photo_estimate.render_map(light, MapOptions(32, sky=sky))
    return rendered.image, rendered.lighting


def test_another_sky_is_in_the_record() -> None:
    image, light = painted(CLOUDY_LIGHT, "preetham")
    assert light == replace(CLOUDY_LIGHT, sky_painted="preetham")
    np.testing.assert_array_equal(image, render(light, 32))
    np.testing.assert_array_equal(image, render(replace(CLOUDY_LIGHT, sky_model="preetham"), 32))
    again, light = painted(replace(CLOUDY_LIGHT, sky_model="perez"), "preetham")
    np.testing.assert_array_equal(again, image)
    assert light.map_sky == "preetham"


def test_the_place_turns_with_the_map() -> None:
    image, light = render_view(CLOUDY_LIGHT, 32, yaw=90.0, context=CONTEXT)
    np.testing.assert_array_equal(image, rotate_envmap(render_with_surroundings(CLOUDY_LIGHT, CONTEXT, 32), 90.0))
    assert light.sun_azimuth == pytest.approx(CLOUDY_LIGHT.sun_azimuth + 90.0)
