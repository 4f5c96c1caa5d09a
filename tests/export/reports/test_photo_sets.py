"""Sets of panorama photos, and what is measured on them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import Panorama, read_index, write_index
from export.reports.photo_sets import COMPARED, PHOTO_FOVS, PHOTO_OVERLAPS, _photograph_sweep, report_photo_sets
from lighting.files.deflate import encode_png
from lighting.geometry import wrap_azimuth
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
    horizontal = 2 * np.degrees(np.arctan(np.tan(np.radians(min(fov)) / 2) * 4 / 3))
    shared = 1 - steps / horizontal
    assert (shared >= PHOTO_OVERLAPS[0] - 1e-9).all()
    assert (shared <= PHOTO_OVERLAPS[1] + 1e-9).all()


def rows_of(report: str) -> dict[str, dict[str, str]]:
    """The cells of a report's tables by row and column."""
    rows, columns = {}, []
    for line in report.splitlines():
        name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        if not name and cells:
            columns = cells
        elif len(cells) == len(columns) > 1 and name != "---":
            rows[f"{name}, {columns[0]}"] = dict(zip(columns, cells, strict=True))
    return rows


def test_pairs_of_noise_are_solved_and_strangers_are_not(data: Path) -> None:
    report = report_photo_sets(data, None, ("pairs",))
    assert "## Two photos of one panorama (2 places)" in report
    row = rows_of(report)["all, solved [%]"]
    assert row["solved [%]"] == "100.00"
    assert float(row["heading, 95 %"]) < 0.5
    assert row["over 2° [% of all]"] == "0.00"
    assert "0 of 2 pairs were given a rotation" in report


def test_one_panorama_a_place(tmp_path: Path) -> None:
    panoramas = read_index(folder_of(tmp_path, 2))
    write_index([*panoramas, replace(panoramas[0], name="again")], tmp_path)
    assert "(2 places)" in report_photo_sets(tmp_path, None, ("pairs",))


def test_a_set_with_matched_headings_has_the_sun_of_true_ones(data: Path, network: Path) -> None:
    rows = rows_of(report_photo_sets(data, network, ("sets",), 1))
    registered = rows["all, connected [%]"]
    assert registered["connected [%]"] == "100.00"
    assert float(registered["95 %"]) < 1.0
    assert float(registered["field of view, 50 %"]) < 0.5
    suns = [next(row for name, row in rows.items() if name.startswith(f"{headings}, ")) for headings in COMPARED]
    assert all(0.0 <= float(row["in 50 % region [%]"]) <= float(row["in 90 % region [%]"]) <= 100.0 for row in suns)
    assert float(suns[1]["sun, 50 %"]) == pytest.approx(float(suns[2]["sun, 50 %"]), abs=2.0)


def test_the_report_is_markdown(data: Path, network: Path) -> None:
    text = report_photo_sets(data, network, ["pairs"], 2)
    assert "## Two photos of one panorama (2 places)" in text
    assert "Photos of two different places: 0 of 2" in text
