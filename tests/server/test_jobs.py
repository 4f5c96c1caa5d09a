"""Long jobs over HTTP: submitted, watched, taken, deleted, within shares and bounds, and across a restart."""

import errno
import io
import json
import shutil
import sqlite3
import time
import zipfile
from collections.abc import Iterator
from contextlib import AsyncExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from unittest.mock import Mock
from urllib.parse import urljoin

import anyio
import numpy as np
import pytest
from PIL import Image
from starlette.testclient import TestClient

from lighting.errors import LightingError
from lighting.estimator import Estimator
from lighting.files.exr import read_exr
from lighting.runtime import start_python
from lighting.stereo.light_vectors import clear_skies
from lighting.stereo.normal_search import Pose
from server import job_kinds, jobs
from server.app import create_app
from server.job_kinds import MAX_FILES, RESULT_FILE
from server.job_store import JOBS_FOLDER, RESULT_SECONDS, JobState, JobStore, StoredJob
from server.limits import Client, client_of_address
from server.problems import BUSY, SHARE_TAKEN
from server.request_body import RequestBody
from server.settings import Settings, SettingsError
from tests.conftest import encode, scene
from tests.helpers.clips import pan, write_clip
from tests.helpers.photos import write_png16
from tests.helpers.skies import JUNE, ball, june_suns, photos
from tests.server.conftest import pack, problem, refused, wait

HOST = client_of_address("192.0.2.1")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "jobs"
    path.mkdir()
    return path


@pytest.fixture
def client(estimator: Estimator, network: Path, folder: Path) -> Iterator[TestClient]:
    app = create_app(Settings(jobs_folder=folder, model=network), estimator)
    with TestClient(app, raise_server_exceptions=False) as client:
        yield client


def submit(client: TestClient, upload: bytes, name: str = "p.zip", **fields: Any) -> Any:
    return client.post("/v1/jobs", data=fields, files={"file": (name, upload)})


@pytest.mark.slow
def test_photos_become_a_zip_that_is_kept_until_it_is_deleted(client: TestClient, folder: Path) -> None:
    upload = pack(**{"day/a.jpg": encode(scene(64, 48)), "day/b.jpg": encode(scene(48, 64)), "day/c.jpg": b"no photo"})
    answer = submit(client, upload, kind="photos", envmap="true", height=16, sun="40,25")
    assert answer.status_code == 202, answer.text
    address = urljoin("/v1/jobs", answer.headers["location"])
    assert answer.json()["links"] == {"self": answer.headers["location"]}
    assert problem(client.get(f"{address}/result"), 409, "no-result")["detail"].startswith("The job is ")
    record = wait(client, address)
    assert (record["state"], record["progress"], record["kind"]) == ("finished", 1.0, "photos")
    assert record["warnings"] == ["1 of 3 photos cannot be read; lighting.jsonl says why."]
    result = client.get(urljoin("/v1/jobs/", record["links"]["result"]))
    assert (result.status_code, result.headers["content-type"]) == (200, "application/zip")
    with zipfile.ZipFile(io.BytesIO(result.content)) as archive:
        assert {"lighting.jsonl", "day/a.jpg.exr", "day/b.jpg.exr"} <= set(archive.namelist())
        lines = [json.loads(line) for line in archive.read("lighting.jsonl").splitlines()]
        _, light = read_exr(archive.extract("day/a.jpg.exr", folder.parent))
    assert light
    assert (light.sun_azimuth, light.sun_elevation) == (40.0, 25.0)
    assert sorted(line["file"] for line in lines) == ["day/a.jpg", "day/b.jpg", "day/c.jpg"]
    assert sum("lighting" in line for line in lines) == 2
    assert names_in(folder / JOBS_FOLDER / record["id"]) == {RESULT_FILE, "job.json"}  # the upload is gone
    assert client.delete(address).status_code == 204
    assert not (folder / JOBS_FOLDER / record["id"]).exists()
    for path in (address, f"{address}/result"):
        problem(client.get(path), 404, "unknown-job")
    problem(client.delete(address), 404, "unknown-job")


@pytest.mark.slow
def test_a_clip_becomes_records_and_a_map(client: TestClient, tmp_path: Path) -> None:
    write_clip(clip := tmp_path / "clip.mp4", pan(8))
    record = wait(client, submit(client, clip.read_bytes(), "clip.mp4", kind="video", height=16).headers["location"])
    assert record["state"] == "finished", record
    with zipfile.ZipFile(io.BytesIO(client.get(urljoin("/v1/jobs/", record["links"]["result"])).content)) as archive:
        assert set(archive.namelist()) == {"lighting.jsonl", "shot-1.exr"}
        assert json.loads(archive.read("lighting.jsonl").splitlines()[0])["file"] == "upload.mp4"  # no folder's name


@pytest.mark.slow
def test_the_photos_of_a_day_become_normals(client: TestClient, tmp_path: Path) -> None:
    normals, mask, _ = ball()
    images = photos(normals, mask, clear_skies(june_suns()), Pose(heading=20.0))
    for index, image in enumerate(images):
        write_png16(tmp_path / f"{index}.png", np.rint(65535 * np.clip(image, 0, 1)).astype(np.uint16))
    Image.fromarray((255 * mask).astype(np.uint8)).save(tmp_path / "mask.png")
    files = {f"day/{path.name}": path.read_bytes() for path in tmp_path.glob("*.png")}
    rows = "".join(f"{index}.png,{time}+00:00\n" for index, time in enumerate(JUNE))
    upload = pack(**files, **{"day/times.csv": f"file,time\n{rows}".encode()})
    answer = submit(client, upload, kind="normals", latitude=47, longitude=0, heading=20)
    record = wait(client, answer.headers["location"])
    assert record["state"] == "finished", record
    with zipfile.ZipFile(io.BytesIO(client.get(urljoin("/v1/jobs/", record["links"]["result"])).content)) as archive:
        assert {"normals_camera.png", "mesh.ply", "normals.json"} <= set(archive.namelist())
        assert abs(json.loads(archive.read("normals.json"))["turbidity"] - 3) < 0.5  # of the sky that was drawn


@pytest.mark.slow
def test_a_job_at_work_waits_for_the_next_start_when_the_service_shuts_down(
    estimator: Estimator, network: Path, folder: Path, tmp_path: Path
) -> None:
    write_clip(clip := tmp_path / "clip.mp4", pan(45))
    settings = Settings(jobs_folder=folder, model=network)
    with TestClient(create_app(settings, estimator), raise_server_exceptions=False) as client:
        address = urljoin(
            "/v1/jobs", submit(client, clip.read_bytes(), "a.mp4", kind="video", height=16).headers["location"]
        )
        while client.get(address).json()["state"] == "queued":
            time.sleep(0.05)
    (record,) = folder.glob("*/*/job.json")
    assert (json.loads(record.read_text())["state"], json.loads(record.read_text())["attempts"]) == ("queued", 0)
    with TestClient(create_app(settings, estimator), raise_server_exceptions=False) as client:
        assert wait(client, address)["state"] == "finished"


@pytest.mark.slow
def test_what_cannot_be_done_is_told_in_a_sentence(client: TestClient, folder: Path) -> None:
    refused = {
        "The upload is no ZIP that can be read.": submit(client, b"text", kind="photos"),
        "photo": submit(client, pack(**{"a.txt": b"text"}), kind="photos"),
        "clip": client.post("/v1/jobs?kind=video", content=b"text", headers={"Content-Type": "video/mp4"}),
        "photos": submit(client, pack(**{"a.jpg": encode(scene(64, 48))}), kind="normals", heading=10),
    }
    for words, answer in refused.items():
        record = wait(client, answer.headers["location"])
        assert record["state"] == "failed"
        assert words in record["error"]
        assert "Traceback" not in record["error"]
        assert str(folder) not in record["error"]
        assert record["code"]
        assert names_in(folder / JOBS_FOLDER / record["id"]) == {"job.json"}
        assert (
            problem(client.get(f"{urljoin('/v1/jobs', answer.headers['location'])}/result"), 409, "no-result")["detail"]
            == record["error"]
        )


def test_what_a_request_may_ask_is_checked_before_it_is_a_job(client: TestClient, folder: Path) -> None:
    upload = pack(a=b"")
    for fields, field, words in (
        ({}, "kind", "is missing; it is one of video, photos, normals"),
        ({"kind": "videos"}, "kind", "did you mean video?"),
        ({"kind": "photos", "every": "1"}, "every", "goes with kind=video"),
        ({"kind": "normals", "time": "2024-06-01T12:00Z"}, "time", "goes with kind=video"),
        ({"kind": "photos", "height": "15"}, "height", "16"),
        ({"kind": "photos", "exposure": "1"}, "exposure", "goes with envmap=true"),
        ({"kind": "photos", "detail": "false"}, "around", "goes with envmap=true"),
        ({"kind": "normals", "detail": "false"}, "around", "goes with kind=video or photos"),
        ({"kind": "normals", "sun": "40,25"}, "sun", "goes with kind=video or photos"),
    ):
        (error,) = problem(submit(client, upload, **fields), 422, "invalid")["errors"]
        assert error["field"] == field
        assert words in error["detail"]
    problem(
        client.post("/v1/jobs?kind=photos", content=b"x", headers={"Content-Type": "image/jpeg"}),
        415,
        "unsupported-type",
    )
    (error,) = problem(client.post("/v1/jobs?kind=photos", files={"photo": ("p", upload)}), 422, "invalid")["errors"]
    assert error["field"] == "photo"
    assert names_in(folder / JOBS_FOLDER) == {"lock"}


def test_an_upload_has_half_of_a_jobs_bytes(estimator: Estimator, folder: Path) -> None:
    app = create_app(Settings(jobs_folder=folder, job_bytes=2000), estimator)
    with TestClient(app, raise_server_exceptions=False) as client:
        problem(submit(client, bytes(1001), kind="photos"), 413, "too-large")
    assert names_in(folder / JOBS_FOLDER) == {"lock"}


def test_a_full_disk_is_told_and_leaves_nothing(
    client: TestClient, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(RequestBody, "save", fail)
    assert problem(submit(client, b"x", kind="photos"), 503, "busy")["detail"] == "The disk for jobs is full."
    assert names_in(folder / JOBS_FOLDER) == {"lock"}


def test_without_a_folder_there_are_no_jobs(estimator: Estimator) -> None:
    with TestClient(create_app(Settings(), estimator), raise_server_exceptions=False) as client:
        for answer in (submit(client, b"", kind="photos"), client.get("/v1/jobs/x"), client.delete("/v1/jobs/x")):
            assert "LIGHTING_JOBS_FOLDER" in problem(answer, 404, "not-found")["detail"]
        assert client.get("/v1/model").json()["jobs"] is False


def submit_to(store: JobStore, client: Client = HOST) -> str:
    """A queued job with its upload."""
    return anyio.run(_submit_to, store, client)


async def _submit_to(store: JobStore, client: Client) -> str:
    async with store.reserve_place(client) as number:
        (store.work_folder(number) / "upload").write_bytes(b"x")
        await store.add(StoredJob(number, client, {"kind": "photos", "upload": "upload"}))
    return number


def end(store: JobStore, number: str, **how: Any) -> None:
    """Let a job end: with a result, unless there is an error."""

    async def work() -> None:
        await store.begin(store.find(number) or pytest.fail("gone"))
        (store.work_folder(number) / RESULT_FILE).write_bytes(b"result")
        assert await store.take_result(number)
        await store.end(number, **how)

    anyio.run(work)


@pytest.fixture
def store(folder: Path) -> Iterator[JobStore]:
    store = JobStore(folder, places=8)
    yield store
    store.close()


def host(number: int) -> Client:
    return client_of_address(f"192.0.2.{number}")


def test_places_have_shares(store: JobStore) -> None:
    first, second = submit_to(store), submit_to(store)
    with refused(SHARE_TAKEN):
        submit_to(store)
    end(store, first, error="It failed.")
    third = submit_to(store)  # to which the one that failed gives way
    assert [job.id for job in store.all_jobs()] == [second, third]
    end(store, second)
    with refused(SHARE_TAKEN):
        submit_to(store)  # a result is not lost to its own client's next job
    assert not list(store.folder.glob(f"{first}*"))


def test_uploads_that_arrive_count_each(store: JobStore) -> None:
    async def work() -> list[str]:
        async with AsyncExitStack() as stack:
            numbers = [await stack.enter_async_context(store.reserve_place(HOST)) for _ in range(2)]
            with refused(SHARE_TAKEN):
                await stack.enter_async_context(store.reserve_place(HOST))
            await stack.enter_async_context(store.reserve_place(host(2)))
        return numbers

    numbers = anyio.run(work)
    assert not any(store.path(number).exists() for number in numbers)  # nothing came of them
    submit_to(store)


def test_who_has_most_makes_room(store: JobStore) -> None:
    site = [client_of_address(f"2001:db8:0:{number}00::1") for number in range(6)]  # of one /48
    ended = [submit_to(store, client) for client in site]
    waiting = [submit_to(store, host(2)) for _ in range(2)]
    end(store, waiting[0], error="It failed.")
    end(store, ended[3])
    end(store, ended[4])
    submit_to(store, host(3))  # failed jobs give way first
    assert store.find(waiting[0]) is None
    submit_to(store, host(4))  # then what ended first, of those who have most
    assert store.find(ended[3]) is None
    submit_to(store, host(5))
    assert store.find(ended[4]) is None
    submit_to(store, host(6))  # then what would come last
    assert store.find(ended[5]) is None
    assert store.find(waiting[1])
    assert len(store.all_jobs()) == 8


def test_none_who_waits_makes_room_for_an_equal(store: JobStore) -> None:
    for number in range(1, 9):
        submit_to(store, host(number))
    with refused(BUSY):
        submit_to(store, host(9))


def test_jobs_survive_a_restart(folder: Path, store: JobStore) -> None:
    with pytest.raises(SettingsError, match="another service uses it"):
        JobStore(folder, places=8)
    numbers = [submit_to(store, host(n)) for n in range(3)]
    anyio.run(store.begin, store.find(numbers[0]) or pytest.fail("gone"))
    end(store, numbers[1], warnings=("It was dark.",))
    store.close()
    again = JobStore(folder, places=8)
    jobs = [again.find(number) for number in numbers]
    assert [job.state for job in jobs if job] == [JobState.QUEUED, JobState.FINISHED, JobState.QUEUED]
    assert jobs[1]
    assert jobs[1].warnings == ("It was dark.",)
    anyio.run(again.begin, jobs[0] or pytest.fail("gone"))
    again.close()
    third = JobStore(folder, places=8)
    failed = third.find(numbers[0])
    assert failed
    assert failed.state is JobState.FAILED
    assert failed.error == "The service ended twice while it worked on this."
    assert names_in(third.path(numbers[0])) == {"job.json"}
    third.close()


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_result_is_kept_for_a_day(store: JobStore, monkeypatch: pytest.MonkeyPatch) -> None:
    ended, queued = submit_to(store), submit_to(store)
    end(store, ended)
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now + RESULT_SECONDS - 10)
    anyio.run(store.sweep)
    assert store.find(ended)
    monkeypatch.setattr(time, "monotonic", lambda: now + RESULT_SECONDS + 10)
    anyio.run(store.sweep)
    assert [job.id for job in store.all_jobs()] == [queued]
    assert not store.path(ended).exists()


def test_a_clock_that_is_set_deletes_no_result(folder: Path, store: JobStore, monkeypatch: pytest.MonkeyPatch) -> None:
    end(store, number := submit_to(store))
    now, began = time.time(), time.monotonic()
    monkeypatch.setattr(time, "time", lambda: now + 2 * RESULT_SECONDS)
    anyio.run(store.sweep)
    store.close()
    again = JobStore(folder, places=8)  # with the clock still wrong
    anyio.run(again.sweep)
    assert again.find(number)
    monkeypatch.setattr(time, "monotonic", lambda: began + 3700.0)
    anyio.run(again.sweep)
    assert again.find(number) is None  # it had an hour
    again.close()


def test_what_others_put_there_stays(folder: Path, store: JobStore, caplog: pytest.LogCaptureFixture) -> None:
    """Beside the program's folder, in it, and in a job's own."""
    end(store, number := submit_to(store))
    store.close()
    stays = [
        *(folder / name for name in ("home/letter.txt", "AbCdEfGhIjKlMnOpQrStUv/upload", "lock.txt", ".hidden/x")),
        *(store.folder / name for name in ("photos/letter.txt", "a.txt", "AbCdEfGhIjKlMnOpQrStUv/letter.txt")),
        store.folder / "WithoutRecordButResult" / RESULT_FILE,
        store.path(number) / "letter.txt",
    ]
    for path in stays:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"dear")
    (store.folder / "AbCdEfGhIjKlMnOpQrStUw").symlink_to(folder / "home", target_is_directory=True)
    again = JobStore(folder, places=8)
    assert [job.id for job in again.all_jobs()] == [number]
    assert caplog.text.count("is left alone") == 5
    anyio.run(again.remove, number, "its client deleted it")
    again.close()
    assert names_in(again.path(number)) == {"letter.txt"}
    assert "is not removed" in caplog.text
    assert [path for path in stays if path.read_bytes() != b"dear"] == []


def test_an_upload_that_a_killed_service_left_is_removed(folder: Path, store: JobStore) -> None:
    async def work() -> None:
        async with store.reserve_place(HOST) as number:
            (store.work_folder(number) / "upload").write_bytes(b"x")
            store.close()
            JobStore(folder, places=8).close()
            assert not store.path(number).exists()

    anyio.run(work)


def test_damaged_records_are_left_alone(folder: Path, store: JobStore, caplog: pytest.LogCaptureFixture) -> None:
    """A hundred of each way in which a record may be damaged; the others are jobs as before."""
    end(store, number := submit_to(store))
    store.close()
    record = (store.path(number) / "job.json").read_text()
    content = json.loads(record)
    damaged = ["", "[]", "\0" * 100, record[:40], "[" * 60_000, record.replace('"result', '"\\ud800')]
    wrong = ("1e999", "-1", "null", '"x"', "[]", "{}", "9" * 5000, '"\\ud800"')
    damaged += [
        record.replace(json.dumps(content[key], separators=(",", ":")), value) for key in content for value in wrong
    ]
    for index, text in enumerate(damaged):
        path = store.folder / f"damaged{index:015d}"
        path.mkdir()
        (path / "job.json").write_text(text.replace(number, path.name))
    again = JobStore(folder, places=8)
    for job in again.all_jobs():  # what was changed harmlessly is a job
        assert job.expires is None or datetime.fromtimestamp(job.expires, UTC)
        assert job.client.groups
        assert job.request["kind"] == "photos"
    anyio.run(again.sweep)
    again.close()
    assert again.find(number)
    assert len(names_in(again.folder)) == len(damaged) + 2
    assert all(len(line.message) < 500 and "\n" not in line.message for line in caplog.records)


OLD_COLUMNS = "id, client, request, state, created, ended, attempts, error, code, warnings"


def make_old_layout(folder: Path) -> dict[str, str]:
    """A table of version 0.2.0 and its folders, as names of jobs by their state; one row is damaged."""
    table = sqlite3.connect(folder / "jobs.sqlite", isolation_level=None)
    table.execute("PRAGMA journal_mode=WAL")
    table.execute(f"CREATE TABLE jobs ({OLD_COLUMNS}, PRIMARY KEY (id))")
    numbers = {state: f"{state:_<22}" for state in ("queued", "running", "finished", "failed", "damaged")}
    for state, number in numbers.items():
        (folder / number).mkdir()
        (folder / number / (RESULT_FILE if state == "finished" else "upload.zip")).write_bytes(state.encode())
        ended = time.time() if state in ("finished", "failed") else None
        row = number, '["192.0.2.1"]', '{"kind": "photos", "upload": "upload.zip"}', state, 1.0, ended, 1, "", "", "[]"
        table.execute(f"INSERT INTO jobs VALUES ({', '.join('?' * 10)})", row)
    table.close()
    (folder / numbers["failed"] / "upload.zip").unlink()
    return numbers


def test_the_older_layout_is_taken_over_once(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    numbers = make_old_layout(folder)
    (folder / "home").mkdir()
    (folder / "lock").touch()
    store = JobStore(folder, places=8)
    states = {job.id: job.state.value for job in store.all_jobs()}
    damaged = numbers.pop("damaged")
    assert states == {number: state.replace("running", "queued") for state, number in numbers.items()}
    assert (store.path(numbers["finished"]) / RESULT_FILE).read_bytes() == b"finished"
    assert (store.work_folder(numbers["queued"]) / "upload.zip").read_bytes() == b"queued"
    assert names_in(folder) == {JOBS_FOLDER, "home", "lock", "jobs.sqlite", damaged}  # what is damaged stays
    assert f"{folder / damaged} is left alone" in caplog.text
    store.close()
    (folder / damaged / "upload.zip").unlink()
    (folder / damaged).rmdir()
    store = JobStore(folder, places=8)
    assert len(store.all_jobs()) == 4
    assert names_in(folder) == {JOBS_FOLDER, "home", "lock"}
    store.close()


def test_a_zip_stays_in_its_folder_and_within_its_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    archive = Path("p.zip")
    archive.write_bytes(pack(**{"../../up.jpg": b"1", "/root.jpg": b"2", "a/b\\c.jpg": b"3", "./.": b"4"}))
    job_kinds._unpack(archive, 100)
    found = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert found == {"p.zip", "photos/up.jpg", "photos/root.jpg", "photos/a/b/c.jpg", "photos/photo"}
    for files, words in (
        ({"big": bytes(101)}, "more than 0.0001 MB"),
        ({f"n{n}": b"" for n in range(MAX_FILES + 1)}, f"at most {MAX_FILES}"),
        ({"y": b"1", "y/z": b"2"}, "no file's: y/z"),
    ):
        archive.write_bytes(pack(**files))
        with pytest.raises(LightingError, match=words):
            job_kinds._unpack(archive, 100)
        for path in sorted(Path("photos").rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()


def test_names_alike_in_a_zip_are_numbered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    archive = Path("p.zip")
    with zipfile.ZipFile(archive, "w") as source:
        for number, name in enumerate(("a.jpg", "x/a.jpg", "../a.jpg", "./a.jpg", "b")):
            source.writestr(name, str(number))
    told = "The ZIP holds a.jpg more than once in a folder; one is a-{}.jpg now."
    assert job_kinds._unpack(archive, 100) == [told.format(2), told.format(3)]
    found = {path.relative_to("photos").as_posix(): path.read_text() for path in Path("photos").rglob("*.jpg")}
    assert found == {"a.jpg": "0", "x/a.jpg": "1", "a-2.jpg": "2", "a-3.jpg": "3"}


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_damaged_zip_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: int) -> None:
    """Damaged in a hundred ways, of which a few hit nothing."""
    monkeypatch.chdir(tmp_path)
    random, archive, damaged = np.random.default_rng(7), Path("p.zip"), 0
    with zipfile.ZipFile(archive, "w", method) as source:
        source.writestr("a.jpg", random.bytes(300) + bytes(300))
        source.writestr("b.jpg", bytes(900))
    whole = archive.read_bytes()
    for _ in range(100):
        data = bytearray(whole)
        data[random.integers(len(data))] = random.integers(256)
        archive.write_bytes(data[: random.integers(20, 2 * len(data))])
        try:
            job_kinds._unpack(archive, 10_000)
        except LightingError as error:
            damaged += str(error) == "The upload is no ZIP that can be read."
        shutil.rmtree("photos", ignore_errors=True)
    assert damaged > 50


def test_a_disk_that_fails_is_not_the_zips_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with zipfile.ZipFile("p.zip", "w") as source:
        source.writestr("a.jpg", bytes(300))
    error = OSError(errno.EIO, "Input/output error")
    monkeypatch.setattr(zipfile.ZipExtFile, "read", Mock(side_effect=error))
    with pytest.raises(OSError, match="Input/output error"):
        job_kinds._unpack(Path("p.zip"), 10_000)


HOSTILE_LINES = (
    *('{"warnings": 5}', '{"warnings": ["\\ud800"]}', '{"warnings": []}', '{"progress": 1e999}', '{"progress": NaN}'),
    *('{"error": 5}', '{"step": [["map"]]}', '{"code": "x"}', '{"log": "one\\ntwo"}', "null", "[]", "\\xff"),
    *("9" * 5000, "[" * 60_000, "{" * 70_000),
)


def test_nothing_that_a_job_says_ends_the_runner(
    estimator: Estimator, folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Whoever has taken a job's process over may write what it likes, also a link in place of the result."""
    lines = iter(HOSTILE_LINES)
    caplog.set_level("INFO")

    def start(_: str) -> Any:
        code = "import os, sys, json; os.chdir(json.loads(sys.stdin.read())['folder'])"
        return start_python(f"{code}; os.symlink('/etc/passwd', '{RESULT_FILE}'); print({next(lines)!r})")

    monkeypatch.setattr(jobs, "start_python", start)
    monkeypatch.setattr(jobs, "_POLL_SECONDS", 0.02)
    with TestClient(create_app(Settings(jobs_folder=folder), estimator), raise_server_exceptions=False) as client:
        for _ in HOSTILE_LINES:
            record = wait(client, submit(client, b"x", kind="photos").headers["location"])
            assert record["state"] == "failed"
            assert record["error"] in (jobs._CRASH_ERROR, jobs._INTERNAL_ERROR)
        assert client.get("/readyz").status_code == 200
    assert "jobs stand still" not in caplog.text
    assert "removed job" in caplog.text  # those that failed gave way to the next ones
    assert not any("\n" in entry.message for entry in caplog.records)


def test_a_system_that_starts_no_process_is_told(
    estimator: Estimator, folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(_: str) -> None:
        raise OSError(errno.EAGAIN, "Resource temporarily unavailable")

    monkeypatch.setattr(jobs, "start_python", fail)
    monkeypatch.setattr(jobs, "_PAUSE_SECONDS", 0.5)
    with TestClient(create_app(Settings(jobs_folder=folder), estimator), raise_server_exceptions=False) as client:
        address = urljoin("/v1/jobs", submit(client, b"x", kind="photos").headers["location"])
        while (answer := client.get("/readyz")).status_code == 200:
            time.sleep(0.02)
        told = problem(answer, 503, "busy")["detail"]
        assert told == "Jobs stand still: Resource temporarily unavailable."
        record = wait(client, address)
        assert (record["state"], record["error"]) == ("failed", jobs._INTERNAL_ERROR)
        while client.get("/readyz").status_code != 200:
            time.sleep(0.02)
    assert caplog.text.count("jobs stand still") == 1
    assert "Traceback" not in caplog.text


def test_a_runner_that_hangs_is_told(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runner = jobs.JobRunner(JobStore(folder, 8), 1, 1.0, lambda _: 0.0, lambda *_: None)
    assert not runner.fault
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now + 1000.0)
    assert runner.fault.startswith("nothing has happened for 1000 s")
    runner.store.close()


@pytest.mark.slow
def test_a_job_that_takes_too_long_or_is_deleted_is_stopped(
    estimator: Estimator, network: Path, folder: Path, tmp_path: Path
) -> None:
    write_clip(clip := tmp_path / "clip.mp4", pan(45))
    app = create_app(Settings(jobs_folder=folder, model=network, job_seconds=0.1), estimator)
    with TestClient(app, raise_server_exceptions=False) as client:
        record = wait(client, submit(client, clip.read_bytes(), "a.mp4", kind="video").headers["location"])
        assert (record["state"], record["error"]) == ("failed", "The job took longer than it may.")
    app = create_app(Settings(jobs_folder=folder, model=network), estimator)
    with TestClient(app, raise_server_exceptions=False) as client:
        address = urljoin("/v1/jobs", submit(client, clip.read_bytes(), "a.mp4", kind="video").headers["location"])
        while client.get(address).json()["state"] == "queued":
            time.sleep(0.05)
        assert client.delete(address).status_code == 204
        problem(client.get(address), 404, "unknown-job")
    assert names_in(folder / JOBS_FOLDER) == {record["id"], "lock"}
