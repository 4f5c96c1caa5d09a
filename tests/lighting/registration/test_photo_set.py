"""Sets of photos: where each looks, found here and in a process of its own."""

import sys
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest

from lighting import runtime
from lighting.errors import MissingExtraError, TurnsError
from lighting.geometry import wrap_azimuth
from lighting.registration import photo_set
from lighting.registration.features import detect_features
from lighting.registration.photo_set import (
    UP_STD,
    View,
    ViewFeatures,
    _angles_about,
    register_views,
    register_views_isolated,
)
from lighting.registration.rotations import camera_from_world
from tests.helpers.cameras import Camera, picture, texture

FOV = 52.0


def views(*azimuths: float) -> list[View]:
    sphere = texture()
    return [View(1.0, 0.0, 46.0, pixels=picture(sphere, (azimuth, 2.0, 0.0), FOV)) for azimuth in azimuths]


OVERLAPPING = views(0.0, 25.0)


@pytest.mark.slow
def test_the_answer_is_the_same() -> None:
    for views_of_one in (OVERLAPPING, [replace(view, metadata_fov=FOV) for view in OVERLAPPING], OVERLAPPING[:1]):
        assert register_views_isolated(views_of_one, 100.0) == register_views(
            [view.with_features() for view in views_of_one]
        )
    assert register_views_isolated(OVERLAPPING, 100.0)[1].heading == pytest.approx(25.0, abs=0.5)


def test_what_takes_too_long_is_ended() -> None:
    began = time.monotonic()
    with pytest.raises(TurnsError, match=r"takes longer than 0\.01 seconds\.$"):
        register_views_isolated(OVERLAPPING * 20, 0.01)
    assert time.monotonic() - began < 50


def test_it_ends_by_itself_where_nobody_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where who asked was killed."""
    endless = "import time, lighting.registration.photo_set as a; a.register_views = lambda _: time.sleep(1000); "
    monkeypatch.setattr(photo_set, "CODE", endless + photo_set.CODE)
    process = runtime.start_python(photo_set.CODE)
    process.communicate(photo_set._request(OVERLAPPING, 0.5), timeout=60)
    assert process.returncode != 0


def test_who_asks_may_stop_it() -> None:
    class GoneError(Exception):
        pass

    def gone() -> None:
        raise GoneError

    began = time.monotonic()
    with pytest.raises(GoneError):
        register_views_isolated(OVERLAPPING * 20, 100.0, gone)
    assert time.monotonic() - began < 50


@pytest.mark.skipif(sys.platform != "linux", reason="the bound is Linux's")
def test_what_takes_too_much_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photo_set, "BASE_MEMORY", 30_000_000)
    with pytest.raises(TurnsError, match="needs too much memory"):
        register_views_isolated(OVERLAPPING, 100.0)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the bound is Linux's")
def test_the_largest_photos_with_the_most_features_fit_into_the_memory() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (256, 256), dtype=np.uint8)
    large = np.repeat(np.kron(noise, np.ones((8, 8), np.uint8))[:2047, :2047, None], 3, axis=2)
    assert {
        registered.heading for registered in register_views_isolated([View(0.0, 0.0, 50.0, pixels=large)] * 2, 100.0)
    } == {0.0}


def test_photos_that_end_the_process_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    fatal = "import os, lighting.registration.photo_set as a; a.register_views = lambda _: os._exit(9); "
    monkeypatch.setattr(photo_set, "CODE", fatal + photo_set.CODE)
    with pytest.raises(TurnsError, match="ended its process"):
        register_views_isolated(OVERLAPPING, 100.0)


def test_without_opencv_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photo_set, "CODE", "import sys; sys.modules['cv2'] = None; " + photo_set.CODE)
    with pytest.raises(MissingExtraError, match=r"pip install 'outdoor-lighting\["):
        register_views_isolated(OVERLAPPING, 100.0)


def test_where_no_process_starts_one_sentence_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/absent/python")
    with pytest.raises(TurnsError, match="does not start"):
        register_views_isolated(OVERLAPPING, 100.0)


CAMERAS: list[Camera] = [(-170.0, 2.0, 0.0), (-140.0, -3.0, 1.5), (165.0, 4.0, -2.0)]
TILTS = [(2.5, 0.5), (-4.0, 1.0), (3.5, -2.5)]  # deg, what a network says of their elevation and roll


def shots(seed: int, cameras: list[Camera]) -> list[ViewFeatures]:
    sphere = texture(seed)
    features = [detect_features(picture(sphere, camera, FOV)) for camera in cameras]
    return [ViewFeatures(*tilt, predicted_fov=46.0, features=f) for f, tilt in zip(features, TILTS, strict=False)]


def test_overlapping_photos_get_their_headings_and_their_lens() -> None:
    registered = register_views(shots(0, CAMERAS))
    assert {p.group for p in registered} == {0}
    true = [float(wrap_azimuth(azimuth - CAMERAS[0][0])) for azimuth, _, _ in CAMERAS]
    assert [p.heading for p in registered] == pytest.approx(true, abs=0.5)
    assert [p.vertical_fov for p in registered] == pytest.approx([FOV] * 3, abs=0.5)
    assert [p.camera_elevation for p in registered] == pytest.approx([c[1] for c in CAMERAS], abs=1.0)
    assert [p.camera_roll for p in registered] == pytest.approx([c[2] for c in CAMERAS], abs=1.0)
    assert registered[0].heading_std == 0.0
    assert all(0.0 < p.heading_std < 1.0 for p in registered[1:])


def test_a_photo_that_notes_gravity_levels_the_others() -> None:
    noted = [
        replace(shot, camera_elevation=e, camera_roll=r)
        for shot, (_, e, r) in zip(shots(0, CAMERAS), CAMERAS, strict=True)
    ]
    wrong = [replace(shot, camera_elevation=shot.camera_elevation + 7.0) for shot in noted[1:]]
    guessed, known = (register_views([replace(noted[0], up_std=sigma), *wrong]) for sigma in (UP_STD, 0.9))
    true = [c[1] for c in CAMERAS]
    assert [p.camera_elevation for p in known] == pytest.approx(true, abs=1.0)
    assert np.abs(np.subtract([p.camera_elevation for p in guessed], true)).max() > 3.0
    assert all(k.heading_std <= g.heading_std for k, g in zip(known, guessed, strict=True))


def test_photos_of_different_places_are_groups_of_their_own() -> None:
    strangers = [*shots(0, CAMERAS[:1]), *shots(1, CAMERAS[:1])]
    registered = register_views(strangers)
    assert [p.group for p in registered] == [0, 1]
    assert [p.vertical_fov for p in registered] == [None, None]
    assert registered[0].camera_elevation == pytest.approx(TILTS[0][0])


def test_a_zoomed_photo_has_a_lens_of_its_own() -> None:
    """One that a common lens or a walk would turn by other angles."""
    sphere, cameras, fovs = texture(0), [(0.0, 2.0, 0.0), (20.0, -3.0, 1.5), (9.0, 1.0, 0.0)], (FOV, FOV, 30.0)
    features = [detect_features(picture(sphere, camera, fov)) for camera, fov in zip(cameras, fovs, strict=True)]
    registered = register_views(
        [ViewFeatures(*tilt, predicted_fov=46.0, features=f) for f, tilt in zip(features, TILTS, strict=True)]
    )
    assert {p.group for p in registered} == {0}
    assert [p.heading for p in registered] == pytest.approx([0.0, 20.0, 9.0], abs=0.3)
    assert [p.vertical_fov for p in registered] == pytest.approx(fovs, abs=0.5)


def test_identical_photos_look_the_same_way() -> None:
    one = shots(0, CAMERAS[:1])
    registered = register_views([one[0], one[0]])
    assert [p.heading for p in registered] == pytest.approx([0.0, 0.0], abs=0.01)
    assert len({p.group for p in registered}) == 1
    assert registered[0].vertical_fov == pytest.approx(46.0, abs=1.0)  # the lens shows in no turn: the guess stays


def test_one_photo_is_its_own_group() -> None:
    (only,) = register_views(shots(0, CAMERAS[:1]))
    assert (only.group, only.heading, only.vertical_fov) == (0, 0.0, None)


def test_angles_about_a_vertical_are_those_of_geometry() -> None:
    rotations = np.array([camera_from_world(*c) @ camera_from_world(*CAMERAS[0]).T for c in CAMERAS])
    heading, elevation, roll = _angles_about(camera_from_world(*CAMERAS[0])[:, 1], rotations)
    assert heading == pytest.approx([float(wrap_azimuth(c[0] - CAMERAS[0][0])) for c in CAMERAS])
    assert elevation == pytest.approx([c[1] for c in CAMERAS])
    assert roll == pytest.approx([c[2] for c in CAMERAS])


def test_a_sheared_copy_takes_no_lens_beyond_all_numbers() -> None:
    """No camera sees one as the other: the search for two lenses goes far, and gives up without a warning."""
    noise = np.kron(np.random.default_rng(1).integers(0, 256, (60, 80), dtype=np.uint8), np.ones((5, 5), np.uint8))
    rolled, sheared = (
        np.roll(noise, 40, axis=1),
        cv2.warpAffine(noise, np.array([[1, 0.3, 0], [0, 1, 0.0]]), (400, 300)).astype(np.uint8),
    )
    registered = register_views(
        [
            ViewFeatures(89.0, 0.0, 50.0, features=detect_features(rolled)),
            ViewFeatures(-90.0, 180.0, 3.0, features=detect_features(sheared)),
        ]
    )
    assert all(np.isfinite([p.heading, p.camera_elevation]).all() for p in registered)
