"""The report of detail around maps, on rendered panoramas, with features that need no ImageNet."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import read_index
from export.reports.map_detail import _choose_views, balance_detail, report_map_detail
from lighting.envmap.detail_library import LIBRARY_PATH
from lighting.model import Model


def toy_features(pictures: list[np.ndarray]) -> np.ndarray:
    return np.array([[p.mean(), p.std(), np.abs(np.diff(p, axis=0)).mean()] for p in pictures])


def test_crops_are_of_as_many_places_as_there_are(data: Path) -> None:
    panoramas = read_index(data)
    places = {p.place for p in panoramas}
    first = _choose_views(panoramas, len(places))
    assert {p.place for p in first} == places
    assert _choose_views(panoramas[::-1], 3) != []


@pytest.mark.slow
def test_the_report_has_a_row_for_each_kind_of_map_and_keeps_what_is_estimated(
    data: Path, lit_network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("export.reports.map_detail._imagenet_features", lambda: toy_features)
    monkeypatch.setattr("export.reports.map_detail.MAP_ROWS", 192)
    model = Model.load(lit_network)
    report = report_map_detail(data, model, 4, "train", tmp_path / "cache")
    for row in ("| true panorama |", "| without detail |"):
        assert report.count(row) == 2
    kept = sorted((tmp_path / "cache").glob("*.npz"))
    assert len(kept) == 4
    before = [file.stat().st_mtime_ns for file in kept]
    assert report_map_detail(data, model, 4, "train", tmp_path / "cache").split("CPU")[0] == report.split("CPU")[0]
    assert [file.stat().st_mtime_ns for file in kept] == before
    library = tmp_path / "detail.npz"
    shutil.copyfile(LIBRARY_PATH, library)
    monkeypatch.setattr("export.reports.map_detail.LIBRARY_PATH", library)
    assert balance_detail(data, model, 4, tmp_path / "cache").endswith(" of 49 panoramas suit 4 crops.")
    with np.load(library) as balanced, np.load(LIBRARY_PATH) as shipped:
        assert set(balanced) == set(shipped)
        assert (balanced["pictures"] == shipped["pictures"]).all()
        assert balanced["cost"].shape == shipped["cost"].shape
