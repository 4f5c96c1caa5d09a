"""The page at /: what the service serves of it, and the page itself in Chromium, driven by tests/browser/page.mjs."""

import gzip
import json
import os
import shutil
import struct
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI
from numpy.typing import NDArray
from PIL import ExifTags, Image
from starlette.testclient import TestClient

from lighting import Lighting, read_exr
from lighting.envmap import place_of, view
from lighting.files import full_record, read_hdr
from lighting.photo import TARGET, read_photo
from lighting.pipeline import Estimator
from lighting.scene import EXPORTERS
from lighting.turns import MAX_SIDE, has_opencv
from server.app import create_app
from server.page import BUNDLE, page_router
from server.settings import Settings

ROOT = Path(__file__).parents[2]
PHOTO = ROOT / "examples" / "railway_field.jpg"
NOON = ROOT / "examples" / "rome" / "noon_steps.jpg"
DATED = "dated.jpg"  # the same with its time and focal length, and without its place
PATIENCE = 900.0  # seconds
FIRST_VIEW = 1_000_000  # bytes, compressed
SEEN_RATIO = 0.75  # of the light that is left in the object's shadow, at most: sun and sky of a clear day


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
    """The service with the packaged network on a free port; a busy machine may match photos slowly."""
    settings = Settings(match_seconds=120)
    server = uvicorn.Server(uvicorn.Config(create_app(settings, Estimator()), port=0, log_level="error", ws="none"))
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started and thread.is_alive():
        time.sleep(0.05)
    yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}/"
    server.should_exit = True
    thread.join()


def halves() -> Image.Image:
    """A blue sky above ground in the sun, of which the right half lies in shade."""
    pixels = np.zeros((240, 320, 3))
    pixels[:120] = np.linspace((40, 90, 180), (150, 190, 235), 120)[:, None]
    pixels[120:, :160], pixels[120:, 160:] = (165, 156, 138), (45, 50, 62)
    return Image.fromarray(pixels.astype(np.uint8))


def triangle_model(width: int = 1) -> bytes:
    """A .glb of one triangle, `width` times as wide as high, with a material of its own."""
    points = np.array([[0, 0, 0], [width, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"doubleSided": True, "pbrMetallicRoughness": {"baseColorFactor": [0, 0.6, 0.1, 1]}}],
        "buffers": [{"byteLength": len(points)}], "bufferViews": [{"buffer": 0, "byteLength": len(points)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "max": [width, 1, 0],
                       "min": [0, 0, 0]}],
    }  # fmt: skip
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(points), 0x004E4942) + points
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def files_for(folder: Path) -> dict[str, str]:
    """What the visitor brings along, by name."""
    (folder / "notes.txt").write_text("This is no photo.", encoding="utf-8")
    (folder / "box.glb").write_bytes(triangle_model())
    halves().save(folder / "halves.png")
    heic = ""
    with suppress(ImportError):
        import pillow_heif

        heic = str(folder / "photo.heic")
        with Image.open(PHOTO) as photo:
            pillow_heif.from_pillow(photo.resize((320, 240))).save(heic)
    shutil.copy(PHOTO, folder)
    with Image.open(NOON) as photo:
        said = photo.getexif()
        del said[ExifTags.Base.GPSInfo]
        photo.save(folder / DATED, exif=said)
    return {
        **{"photo": str(PHOTO), "dated": str(folder / DATED), "textFile": str(folder / "notes.txt"), "heic": heic},
        **{"halves": str(folder / "halves.png"), "model": str(folder / "box.glb"), "folder": str(folder)},
    }


@pytest.fixture(scope="module")
def visit(url: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a visitor saw, and the folder with what they downloaded."""
    folder = tmp_path_factory.mktemp("visit")
    return {**visited("page.mjs", url, files_for(folder)), "folder": folder, "url": url}


def visited(script: str, url: str, files: dict[str, Any]) -> dict[str, Any]:
    """What a script of tests/browser saw that visits the page with these files."""
    command = ["node", str(ROOT / "tests" / "browser" / script), url, str(chromium()), json.dumps(files)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    seen: dict[str, Any] = json.loads(done.stdout)
    return seen


in_chromium = pytest.mark.skipif(bool(missing()), reason=missing() or "all is there")


def run(copied: str, folder: Path) -> None:
    """Run in a folder what the page copied, a curl command or a Python program."""
    command = ["sh", "-c", copied] if copied.startswith("curl ") else [sys.executable, "-c", copied]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run(command, cwd=folder, env=environment, check=True, timeout=120, capture_output=True)


def together(files: list[Path]) -> NDArray[np.float32]:
    """The map of the last of several photos, by the library: their light and camera, the place as it alone has it."""
    match, estimator = has_opencv(), Estimator()
    photos = [read_photo(file, target=MAX_SIDE if match else TARGET) for file in files]
    light, photo = estimator.together(photos, match=match)[-1].lighting, read_photo(files[-1])
    alone = estimator(photo)

    def finer(side: int) -> NDArray[np.uint8]:
        return read_photo(files[-1], target=side).pixels

    place = place_of(alone, photo.pixels, 512, finer, exposure=light.exposure)
    return view(light, 512, sun=light.sun_shines, place=place)[0]


def colours(file: Path) -> NDArray[np.float64]:
    """A picture's linear luminance, roughly."""
    with Image.open(file) as picture:
        return (np.asarray(picture.convert("L"), dtype=np.float64) / 255) ** 2.2


@pytest.mark.slow
@in_chromium
class TestTheLight:
    def test_a_photo_is_answered(self, visit: dict[str, Any]) -> None:
        assert visit["title"].startswith("Sun ")
        assert {"Sun azimuth", "Turbidity", "Vertical field of view"} <= set(visit["numbers"])
        assert "of this photo alone" in visit["note"]
        record = json.loads((visit["folder"] / "estimate.json").read_text())
        assert full_record(Lighting.from_dict(record)) == record

    def test_the_dome_is_read_by_keyboard(self, visit: dict[str, Any]) -> None:
        assert "within 10°" in visit["readout"]
        assert visit["changed"]

    def test_sixty_key_presses_make_at_most_two_requests(self, visit: dict[str, Any]) -> None:
        assert len(visit["pressed"]) <= 2

    def test_they_are_undone_in_one_step(self, visit: dict[str, Any]) -> None:
        assert visit["undone"] != visit["slid"] == visit["redone"]

    def test_a_slider_moves_the_sun(self, visit: dict[str, Any]) -> None:
        assert visit["slider"] == "straight behind"
        assert "no WebGL" in visit["flat"]
        text = (visit["folder"] / "edited.json").read_text()
        assert Lighting.from_dict(json.loads(text)).sun_azimuth == -180
        assert not {"radius_50", "radius_90"} & set(json.loads(text)["sun"])
        assert json.loads(text)["sun"]["visibility"] in (0, 1)

    def test_the_map_that_is_downloaded_has_the_sun_where_the_slider_put_it(self, visit: dict[str, Any]) -> None:
        assert visit["exr"] == "railway_field.exr"
        image, _ = read_exr(visit["folder"] / "map.exr")
        assert image.shape == (512, 1024, 3)
        _, column, _ = np.unravel_index(int(image.argmax()), image.shape)
        assert min(column, 1023 - column) <= 2
        assert read_hdr(visit["folder"] / "map.hdr").shape == (256, 512, 3)
        with Image.open(visit["folder"] / "map.png") as picture:
            assert picture.size == (512, 256)

    def test_every_scene_and_the_preview_are_downloaded(self, visit: dict[str, Any]) -> None:
        for tool in EXPORTERS:
            with zipfile.ZipFile(visit["folder"] / f"{tool}.zip") as scene:
                assert any(name.endswith((".png", ".glb", ".html")) for name in scene.namelist())
        with Image.open(visit["folder"] / "preview.png") as picture:
            assert picture.width == 1600

    def test_what_is_copied_runs(self, visit: dict[str, Any]) -> None:
        """The commands as curl, the programs in Python, for the estimate and for the light that was changed."""
        folder, target = visit["folder"], visit["folder"] / "railway_field.exr"
        assert visit["url"] in visit["curl"]
        assert "sun_azimuth=-180" in visit["changedCurl"]
        maps = []
        for kind in ("curl", "python", "changedCurl", "changedPython"):
            target.unlink(missing_ok=True)
            run(visit[kind], folder)
            maps.append(read_exr(target)[0])
        assert np.allclose(maps[0], maps[1], rtol=1e-3)
        assert np.allclose(maps[2], maps[3], rtol=1e-3)
        assert not np.allclose(maps[0], maps[2], rtol=1e-3)

    def test_a_text_file_is_refused_in_words(self, visit: dict[str, Any]) -> None:
        assert visit["error"].startswith("The photo cannot be read. notes.txt: The file is not a ")
        assert visit["kept"] == [visit["title"], f"Below is still the answer for {PHOTO.name}.", ""]

    def test_what_is_said_of_an_error_goes_away_with_it(self, visit: dict[str, Any]) -> None:
        assert visit["forgiven"] == [False, False]

    def test_one_of_several_that_is_no_photo_is_named(self, visit: dict[str, Any]) -> None:
        assert "Photo 2 of 2, notes.txt: " in visit["errorOfOne"]

    def test_more_photos_than_are_taken_are_refused_in_words(self, visit: dict[str, Any]) -> None:
        detail = "At most 8 photos are taken here, and the form holds more."
        assert visit["errorOfMany"] == f"These photos cannot be taken. {detail}"


@pytest.mark.slow
@in_chromium
class TestTheObject:
    def test_a_click_moves_it_there(self, visit: dict[str, Any]) -> None:
        assert np.allclose(visit["clicked"], [0.44, 0.85], atol=0.01)
        assert "away, if the camera was 1.6 m above the ground" in visit["scene"]

    def test_a_drag_turns_it_and_leaves_it_where_it_is(self, visit: dict[str, Any]) -> None:
        turn, foot = visit["dragged"]
        assert float(turn) > 10
        assert foot == visit["clicked"]

    def test_keys_move_turn_and_scale_it(self, visit: dict[str, Any]) -> None:
        (turn, foot, _), (before, start) = visit["keyed"], visit["dragged"]
        assert float(turn) == pytest.approx(float(before) + 10, abs=1)
        assert foot[0] > start[0]
        assert foot[1] < start[1]

    def test_the_sky_is_no_place_for_it(self, visit: dict[str, Any]) -> None:
        note, foot = visit["sky"]
        assert "below the horizon" in note
        assert foot == visit["keyed"][1]

    def test_all_of_it_is_undone(self, visit: dict[str, Any]) -> None:
        undo, foot = visit["back"]
        assert not undo
        assert foot != visit["clicked"]

    def test_the_shadow_darkens_lit_ground_and_ends_where_the_photo_is_in_shade(self, visit: dict[str, Any]) -> None:
        """The sun is to the left: the shadow runs to the right, from the lit half into the half in shade."""
        picture = colours(visit["folder"] / "shadow.png")
        height, width = picture.shape
        rows = slice(round(0.82 * height), round(0.88 * height))
        lit, shade = picture[rows, round(0.2 * width)].mean(), picture[rows, round(0.95 * width)].mean()
        shadow = picture[rows, round(0.485 * width) : round(0.495 * width)]
        beyond = picture[rows, round(0.53 * width) : round(0.6 * width)]
        assert np.median(shadow) < SEEN_RATIO * lit
        assert beyond.min() > 0.85 * shade

    def test_its_light_follows_the_sun(self, visit: dict[str, Any]) -> None:
        assert visit["before"] != visit["after"]

    def test_materials_look_different(self, visit: dict[str, Any]) -> None:
        assert len(set(visit["looks"])) == 3

    def test_a_dropped_glb_takes_its_place_in_its_own_material(self, visit: dict[str, Any]) -> None:
        assert not visit["ownOffered"]
        assert visit["own"] == ["chair.glb", True]
        with Image.open(visit["folder"] / "own.png") as picture:
            red, green, _ = np.moveaxis(np.asarray(picture.convert("RGB"), dtype=int), 2, 0)
        assert (green > red + 40).sum() > 50
        assert "cannot be read" in visit["brokenModel"]


@pytest.mark.slow
@in_chromium
class TestWhatThePhotoSays:
    def test_it_is_shown(self, visit: dict[str, Any]) -> None:
        time, place, _, lens, camera, held = visit["facts"]
        assert (time, place) == ("2024-08-10 14:28:12 (no time zone)", "not in the file")
        assert (lens, camera) == ("20 mm (as of a 35 mm camera)", "SONY ILCE-9M2")
        assert held == "not in the file"

    def test_it_is_corrected_in_the_page(self, visit: dict[str, Any]) -> None:
        (asked,) = visit["corrected"]
        assert {"lat=41.91", "lon=12.48", "utc_offset=%2B02%3A00"} <= set(urlsplit(asked).query.split("&"))
        before, corrected, after = visit["evidence"]
        assert "time and place" in corrected
        assert "time and place" not in before == after
        assert visit["form"] == "2024-08-10T14:28:12"
        assert "dark" in visit["night"]
        assert visit["nightInSight"]

    def test_several_photos_are_answered_together(self, visit: dict[str, Any]) -> None:
        assert len(visit["together"]) == 2
        assert "other photos" in visit["togetherEvidence"]
        assert visit["second"] == [DATED, "true"]

    def test_their_files_and_copies_hold_the_light_that_the_page_shows(self, visit: dict[str, Any]) -> None:
        folder = visit["folder"]
        said = Lighting.from_dict(json.loads((folder / "together.json").read_text()))
        image, held = read_exr(folder / "together.exr")
        power = ("exposure", "sun_irradiance", "sky_irradiance", "sky_cover", "ground_color")
        for name in ("sun_azimuth", *power, "camera_elevation", "camera_roll", "vertical_fov"):
            assert getattr(held, name) == pytest.approx(getattr(said, name), rel=1e-5), name
        np.testing.assert_allclose(image, together([PHOTO, folder / DATED]), rtol=5e-3, atol=2e-3)
        for copied in visit["togetherCopies"]:
            run(copied, folder)
            np.testing.assert_allclose(read_exr(folder / DATED.replace("jpg", "exr"))[0], image, atol=2e-3)

    def test_a_copy_goes_away_with_what_it_is_of(self, visit: dict[str, Any]) -> None:
        assert visit["copyShown"] == [True, False]

    def test_heic_is_shown_as_the_service_decodes_it(self, visit: dict[str, Any]) -> None:
        if "heic" not in visit:
            pytest.skip("pillow-heif is not installed")
        width, height, status = visit["heic"]
        assert (width, height) == (320, 240)
        assert "The service decoded it" in status

    def test_the_headline_is_as_soft_as_the_answer(self, visit: dict[str, Any]) -> None:
        assert visit["titles"] == [
            "No direct sun",
            "Sun probably right of the camera",
            "This does not look like an outdoor daylight photo",
        ]
        assert visit["warnings"] == ["The clock and the pixels disagree."]
        line, share, grey = visit["pale"]
        assert line == share == grey


@pytest.mark.slow
@in_chromium
class TestForEverybody:
    def test_an_example_is_answered_on_a_narrow_screen_by_keyboard(self, visit: dict[str, Any]) -> None:
        assert len(visit["examples"]) == 6
        assert visit["example"]
        assert visit["overflow"] == [0, 0]

    def test_axe_finds_nothing_serious(self, visit: dict[str, Any]) -> None:
        assert visit["faultsBefore"] == visit["faults"] == visit["narrowFaults"] == []

    def test_the_first_view_is_small(self, visit: dict[str, Any]) -> None:
        assert [path for path in visit["first"] if path.startswith("v1/")] == ["v1/model"]
        served = [BUNDLE / (path or "index.html") for path in visit["first"] if path != "v1/model"]
        assert len(served) > 8
        assert sum(len(gzip.compress(file.read_bytes())) for file in served) < FIRST_VIEW

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
    again = site(tmp_path).get("/", headers={"If-None-Match": answer.headers["ETag"]})
    assert (again.status_code, again.content) == (304, b"")
    script = site(tmp_path).get("/assets/main-1.js")
    assert "immutable" in script.headers["Cache-Control"]
    assert script.headers["Content-Type"].startswith("text/javascript")


def packed_site(bundle: Path) -> TestClient:
    """A page with a script and its gzipped copy, and a picture without one."""
    (bundle / "assets").mkdir()
    for name, data in (("index.html", b"<p>page</p>"), ("assets/main-1.js", b"true"), ("assets/icon-1.svg", b"<svg/>")):
        (bundle / name).write_bytes(data)
        (bundle / f"{name}.gz").write_bytes(gzip.compress(data))
    (bundle / "assets" / "sky-1.jpg").write_bytes(b"\xff\xd8")
    return site(bundle)


@pytest.mark.parametrize("accepted", ["gzip", "br, GZIP;q=0.5", "*", "gzip, identity;q=0", "x, gzip ; q=1.0"])
def test_a_client_that_takes_gzip_gets_the_copy(tmp_path: Path, accepted: str) -> None:
    client, plain = packed_site(tmp_path), {"Accept-Encoding": "identity"}
    for path, text, kind in (("/", "<p>page</p>", "text/html"), ("/assets/icon-1.svg", "<svg/>", "image/svg+xml")):
        answer, other = client.get(path, headers={"Accept-Encoding": accepted}), client.get(path, headers=plain)
        assert answer.text == other.text == text
        assert answer.headers["Content-Encoding"] == "gzip"
        assert answer.headers["Content-Length"] == str(len(gzip.compress(text.encode())))
        assert answer.headers["Vary"] == other.headers["Vary"] == "Accept-Encoding"
        assert answer.headers["Content-Type"] == other.headers["Content-Type"]
        assert answer.headers["Content-Type"].startswith(kind)
        assert answer.headers["ETag"] != other.headers["ETag"]
        known = {"Accept-Encoding": accepted, "If-None-Match": answer.headers["ETag"]}
        again = client.get(path, headers=known)
        assert (again.status_code, again.headers["Vary"]) == (304, "Accept-Encoding")
        assert "Content-Encoding" not in again.headers
        assert client.get(path, headers={**known, **plain}).status_code == 200


@pytest.mark.parametrize("accepted", ["", "identity", "br", "gzip;q=0", "gzip;q=0.000, *", "*;q=0"])
def test_another_client_gets_the_file_itself(tmp_path: Path, accepted: str) -> None:
    answer = packed_site(tmp_path).get("/assets/main-1.js", headers={"Accept-Encoding": accepted})
    assert (answer.text, answer.headers["Content-Length"]) == ("true", "4")
    assert "Content-Encoding" not in answer.headers
    assert answer.headers["Vary"] == "Accept-Encoding"


def test_a_file_without_a_copy_is_the_same_for_all(tmp_path: Path) -> None:
    client = packed_site(tmp_path)
    answer = client.get("/assets/sky-1.jpg", headers={"Accept-Encoding": "gzip"})
    assert (answer.status_code, answer.content) == (200, b"\xff\xd8")
    assert not {"content-encoding", "vary"} & set(answer.headers)
    for path in ("/assets/none.js", "/assets/%00", f"/assets/{'a' * 300}", "/assets/../../page.py", "/assets/"):
        assert client.get(path, headers={"Accept-Encoding": "gzip"}).status_code == 404


@pytest.mark.skipif(not (BUNDLE / "index.html").is_file(), reason="the page is not built")
def test_the_build_makes_a_copy_of_all_that_gets_smaller_by_it() -> None:
    copies = {file.with_suffix("") for file in BUNDLE.rglob("*.gz")}
    assert copies == {file for file in BUNDLE.rglob("*") if file.suffix in {".html", ".css", ".js", ".svg"}}
    for file in copies:
        assert gzip.decompress(file.with_name(f"{file.name}.gz").read_bytes()) == file.read_bytes()


@pytest.mark.parametrize("asked", ["bytes=0-1", "bytes=9-", "bytes=0-1,9-", "bytes=a-b", "lines=0-1"])
def test_a_file_of_the_page_comes_whole_whatever_range_is_asked_for(tmp_path: Path, asked: str) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("page")
    (tmp_path / "assets" / "main-1.js").write_text("true")
    for path, text in (("/", "page"), ("/assets/main-1.js", "true")):
        answer = site(tmp_path).get(path, headers={"Range": asked})
        assert (answer.status_code, answer.text) == (200, text)
        assert answer.headers["Accept-Ranges"] == "none"


def test_browsers_get_an_icon(client: TestClient) -> None:
    answer = client.get("/favicon.ico")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png")
    assert Image.open(BytesIO(answer.content)).size == (32, 32)
    assert answer.headers["cache-control"] == "public, max-age=86400"
