"""Folders of photos."""

import os
from pathlib import Path

import pytest

from tests.conftest import encode, scene
from tests.helpers.processes import MANY_PHOTOS


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """Five photos, one of them damaged and one in a folder below, and what is no photo."""
    folder = tmp_path / "photos"
    (folder / "below").mkdir(parents=True)
    for name, width in [("a.jpg", 320), ("b.PNG", 200), ("ä b.webp", 160), ("below/a.jpg", 240)]:
        suffix = {".png": "PNG", ".webp": "WEBP"}.get(Path(name).suffix.lower(), "JPEG")
        (folder / name).write_bytes(encode(scene(width, 150), suffix))
    (folder / "bad.jpg").write_bytes(b"not a photo")
    for name in ("notes.txt", ".hidden.jpg"):
        (folder / name).write_bytes(encode(scene(64, 64)))
    (folder / ".trash").mkdir()
    (folder / ".trash" / "c.jpg").write_bytes(encode(scene(64, 64)))
    return folder


@pytest.fixture
def many(tmp_path: Path) -> Path:
    """So many photos that a batch can be stopped half-way."""
    folder = tmp_path / "many"
    folder.mkdir()
    (folder / "0000.jpg").write_bytes(encode(scene(320, 240)))
    for number in range(1, MANY_PHOTOS):
        os.link(folder / "0000.jpg", folder / f"{number:04}.jpg")
    return folder
