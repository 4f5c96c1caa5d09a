"""Photos placed in a process of their own: the same answer, and nothing that a photo does holds anybody for long."""

import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from lighting import processes
from lighting.errors import MissingExtraError, TurnsError
from lighting.turns import View, apart, place, place_apart
from tests.lighting.turns.cameras import picture, texture

pytest.importorskip("cv2")
FOV = 52.0


def views(*azimuths: float) -> list[View]:
    sphere = texture()
    return [View(picture(sphere, (azimuth, 2.0, 0.0), FOV), 1.0, 0.0, 46.0) for azimuth in azimuths]


OVERLAPPING = views(0.0, 25.0)


@pytest.mark.slow
def test_the_answer_is_the_same() -> None:
    for asked in (OVERLAPPING, [replace(view, noted_fov=FOV) for view in OVERLAPPING], OVERLAPPING[:1]):
        assert place_apart(asked, 100.0) == place([view.shot() for view in asked])
    assert place_apart(OVERLAPPING, 100.0)[1].heading == pytest.approx(25.0, abs=0.5)


def test_what_takes_too_long_is_ended() -> None:
    began = time.monotonic()
    with pytest.raises(TurnsError, match=r"takes longer than 0\.01 seconds\.$"):
        place_apart(OVERLAPPING * 20, 0.01)
    assert time.monotonic() - began < 5


def test_it_ends_by_itself_where_nobody_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where who asked was killed."""
    endless = "import time, lighting.turns.apart as a; a.place = lambda _: time.sleep(1000); "
    monkeypatch.setattr(apart, "CODE", endless + apart.CODE)
    process = processes.python(apart.CODE)
    process.communicate(apart._request(OVERLAPPING, 0.5), timeout=60)
    assert process.returncode != 0


def test_who_asks_may_stop_it() -> None:
    class GoneError(Exception):
        pass

    def gone() -> None:
        raise GoneError

    began = time.monotonic()
    with pytest.raises(GoneError):
        place_apart(OVERLAPPING * 20, 100.0, gone)
    assert time.monotonic() - began < 50


@pytest.mark.skipif(sys.platform != "linux", reason="the bound is Linux's")
def test_what_takes_too_much_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apart, "MEMORY", 30_000_000)
    with pytest.raises(TurnsError, match="needs too much memory"):
        place_apart(OVERLAPPING, 100.0)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the bound is Linux's")
def test_the_largest_photos_with_the_most_features_fit_into_the_memory() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (256, 256), dtype=np.uint8)
    large = np.repeat(np.kron(noise, np.ones((8, 8), np.uint8))[:2047, :2047, None], 3, axis=2)
    assert {placed.heading for placed in place_apart([View(large, 0.0, 0.0, 50.0)] * 2, 100.0)} == {0.0}


def test_photos_that_end_the_process_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    fatal = "import os, lighting.turns.apart as a; a.place = lambda _: os._exit(9); "
    monkeypatch.setattr(apart, "CODE", fatal + apart.CODE)
    with pytest.raises(TurnsError, match="ended its process"):
        place_apart(OVERLAPPING, 100.0)


def test_without_opencv_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apart, "CODE", "import sys; sys.modules['cv2'] = None; " + apart.CODE)
    with pytest.raises(MissingExtraError, match=r"pip install 'outdoor-lighting\["):
        place_apart(OVERLAPPING, 100.0)


def test_where_no_process_starts_one_sentence_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/absent/python")
    with pytest.raises(TurnsError, match="does not start"):
        place_apart(OVERLAPPING, 100.0)
