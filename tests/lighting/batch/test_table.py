"""The results as Parquet."""

import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest
from pyarrow.parquet import read_table

from lighting.batch import require_parquet, write_table
from lighting.batch.table import row, schema
from lighting.errors import BatchError, MissingExtraError
from lighting.ranges import RANGES
from lighting.records import Lighting
from tests.conftest import encode, scene
from tests.lighting.batch.runners import records, run

LIGHT = Lighting(10.0, 20.0, 3.0, 1.0)


@pytest.mark.slow
def test_parquet_holds_the_same_numbers(photos: Path, tmp_path: Path, network: Path) -> None:
    assert run(photos, tmp_path / "out", "--parquet", "--model", network).exit_code == 1
    table = read_table(tmp_path / "out" / "lighting.parquet")
    assert table.column_names[:2] == ["file", "error"]
    assert set(RANGES) < set(table.column_names)
    rows = {row["file"]: row for row in table.to_pylist()}
    for record in records(tmp_path / "out"):
        row = rows.pop(record["file"])
        assert row["error"] == record.get("error")
        assert row["sun_azimuth"] == (record["lighting"]["sun"]["azimuth"] if "lighting" in record else None)
    assert rows == {}


@pytest.mark.slow
def test_a_table_that_is_there_keeps_up_with_the_results(tmp_path: Path, network: Path) -> None:
    folder, out = tmp_path / "photos", tmp_path / "out"
    folder.mkdir()
    for name, options in (("a.jpg", ["--parquet"]), ("b.jpg", [])):
        (folder / name).write_bytes(encode(scene(64, 64)))
        assert run(folder, out, *options, "--model", network).exit_code == 0
    assert read_table(out / "lighting.parquet")["file"].to_pylist() == ["a.jpg", "b.jpg"]


@pytest.mark.slow
def test_names_that_are_no_text_reach_the_table(tmp_path: Path, network: Path) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    (folder / os.fsdecode(b"caf\xe9.jpg")).write_bytes(encode(scene(64, 64)))
    assert run(folder, tmp_path / "out", "--parquet", "--model", network).exit_code == 0
    (row,) = read_table(tmp_path / "out" / "lighting.parquet").to_pylist()
    assert row["file"] == "caf\\udce9.jpg"


def test_parquet_says_what_it_needs(photos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    result = run(photos, tmp_path / "out", "--parquet")
    assert result.exit_code == 1
    assert result.stderr == "Error: Parquet needs pyarrow: pip install 'outdoor-lighting[parquet]'.\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            {"lighting": {**LIGHT.to_dict(), "sky": {"turbidity": 11, "exposure": 1.0}}},
            "sky.turbidity is 11; it must lie in",
        ),
        ({}, "The lighting record needs an object 'sun'."),
    ],
)
def test_a_line_that_cannot_be_is_named(tmp_path: Path, content: dict[str, Any], said: str) -> None:
    lines = [{"file": "a.jpg", "error": "No."}, {"file": "b.jpg", **content}]
    journal = tmp_path / "lighting.jsonl"
    journal.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8-sig")
    with pytest.raises(BatchError, match=rf"^{journal}, line 2: {said}"):
        write_table(tmp_path)
    assert list(tmp_path.iterdir()) == [journal]


def test_a_row_has_the_schemas_columns() -> None:
    columns = schema().names
    assert list(row("a.jpg", Lighting(10.0, 20.0, 3.0, 1.0))) == columns
    failed = row("b.jpg", "no photo")
    assert list(failed) == columns
    assert {name for name, value in failed.items() if value is not None} == {"file", "error"}


def test_the_lack_of_pyarrow_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"^Parquet needs pyarrow: pip install"):
        require_parquet(Path())


def test_the_strength_of_the_light_has_columns_of_its_own() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    light = Lighting(0.0, 30.0, 3.0, 1.0, sun_irradiance=(3.0, 2.0, 1.0), sky_irradiance=(0.4, 0.5, 0.8), suitable=0.9)
    table = pyarrow.Table.from_pylist([row("a.jpg", light), row("b.jpg", "It is damaged.")], schema())
    assert table["sun_irradiance"].to_pylist() == [[3.0, 2.0, 1.0], None]
    assert table["sky_model"].to_pylist() == ["hosek-wilkie", None]
    assert (table["suitable"].to_pylist(), table["sky_cover"].to_pylist()) == ([0.9, None], [None, None])
