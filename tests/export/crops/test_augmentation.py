"""Tests of augmentation."""

import zlib
from dataclasses import replace

import numpy as np
import pytest

from export.crops.augmentation import (
    CAMERA_EFFECTS,
    PICTURE_EFFECTS,
    SCENE_EFFECTS,
    Effect,
    Linear,
    Picture,
    augment,
    cutmix,
    cutmix_partners,
    matching_camera,
)
from export.crops.crops import Camera, Crop, Source, crop_panorama, crop_rng
from tests.helpers.panoramas import EXAMPLES_SPEC, VIEWS, brightest, crop, label, source


def test_augmentation_keeps_the_size_and_tells_its_gain() -> None:
    flat = Crop(np.full((120, 160, 3), 0.2, np.float32), Camera(0, 0, 0, 50.0, 4 / 3), 0.0, 20.0, 2.0, 1.0, 3.0, 0.5)
    rng = np.random.default_rng(3)
    drawn = [augment(flat, rng) for _ in range(60)]
    assert {picture.shape for picture, _, _ in drawn} == {(120, 160, 3)}
    brightness = [float(np.median(picture)) for picture, _, _ in drawn]
    assert np.corrcoef(brightness, [np.log(gains.mean()) for _, gains, _ in drawn])[0, 1] > 0.8


def test_an_underexposed_sun_stays_white() -> None:
    white = Crop(np.ones((64, 64, 3), np.float32), Camera(0, 0, 0, 50.0, 1.0), 90.0, 20.0, 2.0, 1.0, 3.0, 0.5)
    rng = np.random.default_rng(0)
    dim = [picture for picture, gains, _ in (augment(white, rng) for _ in range(40)) if gains.mean() < 0.8]
    assert np.median([np.median(picture) for picture in dim]) > 235


def test_augmentation_tells_when_it_hides_the_sun() -> None:
    """A white spot stands where the sun is; it is gone from the picture exactly when it is said to be."""
    one = crop(replace(VIEWS[2], roll=0.0), 0.0, 20.0)
    x, y = map(int, one.sun_pixel or (0, 0))
    one.linear[y - 6 : y + 7, x - 6 : x + 7] = 1.0
    rng = np.random.default_rng(5)
    drawn = [augment(one, rng) for _ in range(80)]
    assert 4 < sum(hidden for *_, hidden in drawn) < 40
    for picture, _, hidden in drawn:
        spot, beside = (float(picture[y - 3 : y + 4, at - 3 : at + 4].mean()) for at in (x, x + 30))
        assert hidden or spot > beside + 20
    away = replace(one, sun_azimuth=170.0)
    assert not any(augment(away, rng)[2] for _ in range(40))


def test_a_new_effect_changes_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two toy effects draw and do nothing, a third blackens half of the crops: the rest stays bit for bit."""
    views = [crop(camera, 0.0, 20.0) for camera in VIEWS]

    def drawn() -> list[tuple[Picture, list[float], bool]]:
        rng = np.random.default_rng(11)
        return [(p, gains.tolist(), hidden) for p, gains, hidden in (augment(v, rng) for v in views for _ in range(8))]

    def draws_only(pixels: Linear, _: Crop, rng: np.random.Generator) -> Linear:
        rng.random(1000)
        return pixels

    def blacken(picture: Picture, _: Crop, rng: np.random.Generator) -> Picture:
        assert 0.0 <= rng.random() < 1.0
        return np.zeros_like(picture)

    before = drawn()
    monkeypatch.setitem(augment.__globals__, "SCENE_EFFECTS", (Effect("toy scene", 1.0, draws_only), *SCENE_EFFECTS))
    more = (Effect("toy", 1.0, draws_only), *CAMERA_EFFECTS)
    monkeypatch.setitem(augment.__globals__, "CAMERA_EFFECTS", more)
    for (one, *rest), (other, *others) in zip(before, drawn(), strict=True):
        assert np.array_equal(one, other)
        assert rest == others
    monkeypatch.setitem(augment.__globals__, "PICTURE_EFFECTS", (*PICTURE_EFFECTS, Effect("toy night", 0.5, blacken)))
    after = drawn()
    black = [not picture.any() for picture, *_ in after]
    assert 0 < sum(black) < len(after)
    for (one, *rest), (other, *others), dark in zip(before, after, black, strict=True):
        assert dark or np.array_equal(one, other)
        assert rest == others


def test_no_two_effects_share_a_stream() -> None:
    names = ["exposure", "white balance", *(effect.name for effect in (*SCENE_EFFECTS, *CAMERA_EFFECTS))]
    names += [effect.name for effect in PICTURE_EFFECTS]
    assert len({zlib.crc32(name.encode()) for name in names}) == len(names)


def at(place: str, elevation: float, direct: str = "yes") -> Source:
    return source(place=place, sun=replace(label(elevation=elevation), direct=direct))


def test_companions_are_other_places_under_the_same_light() -> None:
    nan = float("nan")
    sources = [
        at("a", 20.0),
        at("a", 21.0),
        at("b", 23.0),
        at("c", 30.0),
        at("d", 22.0, "no"),
        at("e", nan, "no"),
        at("f", nan, "no"),
        at("g", 16.0),
    ]
    partners = cutmix_partners(sources, np.arange(1.0, 9.0))
    assert [list(numbers) for numbers, _ in partners] == [[2, 7], [2], [0, 1], [3], [4], [6], [5], [0]]
    np.testing.assert_allclose(partners[0][1], [3 / 11, 1.0])
    assert all(chances[-1] == pytest.approx(1.0) for _, chances in partners)


def test_panoramas_that_are_never_drawn_are_nobodys_companion() -> None:
    partners = cutmix_partners([at("a", 20.0), at("b", 21.0), at("c", 60.0)], np.array([1.0, 0.0, 0.0]))
    assert [list(numbers) for numbers, _ in partners] == [[0], [0], [2]]
    assert all(chances[-1] == 1.0 for _, chances in partners)


@pytest.mark.parametrize("mirrored", [False, True])
def test_both_cameras_see_their_sun_in_the_same_place(mirrored: bool) -> None:
    one, other = source(), source("ldr", sun=label())
    rotated = replace(other, levels=(np.roll(other.levels[0], 100, axis=1),), label=label(40.0 + 100 / 512 * 360))
    camera = Camera(30.0, 15.0, 6.0, 60.0, 4 / 3, mirrored)
    first = crop_panorama(one, camera, EXAMPLES_SPEC)
    mirrored_views = set()
    for index in range(12):
        second_camera = matching_camera(camera, one, rotated, crop_rng("same view", index, "test"))
        second = crop_panorama(rotated, second_camera, EXAMPLES_SPEC)
        mirrored_views.add(second_camera.mirrored)
        assert second.sun_azimuth == pytest.approx(first.sun_azimuth)
        assert second.camera.roll == pytest.approx(first.camera.roll)
        np.testing.assert_allclose(brightest(second), brightest(first), atol=2.0)
    assert mirrored_views == {False, True}


def test_without_a_sun_the_second_camera_looks_anywhere() -> None:
    one, other = at("a", float("nan"), "no"), at("b", float("nan"), "no")
    one = replace(one, label=replace(one.label, sun_azimuth=float("nan")))
    camera = Camera(30.0, 15.0, 6.0, 60.0, 4 / 3)
    mirrored_views = [matching_camera(camera, one, other, crop_rng("no sun", i, "test")) for i in range(20)]
    assert np.ptp([c.azimuth for c in mirrored_views]) > 180
    assert {(c.elevation, c.roll, c.vertical_fov) for c in mirrored_views} == {(15.0, 6.0, 60.0)}


def test_a_joined_crop_shows_both_places_and_the_first_ones_sun() -> None:
    camera = Camera(30.0, 15.0, 0.0, 60.0, 4 / 3)
    one = crop_panorama(source(), camera, EXAMPLES_SPEC)
    other = replace(one, linear=np.full_like(one.linear, 7.0), sun_elevation=28.0, sun_std=6.0)
    shares = []
    for index in range(60):
        crop = cutmix(one, other, crop_rng("joined", index, "test"))
        second = (crop.linear == 7.0).all(axis=-1)
        np.testing.assert_array_equal(crop.linear[~second], one.linear[~second])
        x, y = brightest(one)
        assert not second[int(y), int(x)]
        assert (crop.sun_azimuth, crop.sun_elevation) == (one.sun_azimuth, one.sun_elevation)
        assert np.isnan([crop.turbidity, crop.exposure]).all()
        assert crop.sun_std == pytest.approx(np.sqrt((2.0**2 + 6.0**2 + 3.0**2) / 2))
        shares.append(second.mean())
    assert 0.2 < np.mean(shares) < 0.5
    assert min(shares) > 0
    assert max(shares) < 0.9


def test_a_sun_that_only_the_second_place_has_in_the_frame_is_not_shown() -> None:
    """The target is the first crop's, which says that no sun is seen."""
    other = crop_panorama(source(), Camera(30.0, 15.0, 0.0, 60.0, 4 / 3), EXAMPLES_SPEC)
    x, y = brightest(other)
    one = replace(other, linear=np.full_like(other.linear, 7.0), sun_azimuth=150.0)
    assert one.sun_pixel is None
    for index in range(20):
        crop = cutmix(one, other, crop_rng("away", index, "test"))
        assert (crop.linear[int(y), int(x)] == 7.0).all()
