"""Sets: headings, one lens, groups."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.geometry import wrap_azimuth
from lighting.turns import UP_SIGMA, Shot, features, place
from lighting.turns.sets import about
from lighting.turns.upright import own_axes
from tests.lighting.turns.cameras import Camera, picture, texture

cv2 = pytest.importorskip("cv2")
FOV = 52.0
CAMERAS: list[Camera] = [(-170.0, 2.0, 0.0), (-140.0, -3.0, 1.5), (165.0, 4.0, -2.0)]
TILTS = [(2.5, 0.5), (-4.0, 1.0), (3.5, -2.5)]  # deg, what a network says of their elevation and roll


def shots(seed: int, cameras: list[Camera]) -> list[Shot]:
    sphere = texture(seed)
    seen = [features(picture(sphere, camera, FOV)) for camera in cameras]
    return [Shot(f, *tilt, guessed_fov=46.0) for f, tilt in zip(seen, TILTS, strict=False)]


def test_overlapping_photos_get_their_headings_and_their_lens() -> None:
    placed = place(shots(0, CAMERAS))
    assert {p.group for p in placed} == {0}
    true = [float(wrap_azimuth(azimuth - CAMERAS[0][0])) for azimuth, _, _ in CAMERAS]
    assert [p.heading for p in placed] == pytest.approx(true, abs=0.5)
    assert [p.vertical_fov for p in placed] == pytest.approx([FOV] * 3, abs=0.5)
    assert [p.camera_elevation for p in placed] == pytest.approx([c[1] for c in CAMERAS], abs=1.0)
    assert [p.camera_roll for p in placed] == pytest.approx([c[2] for c in CAMERAS], abs=1.0)
    assert placed[0].heading_sigma == 0.0
    assert all(0.0 < p.heading_sigma < 1.0 for p in placed[1:])


def test_a_photo_that_notes_gravity_levels_the_others() -> None:
    noted = [
        replace(shot, camera_elevation=e, camera_roll=r)
        for shot, (_, e, r) in zip(shots(0, CAMERAS), CAMERAS, strict=True)
    ]
    wrong = [replace(shot, camera_elevation=shot.camera_elevation + 7.0) for shot in noted[1:]]
    guessed, known = (place([replace(noted[0], up_sigma=sigma), *wrong]) for sigma in (UP_SIGMA, 0.9))
    true = [c[1] for c in CAMERAS]
    assert [p.camera_elevation for p in known] == pytest.approx(true, abs=1.0)
    assert np.abs(np.subtract([p.camera_elevation for p in guessed], true)).max() > 3.0
    assert all(k.heading_sigma <= g.heading_sigma for k, g in zip(known, guessed, strict=True))


def test_photos_of_different_places_are_groups_of_their_own() -> None:
    strangers = [*shots(0, CAMERAS[:1]), *shots(1, CAMERAS[:1])]
    placed = place(strangers)
    assert [p.group for p in placed] == [0, 1]
    assert [p.vertical_fov for p in placed] == [None, None]
    assert placed[0].camera_elevation == pytest.approx(TILTS[0][0])


def test_a_zoomed_photo_has_a_lens_of_its_own() -> None:
    """One that a common lens or a walk would turn by other angles."""
    sphere, cameras, fovs = texture(0), [(0.0, 2.0, 0.0), (20.0, -3.0, 1.5), (9.0, 1.0, 0.0)], (FOV, FOV, 30.0)
    seen = [features(picture(sphere, camera, fov)) for camera, fov in zip(cameras, fovs, strict=True)]
    placed = place([Shot(f, *tilt, guessed_fov=46.0) for f, tilt in zip(seen, TILTS, strict=True)])
    assert {p.group for p in placed} == {0}
    assert [p.heading for p in placed] == pytest.approx([0.0, 20.0, 9.0], abs=0.3)
    assert [p.vertical_fov for p in placed] == pytest.approx(fovs, abs=0.5)


def test_identical_photos_look_the_same_way() -> None:
    one = shots(0, CAMERAS[:1])
    placed = place([one[0], one[0]])
    assert [p.heading for p in placed] == pytest.approx([0.0, 0.0], abs=0.01)
    assert len({p.group for p in placed}) == 1
    assert placed[0].vertical_fov == pytest.approx(46.0, abs=1.0)  # the lens shows in no turn: the guess stays


def test_one_photo_is_its_own_group() -> None:
    (only,) = place(shots(0, CAMERAS[:1]))
    assert (only.group, only.heading, only.vertical_fov) == (0, 0.0, None)


def test_angles_about_a_vertical_are_those_of_geometry() -> None:
    rotations = np.array([own_axes(*c) @ own_axes(*CAMERAS[0]).T for c in CAMERAS])
    heading, elevation, roll = about(own_axes(*CAMERAS[0])[:, 1], rotations)
    assert heading == pytest.approx([float(wrap_azimuth(c[0] - CAMERAS[0][0])) for c in CAMERAS])
    assert elevation == pytest.approx([c[1] for c in CAMERAS])
    assert roll == pytest.approx([c[2] for c in CAMERAS])


def test_a_sheared_copy_takes_no_lens_beyond_all_numbers() -> None:
    """No camera sees one as the other: the search for two lenses goes far, and gives up without a warning."""
    noise = np.kron(np.random.default_rng(1).integers(0, 256, (60, 80), dtype=np.uint8), np.ones((5, 5), np.uint8))
    rolled, sheared = (
        np.roll(noise, 40, axis=1),
        cv2.warpAffine(noise, np.array([[1, 0.3, 0], [0, 1, 0.0]]), (400, 300)),
    )
    placed = place([Shot(features(rolled), 89.0, 0.0, 50.0), Shot(features(sheared), -90.0, 180.0, 3.0)])
    assert all(np.isfinite([p.heading, p.camera_elevation]).all() for p in placed)
