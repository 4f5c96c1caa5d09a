"""Damaged networks and tables: seen before anything is answered, named in one sentence."""

import random
import subprocess
import sys
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import pytest

import lighting.checksum as checksum
from lighting.checksum import (
    CHECKSUMS,
    DATA_FOLDER,
    compute_checksum,
    list_checksums,
    verify_checksum,
    verify_checksums,
)
from lighting.envmap.detail_library import load_detail_library
from lighting.errors import ModelError
from lighting.model import Model
from lighting.sky import clear_sky
from lighting.stereo.normal_network import Network

EXAMPLE = Path(__file__).parents[2] / "examples" / "wide_street.jpg"
LOADERS: dict[str, Callable[[], object]] = {
    "outdoor-4.3.0.onnx": Model.load,
    "outdoor-4.3.0.onnx.data": Model.load,
    "normals-1.0.0.onnx": lambda: Network.load(),
    "detail.npy": load_detail_library.__wrapped__,
    "prague.f16": clear_sky._load_skies.__wrapped__,
    "hosek_wilkie.f32": clear_sky._load_tables.__wrapped__,
}


def flipped(data: bytes) -> bytes:
    """50 bytes changed."""
    chance, changed = random.Random(1), bytearray(data)
    for at in chance.sample(range(len(data)), 50):
        changed[at] ^= chance.randrange(1, 256)
    return bytes(changed)


def swapped(data: bytes) -> bytes:
    """Two sectors in each other's place."""
    return data[4096:8192] + data[:4096] + data[8192:]


def cut(data: bytes) -> bytes:
    return data[:-100]


DAMAGES = [flipped, swapped, cut, lambda data: bytes(len(data)), lambda data: data + b"\0", lambda _: b""]


def damaged_copy(folder: Path, name: str, data: bytes | None) -> Path:
    """A folder as this package's data, but for one file; None: it is missing."""
    copy = folder / "data"
    copy.mkdir()
    for path in DATA_FOLDER.iterdir():
        if path.name != name:
            (copy / path.name).symlink_to(path)
    if data is not None:
        (copy / name).write_bytes(data)
    return copy


def test_every_network_and_table_is_listed() -> None:
    assert (DATA_FOLDER / CHECKSUMS).read_text() == list_checksums(), "python -m scripts.checksums"
    assert verify_checksums() == len(LOADERS)


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("size", [5000, 262_144, 600_001])
def test_every_damage_changes_the_checksum(damage: Callable[[bytes], bytes], size: int) -> None:
    data = random.Random(size).randbytes(size)
    assert compute_checksum(BytesIO(data)) != compute_checksum(BytesIO(damage(data)))


def test_every_bit_counts() -> None:
    """Also where a bit flips twice in one row, in one column, or in both of two of each."""
    data = random.Random(0).randbytes(2 * 262_144)
    whole = compute_checksum(BytesIO(data))
    for places in ((0,), (77_777,), (0, 8), (0, 4096), (0, 4096, 262_144), (524_287,), (8, 16, 24, 32)):
        changed = bytearray(data)
        for at in places:
            changed[at] ^= 16
        assert compute_checksum(BytesIO(changed)) != whole


@pytest.mark.parametrize("damage", [flipped, cut, lambda data: bytes(len(data)), lambda _: None])
@pytest.mark.parametrize("name", LOADERS)
def test_a_damaged_file_is_named(
    name: str, damage: Callable[[bytes], bytes | None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = damage((DATA_FOLDER / name).read_bytes())
    copy = damaged_copy(tmp_path, name, data)
    monkeypatch.setattr(checksum, "DATA_FOLDER", copy)
    monkeypatch.setattr("lighting.model.DATA_FOLDER", copy)
    monkeypatch.setattr("lighting.stereo.normal_network.DATA_FOLDER", copy)
    monkeypatch.setattr("lighting.envmap.detail_library.LIBRARY_PATH", copy / "detail.npy")
    for check in (LOADERS[name], verify_checksums):
        with pytest.raises(ModelError) as error:
            check()
        if data is not None or not name.endswith(".onnx"):
            state = "missing" if data is None else "damaged"
            assert str(error.value) == f"{copy / name} is {state}; install this package again."


def test_other_files_than_the_package_s_pass(tmp_path: Path) -> None:
    (tmp_path / "prague.f16").write_bytes(b"another's")
    verify_checksum(tmp_path / "prague.f16")
    verify_checksum(tmp_path / "absent")


@pytest.mark.parametrize("text", [None, "", "no checksum of any file"])
def test_a_damaged_list_is_named(text: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copy = damaged_copy(tmp_path, CHECKSUMS, text if text is None else text.encode())
    monkeypatch.setattr(checksum, "DATA_FOLDER", copy)
    checksum._read_list.cache_clear()
    try:
        with pytest.raises(ModelError, match=r"install this package again\.$"):
            checksum.read_checked("prague.f16")
    finally:
        monkeypatch.undo()
        checksum._read_list.cache_clear()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["outdoor-4.3.0.onnx.data", "prague.f16", "detail.npy"])
def test_a_command_answers_with_a_sentence(name: str, tmp_path: Path) -> None:
    package = tmp_path / "lighting"
    package.mkdir()
    for path in DATA_FOLDER.parent.iterdir():
        if path != DATA_FOLDER:
            (package / path.name).symlink_to(path)
    data = damaged_copy(package, name, flipped((DATA_FOLDER / name).read_bytes()))
    command = [sys.executable, "-m", "lighting", "envmap", str(EXAMPLE), "-o", "sky.exr"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"Error: {data / name} is damaged; install this package again.\n"
    assert not (tmp_path / "sky.exr").exists()
