"""What augmentation changes, and what it tells."""

import zlib
from dataclasses import replace

import numpy as np
import pytest

from export.crops.augment import CAMERA_EFFECTS, PICTURE_EFFECTS, SCENE_EFFECTS, Effect, Linear, Picture, augment
from export.crops.cameras import Camera
from export.crops.crops import Crop
from tests.export.crops.examples import VIEWS, crop


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
