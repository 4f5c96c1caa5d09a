"""The page at /: what the service serves of it, and the page itself in Chromium, driven by tests/browser/page.mjs."""

import json
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI
from starlette.testclient import TestClient

from lighting import Lighting, read_exr
from lighting.files import full_record
from lighting.pipeline import Estimator
from server.app import create_app
from server.page import BUNDLE, page_router
from server.settings import Settings

ROOT = Path(__file__).parents[2]
PHOTO = ROOT / "examples" / "railway_field.jpg"
PATIENCE = 400.0  # seconds


def missing() -> str:
    """What the browser test lacks here, in words; empty if nothing."""
    if not shutil.which("node"):
        return "node is not installed"
    if not chromium():
        return "chromium is not installed"
    if not (BUNDLE / "index.html").is_file():
        return "the page is not built: run npm ci && npm run build in server/web"
    if not (BUNDLE.parent / "node_modules" / "playwright-core").is_dir():
        return "playwright-core is not installed: run npm ci in server/web"
    return ""


def chromium() -> str | None:
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    """The service with the packaged network on a free port."""
    server = uvicorn.Server(uvicorn.Config(create_app(Settings(), Estimator()), port=0, log_level="error", ws="none"))
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started and thread.is_alive():
        time.sleep(0.05)
    yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}/"
    server.should_exit = True
    thread.join()


@pytest.fixture(scope="module")
def visit(url: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a visitor saw, and the folder with what they downloaded."""
    folder = tmp_path_factory.mktemp("visit")
    text = folder / "notes.txt"
    text.write_text("This is no photo.", encoding="utf-8")
    command = ["node", str(ROOT / "tests" / "browser" / "page.mjs"), url, str(chromium()), str(PHOTO), str(text)]
    done = subprocess.run([*command, str(folder)], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    return {**json.loads(done.stdout), "folder": folder}


in_chromium = pytest.mark.skipif(bool(missing()), reason=missing() or "all is there")


@pytest.mark.slow
@in_chromium
class TestInChromium:
    def test_a_photo_is_answered(self, visit: dict[str, Any]) -> None:
        assert visit["title"].startswith("Sun ")
        assert {"Sun azimuth", "Turbidity", "Vertical field of view"} <= set(visit["numbers"])
        record = json.loads((visit["folder"] / "estimate.json").read_text())
        assert full_record(Lighting.from_dict(record)) == record

    def test_the_dome_is_read_by_keyboard(self, visit: dict[str, Any]) -> None:
        assert "within 10°" in visit["readout"]
        assert visit["changed"]

    def test_a_slider_moves_the_sun(self, visit: dict[str, Any]) -> None:
        assert visit["slider"] == "straight behind"
        assert visit["before"] != visit["after"]
        edited = Lighting.from_dict(json.loads((visit["folder"] / "edited.json").read_text()))
        assert edited.sun_azimuth == -180

    def test_the_map_that_is_downloaded_has_the_sun_where_the_slider_put_it(self, visit: dict[str, Any]) -> None:
        assert visit["exr"] == "railway_field.exr"
        image, _ = read_exr(visit["folder"] / "map.exr")
        assert image.shape == (512, 1024, 3)
        _, column, _ = np.unravel_index(int(image.argmax()), image.shape)
        assert min(column, 1023 - column) <= 2

    def test_a_text_file_is_refused_in_words(self, visit: dict[str, Any]) -> None:
        assert "photo" in visit["error"]
        assert visit["kept"] == visit["title"]

    def test_an_example_is_answered_on_a_narrow_screen(self, visit: dict[str, Any]) -> None:
        assert visit["example"].startswith("Sun ")
        assert visit["overflow"] == 0

    def test_the_browser_has_nothing_to_complain_of(self, visit: dict[str, Any]) -> None:
        """No script error, nothing the content policy stops, nothing from another host."""
        assert visit["complaints"] == []


def site(bundle: Path) -> TestClient:
    app = FastAPI()
    app.include_router(page_router(bundle))
    return TestClient(app)


def test_without_the_bundle_the_page_says_so(tmp_path: Path) -> None:
    answer = site(tmp_path).get("/")
    assert answer.status_code == 200
    assert "not built" in answer.text


def test_the_bundle_is_served(tmp_path: Path) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("<p>page</p>")
    (tmp_path / "assets" / "main-1.js").write_text("true")
    answer = site(tmp_path).get("/")
    assert (answer.text, answer.headers["Cache-Control"]) == ("<p>page</p>", "no-cache")
    script = site(tmp_path).get("/assets/main-1.js")
    assert "immutable" in script.headers["Cache-Control"]
    assert script.headers["Content-Type"].startswith("text/javascript")
