"""Tests of labels."""

import dataclasses
import math
import re
from pathlib import Path

import pytest

from export.data.labels import Label, check_labels, label_folder, label_panorama, read_labels, write_labels
from export.data.panoramas import DataError, Panorama, read_index
from export.data.rendered_panoramas import render_folder
from tests.helpers.panoramas import ROW, write_index


def test_a_given_sun_wins_over_the_found_one(tmp_path: Path) -> None:
    render_folder(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    moved = dataclasses.replace(panorama, sun_azimuth=10.0, sun_elevation=20.0, sun_uncertainty=None)
    label = label_panorama(moved)
    assert (label.sun_azimuth, label.sun_elevation, label.sun_source) == (10.0, 20.0, "given")
    assert label.sun_uncertainty > 0
    assert label.found_azimuth == pytest.approx(panorama.sun_azimuth, abs=3.0)


@pytest.mark.parametrize(
    ("sun", "label", "source"), [("unknown", "", "found"), ("unknown", "by eye", "none"), ("none", "", "none")]
)
def test_a_found_sun_is_used_only_where_nobody_looked(tmp_path: Path, sun: str, label: str, source: str) -> None:
    render_folder(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    bare = Panorama("a", panorama.path, "ldr", "here", "train", sun, label=label)
    labelled = label_panorama(bare)
    assert labelled.sun_source == source
    assert math.isnan(labelled.sun_azimuth) == (source == "none")
    assert math.isnan(labelled.turbidity) == (source == "none")
    assert not math.isnan(labelled.found_azimuth)


def test_the_fit_of_an_altered_sky_is_not_trusted(tmp_path: Path) -> None:
    render_folder(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    assert label_panorama(panorama).fit_ok
    assert not label_panorama(dataclasses.replace(panorama, notes="strong HDR tone mapping")).fit_ok


LABEL = Label("a", -12.5, 40.0, 2.0, "given", -12.0, 41.0, 3.2, 5.1, 0.12, True, "yes")


def test_labels_survive_a_file(tmp_path: Path) -> None:
    none = dataclasses.replace(LABEL, name="b", sun_source="none", sun_azimuth=math.nan, fit_ok=False, direct="")
    write_labels([LABEL, none], tmp_path / "labels.csv")
    first, second = read_labels(tmp_path / "labels.csv")
    assert first == LABEL
    assert math.isnan(second.sun_azimuth)
    assert dataclasses.replace(second, sun_azimuth=0.0) == dataclasses.replace(none, sun_azimuth=0.0)


def test_labels_that_cannot_be_written_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(DataError, match="cannot be written"):
        write_labels([LABEL], tmp_path / "file" / "labels.csv")


@pytest.mark.parametrize(
    ("text", "message"),
    [(None, "cannot be read"), ("name,turbidity\na,3\n", "no column"), ("NUMBER", "cannot be read")],
)
def test_labels_that_cannot_be_read_are_refused(tmp_path: Path, text: str | None, message: str) -> None:
    path = tmp_path / "labels.csv"
    if text == "NUMBER":
        write_labels([LABEL], path)
        path.write_text(path.read_text().replace("3.2", "three"))
    elif text is not None:
        path.write_text(text)
    with pytest.raises(DataError, match=message):
        read_labels(path)


@pytest.mark.slow
def test_rendered_skies_are_labelled_well(data: Path) -> None:
    _, said = check_labels(data, data / "labels.csv")
    numbers = [float(number) for number in re.findall(r"\d+(?:\.\d+)?", said)]
    detected, rendered, sun_error, fitted, turbidity_error, exposure_error = numbers
    assert rendered > 48
    assert detected > 0.85 * rendered
    assert sun_error < 1.0
    assert fitted > 0.9 * rendered
    assert turbidity_error < 0.3
    assert exposure_error < 2.0  # %


def test_agreement_counts_suns_and_overcast_skies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    missed = dataclasses.replace(LABEL, name="b", found_azimuth=math.nan, found_elevation=math.nan)
    wrong = dataclasses.replace(LABEL, name="c", found_azimuth=170.0)
    none = dataclasses.replace(missed, name="d", sun_source="none", sun_azimuth=math.nan)
    suns = {"a": "visible", "b": "visible", "c": "visible", "d": "none"}
    write_index(tmp_path, *(ROW | {"name": name, "sun": sun} for name, sun in suns.items()))
    write_labels([LABEL, missed, wrong, none], tmp_path / "labels.csv")
    monkeypatch.setattr("export.data.labels._check_rendered", lambda: "not here")
    said, _ = check_labels(tmp_path, tmp_path / "labels.csv")
    assert "sun found in 2 of 3, off by " in said
    assert "50.0% by more than 20 deg. No sun found in 1 of 1 without one" in said
    found = re.search(r"by ([\d.]+) deg .*quartiles ([\d.]+) and ([\d.]+)", said)
    assert found
    middle, low, high = map(float, found.groups())
    assert low < middle < high


@pytest.mark.slow
@pytest.mark.needs("scipy")
def test_a_folder_is_labelled_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("export.data.labels._check_rendered", lambda: "sun found in 1 of 1")
    render_folder(tmp_path, 8, 64)
    label_folder(tmp_path, tmp_path / "labels.csv", workers=2)
    labels = read_labels(tmp_path / "labels.csv")
    assert [label.name for label in labels] == [p.name for p in read_index(tmp_path)]
    assert sum(label.fit_ok for label in labels) >= 4
    printed = capsys.readouterr().out
    assert "found suns against given ones: sun found in" in printed
    assert "rendered skies: sun found in" in printed
