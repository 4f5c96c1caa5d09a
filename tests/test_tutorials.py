"""Tutorials that need a browser or Blender, as a reader does them; tests/test_book.py runs the others."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
import uvicorn
from PIL import Image

from scripts.book import ROOT, CodeBlock, read_code_blocks
from server.app import create_app
from server.settings import Settings
from tests.helpers.engines import PYTHON, folder_in_chroot, needs_blender, needs_engines, run_in_chroot
from tests.helpers.requirements import require

LEARN = ROOT / "docs" / "learn"
PHOTO = ROOT / "examples" / "wide_street.jpg"
SERVICE = "http://127.0.0.1:8000"
PATIENCE = 300.0  # seconds


def read_saved_files(page: Path) -> dict[str, str]:
    """The blocks that a page tells to save, by the names that it gives them."""
    texts = dict(re.findall(r"^Save this as `([\w.]+)`.*?\n```\w+\n(.*?)^```$", page.read_text("utf-8"), re.M | re.S))
    assert texts
    return texts


class _QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def site(folder: Path) -> Iterator[str]:
    """The address of a folder's files."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_QuietHandler, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()


@contextmanager
def service(origin: str) -> Iterator[str]:
    """The address of a service that pages of an origin may call."""
    app = create_app(Settings(cors_origins=(origin,)))
    server = uvicorn.Server(uvicorn.Config(app, port=0, log_level="error", ws="none"))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started and thread.is_alive():
        time.sleep(0.02)
    try:
        yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join(30)


@pytest.mark.slow
def test_the_web_page_shows_an_object_in_a_visitors_photo(tmp_path: Path) -> None:
    """It is red and stands on the spot; the ground beside it is darker than in the photo, and the rest is the photo."""
    browser, node, modules = map(require, ("chromium", "node", "server/web"))
    (tmp_path / "node_modules").symlink_to(modules)
    picture = tmp_path / "picture.png"
    with site(tmp_path) as origin, service(origin) as address:
        for name, text in read_saved_files(LEARN / "web-page.md").items():
            (tmp_path / name).write_text(text.replace(SERVICE, address), encoding="utf-8")
        files = json.dumps({"photo": str(PHOTO), "picture": str(picture)})
        command = [node, ROOT / "tests" / "browser" / "run.mjs", origin, browser, "tutorial", files]
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["complaints"] == []
    shown = np.asarray(Image.open(picture).convert("RGB"), dtype=float)
    plain = np.asarray(Image.open(PHOTO).convert("RGB").resize(shown.shape[1::-1]), dtype=float)
    red = (shown[..., 0] > 1.8 * shown[..., 1]) & (plain[..., 0] < 1.3 * plain[..., 1])
    rows, columns = np.nonzero(red)
    assert 200 < red.sum() < 0.1 * red.size
    assert 0.5 < rows.mean() / len(shown) < 0.95
    assert 0.2 < columns.mean() / shown.shape[1] < 0.8
    darker = (shown.mean(-1) < 0.8 * plain.mean(-1)) & ~red
    assert darker[rows.min() :].sum() > 50
    assert np.abs(shown - plain)[: len(shown) // 3].mean() < 6


@needs_engines
def test_blender_52_shows_an_object_in_a_photo() -> None:
    """`lighting` runs here, `blender` in the chroot."""
    with folder_in_chroot() as folder:
        follow_blender_page(folder, lambda words: run_in_chroot(folder, shlex.join(["blender", *words])))
        check_monkey(folder)


@pytest.mark.slow
@needs_blender
def test_bpy_shows_an_object_in_a_photo(tmp_path: Path) -> None:
    """`blender` is the module bpy."""
    program = [PYTHON, str(ROOT / "tests" / "blender" / "blender.py")]

    def run(words: list[str]) -> None:
        subprocess.run([*program, *words], cwd=tmp_path, capture_output=True, check=True, timeout=PATIENCE)

    follow_blender_page(tmp_path, run)
    check_monkey(tmp_path)


def follow_blender_page(folder: Path, blender: Callable[[list[str]], object]) -> None:
    """Run all blocks of docs/learn/blender.md, one after the other.

    Args:
        folder: of the reader.
        blender: runs Blender in the folder, by the words after its name.
    """
    page = LEARN / "blender.md"
    shutil.copy(ROOT / "examples" / "wide_street.jpg", folder / "photo.jpg")
    for name, text in read_saved_files(page).items():
        (folder / name).write_text(text, encoding="utf-8")
    for line in (line for block in read_code_blocks(page.read_text("utf-8")) for line in _commands(block)):
        program, *words = shlex.split(line)
        if program == "blender":
            blender(words if "--background" in words else ["--background", *words])  # no window
        else:
            command = [sys.executable, "-m", program, *words]
            environment = {**os.environ, "PYTHONPATH": str(ROOT)}
            subprocess.run(command, cwd=folder, capture_output=True, check=True, env=environment)


def check_monkey(folder: Path) -> None:
    """Assert that object and shadow stand in the lower half of the photo, and that the other scenes are there."""
    scene = folder / "photo-blender"
    shown = np.asarray(Image.open(scene / "monkey.png").convert("RGB"), dtype=float)
    plate = Image.open(scene / "plate.png").convert("RGB").resize(shown.shape[1::-1], Image.Resampling.BOX)
    assert (folder / "evening" / "scene.py").is_file()
    assert (folder / "gray" / "scene.py").is_file()
    changed = np.abs(shown - np.asarray(plate, dtype=float)).max(-1) > 40
    rows, columns = np.nonzero(changed)
    assert 0.002 < changed.mean() < 0.1
    assert 0.5 < np.median(rows) / len(shown) < 1.0
    assert 0.2 < np.median(columns) / shown.shape[1] < 0.8


def _commands(block: CodeBlock) -> list[str]:
    """The lines of a block of commands."""
    return block.text.splitlines() if block.language == "sh" else []
