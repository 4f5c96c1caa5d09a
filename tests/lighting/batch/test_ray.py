"""The batch on Ray: the same rows as the pool, each photo once though a node is lost."""

import json
import shutil
import threading
import time
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import ray
from click.testing import CliRunner, Result

from lighting.cli import cli
from lighting.files.exr import read_exr
from tests.conftest import encode, scene

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]  # Ray and its children warn of much

FEW, MANY = 8, 80  # photos; so many that a node is lost before all are done


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A head node and this process connected to it."""
    from ray.cluster_utils import Cluster

    head = {"num_cpus": 1, "object_store_memory": 200_000_000, "include_dashboard": False}
    made = Cluster(initialize_head=True, head_node_args=head)
    ray.init(address=made.address, log_to_driver=False, logging_level="error")
    yield made
    ray.shutdown()
    made.shutdown()


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    return write_photos(tmp_path / "photos", FEW)


@pytest.fixture
def many(tmp_path: Path) -> Path:
    return write_photos(tmp_path / "photos", MANY)


def write_photos(folder: Path, count: int) -> Path:
    """A folder with half of the photos, one that is none, and a folder below with the other half."""
    (folder / "below").mkdir(parents=True)
    for number in range(count):
        name = f"below/{number:02}.jpg" if number % 2 else f"{number:02}.jpg"
        (folder / name).write_bytes(encode(scene(640 + number, 480)))
    (folder / "bad.jpg").write_bytes(b"not a photo")
    return folder


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["batch", *map(str, arguments)], prog_name="lighting")


def on_ray(*arguments: object) -> Result:
    return run("--engine", "ray", *arguments)


def rows(out: Path) -> list[dict[str, Any]]:
    from pyarrow.parquet import read_table

    found: list[dict[str, Any]] = read_table(out / "lighting.parquet").to_pylist()
    return sorted(found, key=lambda row: str(row["file"]))


def test_ray_and_the_pool_agree(cluster: Any, photos: Path, tmp_path: Path, network: Path) -> None:
    """On sidecars, too."""
    assert cluster.list_all_nodes()
    taken = {"photoTakenTime": {"timestamp": "1717253400"}, "geoData": {"latitude": 48.1, "longitude": 11.6}}
    (photos / "00.jpg.supplemental-metadata.json").write_text(json.dumps(taken))
    result = on_ray(photos / "*.jpg", tmp_path / "ray", "--model", network)
    assert result.exit_code == 1
    assert f"Photos that failed: 1; the reasons are in {tmp_path / 'ray'}.\n" in result.stderr
    assert f"\n{FEW // 2} done, 1 failed, 0 skipped; " in result.stderr
    assert run(photos / "*.jpg", tmp_path / "pool", "--model", network, "--parquet", "--workers", 1).exit_code == 1
    assert len(rows(tmp_path / "ray")) == FEW // 2 + 1
    assert rows(tmp_path / "ray") == rows(tmp_path / "pool")
    assert rows(tmp_path / "ray")[0]["utc_time"] == datetime(2024, 6, 1, 14, 50, tzinfo=UTC)


def test_each_photo_once_though_a_node_is_lost(cluster: Any, many: Path, tmp_path: Path, network: Path) -> None:
    out = tmp_path / "out"
    node = cluster.add_node(num_cpus=1, object_store_memory=200_000_000)
    cluster.wait_for_nodes()
    seen: list[int] = []

    def kill_half_way() -> None:
        end = time.monotonic() + 120
        while len(maps := list(out.glob("**/*.exr"))) < MANY // 4 and time.monotonic() < end:
            time.sleep(0.02)
        seen.append(len(maps))
        cluster.remove_node(node, allow_graceful=False)

    killer = threading.Thread(target=kill_half_way)
    killer.start()
    result = on_ray(many, out, "--envmap", "--height", 128, "--workers", 2, "--model", network)
    killer.join()
    assert MANY // 4 <= seen[0] < MANY
    assert result.exit_code == 1
    names = {path.relative_to(many).as_posix() for path in many.glob("**/*.jpg")}
    assert Counter(row["file"] for row in rows(out)) == Counter(names)
    assert [row["file"] for row in rows(out) if row["error"]] == ["bad.jpg"]
    assert all(read_exr(out / f"{name}.exr")[0].shape == (128, 256, 3) for name in names - {"bad.jpg"})


def test_going_on_adds_what_is_missing(cluster: Any, photos: Path, tmp_path: Path, network: Path) -> None:
    assert cluster.list_all_nodes()
    out = tmp_path / "out"
    shutil.copytree(photos / "below", tmp_path / "few")
    assert on_ray(tmp_path / "few", out, "--model", network).exit_code == 0
    before = {path: path.read_bytes() for path in (out / "lighting.parquet").iterdir()}
    (out / "lighting.parquet" / "torn.parquet").write_bytes(next(iter(before.values()))[:-9])
    (tmp_path / "few" / "new.jpg").write_bytes(encode(scene(100, 90)))
    assert on_ray(tmp_path / "few", out, "--model", network).exit_code == 0
    assert len(rows(out)) == len({row["file"] for row in rows(out)}) == 5
    assert {path: path.read_bytes() for path in before} == before
    assert json.loads((out / "batch.json").read_text())["engine"] == "ray"


def test_uris_are_read_and_written(cluster: Any, photos: Path, tmp_path: Path, network: Path) -> None:
    """By way of file://, which goes through pyarrow's filesystems as s3:// and gs:// do."""
    assert cluster.list_all_nodes()
    source, out = (photos / "below").as_uri(), (tmp_path / "out").as_uri()
    result = on_ray(source, out, "--envmap", "--height", 16, "--model", network)
    assert result.exit_code == 0
    assert len(rows(tmp_path / "out")) == len(list(tmp_path.glob("out/*.exr"))) == FEW // 2
