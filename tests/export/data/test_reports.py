"""Labels against what is known."""

import dataclasses
import math
from pathlib import Path

import pytest

from export.data.labels import Label, read_labels
from export.data.panoramas import Panorama, read_index
from export.data.reports import agreement, check_rendered, run
from export.data.synthetic import write_dataset

LABEL = Label("a", -12.5, 40.0, 2.0, "given", -12.0, 41.0, 3.2, 5.1, 0.12, True, "yes")


@pytest.mark.slow
def test_rendered_skies_are_labelled_well() -> None:
    check = check_rendered(60)
    assert check.rendered > 50
    assert check.found > 0.85 * check.rendered
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
    assert "found suns against given ones: sun found in" in printed
    assert "rendered skies: sun found in" in printed
