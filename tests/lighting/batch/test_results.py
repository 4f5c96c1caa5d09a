"""Tests of results."""

import json
import os
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from pyarrow.parquet import read_table

from lighting.batch.job import BatchJob
from lighting.batch.ray import PhotoActor, _filesystem_at, _open_results
from lighting.batch.results import open_journal, read_answers, require_parquet, table_row, table_schema, write_parquet
from lighting.errors import BatchError, MissingExtraError
from lighting.fields import RANGES
from lighting.records import Lighting
from tests.conftest import encode, munich, scene
from tests.helpers.processes import read_records, run_batch

FAILED = json.dumps({"file": "c.jpg", "error": "No."})
LINES = [json.dumps({"file": name, "lighting": {}}) for name in ("a.jpg", "b/ä.jpg")]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "lighting.jsonl"


def fill(path: Path) -> bytes:
    with open_journal(path) as journal:
        journal.append("a.jpg", LINES[0], failed=False)
        journal.append("b/ä.jpg", LINES[1], failed=False)
    return path.read_bytes()


def files_in(path: Path) -> list[str]:
    """The photos that a journal names."""
    return [json.loads(line)["file"] for line in path.read_text(encoding="utf-8").splitlines()]


def test_lines_are_there_as_soon_as_they_are_appended(path: Path) -> None:
    with open_journal(path) as journal:
        journal.append("a.jpg", LINES[0], failed=False)
        assert path.read_text() == LINES[0] + "\n"
        assert journal.names == {"a.jpg"}


def test_what_is_done_is_known_again(path: Path) -> None:
    fill(path)
    with open_journal(path) as journal:
        journal.append("c.jpg", FAILED, failed=True)
        assert journal.names == {"a.jpg", "b/ä.jpg", "c.jpg"}
        assert journal.failed == 1
    assert files_in(path) == [
        "a.jpg",
        "b/ä.jpg",
        "c.jpg",
    ]


def test_what_failed_is_forgotten_and_tried_again(path: Path) -> None:
    with open_journal(path) as journal:
        journal.append("c.jpg", FAILED, failed=True)
    whole = fill(path)
    assert whole == f"{LINES[0]}\n{LINES[1]}\n".encode()
    with open_journal(path) as journal:
        journal.append("c.jpg", FAILED, failed=True)
    with open_journal(path) as journal:
        assert (journal.names, journal.failed) == ({"a.jpg", "b/ä.jpg"}, 0)
        assert path.read_bytes() == whole
        with pytest.raises(BatchError, match="Another batch"), open_journal(path):
            pass
        journal.append("c.jpg", json.dumps({"file": "c.jpg", "lighting": {}}), failed=False)
    assert files_in(path) == [
        "a.jpg",
        "b/ä.jpg",
        "c.jpg",
    ]
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_photo_that_failed_before_it_was_done_is_done(path: Path) -> None:
    """Such journals are put together by hand; the answer was thrown away with the failure."""
    done = json.dumps({"file": "c.jpg", "lighting": {}})
    path.write_text(f"{FAILED}\n{done}\n{LINES[0]}\n")
    with open_journal(path) as journal:
        assert (journal.names, journal.failed) == ({"c.jpg", "a.jpg"}, 0)
    assert path.read_text() == f"{done}\n{LINES[0]}\n"


def test_a_line_cut_anywhere_is_not_done(path: Path) -> None:
    whole = fill(path)
    first = len(LINES[0]) + 1
    for end in range(first, len(whole)):
        path.write_bytes(whole[:end])
        with open_journal(path) as journal:
            assert journal.names == {"a.jpg"}
            journal.append("b/ä.jpg", LINES[1], failed=False)
        assert path.read_bytes() == whole


@pytest.mark.parametrize(
    "tail", [b"\0" * 512, b"nonsense\n", b"[]\n", b'{"lighting": {}}\n', b'{"file": 3}\n', b"\xff\n"]
)
def test_a_damaged_tail_is_cut_off(path: Path, tail: bytes) -> None:
    whole = fill(path)
    path.write_bytes(whole + tail + whole)
    with open_journal(path) as journal:
        assert len(journal.names) == 2
    assert path.read_bytes() == whole


@pytest.mark.parametrize("damage", [b"\n", b"\0\0\n", b'{"file": "a.j\n', b"\xff\n"])
def test_what_stands_behind_a_damaged_line_is_not_lost(path: Path, damage: bytes) -> None:
    """A blank line from an editor, or a block of zeros after a power cut, cost all results behind it."""
    first, second = fill(path).splitlines(keepends=True)
    path.write_bytes(first + damage + second)
    with open_journal(path) as journal:
        assert journal.names == {"a.jpg", "b/ä.jpg"}
        assert path.read_bytes() == first + second
        journal.append("c.jpg", LINES[0].replace("a.jpg", "c.jpg"), failed=False)
    assert files_in(path) == [
        "a.jpg",
        "b/ä.jpg",
        "c.jpg",
    ]


def test_what_somebody_wrote_into_a_journal_is_kept_aside(path: Path) -> None:
    first, second = fill(path).splitlines(keepends=True)
    again = json.dumps({"file": "a.jpg", "lighting": {"mine": 1}}).encode() + b"\n"
    foreign = [
        *(b"# seen with Anna\n", again, b'{"file": "c.jpg", "lighting": []}\n', b'{"file": "d.jpg", "error": 5}\n'),
        b"[" * 60_000 + b"\n",
    ]
    path.write_bytes(first + b"".join(foreign) + second + b"\n")
    with open_journal(path) as journal:
        assert journal.names == {"a.jpg", "b/ä.jpg"}
    assert path.read_bytes() == first + second
    removed = path.with_name("lighting.jsonl.removed")
    assert removed.read_bytes() == b"".join(foreign)
    path.write_bytes(first + b"more\n")
    with open_journal(path):
        pass
    assert removed.read_bytes() == b"".join(foreign) + b"more\n"


def test_names_with_half_a_character_are_known_again(path: Path) -> None:
    """As earlier versions wrote them, and as somebody may."""
    path.write_text('{"file": "caf\\udce9.jpg", "lighting": {}}\n{"file": "a\\ud800.jpg", "lighting": {}}\n')
    with open_journal(path) as journal:
        assert journal.names == {"caf\\xe9.jpg", "a\\ud800.jpg"}


@pytest.mark.parametrize("share", ["0.5", [], "x", 2, -1, {"a": 1}])
def test_a_share_that_somebody_edited_is_named(path: Path, share: object) -> None:
    edited = {"file": "b.jpg", "lighting": LIGHT.to_dict() | {"suitable": share}}
    path.write_text("".join(f"{json.dumps(line)}\n" for line in ({"file": "a.jpg", "error": "gone"}, edited)))
    with pytest.raises(BatchError, match="line 2: suitable "):
        list(read_answers(path))


def test_clear_forgets_everything(path: Path) -> None:
    fill(path)
    with open_journal(path) as journal:
        journal.clear()
        assert (journal.names, journal.failed, path.read_bytes()) == (set(), 0, b"")
        journal.append("b/ä.jpg", LINES[1], failed=True)
    assert path.read_text() == LINES[1] + "\n"


def test_only_one_batch_at_a_time(path: Path) -> None:
    fill(path)
    with open_journal(path), pytest.raises(BatchError, match="Another batch"), open_journal(path):
        pass
    with open_journal(path) as journal:
        assert len(journal.names) == 2


LIGHT = Lighting(10.0, 20.0, 3.0, 1.0)


@pytest.mark.slow
def test_parquet_holds_the_same_numbers(photos: Path, tmp_path: Path, network: Path) -> None:
    assert run_batch(photos, tmp_path / "out", "--parquet", "--model", network).exit_code == 1
    table = read_table(tmp_path / "out" / "lighting.parquet")
    assert table.column_names[:2] == ["file", "error"]
    assert set(RANGES) < set(table.column_names)
    rows = {row["file"]: row for row in table.to_pylist()}
    for record in read_records(tmp_path / "out"):
        row = rows.pop(record["file"])
        assert row["error"] == record.get("error")
        assert row["sun_azimuth"] == (record["lighting"]["sun"]["azimuth"] if "lighting" in record else None)
        assert row["light_probe"] == (record["lighting"]["light_probe"] if "lighting" in record else None)
    assert rows == {}


@pytest.mark.slow
def test_a_table_that_is_there_keeps_up_with_the_results(tmp_path: Path, network: Path) -> None:
    folder, out = tmp_path / "photos", tmp_path / "out"
    folder.mkdir()
    for name, options in (("a.jpg", ["--parquet"]), ("b.jpg", [])):
        (folder / name).write_bytes(encode(scene(64, 64)))
        assert run_batch(folder, out, *options, "--model", network).exit_code == 0
    assert read_table(out / "lighting.parquet")["file"].to_pylist() == ["a.jpg", "b.jpg"]


@pytest.mark.slow
def test_names_that_are_no_text_reach_the_table(tmp_path: Path, network: Path) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    (folder / os.fsdecode(b"caf\xe9.jpg")).write_bytes(encode(scene(64, 64)))
    assert run_batch(folder, tmp_path / "out", "--parquet", "--model", network).exit_code == 0
    (row,) = read_table(tmp_path / "out" / "lighting.parquet").to_pylist()
    assert row["file"] == "caf\\xe9.jpg"


@pytest.mark.slow
def test_parquet_holds_when_a_photo_was_taken(tmp_path: Path, network: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "phone.jpg").write_bytes(encode(scene(64, 64), exif=munich()))
    assert run_batch(tmp_path / "photos", tmp_path / "out", "--parquet", "--model", network).exit_code == 0
    (row,) = read_table(tmp_path / "out" / "lighting.parquet").to_pylist()
    assert row["utc_time"] == datetime(2024, 6, 1, 7, 10, tzinfo=UTC)
    assert (row["utc_offset"], row["time_source"]) == (2.0, "offset in the file")


def test_parquet_says_what_it_needs(photos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    result = run_batch(photos, tmp_path / "out", "--parquet")
    assert result.exit_code == 1
    assert result.stderr == "Error: Parquet needs pyarrow: pip install 'outdoor-lighting[all]'.\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            {"lighting": {**LIGHT.to_dict(), "sky": {"turbidity": 11, "exposure": 1.0}}},
            "sky.turbidity is 11; it must lie in",
        ),
        ({}, "The lighting record needs an object 'sun'."),
        (
            {"lighting": {**LIGHT.to_dict(), "light_probe": {"coefficients": "none"}}},
            "light_probe is not what a",
        ),
        ({"lighting": LIGHT.to_dict(), "crop": [1, 2]}, "crop is not what a batch writes"),
    ],
)
def test_a_line_that_cannot_be_is_named(tmp_path: Path, content: dict[str, Any], said: str) -> None:
    lines = [{"file": "a.jpg", "error": "No."}, {"file": "b.jpg", **content}]
    journal = tmp_path / "lighting.jsonl"
    journal.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8-sig")
    with pytest.raises(BatchError, match=rf"^{journal}, line 2: {said}"):
        write_parquet(tmp_path)
    assert list(tmp_path.iterdir()) == [journal]


def test_a_row_has_the_schemas_columns() -> None:
    columns = table_schema().names
    assert list(table_row("a.jpg", Lighting(10.0, 20.0, 3.0, 1.0))) == columns
    failed = table_row("b.jpg", "no photo")
    assert list(failed) == columns
    assert {name for name, value in failed.items() if value is not None} == {"file", "error"}


def test_the_lack_of_pyarrow_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"^Parquet needs pyarrow: pip install"):
        require_parquet(Path())


def test_the_strength_of_the_light_has_columns_of_its_own() -> None:
    import pyarrow

    light = Lighting(0.0, 30.0, 3.0, 1.0, sun_irradiance=(3.0, 2.0, 1.0), sky_irradiance=(0.4, 0.5, 0.8), suitable=0.9)
    table = pyarrow.Table.from_pylist([table_row("a.jpg", light), table_row("b.jpg", "It is damaged.")], table_schema())
    assert table["sun_irradiance"].to_pylist() == [[3.0, 2.0, 1.0], None]
    assert table["sky_model"].to_pylist() == ["hosek-wilkie", None]
    assert (table["suitable"].to_pylist(), table["sky_cover"].to_pylist()) == ([0.9, None], [None, None])


@pytest.fixture
def ray_job(tmp_path: Path, network: Path) -> BatchJob:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "batch.json").write_text('{"engine": "pool"}\n')
    return BatchJob(str(tmp_path), str(tmp_path / "out"), str(network), engine="ray")


@pytest.mark.parametrize(
    ("name", "content", "refused"),
    [
        ("lighting.jsonl", '{"file": "a.jpg", "error": "No."}\n', False),
        ("lighting.jsonl", '{"file": "a.jpg", "lighting": {}}\n', True),
        ("lighting.parquet/part.parquet", "", True),
        ("lighting.parquet", "", True),
    ],
)
def test_results_of_other_settings_are_refused_on_ray(
    ray_job: BatchJob, name: str, content: str, refused: bool
) -> None:
    file = Path(ray_job.out, name)
    file.parent.mkdir(exist_ok=True)
    file.write_text(content)
    if refused:
        with pytest.raises(BatchError, match="other settings"):
            _open_results(*_filesystem_at(ray_job.out), ray_job, overwrite=False)
    else:
        _open_results(*_filesystem_at(ray_job.out), ray_job, overwrite=False)
        assert '"engine": "ray"' in Path(ray_job.out, "batch.json").read_text()
    assert file.read_text() == content


@pytest.mark.needs("pyarrow")
def test_an_actor_of_ray_reads_sidecars_and_makes_rows_of_texts(tmp_path: Path, network: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(encode(scene(320, 240)))
    taken = {"photoTakenTime": {"timestamp": "1717253400"}, "geoData": {"latitude": 48.1, "longitude": 11.6}}
    (tmp_path / "a.jpg.supplemental-metadata.json").write_text(json.dumps(taken))
    actor = PhotoActor(BatchJob(str(tmp_path), str(tmp_path / "out"), str(network), engine="ray"))
    row = actor({"path": str(tmp_path.resolve() / "a.jpg"), "bytes": (tmp_path / "a.jpg").read_bytes()})
    assert row["error"] is None
    assert row["utc_time"].startswith("2024-06-01T14:50:00")
    assert list(row) == table_schema().names
    assert len(row["light_probe"]["coefficients"]) == 9
