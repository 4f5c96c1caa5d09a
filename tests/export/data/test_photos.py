"""The table of photos to learn from."""

import math
from pathlib import Path

import pytest

from export.data.panoramas import DataError
from export.data.photos import COLUMNS, PHOTOS, read_photo_rows, require_photo_rows


def table(folder: Path, *rows: str) -> None:
    (folder / PHOTOS).write_text("\n".join([",".join(COLUMNS), *rows]) + "\n", encoding="utf-8")
    (folder / "a.jpg").write_bytes(b"")


def test_rows_keep_what_they_know(tmp_path: Path) -> None:
    table(tmp_path, "a.jpg,x_1,-35.9,51.2,yes,53.1,15", "a.jpg,x_2,,4.0,unclear,,")
    one, other = read_photo_rows(tmp_path)
    assert (one.sun_azimuth, one.sun_elevation, one.direct, one.azimuth_std) == (-35.9, 51.2, "yes", 15.0)
    assert math.isnan(other.sun_azimuth)
    assert math.isnan(other.horizontal_fov)
    assert other.direct == ""


def test_a_folder_without_the_table_has_no_photos(tmp_path: Path) -> None:
    assert read_photo_rows(tmp_path) == []


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("a.jpg,x,1,,yes,50,15", "sun_elevation is empty"),
        ("b.jpg,x,1,2,yes,50,15", "no photo"),
        ("a.jpg,x,w,2,,,", "'w'"),
    ],
)
def test_a_row_that_cannot_be_used_is_named(tmp_path: Path, row: str, words: str) -> None:
    table(tmp_path, row)
    with pytest.raises(DataError, match=f"line 2: .*{words}"):
        read_photo_rows(tmp_path)


def test_photos_that_are_needed_are_there_and_permissive_where_that_is_asked(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"There is no photo to learn from in .*photos_train\.csv\.$"):
        require_photo_rows(tmp_path)
    table(tmp_path, "a.jpg,x_1,1,2,yes,50,15")
    assert len(require_photo_rows(tmp_path)) == 1
    with pytest.raises(DataError, match="no photo with a permissive licence"):
        require_photo_rows(tmp_path, licensed_only=True)
    lines = [",".join([*COLUMNS, "licence"])]
    lines += [f"a.jpg,{licence},1,2,yes,50,15,{licence}" for licence in ("none stated", "GPL", "CC-BY 4.0", "")]
    (tmp_path / PHOTOS).write_text("\n".join(lines), encoding="utf-8")
    assert [row.group for row in require_photo_rows(tmp_path, licensed_only=True)] == ["CC-BY 4.0"]
    assert len(require_photo_rows(tmp_path)) == 4
