"""Tests of pool."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import ExifTags, Image

from lighting.batch.photo_search import find_photos
from lighting.batch.pool import FOREIGN_MAP, _dismiss, _map_in_processes, _start
from lighting.cli import cli
from lighting.errors import BatchError, ModelError
from lighting.estimator import Estimator
from lighting.files.exr import read_exr
from lighting.model import Model
from lighting.photo.reader import read_photo
from lighting.record_json import record_with_coefficients
from tests.conftest import encode, scene, write_network
from tests.helpers.pool_work import ITEMS, environment, mortal, second_attempt, shout, stillborn, unable
from tests.helpers.predictions import without_probe
from tests.helpers.processes import MANY_PHOTOS, read_records, run_batch

SOME_PHOTOS = 8  # that are done when a batch is stopped


@pytest.mark.slow
def test_lines_are_those_of_estimate(photos: Path, tmp_path: Path, network: Path) -> None:
    for name in ("a.gif", "b.JXL"):
        (photos / name).touch()
    result = run_batch(photos, tmp_path / "out", "--model", network)
    assert (result.exit_code, result.stdout) == (1, "")
    failures, summary, written = result.stderr.splitlines()
    lines = tmp_path / "out" / "lighting.jsonl"
    assert written == f"Wrote {lines}." + (f" Open it: jq . {lines}" if shutil.which("jq") else "")
    assert failures == f"Photos that failed: 1; the reasons are in {tmp_path / 'out'}."
    assert re.fullmatch(r"4 done, 1 failed, 2 skipped \(1 \.gif, 1 \.jxl\); [\d.]+ photos a second\.", summary)
    found = {record.pop("file"): record for record in read_records(tmp_path / "out")}
    assert sorted(found) == find_photos(str(photos))[1]
    assert found.pop("bad.jpg")["error"].startswith("This is a text")
    estimator = Estimator(Model.load(network))
    estimates = {name: estimator(read_photo(photos / name)) for name in found}
    assert found == {
        name: {"lighting": record_with_coefficients(light.lighting, light.light_probe())}
        for name, light in estimates.items()
    }
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"batch.json", "lighting.jsonl"}


@pytest.mark.slow
def test_maps_lie_under_the_photos_own_names(photos: Path, tmp_path: Path, network: Path) -> None:
    assert (
        run_batch(photos / "**" / "a.jpg", tmp_path / "out", "--envmap", "--height", 32, "--model", network).exit_code
        == 0
    )
    assert sorted(path.name for path in tmp_path.glob("out/**/*.exr")) == ["a.jpg.exr", "a.jpg.exr"]
    for record in read_records(tmp_path / "out"):
        image, lighting = read_exr(tmp_path / "out" / f"{record['file']}.exr")
        assert image.shape == (32, 64, 3)
        assert lighting is not None
        assert record_with_coefficients(lighting) == without_probe(record["lighting"])


@pytest.mark.slow
def test_maps_take_the_options_of_render(photos: Path, tmp_path: Path, network: Path) -> None:
    options = ["--envmap", "--height", 64, "--no-sun", "--yaw", 90, "--model", network]
    assert run_batch(photos / "a.jpg", tmp_path / "out", *options).exit_code == 0
    (record,) = read_records(tmp_path / "out")
    (tmp_path / "record.json").write_text(json.dumps(record))
    arguments = [tmp_path / "record.json", "-o", tmp_path / "same.exr", "--height", 64, "--no-sun", "--yaw", 90]
    assert CliRunner().invoke(cli, ["render", *map(str, arguments)]).exit_code == 0
    same = read_exr(tmp_path / "same.exr")
    batch = read_exr(tmp_path / "out" / "a.jpg.exr")
    assert batch[1] == same[1]
    np.testing.assert_array_equal(batch[0], same[0])


@pytest.mark.slow
def test_a_name_too_long_for_its_map_fails_alone(tmp_path: Path, network: Path) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    names = ["a.jpg", "m" * 244 + ".jpg", "n" * 248 + ".jpg"]  # with .exr the second just fits a name of 255
    for name in names:
        (folder / name).write_bytes(encode(scene(64, 64)))
    result = run_batch(folder, tmp_path / "out", "--envmap", "--height", 16, "--model", network)
    assert result.exit_code == 1
    failed = {record["file"]: record.get("error") for record in read_records(tmp_path / "out")}
    assert failed == dict(zip(names, [None, None, "The photo's name is too long for a map of that name."], strict=True))
    assert len(list(tmp_path.glob("out/*.exr"))) == 2


@pytest.mark.slow
def test_a_photo_whose_map_has_the_name_of_a_folder_fails_alone(tmp_path: Path, network: Path) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    for name in ("a.jpg", "b.jpg"):
        (folder / name).write_bytes(encode(scene(64, 64)))
    (tmp_path / "out" / "a.jpg.exr").mkdir(parents=True)
    assert run_batch(folder, tmp_path / "out", "--envmap", "--height", 16, "--model", network).exit_code == 1
    failed = {record["file"]: record.get("error") for record in read_records(tmp_path / "out")}
    assert failed == {"a.jpg": "A folder in the results has the name of the photo's map.", "b.jpg": None}


@pytest.mark.slow
def test_what_failed_is_tried_again(photos: Path, tmp_path: Path, network: Path) -> None:
    arguments = (photos, tmp_path / "out", "--model", network)
    assert run_batch(*arguments).exit_code == 1
    before = read_records(tmp_path / "out")
    assert run_batch(*arguments).exit_code == 1
    assert sorted(map(str, read_records(tmp_path / "out"))) == sorted(map(str, before))
    (photos / "bad.jpg").write_bytes(encode(scene(64, 64)))
    assert run_batch(*arguments).exit_code == 0
    assert {r["file"] for r in read_records(tmp_path / "out") if "lighting" in r} == {r["file"] for r in before}
    assert len(read_records(tmp_path / "out")) == len(before)


@pytest.mark.slow
def test_what_is_known_of_all_photos_counts_and_is_kept(photos: Path, tmp_path: Path, network: Path) -> None:
    out = tmp_path / "out"
    said = (photos / "a.jpg", out, "--model", network, "--fov", 44, "--no-exif")
    assert run_batch(*said).exit_code == 0
    (record,) = read_records(out)
    assert record["lighting"]["camera"]["vertical_fov"] == 44.0
    assert json.loads((out / "batch.json").read_text())["metadata"] == {"metadata": False, "vertical_fov": 44.0}
    assert run_batch(*said[:-2], 45, "--no-exif").stderr.endswith(
        "other settings (metadata); choose another folder, or --overwrite.\n"
    )
    assert run_batch(*said[:-1], "--lat", 91, "--lon", 0).exit_code == 2


@pytest.mark.slow
def test_a_missing_network_is_one_sentence(photos: Path, tmp_path: Path) -> None:
    result = run_batch(photos, tmp_path / "out", "--model", tmp_path / "no.onnx")
    assert (result.exit_code, result.stderr) == (1, f"Error: There is no network at {tmp_path / 'no.onnx'}.\n")


@pytest.mark.slow
def test_a_damaged_network_is_one_sentence(photos: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.onnx").write_bytes(b"nonsense")
    result = run_batch(photos, tmp_path / "out", "--model", tmp_path / "bad.onnx")
    assert result.exit_code == 1
    assert "is not an ONNX network that can be read" in result.stderr
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.slow
def test_finished_photos_are_not_redone(photos: Path, tmp_path: Path, network: Path) -> None:
    assert run_batch(photos, tmp_path / "out", "--model", network).exit_code == 1
    lines = (tmp_path / "out" / "lighting.jsonl").read_bytes().splitlines(keepends=True)
    before = b"".join(line for line in lines if b'"error"' not in line)
    (photos / "new.jpg").write_bytes(encode(scene(100, 80)))
    assert run_batch(photos, tmp_path / "out", "--model", network).exit_code == 1
    after = (tmp_path / "out" / "lighting.jsonl").read_bytes()
    assert after.startswith(before)
    assert [json.loads(line)["file"] for line in after[len(before) :].splitlines()] == ["bad.jpg", "new.jpg"]


@pytest.mark.slow
def test_overwrite_starts_anew(photos: Path, tmp_path: Path, network: Path) -> None:
    assert run_batch(photos, tmp_path / "out", "--parquet", "--model", network).exit_code == 1
    (photos / "bad.jpg").unlink()
    assert run_batch(photos, tmp_path / "out", "--overwrite", "--model", network).exit_code == 0
    assert len(read_records(tmp_path / "out")) == 4
    assert not (tmp_path / "out" / "lighting.parquet").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "named"),
    [
        (["--envmap"], "maps"),
        pytest.param(["--model", "other.onnx"], "network, sha256", marks=pytest.mark.thorough),
        pytest.param(["--source"], "source", marks=pytest.mark.thorough),
    ],
)
def test_results_of_another_job_are_refused(
    photos: Path, tmp_path: Path, network: Path, change: list[str], named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_network(tmp_path / "other.onnx", bias=1.0)
    assert run_batch(photos, "out", "--model", network).exit_code == 1
    source = photos / "below" if change == ["--source"] else photos
    result = run_batch(source, "out", "--model", network, *([] if change == ["--source"] else change))
    assert result.exit_code == 1
    assert (
        result.stderr
        == f"Error: out holds results of other settings ({named}); choose another folder, or --overwrite.\n"
    )
    assert len(read_records(tmp_path / "out")) == 5


@pytest.mark.slow
def test_a_folder_without_one_photo_done_takes_other_settings(photos: Path, tmp_path: Path, network: Path) -> None:
    (tmp_path / "damaged.onnx").write_bytes(b"nonsense")
    out = tmp_path / "out"
    assert run_batch(photos, out, "--model", tmp_path / "damaged.onnx").exit_code == 1
    assert (out / "batch.json").exists()
    assert run_batch(photos / "bad.jpg", out, "--model", network).exit_code == 1
    assert [set(record) for record in read_records(out)] == [{"file", "error"}]
    assert run_batch(photos / "a.jpg", out, "--model", network, "--fov", 44).exit_code == 0
    assert [record["file"] for record in read_records(out)] == ["a.jpg"]


@pytest.mark.slow
def test_what_ray_did_is_refused(photos: Path, tmp_path: Path, network: Path) -> None:
    (tmp_path / "lighting.parquet").mkdir()
    (tmp_path / "batch.json").write_text('{"engine": "ray"}\n')
    (tmp_path / "lighting.parquet" / "part.parquet").touch()
    result = run_batch(photos / "a.jpg", tmp_path, "--model", network)
    assert result.exit_code == 1
    assert "holds results of other settings (engine, " in result.stderr


@pytest.mark.slow
def test_a_photo_of_night_failed_and_could_be_read(tmp_path: Path, network: Path) -> None:
    exif = Image.Exif()
    exif[ExifTags.IFD.Exif] = {
        ExifTags.Base.DateTimeOriginal: "2024:06:01 23:00:00",
        ExifTags.Base.OffsetTimeOriginal: "+02:00",
    }
    (tmp_path / "night.jpg").write_bytes(encode(scene(160, 120), exif=exif.tobytes()))
    out = tmp_path / "out"
    result = run_batch(tmp_path / "night.jpg", out, "--lat", 48, "--lon", 11, "--model", network)
    assert result.stderr.splitlines()[0] == f"Photos that failed: 1; the reasons are in {out}."
    assert "too dark for these skies" in read_records(out)[0]["error"]


@pytest.mark.slow
def test_a_journal_without_settings_is_refused(photos: Path, tmp_path: Path, network: Path) -> None:
    (tmp_path / "lighting.jsonl").write_text("somebody's\n")
    result = run_batch(photos, tmp_path, "--model", network)
    assert result.exit_code == 1
    assert "holds results, but no batch.json" in result.stderr
    assert (tmp_path / "lighting.jsonl").read_text() == "somebody's\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("batch.json", "no batch wrote"),
        pytest.param("lighting.parquet", "but no batch.json", marks=pytest.mark.needs("pyarrow")),
    ],
)
def test_files_of_the_user_s_are_not_replaced_unasked(
    photos: Path, tmp_path: Path, network: Path, name: str, words: str
) -> None:
    (tmp_path / name).write_text('{"mine": 1}')
    result = run_batch(photos, tmp_path, "--model", network)
    assert result.exit_code == 1
    assert words in result.stderr
    assert (tmp_path / name).read_text() == '{"mine": 1}'


@pytest.mark.slow
def test_a_file_of_the_user_s_is_no_photo_s_map(tmp_path: Path, network: Path) -> None:
    """Also with --overwrite, which discards results alone; a map of an earlier run is replaced."""
    folder, out = tmp_path / "photos", tmp_path / "out"
    folder.mkdir()
    for name in (os.fsdecode(b"caf\xe9.jpg"), "b.jpg"):
        (folder / name).write_bytes(encode(scene(64, 64)))
    options = ("--envmap", "--height", 16, "--model", network)
    assert run_batch(folder, out, *options).exit_code == 0
    assert run_batch(folder, out, *options).exit_code == 0  # both are known again
    assert "\\ud" not in (out / "lighting.jsonl").read_text()
    (out / "b.jpg.exr").write_text("mine")
    assert run_batch(folder, out, *options, "--overwrite").exit_code == 1
    errors = {record["file"]: record.get("error") for record in read_records(out)}
    assert errors == {"b.jpg": FOREIGN_MAP, "caf\\xe9.jpg": None}
    assert (out / "b.jpg.exr").read_text() == "mine"


@pytest.mark.slow
@pytest.mark.parametrize(
    "sign",
    [signal.SIGINT, *(pytest.param(s, marks=pytest.mark.thorough) for s in (signal.SIGKILL, signal.SIGTERM))],
    ids=lambda sign: sign.name,
)
def test_a_stopped_batch_goes_on(many: Path, tmp_path: Path, network: Path, sign: signal.Signals) -> None:
    """Each photo exactly once, and its map whole, whatever stopped the first run."""
    out = tmp_path / "out"
    command = [sys.executable, "-m", "lighting", "batch", many, out, "--envmap", "--height", "16", "--model", network]
    first = subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE, start_new_session=True)
    wait_for_lines(out / "lighting.jsonl", SOME_PHOTOS)
    if sign is signal.SIGINT:
        os.killpg(first.pid, sign)  # as a terminal does
    else:
        first.send_signal(sign)
    _, error = first.communicate(timeout=60)
    assert first.returncode != 0
    assert b"Traceback" not in error
    before = (out / "lighting.jsonl").read_bytes()
    assert SOME_PHOTOS <= before.count(b"\n") < MANY_PHOTOS
    second = subprocess.run(list(map(str, command)), capture_output=True, timeout=120, check=False)
    assert (second.returncode, second.stderr.count(b"\n")) == (0, 2)
    assert re.search(rf"{MANY_PHOTOS} done, 0 failed, 0 skipped; \d+ by an earlier run, ".encode(), second.stderr)
    assert (out / "lighting.jsonl").read_bytes().startswith(before[: before.rindex(b"\n") + 1])
    assert Counter(record["file"] for record in read_records(out)) == Counter(find_photos(str(many))[1])
    assert all(read_exr(out / f"{number:04}.jpg.exr")[0].shape == (16, 32, 3) for number in range(MANY_PHOTOS))


@pytest.mark.slow
def test_what_killed_runs_left_under_temporary_names_is_removed(photos: Path, tmp_path: Path, network: Path) -> None:
    out = tmp_path / "out"
    (out / "below").mkdir(parents=True)
    left = [out / f".0123456789abcdef{end}" for end in (".exr", ".json", ".jsonl")]
    for path in (*left, out / "below" / ".fedcba9876543210.exr", out / ".own.exr"):
        path.touch()
        os.utime(path, (hours_ago := time.time() - 7200, hours_ago))
    running = out / ".00112233445566aa.exr"
    running.touch()  # another command is writing it
    run_batch(photos, out, "--envmap", "--height", 16, "--model", network)
    assert {path.name for path in out.rglob(".*")} == {".own.exr", running.name}


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the workers in Linux's /proc")
def test_a_killed_worker_costs_nothing(many: Path, tmp_path: Path, network: Path) -> None:
    out = tmp_path / "out"
    command = [sys.executable, "-m", "lighting", "batch", many, out, "--workers", "2", "--model", network]
    running = subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE)
    wait_for_lines(out / "lighting.jsonl", SOME_PHOTOS)
    os.kill(workers_of(running.pid)[0], signal.SIGKILL)
    _, error = running.communicate(timeout=120)
    assert (running.returncode, error.startswith(f"{MANY_PHOTOS} done, 0 failed, 0 skipped;".encode())) == (0, True)
    assert Counter(record["file"] for record in read_records(out)) == Counter(find_photos(str(many))[1])
    assert all("lighting" in record for record in read_records(out))


def wait_for_lines(path: Path, count: int) -> None:
    end = time.monotonic() + 300
    while not path.exists() or path.read_bytes().count(b"\n") < count:
        assert time.monotonic() < end
        time.sleep(0.002)


def workers_of(pid: int) -> list[int]:
    """Processes that the pool of a process started."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(child) for child in children if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()]


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 3])
def test_each_item_once(workers: int) -> None:
    results = list(_map_in_processes(ITEMS, shout, workers))
    assert sorted(results) == sorted((item, item.upper()) for item in ITEMS)


@pytest.mark.slow
def test_nothing_to_do() -> None:
    assert list(_map_in_processes([], shout, 2)) == []


@pytest.mark.slow
def test_an_item_that_lost_its_worker_is_tried_again(tmp_path: Path) -> None:
    items = [*ITEMS[:5], "accident", *ITEMS[5:]]
    results = list(_map_in_processes(items, partial(mortal, tmp_path), 2))
    assert sorted(results) == sorted((item, item.upper()) for item in items)


@pytest.mark.slow
def test_an_item_that_always_loses_its_worker_yields_none(tmp_path: Path) -> None:
    results = list(_map_in_processes([*ITEMS, "poison"], partial(mortal, tmp_path), 2))
    assert sorted(item for item, _ in results) == sorted([*ITEMS, "poison"])
    assert [item for item, result in results if result is None] == ["poison"]


@pytest.mark.slow
def test_an_exception_ends_everything(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="It failed"):
        list(_map_in_processes(["error", *ITEMS], partial(mortal, tmp_path), 2))


@pytest.mark.slow
def test_an_exception_of_the_preparation_is_raised() -> None:
    with pytest.raises(ModelError, match="There is no network"):
        list(_map_in_processes(ITEMS, unable, 2))


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.thorough)])
def test_one_worker_that_dies_as_it_starts_costs_nothing(tmp_path: Path, workers: int) -> None:
    found = dict(_map_in_processes(ITEMS, partial(second_attempt, tmp_path), workers))
    assert found == {item: item.upper() for item in ITEMS}


@pytest.mark.slow
def test_workers_that_die_as_they_start_end_everything() -> None:
    with pytest.raises(BatchError, match="exit status 3"):
        list(_map_in_processes(ITEMS, stillborn, 1))


@pytest.mark.slow
def test_a_worker_is_never_interrupted_even_while_it_starts() -> None:
    """The shell's Ctrl-C reaches all processes; one that imported its modules then printed a traceback."""
    worker = _start(shout)
    try:
        for _ in range(20):
            os.kill(worker.process.pid or 0, signal.SIGINT)
            time.sleep(0.02)
        assert worker.connection.recv() == "ready"
    finally:
        _dismiss([worker])
    assert worker.process.exitcode == 0


@pytest.mark.slow
def test_workers_are_other_processes_with_one_thread_each() -> None:
    ((_, answer),) = _map_in_processes(["OMP_NUM_THREADS"], environment, 1)
    threads, pid = str(answer).split()
    assert threads == "1"
    assert int(pid) != os.getpid()


INTERRUPTED = """
import os, signal, threading, time
from lighting.batch.pool import _block_interrupts

leave = threading.Event()
other = threading.Thread(target=leave.wait)
other.start()
try:
    with _block_interrupts():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1.0)
        print("started", flush=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
finally:
    leave.set()
"""


@pytest.mark.slow
def test_a_process_that_starts_is_not_left_half_told() -> None:
    """Ctrl-C reached a thread of numpy's, cut the start short, and the new process printed a traceback.

    In a process of its own: what answers a signal is the whole process's, and a library may have changed it here.
    """
    first = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"  # a background job ignores it
    ended = subprocess.run([sys.executable, "-c", first + INTERRUPTED], capture_output=True, text=True, timeout=60)
    assert (ended.stdout.split(), ended.stderr) == (["started", "interrupted"], "")
