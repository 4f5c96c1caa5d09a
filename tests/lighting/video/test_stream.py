"""Streams: keyframes, chains, and the light of each frame."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from lighting.errors import ParameterError, PhotoError, WarningCode
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, wrap_azimuth, zoomed_fov
from lighting.model import Model
from lighting.registration.rotations import rotation_about, rotation_vector
from lighting.video import tracking
from lighting.video.observation import estimate_frame
from lighting.video.stream import FIRST_CHAIN, MAX_KEYFRAMES, BankKeyframe, KeyframeBank, Tracker
from lighting.video.tracking import FrameRotation, Keyframe
from tests.helpers.cameras import poles
from tests.helpers.clips import FOV, Pixels, look, orientation, panorama, seen


def key(number: int, stretch: int = 0) -> Keyframe:
    return Keyframe(number, stretch, number, 0.1 * number, np.zeros((2, 2), np.uint8))


def around(count: int) -> list[Floats]:
    """Orientations that are 15 deg or more apart: rounds at three elevations."""
    return [orientation(20.0 * (i % 18), 30.0 * (i // 18) - 30.0) for i in range(count)]


def filled(chains: list[int]) -> KeyframeBank:
    bank = KeyframeBank()
    for number, chain in enumerate(chains):
        bank.add(BankKeyframe(key(number), around(54)[number], chain))
    return bank


def test_a_chain_has_one_keyframe_of_a_direction() -> None:
    bank = KeyframeBank()
    for number, chain in enumerate((FIRST_CHAIN, FIRST_CHAIN, 1)):
        bank.add(BankKeyframe(key(number), orientation(5.0 * number), chain))
    assert [kept.keyframe.number for kept in bank.keyframes] == [0, 2]


@pytest.mark.parametrize(
    "chains", [[FIRST_CHAIN] * 40, [FIRST_CHAIN] * 5 + [1] * 49, [FIRST_CHAIN] * 30 + list(range(1, 25))]
)
def test_memory_is_bounded_and_the_first_frame_stays(chains: list[int]) -> None:
    bank = filled(chains)
    assert len(bank.keyframes) == MAX_KEYFRAMES
    assert bank.keyframes[0].keyframe.number == 0
    assert bank.keyframes[-1].keyframe.number == len(chains) - 1


def test_a_stretch_that_is_not_linked_does_not_push_out_what_it_could_be_linked_by() -> None:
    bank = filled([FIRST_CHAIN] * 20 + [1] * 34)
    assert sum(kept.chain == FIRST_CHAIN for kept in bank.keyframes) == MAX_KEYFRAMES // 2
    left = filled([FIRST_CHAIN] * 20 + [1] * 6 + [2] * 20)
    assert [sum(kept.chain == c for kept in left.keyframes) for c in (FIRST_CHAIN, 1, 2)] == [16, 0, 16]


def test_all_strangers_have_their_turn_and_the_nearest_are_always_compared() -> None:
    bank, seen = filled([FIRST_CHAIN] * 30), set[int]()
    for number in range(30, 60):
        now = {kept.keyframe.number for kept in bank.of_other_chains(key(number, 1), around(1)[0], 1)}
        assert {0, 1, 17} <= now
        assert len(now) == 6
        seen |= now
    assert seen == set(range(30))
    assert not bank.nearest_of_chain(key(60, 1), around(1)[0], 1, 180.0)
    assert not bank.of_other_chains(key(60), around(1)[0], FIRST_CHAIN)


def test_a_chain_that_is_joined_is_turned() -> None:
    bank, turn = filled([FIRST_CHAIN, 1, 1]), rotation_about(np.array([0.0, 1.0, 0.0]))
    bank.join(1, FIRST_CHAIN, turn)
    assert {kept.chain for kept in bank.keyframes} == {FIRST_CHAIN}
    for kept, before, turned in zip(bank.keyframes, around(3), (np.eye(3), turn, turn), strict=True):
        np.testing.assert_allclose(kept.orientation, before @ turned)


BLACK = np.zeros((180, 320, 3), np.uint8)
MUNICH = UserInput(time=datetime(2024, 6, 1, 10, tzinfo=UTC), latitude=48.0, longitude=11.0)


@pytest.fixture(scope="module")
def model(network: Path) -> Model:
    return Model.load(network, threads=1)


def test_headings_come_back_after_a_round(model: Model) -> None:
    tracker = Tracker(model, UserInput(vertical_fov=FOV), look_every=5.0)
    headings = [9.0 * i for i in range(41)]
    answers = [tracker(look(h), 0.1 * i) for i, h in enumerate(headings)]
    off = [float(wrap_azimuth(a.heading - h)) for a, h in zip(answers, headings, strict=True) if a is not None]
    assert len(off) == 41
    assert np.abs(off[-1]) < 1.0
    assert np.abs(off).max() < 6.0  # the network's level is off by 4 deg
    assert all(a is not None and a.followed for a in answers)


def test_lettering_does_not_hold_a_camera_that_turns(model: Model) -> None:
    tracker = Tracker(model, UserInput(vertical_fov=FOV), look_every=100.0)
    answers = []
    for i in range(50):
        frame = look(1.5 * i).copy()
        for row in range(14, frame.shape[0], 18):  # more of it than of the world
            cv2.putText(frame, "ALT 20 SPD 14 BAT 97 " * 2, (4, row), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255,) * 3)
        answers.append(tracker(frame, 0.1 * i))
    first, last = answers[30], answers[-1]
    assert first is not None
    assert last is not None
    assert last.heading - first.heading == pytest.approx(1.5 * 19, abs=3.0)
    assert WarningCode.OVERLAY in {getattr(warning, "code", None) for warning in last.lighting.warnings}


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda frame: cv2.copyMakeBorder(frame, 40, 40, 0, 0, cv2.BORDER_CONSTANT), WarningCode.BORDER),
        (lambda frame: frame // 4 + 90, WarningCode.CURVE),
        (lambda frame: frame, None),
    ],
)
def test_a_stream_tells_what_clips_tell(
    change: Callable[[Pixels], Pixels], code: WarningCode | None, model: Model
) -> None:
    tracker = Tracker(model, UserInput(vertical_fov=FOV), look_every=100.0)
    answers = [tracker(np.asarray(change(look(6.0 * i)), dtype=np.uint8), 0.5 * i) for i in range(6)]
    last = answers[-1]
    assert last is not None
    told = {getattr(warning, "code", None) for warning in last.lighting.warnings}
    assert told & {WarningCode.BORDER, WarningCode.CURVE} == ({code} if code else set())


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"model": "network.onnx"}, "A Model is needed, not str"),
        ({"user_input": {"latitude": 3.0}}, "is a UserInput, not dict"),
    ],
)
def test_a_tracker_says_what_it_takes(wrong: dict[str, Any], said: str, model: Model) -> None:
    with pytest.raises(ParameterError, match=said):
        Tracker(**{"model": model, **wrong})


def test_given_is_the_old_name_of_user_input(model: Model) -> None:
    with pytest.warns(DeprecationWarning, match=r"Tracker\.given is now .*Tracker\.user_input"):
        tracker = Tracker(model, given=MUNICH)
    assert tracker._clip_metadata.user_input is MUNICH


def test_angles_of_a_light_have_four_digits_behind_the_point(model: Model) -> None:
    tracker = Tracker(model, look_every=5.0)
    for i in range(3):
        answer = tracker(look(3.0 * i), 0.1 * i)
    assert answer is not None
    told = answer.lighting
    angles = (told.sun_azimuth, told.camera_elevation, told.camera_roll, told.vertical_fov, told.relative_heading)
    assert all(angle == round(angle, 4) for angle in angles if angle is not None)


def test_what_is_lost_is_found_again(model: Model) -> None:
    tracker = Tracker(model, UserInput(vertical_fov=FOV), look_every=5.0)
    for i in range(20):
        tracker(look(2.0 * i), 0.1 * i)
    blind = tracker(np.zeros((180, 320, 3), np.uint8), 2.0)
    assert blind is not None
    assert not blind.followed
    assert not blind.linked
    for i in range(4):  # somewhere else that it has seen
        found = tracker(look(9.0 + 0.2 * i), 2.1 + 0.1 * i)
    assert found is not None
    assert found.heading == pytest.approx(9.6, abs=1.5)
    assert found.linked


def test_another_place_is_not_linked_until_the_first_is_seen_again(model: Model) -> None:
    tracker = Tracker(model, UserInput(vertical_fov=FOV), look_every=5.0)
    first = [look(2.0 * i) for i in range(20)]
    other = [look(100.0 + 2.0 * i, seed=5) for i in range(20)]
    answers = [tracker(picture, 0.1 * i) for i, picture in enumerate([*first, *other, *first[:4]])]
    linked = [a.linked for a in answers if a is not None]
    assert linked[:20] == [True] * 20
    assert linked[20:41] == [False] * 21  # the first frame of a stretch is recognised when one follows it
    assert linked[-1]
    assert answers[-1] is not None
    assert answers[-1].heading == pytest.approx(6.0, abs=1.5)


def test_keyframes_of_a_stretch_are_turned_when_it_is_linked(model: Model) -> None:
    """Lost between 20 and 120 deg, and comes back: then what it saw from 120 on is against the first frame, too."""
    tracker = Tracker(model, UserInput(vertical_fov=FOV), look_every=5.0)
    headings = [*np.linspace(0, 20, 11).tolist(), *np.linspace(120, 10, 56).tolist()]
    answers = [tracker(look(h), 0.1 * i) for i, h in enumerate(headings)]
    assert answers[11] is not None
    assert answers[11].heading == pytest.approx(20.0, abs=2.0)
    assert not answers[11].linked
    assert answers[-1] is not None
    assert answers[-1].heading == pytest.approx(10.0, abs=2.0)
    assert answers[-1].linked
    for kept in tracker._bank.keyframes:
        there = np.degrees(np.arctan2(-kept.orientation[2, 0], kept.orientation[2, 2]))
        assert there == pytest.approx(headings[kept.keyframe.frame], abs=2.0)
        assert kept.chain == FIRST_CHAIN


def test_what_another_place_shows_of_the_sun_does_not_count_for_the_first(model: Model) -> None:
    tracker = Tracker(model, replace(MUNICH, heading=30.0, vertical_fov=FOV), look_every=0.0)
    first, other = [look(2.0 * i) for i in range(10)], [look(150.0 + 2.0 * i, seed=5) for i in range(10)]
    answers = [tracker(picture, 0.1 * i) for i, picture in enumerate([*first, *other, *first[:3]])]
    before, lost, again = (answers[i] for i in (9, 19, 22))
    assert before is not None
    assert lost is not None
    assert again is not None
    assert tracker._light is tracker._first_light
    assert tracker._first_light.light._count == 12  # a stretch is recognised when a second frame follows
    assert before.lighting.camera_heading == pytest.approx(48.0, abs=6.0)
    assert lost.lighting.camera_heading != pytest.approx(68.0, abs=6.0)  # the first frame's heading tells it nothing
    assert again.lighting.camera_heading == pytest.approx(34.0, abs=6.0)


def line(a: tuple[float, float], b: tuple[float, float], count: int) -> list[tuple[float, float]]:
    """Azimuths and elevations [deg] of a camera that is turned from one to the other."""
    return [(float(x), float(y)) for x, y in np.linspace(a, b, count)]


def followed(tracker: Tracker, views: Sequence[tuple[float, float] | None]) -> list[tuple[bool, float]]:
    """Of each view, black where None: whether it is linked to the first, and how far off it then is [deg]."""
    found = []
    for i, view in enumerate(views):
        answer = tracker(BLACK if view is None else look(*view), 0.1 * i)
        assert answer is not None
        true = np.eye(3) if view is None else orientation(*view) @ orientation(0.0).T
        off = float(np.degrees(np.linalg.norm(rotation_vector(tracker._orientation @ true.T))))
        found.append((answer.linked, off))
    return found


def test_what_was_kept_while_the_thread_was_lost_does_not_move_linked_headings(model: Model) -> None:
    """Lost at an azimuth of 20 deg; what is seen then, 45 deg further down, is kept as if it were straight ahead."""
    first, lost = line((0, 0), (20, 0), 11), line((20, -45), (65, -45), 24)
    again = [*line((5, 0), (45, 0), 21), *line((45, -2), (45, -45), 22), *line((45, -45), (45, 0), 22)]
    found = followed(Tracker(model, UserInput(vertical_fov=FOV), look_every=5.0), [*first, None, *lost, None, *again])
    assert [linked for linked, _ in found] == [True] * 11 + [False] * 27 + [True] * 64
    assert max(off for linked, off in found if linked) < 0.5


def test_a_stretch_that_is_recognised_by_a_linked_camera_is_linked(model: Model) -> None:
    """What two stretches saw, the second of which recognised the first, is turned when a linked camera comes there."""
    first, lost = line((0, 0), (20, 0), 11), line((150, 0), (180, 0), 16)
    further, on = line((160, 0), (120, 0), 21), line((5, 0), (175, 0), 86)
    tracker = Tracker(model, UserInput(vertical_fov=FOV), look_every=5.0)
    views = [*first, None, *lost, None, *further, None, *on]
    found = followed(tracker, views)
    assert [linked for linked, _ in found] == [True] * 11 + [False] * 41 + [True] * 85
    assert max(off for linked, off in found if linked) < 1.0
    seen = {kept.keyframe.frame for kept in tracker._bank.keyframes if kept.chain == FIRST_CHAIN}
    assert seen & set(range(12, 28))
    assert seen & set(range(29, 50))
    for kept in tracker._bank.keyframes:
        view = views[kept.keyframe.frame]
        assert view is not None
        true = orientation(*view) @ orientation(0.0).T
        assert np.degrees(np.linalg.norm(rotation_vector(kept.orientation @ true.T))) < 1.0


def test_a_keyframe_whose_turn_is_not_believed_ends_the_link(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """While a camera turns from 20 to 80 deg no turn is believed, though points are followed all the time."""
    tracker, lost = Tracker(model, UserInput(vertical_fov=FOV), look_every=5.0), range(11, 41)
    views = [*line((0, 0), (90, 0), 46), *line((88, 0), (10, 0), 40)]

    def is_reliable(rotation: FrameRotation, *, is_start: bool) -> bool:
        return tracker._count - 1 not in lost and tracking.is_reliable(rotation, is_start=is_start)

    monkeypatch.setattr("lighting.video.stream.is_reliable", is_reliable)
    found = followed(tracker, views)
    assert all(linked for linked, _ in found[:11])
    assert not all(linked for linked, _ in found)
    assert all(off < 1.0 for i, (linked, off) in enumerate(found) if linked and i not in lost)
    assert found[-1][0]


def test_where_all_was_dark_the_first_frame_is_the_first_that_is_not(model: Model) -> None:
    tracker = Tracker(model, UserInput(vertical_fov=FOV), look_every=5.0)
    for i in range(10):
        assert tracker(look(100.0 + 2.0 * i, gain=0.03), 0.1 * i) is None
    tracker(BLACK, 1.0)
    found = followed(tracker, [*line((0, 0), (20, 0), 11), *line((40, 0), (110, 0), 36)][:11])
    assert [linked for linked, _ in found] == [True] * 11
    assert max(off for _, off in found) < 0.5


def test_with_time_and_place_there_is_an_absolute_heading(model: Model) -> None:
    tracker = Tracker(model, MUNICH, look_every=0.5)
    answers = [tracker(look(3.0 * i), 0.1 * i) for i in range(20)]
    last = answers[-1]
    assert last is not None
    assert last.lighting.camera_heading is not None
    assert last.lighting.sun_elevation == pytest.approx(61.0, abs=3.0)  # Munich in June
    towards_sun = last.lighting.camera_heading + last.lighting.sun_azimuth
    assert float(wrap_azimuth(towards_sun - 148.0)) == pytest.approx(0.0, abs=15.0)


def test_a_lens_that_is_given_tells_how_the_camera_was_held(model: Model) -> None:
    pixels = poles(20.0, 0.0, 60.0)
    told = Tracker(model, UserInput(vertical_fov=60.0, metadata=False))(pixels, 0.0)
    known = estimate_frame(model, pixels, 60.0).by_lens
    assert told is not None
    assert known is not None
    assert told.lighting.camera_elevation == pytest.approx(known.prediction.camera_elevation, abs=1e-3)


def test_frames_of_one_row_are_no_crash(model: Model) -> None:
    tracker, frame = Tracker(model), np.full((1, 1000, 3), 128, np.uint8)
    assert [tracker(frame, time) for time in (0.0, 1.0)] == [None, None]  # it shows nothing to follow


def test_warnings_speak_of_the_stream(model: Model) -> None:
    told = Tracker(model, UserInput(vertical_fov=150.0, metadata=False))(look(0.0), 0.0)
    assert told is not None
    assert any("it may be cropped" in warning for warning in told.lighting.warnings)
    assert not any("photo" in warning for warning in told.lighting.warnings)


def test_the_ground_is_the_one_that_was_seen(lit_network: Path) -> None:
    answer = Tracker(Model.load(lit_network, threads=1), UserInput(vertical_fov=FOV))(look(0.0), 0.0)
    assert answer is not None
    assert answer.lighting.ground_color is not None


def test_in_the_dark_there_is_no_answer(model: Model) -> None:
    assert Tracker(model)(np.zeros((180, 320, 3), np.uint8), 0.0) is None


@pytest.mark.parametrize(
    "frame", [np.zeros((180, 320)), np.zeros((180, 320), np.uint8), np.zeros((0, 320, 3), np.uint8), "frame"]
)
def test_what_is_no_frame_is_a_sentence(model: Model, frame: Any) -> None:
    with pytest.raises(PhotoError, match=r"^The pixels "):
        Tracker(model)(frame, 0.0)


def test_a_frame_has_a_time(model: Model) -> None:
    with pytest.raises(ParameterError, match="finite number of seconds, not nan"):
        Tracker(model)(np.zeros((180, 320, 3), np.uint8), float("nan"))


def test_a_time_beyond_all_clocks_is_a_sentence(model: Model) -> None:
    for given in (None, MUNICH):
        with pytest.raises(ParameterError, match=r"seconds after the first, not 1e\+15"):
            Tracker(model, given)(look(0.0), 1e15)


@pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf")])
def test_looks_are_some_time_apart(model: Model, seconds: float) -> None:
    with pytest.raises(ParameterError, match="look_every must be a finite number of seconds"):
        Tracker(model, look_every=seconds)


def test_when_night_falls_the_sun_stays_and_headings_go_on(model: Model) -> None:
    """Civil twilight ends at 19:47:48 UTC, after the fourth frame."""
    dusk = UserInput(time=datetime(2024, 6, 1, 19, 30, tzinfo=UTC), latitude=48.0, longitude=11.0, vertical_fov=FOV)
    tracker = Tracker(model, dusk, look_every=0.0)
    answers = [tracker(look(3.0 * i), 300.0 * i) for i in range(8)]
    day, last = answers[3], answers[-1]
    assert day is not None
    assert last is not None
    assert last.heading == pytest.approx(21.0, abs=1.5)
    assert last.lighting.sun_elevation == day.lighting.sun_elevation
    assert last.lighting.sun_visibility == day.lighting.sun_visibility == 0.0
    suns = [float(wrap_azimuth(a.lighting.sun_azimuth + a.heading)) for a in (day, last)]
    assert suns[0] == pytest.approx(suns[1], abs=1e-4)  # angles of a light have four digits


def test_a_stream_of_night_is_refused(model: Model) -> None:
    night = UserInput(time=datetime(2024, 6, 1, 23, tzinfo=UTC), latitude=48.0, longitude=11.0)
    with pytest.raises(ParameterError, match="below the horizon"):
        Tracker(model, night)(look(0.0), 0.0)


def test_memory_does_not_grow(model: Model) -> None:
    tracker = Tracker(model, UserInput(vertical_fov=FOV), look_every=2.0)
    for i in range(33):
        tracker(look(15.0 * i % 360.0), 0.1 * i)
    assert len(tracker._bank.keyframes) <= 32
    assert len(tracker._key_poses) <= 2
    assert len(tracker._light.light._sectors) <= 24


def test_a_zoom_ends_the_link_until_what_was_seen_before_is_recognised(model: Model) -> None:
    """Turns to and fro; from 10 to 15 s the focal length grows by half, which bent all turns after it."""
    tracker = Tracker(model, UserInput(vertical_fov=FOV), look_every=1.0)
    time = np.arange(250) / 10.0
    headings, zoom = 25.0 * np.sin(time / 2.0), 1.5 ** np.clip((time - 10.0) / 5.0, 0.0, 1.0)
    answers = [
        tracker(seen(panorama(), h, fov=zoomed_fov(FOV, z)), t)
        for h, z, t in zip(headings.tolist(), zoom.tolist(), time.tolist(), strict=True)
    ]
    linked = np.array([a is not None and a.linked for a in answers])
    off = np.array([np.nan if a is None else a.heading for a in answers]) - headings
    assert linked[:100].all()
    assert not linked[100:150].all()
    assert linked[150:].any()
    assert np.abs(off[150:][linked[150:]]).max() < 3.0


def test_turning_alone_is_no_zoom(model: Model) -> None:
    tracker = Tracker(model, look_every=1.0)  # the network says 50 deg
    answers = [tracker(look(3.0 * i, 4.0 * np.sin(i / 5.0)), 0.1 * i) for i in range(60)]
    assert all(a is not None and a.linked for a in answers)
