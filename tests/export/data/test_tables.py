"""CSV tables: what is written is read, and bad files are refused."""

from pathlib import Path

import pytest

from export.data.tables import DataError, read_table, write_table


def test_a_table_survives_its_file_and_makes_its_folder(tmp_path: Path) -> None:
    path = tmp_path / "new" / "table.csv"
    write_table(path, ["name", "note"], [["a", 'with, comma and "quotes"'], ["b", ""]])
    assert read_table(path, ["note"]) == [
        {"name": "a", "note": 'with, comma and "quotes"'},
        {"name": "b", "note": ""},
    ]


def test_short_rows_are_filled_and_a_byte_order_mark_is_no_part_of_a_name(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(b"\xef\xbb\xbfname,note\na\n")
    assert read_table(path, ["name"]) == [{"name": "a", "note": ""}]


def test_missing_columns_and_files_are_named(tmp_path: Path) -> None:
    write_table(tmp_path / "table.csv", ["name"], [])
    with pytest.raises(DataError, match="has no column place, split"):
        read_table(tmp_path / "table.csv", ["name", "place", "split"])
    with pytest.raises(DataError, match="cannot be read"):
        read_table(tmp_path / "none.csv")


def test_a_table_that_fails_midway_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        write_table(tmp_path / "table.csv", ["x"], ([1 / x] for x in (1, 0)))
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_missing_or_in_the_way_is_named_once(tmp_path: Path) -> None:
    missing = tmp_path / "none.csv"
    with pytest.raises(DataError) as refused:
        read_table(missing)
    assert str(refused.value) == f"{missing} cannot be read: No such file or directory."
    with pytest.raises(DataError) as refused:
        write_table(tmp_path, ["x"], [])
    assert str(refused.value).count(str(tmp_path)) == 1
