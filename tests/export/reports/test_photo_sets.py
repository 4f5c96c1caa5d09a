"""Sets of panorama photos, and what is measured on them."""

from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import Panorama, write_index
from export.reports.multi_view import fuse_sets, set_figures, set_sun_figures
from export.reports.photo_sets import PhotoSetOptions, _rows, report_photo_sets
from export.reports.registration import (
    PHOTO_FOVS,
    SWEEP_OVERLAPS,
    _sweep_width,
    match_sweeps,
    match_zooms,
    one_panorama_per_place,
    pair_figures,
    photograph_sweep,
    split_by_overlap,
)
from lighting.files.atomic import encode_png
from lighting.geometry import wrap_azimuth
from lighting.model import Model
from tests.helpers.cameras import texture

pytest.importorskip("cv2")


def folder_of(path: Path, places: int) -> Path:
    """A folder of noise panoramas, each a place of its own with a sun."""
    rows = []
    for number in range(places):
        (path / f"{number}.png").write_bytes(encode_png(texture(number).astype(np.uint8)))
        file = (path / f"{number}.png").resolve()
        rows.append(Panorama(f"p{number}", file, "ldr", f"place{number}", "val", "visible", 30.0, 40.0, 2.0))
    write_index(rows, path)
    return path


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return folder_of(tmp_path_factory.mktemp("panoramas"), 2)


@pytest.fixture(scope="module")
def panoramas(data: Path) -> list[Panorama]:
    return _rows(data, "val", None)


def test_a_sweep_overlaps_as_it_says_and_is_the_same_again(panoramas: list[Panorama]) -> None:
    taken, again = (photograph_sweep(panoramas[0], 4, "test") for _ in range(2))
    assert all((a.pixels == b.pixels).all() for a, b in zip(taken, again, strict=True))
    fov = {t.camera.vertical_fov for t in taken}
    assert len(fov) == 1
    assert PHOTO_FOVS[0] <= min(fov) <= PHOTO_FOVS[1]
    steps = np.abs(wrap_azimuth(np.diff([t.camera.azimuth for t in taken])))
    shared = 1 - steps / _sweep_width(min(fov))
    assert (shared >= SWEEP_OVERLAPS[0] - 1e-9).all()
    assert (shared <= SWEEP_OVERLAPS[1] + 1e-9).all()


def test_one_panorama_a_place() -> None:
    rows = [Panorama(name, Path(name), "ldr", place, "val") for name, place in (("a", "x"), ("b", "x"), ("c", "y"))]
    assert sorted(p.place for p in one_panorama_per_place(rows)) == ["x", "y"]


def test_pairs_of_noise_are_solved_and_strangers_are_not(panoramas: list[Panorama]) -> None:
    answers, strangers = match_sweeps(panoramas)
    row = pair_figures(answers)
    assert row["solved [%]"] == 100.0
    assert row["heading, 95 %"] < 0.5
    assert strangers == [None, None]
    assert sum(len(part) for part in split_by_overlap(answers).values()) == 2


def test_zoomed_photos_of_noise_are_solved_with_both_lenses(panoramas: list[Panorama]) -> None:
    answers = list(match_zooms(panoramas))
    assert all(a.turn is not None and a.turn.zoomed and a.heading_error < 0.5 for a in answers)
    assert pair_figures(answers)["field of view, 95 %"] < 1.0


def test_a_set_with_matched_headings_has_the_sun_of_true_ones(panoramas: list[Panorama], network: Path) -> None:
    found = fuse_sets(Model.load(network), panoramas[:1])
    row = set_figures(found)
    assert row["connected [%]"] == 100.0
    assert row["95 %"] < 1.0
    assert row["field of view, 50 %"] < 0.5
    assert row["photos"] == 3.0
    assert set(set_sun_figures(found)) == {"headings unknown", "headings by matches", "true headings"}


def test_the_report_is_markdown(data: Path) -> None:
    text = report_photo_sets(PhotoSetOptions(data, ["pairs"], count=2))
    assert "## Two photos of one panorama (2 places)" in text
    assert "Photos of two different places: 0 of 2" in text


def test_only_the_last_rows_of_unseen_places(data: Path) -> None:
    assert [p.name for p in _rows(data, "val", 1)] == ["p1"]
