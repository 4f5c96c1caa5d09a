"""Clips measured against their truth, and which panoramas they are taken in."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from export.data import DataError, Panorama, write_index
from export.video import evaluate, streams
from export.video.sequences import RATE, Pixels, Sequenced, look
from lighting.files import encode_png
from lighting.model import Model
from lighting.video.shot import solve
from lighting.video.watch import shots_watched
from lighting.video.watched import Circumstances
from tests.lighting.video.clips import FOV, SIZE, panorama

pytest.importorskip("cv2")

COUNT = 40


@pytest.fixture(scope="module")
def model(network: Path) -> Model:
    return Model.load(network, threads=1)


def pan() -> Sequenced:
    """A level camera that turns by 50 degrees and grows darker."""
    time, level = np.arange(COUNT) / RATE, np.zeros(COUNT)
    azimuth = 20.0 + 50.0 * time / time[-1]
    gain = np.linspace(1.0, 0.7, COUNT)[:, None] * np.ones(3)

    def shot(i: int) -> Pixels:
        return look(panorama(), (float(azimuth[i]), 0.0, 0.0), FOV, SIZE)

    return Sequenced("pan", time, (azimuth, level, level), gain, FOV, np.ones(COUNT), (30.0, 40.0), shot)


def test_a_clip_is_measured_against_what_is_true_of_it(model: Model) -> None:
    """The same pictures, once with their own truth and once with another told of them."""
    clip = pan()
    (watched,) = shots_watched(clip.frames(), model)
    sun = solve(watched, Circumstances()).fused.sun
    clip = replace(clip, sun=(clip.path[0][0] + sun.azimuth, sun.elevation))
    right = evaluate.measured(clip, model)
    assert right["sun"] < 1e-3
    assert right["heading, 90 %"] < 2.0
    assert right["field of view"] < 1.5
    assert right["trembling"] < 0.3
    assert right["gain"] < 3.0
    assert right["split"] == right["bridged"] == 0.0
    azimuth, level, roll = clip.path
    told = replace(clip, path=(1.2 * azimuth, level + 10.0, roll - 5.0), vertical_fov=FOV + 8.0, sun=(100.0, 40.0))
    wrong = evaluate.measured(told, model)
    assert wrong["heading"] == pytest.approx(5.0, abs=1.0)
    assert wrong["elevation"] > 4.0
    assert wrong["roll"] > 3.0
    assert wrong["field of view"] == pytest.approx(8.0, abs=1.5)
    assert wrong["sun"] > 20.0


def test_a_row_has_medians_worst_cases_shares_and_counts() -> None:
    clip = dict.fromkeys((*evaluate.MEDIANS, "in 50 %", "in 90 %", "bridged", "split", "doubted"), 0.0)
    clips = [clip | {"trembling": t, "sun": t, "in 50 %": 100.0 * (t < 2), "split": t < 3} for t in (1.0, 2.0, 9.0)]
    row = evaluate.figures(clips)
    assert row["sun"] == 2.0
    assert row["trembling, worst"] == 9.0
    assert row["in 50 %"] == pytest.approx(100.0 / 3)
    assert row["split"] == 2.0
    assert "| 9.00 |" in evaluate.shown({"pan": row})


def test_panoramas_are_of_different_places_as_long_as_there_are_some(tmp_path: Path) -> None:
    (tmp_path / "0.png").write_bytes(encode_png(panorama()))

    def row(name: str, place: str, split: str = "val", sun: str = "visible") -> Panorama:
        return Panorama(name, tmp_path / "0.png", "ldr", place, split, sun, 30.0, 40.0, 2.0)

    unfit = [row("train", "t", "train"), row("hidden", "h", sun="inferred")]
    write_index([row("a", "x"), row("b", "x"), row("c", "x"), row("d", "y"), *unfit], tmp_path)
    found = evaluate.chosen(tmp_path, 3)
    assert {p.place for p in found[:2]} == {"x", "y"}
    assert [p.name for p in found] == [p.name for p in evaluate.chosen(tmp_path, 9)[:3]]
    assert {p.name for p in evaluate.chosen(tmp_path, 9)} == {"a", "b", "c", "d"}
    write_index(unfit, tmp_path)
    with pytest.raises(DataError, match="shows a given sun"):
        evaluate.chosen(tmp_path, 3)


def test_a_stream_is_silently_off_where_a_linked_heading_is() -> None:
    errors, linked = np.tile([1.0, 2.0], (60, 1)), np.ones(60, dtype=bool)
    errors[30:36, 0], linked[33:45] = streams.OFF + 4.0, False
    errors[50:, 1] = 6.0
    found = streams._errors(errors, linked)
    assert found["heading"] == found["at the end"] == 1.0
    assert found["worst"] == streams.OFF + 4.0
    assert (found["absolute"], found["absolute, end"]) == (2.0, 4.0)
    assert found["linked"] == pytest.approx(80.0)
    assert found["silent"] == pytest.approx(5.0)
