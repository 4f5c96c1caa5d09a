"""Sets of panorama photos, and what is measured on them."""

from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import Panorama, read_index, write_index
from export.reports.photo_sets import (
    COMPARED,
    PHOTO_FOVS,
    PHOTO_OVERLAPS,
    _fuse_sets,
    _horizontal_fov,
    _one_per_place,
    _pair_figures,
    _photograph_sweep,
    _register_pairs,
    _set_figures,
    _sun_figures,
    report_photo_sets,
)
from lighting.files.deflate import encode_png
from lighting.geometry import wrap_azimuth
from lighting.model import Model
from tests.helpers.cameras import texture

pytestmark = pytest.mark.needs("cv2")


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
    return read_index(data, "val")


def test_a_sweep_overlaps_as_it_says_and_is_the_same_again(panoramas: list[Panorama]) -> None:
    photos, again = (_photograph_sweep(panoramas[0], 4, "test") for _ in range(2))
    assert all((a.pixels == b.pixels).all() for a, b in zip(photos, again, strict=True))
    fov = {t.camera.vertical_fov for t in photos}
    assert len(fov) == 1
    assert PHOTO_FOVS[0] <= min(fov) <= PHOTO_FOVS[1]
    steps = np.abs(wrap_azimuth(np.diff([t.camera.azimuth for t in photos])))
    shared = 1 - steps / _horizontal_fov(min(fov))
    assert (shared >= PHOTO_OVERLAPS[0] - 1e-9).all()
    assert (shared <= PHOTO_OVERLAPS[1] + 1e-9).all()


def test_one_panorama_a_place() -> None:
    rows = [Panorama(name, Path(name), "ldr", place, "val") for name, place in (("a", "x"), ("b", "x"), ("c", "y"))]
    assert sorted(p.place for p in _one_per_place(rows)) == ["x", "y"]


def test_pairs_of_noise_are_solved_and_strangers_are_not(panoramas: list[Panorama]) -> None:
    pairs, strangers = _register_pairs(panoramas)
    row = _pair_figures(pairs)
    assert row["solved [%]"] == 100.0
    assert row["heading, 95 %"] < 0.5
    assert row["over 2° [% of all]"] == 0.0
    assert strangers == [None, None]


def test_a_set_with_matched_headings_has_the_sun_of_true_ones(panoramas: list[Panorama], network: Path) -> None:
    (photo_set,) = _fuse_sets(Model.load(network), panoramas[:1])
    assert len(photo_set.cameras) == 3
    row = _set_figures([photo_set])
    assert row["connected [%]"] == 100.0
    assert row["95 %"] < 1.0
    assert row["field of view, 50 %"] < 0.5
    rows = [_sun_figures([photo_set], headings) for headings in COMPARED]
    assert all(0.0 <= row["in 50 % region [%]"] <= row["in 90 % region [%]"] <= 100.0 for row in rows)
    assert rows[1]["sun, 50 %"] == pytest.approx(rows[2]["sun, 50 %"], abs=2.0)


def test_the_report_is_markdown(data: Path, network: Path) -> None:
    text = report_photo_sets(data, network, ["pairs"], 2)
    assert "## Two photos of one panorama (2 places)" in text
    assert "Photos of two different places: 0 of 2" in text
