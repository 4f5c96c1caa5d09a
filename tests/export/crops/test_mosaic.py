"""Two places in one picture: which may share it, whether their suns coincide, what the picture's targets are."""

from dataclasses import replace

import numpy as np
import pytest

from export.crops.cameras import Camera
from export.crops.crops import take
from export.crops.mosaic import companions, joined, same_view
from export.crops.seeds import generator
from export.crops.sources import Source
from tests.export.crops.examples import SPEC, brightest, label, source


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
    found = companions(sources, np.arange(1.0, 9.0))
    assert [list(numbers) for numbers, _ in found] == [[2, 7], [2], [0, 1], [3], [4], [6], [5], [0]]
    np.testing.assert_allclose(found[0][1], [3 / 11, 1.0])
    assert all(chances[-1] == pytest.approx(1.0) for _, chances in found)


def test_panoramas_that_are_never_drawn_are_nobodys_companion() -> None:
    found = companions([at("a", 20.0), at("b", 21.0), at("c", 60.0)], np.array([1.0, 0.0, 0.0]))
    assert [list(numbers) for numbers, _ in found] == [[0], [0], [2]]
    assert all(chances[-1] == 1.0 for _, chances in found)


@pytest.mark.parametrize("mirrored", [False, True])
def test_both_cameras_see_their_sun_in_the_same_place(mirrored: bool) -> None:
    one, other = source(), source("ldr", sun=label())
    turned = replace(other, levels=(np.roll(other.levels[0], 100, axis=1),), label=label(40.0 + 100 / 512 * 360))
    camera = Camera(30.0, 15.0, 6.0, 60.0, 4 / 3, mirrored)
    first = take(one, camera, SPEC)
    seen = set()
    for index in range(12):
        second_camera = same_view(camera, one, turned, generator("same view", index, "test"))
        second = take(turned, second_camera, SPEC)
        seen.add(second_camera.mirrored)
        assert second.sun_azimuth == pytest.approx(first.sun_azimuth)
        assert second.camera.roll == pytest.approx(first.camera.roll)
        np.testing.assert_allclose(brightest(second), brightest(first), atol=2.0)
    assert seen == {False, True}


def test_without_a_sun_the_second_camera_looks_anywhere() -> None:
    one, other = at("a", float("nan"), "no"), at("b", float("nan"), "no")
    one = replace(one, label=replace(one.label, sun_azimuth=float("nan")))
    camera = Camera(30.0, 15.0, 6.0, 60.0, 4 / 3)
    seen = [same_view(camera, one, other, generator("no sun", i, "test")) for i in range(20)]
    assert np.ptp([c.azimuth for c in seen]) > 180
    assert {(c.elevation, c.roll, c.vertical_fov) for c in seen} == {(15.0, 6.0, 60.0)}


def test_a_joined_crop_shows_both_places_and_the_first_ones_sun() -> None:
    camera = Camera(30.0, 15.0, 0.0, 60.0, 4 / 3)
    one = take(source(), camera, SPEC)
    other = replace(one, linear=np.full_like(one.linear, 7.0), sun_elevation=28.0, sun_uncertainty=6.0)
    shares = []
    for index in range(60):
        crop = joined(one, other, generator("joined", index, "test"))
        second = (crop.linear == 7.0).all(axis=-1)
        np.testing.assert_array_equal(crop.linear[~second], one.linear[~second])
        x, y = brightest(one)
        assert not second[int(y), int(x)]
        assert (crop.sun_azimuth, crop.sun_elevation) == (one.sun_azimuth, one.sun_elevation)
        assert np.isnan([crop.turbidity, crop.exposure]).all()
        assert crop.sun_uncertainty == pytest.approx(np.sqrt((2.0**2 + 6.0**2 + 3.0**2) / 2))
        shares.append(second.mean())
    assert 0.2 < np.mean(shares) < 0.5
    assert min(shares) > 0
    assert max(shares) < 0.9


def test_a_sun_that_only_the_second_place_has_in_the_frame_is_not_shown() -> None:
    """The target is the first crop's, which says that no sun is seen."""
    other = take(source(), Camera(30.0, 15.0, 0.0, 60.0, 4 / 3), SPEC)
    x, y = brightest(other)
    one = replace(other, linear=np.full_like(other.linear, 7.0), sun_azimuth=150.0)
    assert one.sun_pixel is None
    for index in range(20):
        crop = joined(one, other, generator("away", index, "test"))
        assert (crop.linear[int(y), int(x)] == 7.0).all()
