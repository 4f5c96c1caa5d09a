"""Tests of labels."""

import dataclasses
import math
from pathlib import Path

import pytest

from export.data.labels import (
    Label,
    _check_rendered,
    _label_panorama,
    _sun_agreement,
    label_folder,
    read_labels,
    write_labels,
)
from export.data.panoramas import DataError, Panorama, read_index
from export.data.rendered_panoramas import _write_dataset


def test_a_given_sun_wins_over_the_found_one(tmp_path: Path) -> None:
    _write_dataset(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    moved = dataclasses.replace(panorama, sun_azimuth=10.0, sun_elevation=20.0, sun_uncertainty=None)
    label = _label_panorama(moved)
    assert (label.sun_azimuth, label.sun_elevation, label.sun_source) == (10.0, 20.0, "given")
    assert label.sun_uncertainty > 0
    assert label.found_azimuth == pytest.approx(panorama.sun_azimuth, abs=3.0)


@pytest.mark.parametrize(
    ("sun", "label", "source"), [("unknown", "", "found"), ("unknown", "by eye", "none"), ("none", "", "none")]
)
def test_a_found_sun_is_used_only_where_nobody_looked(tmp_path: Path, sun: str, label: str, source: str) -> None:
    _write_dataset(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    bare = Panorama("a", panorama.path, "ldr", "here", "train", sun, label=label)
    labelled = _label_panorama(bare)
    assert labelled.sun_source == source
    assert math.isnan(labelled.sun_azimuth) == (source == "none")
    assert math.isnan(labelled.turbidity) == (source == "none")
    assert not math.isnan(labelled.found_azimuth)


def test_the_fit_of_an_altered_sky_is_not_trusted(tmp_path: Path) -> None:
    _write_dataset(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    assert _label_panorama(panorama).fit_ok
    assert not _label_panorama(dataclasses.replace(panorama, notes="strong HDR tone mapping")).fit_ok


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
def test_rendered_skies_are_labelled_well() -> None:
    check = _check_rendered(30)
    assert check.rendered > 24
    assert check.detected > 0.85 * check.rendered
    assert check.sun_error < 1.0
    assert check.fitted > 0.9 * check.rendered
    assert check.turbidity_error < 0.3
    assert check.exposure_error < 0.02


def test_agreement_counts_suns_and_overcast_skies() -> None:
    def panorama(name: str, sun: str) -> Panorama:
        return Panorama(name, Path(name), "ldr", "here", "train", sun)

    missed = dataclasses.replace(LABEL, name="b", found_azimuth=math.nan, found_elevation=math.nan)
    wrong = dataclasses.replace(LABEL, name="c", found_azimuth=170.0)
    none = dataclasses.replace(missed, name="d", sun_source="none", sun_azimuth=math.nan)
    suns = [panorama("a", "visible"), panorama("b", "visible"), panorama("c", "visible"), panorama("d", "none")]
    result = _sun_agreement(suns, [LABEL, missed, wrong, none])
    assert (result.visible, result.detected, result.overcast, result.rejected) == (3, 2, 1, 1)
    assert result.outlier_rate == 0.5
    assert result.error_25 < result.error_50 < result.error_75


@pytest.mark.slow
@pytest.mark.needs("scipy")
def test_a_folder_is_labelled_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("export.data.labels._check_rendered", lambda: _check_rendered(4, 32))
    _write_dataset(tmp_path, 8, 64)
    label_folder(tmp_path, tmp_path / "labels.csv", workers=2)
    labels = read_labels(tmp_path / "labels.csv")
    assert [label.name for label in labels] == [p.name for p in read_index(tmp_path)]
    assert sum(label.fit_ok for label in labels) >= 4
    printed = capsys.readouterr().out
    assert "found suns against given ones: sun found in" in printed
    assert "rendered skies: sun found in" in printed
