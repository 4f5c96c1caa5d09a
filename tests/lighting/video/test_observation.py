"""Where shots begin, and what frames of a clip say of its light."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lighting.estimator import Estimator
from lighting.fusion.single_view import Observations
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, direction
from lighting.model import Model
from lighting.photo.reader import photo_from_array
from lighting.prediction import Light, Prediction
from lighting.sun_grid import soft_label
from lighting.video import observation
from lighting.video.observation import (
    MIN_LOOK_INTERVAL,
    Dissolve,
    DissolveDetector,
    FrameObservation,
    ShotLight,
    _is_mixture,
    estimate_frame,
    observe_shots,
)
from lighting.video.shot import Shot, solve_shot
from lighting.video.tracking import ClipMetadata, FrameEstimate
from tests.conftest import TINY, scene
from tests.helpers.cameras import poles
from tests.helpers.clips import Pixels, frames, look, pan

ALONE, MIXED = 45, 18  # frames, at 30 a second


def dissolving(mixed: int = MIXED, turn: float = 10.0) -> list[Pixels]:
    """A camera that turns by 20 deg in one place, and one that turns by another angle in another."""
    first, second = pan(ALONE + mixed, 20.0), pan(ALONE + mixed, turn, seed=5)
    share = (np.arange(mixed) + 1.0) / (mixed + 1.0)
    both = [
        np.round((1 - s) * a + s * b).astype(np.uint8)
        for s, a, b in zip(share.tolist(), first[ALONE:], second[:mixed], strict=True)
    ]
    return [*first[:ALONE], *both, *second[mixed:]]


def told(pictures: list[Pixels]) -> list[Dissolve]:
    dissolves = DissolveDetector()
    found = [dissolves.take(frame) for frame in frames(pictures)]
    return [dissolve for dissolve in (*found, dissolves.finish()) if dissolve is not None]


def shots(pictures: list[Pixels], model: Model) -> list[Shot]:
    return [solve_shot(watched, ClipMetadata()) for watched in observe_shots(frames(pictures), model, 0.5)]


@pytest.fixture(scope="module")
def model(network: Path) -> Model:
    return Model.load(network, threads=1)


@pytest.mark.parametrize("mixed", [9, 18, 30])
def test_a_dissolve_is_told_with_its_time(mixed: int) -> None:
    (dissolve,) = told(dissolving(mixed))
    assert dissolve.first == pytest.approx(ALONE / 30.0, abs=0.3)
    assert dissolve.last == pytest.approx((ALONE + mixed) / 30.0, abs=0.3)


def test_a_dissolve_between_cameras_that_turn_alike_is_told() -> None:
    assert len(told(dissolving(turn=20.0))) == 1


def test_a_pan_a_cut_and_an_exposure_that_changes_are_no_dissolves() -> None:
    assert told(pan(90, 60.0)) == []
    assert told([*pan(45, 20.0), *pan(45, 20.0, seed=5)]) == []
    assert told([look(0.5 * i, gain=1.0 - 0.01 * i) for i in range(60)]) == []


def test_a_place_that_fades_to_black_and_back_is_no_dissolve() -> None:
    gains = np.abs(np.linspace(-1.0, 1.0, 60)).tolist()
    assert told([look(0.3 * i, gain=g) for i, g in enumerate(gains)]) == []


def test_a_glare_that_comes_and_goes_is_no_dissolve() -> None:
    glare = np.linspace(0.0, 200.0, 320)[None, :, None]
    strength = np.clip(1.0 - np.abs(np.linspace(-1.5, 1.5, 60)), 0.0, 1.0).tolist()
    pictures = [np.clip(look(0.3 * i) + s * glare, 0, 255).astype(np.uint8) for i, s in enumerate(strength)]
    assert told(pictures) == []


def test_a_dissolve_makes_two_shots_and_its_own_frames_are_bridged(model: Model) -> None:
    first, second = shots(dissolving(), model)
    middle = ALONE + MIXED // 2
    assert len(first.frames) + len(second.frames) == 2 * ALONE + MIXED
    assert second.frames[0] == pytest.approx(middle, abs=4)
    assert first.path.bridged[ALONE + 3 :].all()
    assert second.path.bridged[: ALONE + MIXED - 3 - second.frames[0]].all()
    assert first.path.heading[ALONE - 6] == pytest.approx(20.0 * (ALONE - 6) / (ALONE + MIXED - 1), abs=1.5)
    turned = second.path.heading[-1] - second.path.heading[0]
    assert turned == pytest.approx(10.0 * ALONE / (ALONE + MIXED - 1), abs=2.0)
    np.testing.assert_allclose(second.gains[0], 1.0)


def test_what_the_network_sees_of_a_mixture_does_not_count(model: Model) -> None:
    for watched in observe_shots(frames(dissolving()), model, 0.1):
        assert watched.estimates
        assert not any(ALONE + 3 <= frame < ALONE + MIXED - 3 for frame in watched.estimates)


def test_a_mixture_has_one_share_throughout() -> None:
    rng = np.random.default_rng(0)
    first, second = rng.normal(0.0, 40.0, (2, 500))

    def mixed(share: float | Floats) -> bool:
        return _is_mixture(first, share * first + (1.0 - share) * second, second)

    assert mixed(0.5)
    assert mixed(0.3)
    assert not mixed(0.05)
    assert not mixed((rng.random(500) < 0.5).astype(float))  # part the one, part the other
    assert not _is_mixture(first, first + 5.0, first + 10.0)  # no two pictures


def sky_of(model: Model, pixels: np.ndarray) -> np.ndarray:
    light = estimate_frame(model, pixels).prediction.light
    assert light is not None
    return light.sky_irradiance


def test_a_frames_sky_gives_the_light_its_colour(lit_network: Path) -> None:
    model = Model.load(lit_network)
    unseen, blue, red = scene(320, 240) // 2, scene(320, 240), scene(320, 240)
    blue[:120], red[:120] = (100, 160, 240), (240, 160, 100)
    said = sky_of(model, unseen)
    assert said == pytest.approx([0.4, 0.5, 0.8])
    assert sky_of(model, blue)[2] / sky_of(model, blue)[0] > 1.1 * said[2] / said[0]
    assert sky_of(model, red)[2] / sky_of(model, red)[0] < 0.9 * said[2] / said[0]


def test_a_network_that_says_nothing_of_the_light_is_left_alone(network: Path) -> None:
    seen = estimate_frame(Model.load(network), scene(320, 240))
    assert seen.prediction.light is None
    assert seen.ground is None


def test_a_lens_that_is_known_enters_how_the_camera_was_held(network: Path) -> None:
    model, pixels = Model.load(network), poles(20.0, 0.0, 60.0)
    seen = estimate_frame(model, pixels, 60.0)
    assert seen.by_lens is not None
    assert estimate_frame(model, pixels).by_lens is None
    assert seen.prediction.camera_elevation == Estimator(model).predict(photo_from_array(pixels)).camera_elevation
    prior = Estimator(model).predict(photo_from_array(pixels), UserInput(vertical_fov=60.0)).camera_elevation
    assert seen.by_lens.prediction.camera_elevation == prior != seen.prediction.camera_elevation


def test_a_frames_ground_has_the_colour_that_it_shows(lit_network: Path) -> None:
    model = Model.load(lit_network)
    green = scene(320, 240)
    green[120:] = (60, 120, 40)
    ground = estimate_frame(model, green).ground
    assert ground is not None
    assert ground[1] > 2 * ground[0] > 2 * ground[2]


def looks_at(monkeypatch: pytest.MonkeyPatch, pictures: list[np.ndarray], rate: float) -> list[int]:
    """The frames that the network sees of a clip."""
    seen: list[int] = []
    monkeypatch.setattr(observation, "estimate_frame", lambda _, pixels, __: seen.append(int(pixels[0, 0, 0])))
    numbered = [picture.copy() for picture in pictures]
    for number, picture in enumerate(numbered):
        picture[0, 0] = number
    model: Any = None
    for _ in observe_shots(frames(numbered, rate), model):
        pass
    return seen


def test_frames_without_contrast_are_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    flat = [np.full((90, 160, 3), level, np.uint8) for level in (128, 60, 180, 250, 128)] * 4
    assert looks_at(monkeypatch, flat, 1.0) == []
    assert looks_at(monkeypatch, [*flat[:3], pan(1)[0]], 1.0) == [3]


def test_a_clip_in_which_nothing_can_be_followed_costs_no_look_a_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (60, 90, 160, 3), dtype=np.uint8)
    seen = looks_at(monkeypatch, list(noise), 60.0)
    assert 5 <= len(seen) <= 11
    assert np.diff(seen).min() >= 60 * MIN_LOOK_INTERVAL - 1e-6


def test_a_new_shot_is_looked_at_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    pictures = [look(0.0)] * 20 + [look(90.0, seed=1)] * 20
    assert next(n for n in looks_at(monkeypatch, pictures, 30.0) if n >= 20) <= 23


SPEC = replace(TINY, sun_grid="fibonacci:1024")
NOTHING = Observations()


def observed_look(azimuth: float, heading: float, evidence: Observations = NOTHING, **other: float) -> FrameObservation:
    """A camera at `heading` that believes in a sun at `azimuth` of the shot, 40 deg high."""
    p = soft_label(direction(azimuth - heading, 40.0), 12.0, SPEC.sun_grid).astype(np.float32)
    values: dict[str, Any] = {"sun_visibility": 0.9, "turbidity": 3.0, "exposure": 0.1, **other}
    prediction = Prediction(SPEC, p, camera_elevation=0.0, camera_roll=0.0, vertical_fov=45.0, **values)
    return FrameObservation(FrameEstimate(prediction), heading, 45.0, observations=evidence)


def sun_of(*looks: FrameObservation, evidence: Observations = NOTHING) -> tuple[float, float, float]:
    light = ShotLight()
    for one in looks:
        light.add(one)
    sun = light.answer(evidence).sun
    return sun.azimuth, sun.elevation, sun.radius_50


def test_the_same_view_again_and_again_is_no_news() -> None:
    once = sun_of(observed_look(50.0, 0.0))
    often = sun_of(*[observed_look(50.0, 0.0)] * 40)
    assert often == pytest.approx(once, abs=0.5)


def test_views_all_around_agree_on_one_sun_and_are_surer() -> None:
    once = sun_of(observed_look(50.0, 0.0))
    around = sun_of(*(observed_look(50.0, h) for h in range(0, 360, 60)))
    assert around[0] == pytest.approx(50.0, abs=2.0)
    assert around[1] == pytest.approx(40.0, abs=2.0)
    assert around[2] < 0.75 * once[2]


def test_one_view_that_errs_is_outvoted() -> None:
    azimuth, _, _ = sun_of(*(observed_look(50.0 if h else 150.0, h) for h in range(0, 360, 45)))
    assert azimuth == pytest.approx(50.0, abs=12.0)  # where the eight lobes add up to is 8 deg off


def test_with_time_and_place_the_sun_tells_north() -> None:
    """The sun stands at 120 deg, and is seen 50 deg right of azimuth 0: that points to 70 deg."""
    when = Observations(candidates=((40.0, 120.0),))
    light = ShotLight()
    for heading in (0.0, 60.0, 120.0):
        light.add(observed_look(50.0, heading, when))
    fused = light.answer(when)
    assert fused.camera_heading is not None
    assert fused.camera_heading.best == pytest.approx(70.0, abs=2.0)
    assert fused.used == ("pixels", "time+place", "turns", "other photos")


def test_exposures_are_those_of_the_first_frame() -> None:
    light = ShotLight()
    light.add(observed_look(50.0, 0.0, exposure=0.1))
    light.add(replace(observed_look(50.0, 90.0, exposure=0.4), gain=4.0))
    assert light.answer(NOTHING).prediction.exposure == pytest.approx(0.1)


def test_no_look_no_answer() -> None:
    light = ShotLight()
    with pytest.raises(ValueError, match="no look"):
        light.answer(NOTHING)


def test_the_strength_of_the_light_is_averaged_in_the_first_frames_exposure() -> None:
    light = ShotLight()
    for gain in (1.0, 2.0):
        one = observed_look(50.0, 0.0)
        strength = Light(np.full(3, 1.0 * gain), np.full(3, 0.5 * gain), 0.2 * gain, 0.9)
        light.add(replace(one, estimate=FrameEstimate(replace(one.estimate.prediction, light=strength)), gain=gain))
    said = light.answer(NOTHING).prediction.light
    assert said is not None
    assert said.sun_irradiance == pytest.approx([1.0] * 3)
    assert said.sky_irradiance == pytest.approx([0.5] * 3)
    assert (said.cover, said.suitable) == pytest.approx((0.3, 0.9))
    assert observed_look(0.0, 0.0).estimate.prediction.light is None


def test_the_ground_is_the_mean_of_the_directions_that_show_it() -> None:
    light = ShotLight()
    light.add(observed_look(50.0, 0.0))
    assert light.ground is None
    for heading, reflectance in ((60.0, 0.1), (60.0, 0.1), (120.0, 0.4)):
        one = observed_look(50.0, heading)
        light.add(replace(one, estimate=replace(one.estimate, ground=np.array([1.0, 0.5, 0.25]) * reflectance)))
    assert light.ground == pytest.approx([0.2, 0.1, 0.05])
