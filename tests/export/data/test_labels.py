"""Suns and skies found in rendered panoramas; reading and writing labels."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from export.data.reports import agreement, check_rendered, run
from export.data.labels import Label, label_panorama, read_labels, write_labels
from export.data.panoramas import DataError, Panorama, decode, read_index
from export.data.sky_fit import fit_sky, sky_mask
from export.data.sun_finder import find_sun
from export.data.synthetic import SyntheticPanorama, render_panorama, write_dataset
from lighting.geometry import angle_between, direction, latlong_directions

LABEL = Label("a", -12.5, 40.0, 2.0, "given", -12.0, 41.0, 3.2, 5.1, 0.12, True, "yes")


def sun_of(scene: SyntheticPanorama) -> np.ndarray:
    return np.asarray(direction(scene.sun_azimuth or 0.0, scene.sun_elevation or 0.0))


@pytest.mark.slow
def test_rendered_skies_are_labelled_well() -> None:
    check = check_rendered(60)
    assert check.rendered > 50
    assert check.found > 0.85 * check.rendered
    assert check.sun_error < 1.0
    assert check.fitted > 0.9 * check.rendered
    assert check.turbidity_error < 0.3
    assert check.exposure_error < 0.02


@pytest.mark.slow
def test_no_sun_is_found_under_overcast_skies() -> None:
    assert [find_sun(decode(render_panorama(seed, 64, overcast=True).picture)) for seed in range(12)] == [None] * 12


def test_an_unclipped_sun_is_found_at_its_peak() -> None:
    scene = render_panorama(0, 128, things=0)
    sun = find_sun(scene.linear)
    assert sun is not None
    assert angle_between(sun.direction, sun_of(scene)) < 0.3


def test_an_hdr_picture_without_a_peak_has_no_sun() -> None:
    assert find_sun(render_panorama(0, 64, overcast=True).linear * 50) is None


@pytest.mark.parametrize("value", [0.0, 0.5, 1.0])
def test_a_plain_picture_has_neither_sun_nor_sky(value: float) -> None:
    plain = np.full((32, 64, 3), value, np.float32)
    assert find_sun(plain) is None
    assert fit_sky(plain, direction(0.0, 45.0)) is None


def test_the_sun_is_found_across_the_seam() -> None:
    scene = render_panorama(0, 128, things=0)
    shift = round((180.0 - (scene.sun_azimuth or 0.0)) / 360.0 * 256)
    sun = find_sun(np.roll(decode(scene.picture), shift, axis=1))
    assert sun is not None
    assert angle_between(sun.direction, direction(180.0, scene.sun_elevation or 0.0)) < 2.0


def test_the_fit_ignores_clouds_and_white_balance() -> None:
    scene = render_panorama(4, 64)
    picture = decode(scene.picture) * np.array([0.92, 1.0, 1.06], np.float32)
    cloud = angle_between(latlong_directions(64), direction((scene.sun_azimuth or 0.0) + 120.0, 50.0)) < 25.0
    picture[cloud] = picture[cloud] * 0.5 + np.array([0.3, 0.3, 0.32], np.float32)
    fit = fit_sky(np.minimum(picture, 1.0), sun_of(scene))
    assert fit is not None
    assert scene.turbidity is not None
    assert abs(fit.turbidity - scene.turbidity) < 1.0
    assert fit.exposure == pytest.approx(scene.exposure, rel=0.1)


def test_a_sky_unlike_the_model_is_not_trusted() -> None:
    scene = render_panorama(0, 64, things=0)
    painted = decode(scene.picture)[::-1].copy()
    painted[:32] = np.linspace(0.8, 0.05, 32, dtype=np.float32)[:, None, None] * np.array([0.3, 0.5, 0.9], np.float32)
    fit = fit_sky(painted, sun_of(scene))
    assert fit is None or not fit.ok


def test_the_sky_mask_leaves_out_the_ground_the_sun_and_the_buildings() -> None:
    scene = render_panorama(4, 64)
    mask = sky_mask(decode(scene.picture), sun_of(scene))
    assert mask.any()
    assert not mask[32:].any()
    assert not mask[angle_between(latlong_directions(64), sun_of(scene)) < 19.0].any()


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


def test_a_given_sun_wins_over_the_found_one(tmp_path: Path) -> None:
    write_dataset(tmp_path, 1, 64)
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
    write_dataset(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    bare = Panorama("a", panorama.path, "ldr", "here", "train", sun, label=label)
    labelled = label_panorama(bare)
    assert labelled.sun_source == source
    assert math.isnan(labelled.sun_azimuth) == (source == "none")
    assert math.isnan(labelled.turbidity) == (source == "none")
    assert not math.isnan(labelled.found_azimuth)


def test_the_fit_of_an_altered_sky_is_not_trusted(tmp_path: Path) -> None:
    write_dataset(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    assert label_panorama(panorama).fit_ok
    assert not label_panorama(dataclasses.replace(panorama, notes="strong HDR tone mapping")).fit_ok


def test_agreement_counts_suns_and_overcast_skies() -> None:
    def panorama(name: str, sun: str) -> Panorama:
        return Panorama(name, Path(name), "ldr", "here", "train", sun)

    missed = dataclasses.replace(LABEL, name="b", found_azimuth=math.nan, found_elevation=math.nan)
    wrong = dataclasses.replace(LABEL, name="c", found_azimuth=170.0)
    none = dataclasses.replace(missed, name="d", sun_source="none", sun_azimuth=math.nan)
    suns = [panorama("a", "visible"), panorama("b", "visible"), panorama("c", "visible"), panorama("d", "none")]
    result = agreement(suns, [LABEL, missed, wrong, none])
    assert (result.visible, result.found, result.overcast, result.rejected) == (3, 2, 1, 1)
    assert result.gross == 0.5
    assert result.error_25 < result.error_50 < result.error_75


@pytest.mark.slow
def test_a_folder_is_labelled_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("export.data.reports.check_rendered", lambda: check_rendered(4, 32))
    write_dataset(tmp_path, 8, 64)
    run(tmp_path, tmp_path / "labels.csv", workers=2)
    labels = read_labels(tmp_path / "labels.csv")
    assert [label.name for label in labels] == [p.name for p in read_index(tmp_path)]
    assert sum(label.fit_ok for label in labels) >= 4
    printed = capsys.readouterr().out
    assert "given against found: sun found in" in printed
    assert "rendered skies: sun found in" in printed
