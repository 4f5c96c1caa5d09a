"""The page in Chromium, visited feature by feature by tests/browser/FEATURE.mjs."""

import gzip
import json
import os
import re
import shutil
import struct
import subprocess
import sys
import threading
import time
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
import uvicorn
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageOps, ImageSequence

from lighting.estimator import Estimator
from lighting.files import MAP_FORMATS
from lighting.files.exr import read_exr
from lighting.files.radiance_hdr import decode_hdr
from lighting.geometry import camera_axes
from lighting.ground import draw_ground_mask
from lighting.photo.reader import TARGET, read_photo
from lighting.record_json import record_with_coefficients
from lighting.records import Lighting
from lighting.registration.features import MATCH_SIDE, has_opencv
from lighting.scene import EXPORTERS
from server.app import create_app
from server.pages import BUNDLE
from server.settings import Settings
from tests.helpers.cameras import picture, texture
from tests.helpers.photos import phone
from tests.helpers.visits import Seen, visit_feature

ROOT = Path(__file__).parents[2]
PHOTO = ROOT / "examples" / "railway_field.jpg"
STREET = ROOT / "examples" / "brick_street.jpg"  # whose answer is unsure
NOON = ROOT / "examples" / "rome" / "noon_steps.jpg"
DATED = "dated.jpg"  # the same with its time and focal length, and without its location
FIRST_VIEW = 45_000  # bytes, compressed, without the pictures of examples
FIRST_PICTURES = 400_000  # bytes
SHADOW_RATIO = 0.75  # of the light that is left in the object's shadow, at most: sun and sky of a clear day
SIZE = (320, 240)
SUNLIT, SHADED = (165, 156, 138), (45, 50, 62)  # ground
METADATA = ["2024-08-10 14:28:12 (time zone by GPS)", "41.9058°\N{NO-BREAK SPACE}N, 12.4824°\N{NO-BREAK SPACE}E"]
SAVE_OPTIONS: dict[str, dict[str, Any]] = {
    **{"jpg": {}, "png": {}, "webp": {}, "tif": {}, "avif": {}},
    "lossless.webp": {"lossless": True},
}

Visit = Callable[[str], Seen]


pytestmark = [pytest.mark.slow, pytest.mark.needs("chromium", "node", "server/web")]


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


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the visitors' files are, those that they bring and those that they download."""
    return tmp_path_factory.mktemp("visits")


@pytest.fixture(scope="module")
def visits(url: str, folder: Path) -> Visit:
    """Visits a feature of the page, each once, and returns what the visitor saw."""
    files = write_files(folder)

    @cache
    def visit(feature: str) -> Seen:
        return visit_feature(url, feature, files)

    return visit


def write_files(folder: Path) -> dict[str, Any]:
    """What the visitors bring along, by name."""
    (folder / "notes.txt").write_text("This is no photo.", encoding="utf-8")
    (folder / "box.glb").write_bytes(triangle_model(1))
    (folder / "wide.glb").write_bytes(triangle_model(4))
    halves().save(folder / "small.png")
    half_shaded_mask().save(folder / "ground-mask.png")
    shutil.copy(PHOTO, folder)
    with Image.open(NOON) as photo:
        exif = photo.getexif()
        del exif[ExifTags.Base.GPSInfo]
        photo.save(folder / DATED, exif=exif)
    return {
        **{
            "folder": str(folder),
            "photo": str(PHOTO),
            "other": str(NOON),
            "street": str(STREET),
            "dated": str(folder / DATED),
        },
        **{
            "groundMask": str(folder / "ground-mask.png"),
            "small": str(folder / "small.png"),
            "textFile": str(folder / "notes.txt"),
            "heic": heic(folder),
        },
        **{"model": str(folder / "box.glb"), "wideModel": str(folder / "wide.glb")},
        **{"formats": every_format(folder, 1), "upright": every_format(folder, 6)},
        **{"letterbox": letterbox(folder), "overlapping": overlapping(folder), "tilted": tilted(folder)},
    }


def halves() -> Image.Image:
    """A blue sky above ground in the sun, of which the right half lies in shade."""
    pixels = np.zeros((240, 320, 3))
    pixels[:120] = np.linspace((40, 90, 180), (150, 190, 235), 120)[:, None]
    pixels[120:, :160], pixels[120:, 160:] = SUNLIT, SHADED
    return Image.fromarray(pixels.astype(np.uint8))


def half_shaded_mask() -> Image.Image:
    """What the service would say of the ground of `halves`, if it knew its camera and its light."""
    lit = np.ones((192, 256), dtype=np.float32)
    lit[96:, 128:] = 0
    return Image.fromarray(draw_ground_mask(lit, Lighting(-90.0, 30.0, 3.0, 5.0, vertical_fov=60.0), None))


def letterbox(folder: Path) -> str:
    """A photo of SIZE between black bars."""
    with Image.open(PHOTO) as photo:
        ImageOps.expand(photo.convert("RGB").resize(SIZE), (0, 60), "black").save(folder / "letterbox.png")
    return str(folder / "letterbox.png")


def triangle_model(width: int) -> bytes:
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


def heic(folder: Path) -> str:
    """A photo as HEIC; empty without pillow-heif."""
    with suppress(ImportError):
        import pillow_heif

        with Image.open(PHOTO) as photo:
            pillow_heif.from_pillow(photo.resize(SIZE)).save(folder / "photo.heic")
        return str(folder / "photo.heic")
    return ""


def read_path(text: str) -> list[float]:
    """The numbers of a line that is drawn as SVG."""
    return [float(number) for number in re.findall(r"-?[\d.]+", text)]


def small_photo(orientation: int) -> tuple[Image.Image, Image.Exif]:
    """A small photo and the EXIF block of the original, with another orientation."""
    with Image.open(NOON) as original:
        exif = original.getexif()
        exif[ExifTags.Base.Orientation] = orientation
        return original.convert("RGB").resize(SIZE), exif


def every_format(folder: Path, orientation: int) -> dict[str, str]:
    """Files of the same photo and metadata, by suffix."""
    files = {}
    for suffix, options in SAVE_OPTIONS.items():
        files[suffix] = str(folder / f"way{orientation}.{suffix}")
        photo, exif = small_photo(
            orientation
        )  # anew, since Pillow takes the orientation out of what it writes to an AVIF
        photo.save(files[suffix], exif=exif, **options)
    with suppress(ImportError):
        import pillow_heif

        files["heic"] = str(folder / f"way{orientation}.heic")
        photo, exif = small_photo(orientation)
        pillow_heif.from_pillow(photo).save(files["heic"], exif=exif.tobytes())
    return files


def tilted(folder: Path) -> list[str]:
    """The photo as of a phone that states that it looked 10 deg up, and 80 deg up, both with a roll of 3 deg."""
    files = []
    for elevation in (10.0, 80.0):
        files.append(str(folder / f"tilted{elevation:.0f}.jpg"))
        lateral, above, into = camera_axes(0.0, elevation, 3.0)[:, 1]
        with Image.open(NOON) as original:
            original.convert("RGB").resize(SIZE[::-1]).save(files[-1], exif=phone(-lateral, -above, into, 1))
    return files


def overlapping(folder: Path) -> list[str]:
    """Two photos that overlap, the second rotated by 25 deg, and one of another location."""
    files = []
    for number, (seed, azimuth) in enumerate([(0, 0.0), (0, 25.0), (1, 0.0)]):
        files.append(str(folder / f"view{number}.png"))
        Image.fromarray(picture(texture(seed), (azimuth, 2.0, 6.0), 50.0)).save(files[-1])
    return files


def read_rgb(file: Path) -> NDArray[np.float64]:
    """A picture's 8-bit values (H, W, 3)."""
    with Image.open(file) as image:
        return np.asarray(image.convert("RGB"), dtype=np.float64)


def read_luminance(file: Path) -> NDArray[np.float64]:
    """A picture's linear luminance, roughly."""
    with Image.open(file) as image:
        return (np.asarray(image.convert("L"), dtype=np.float64) / 255) ** 2.2


@pytest.mark.parametrize(
    "feature",
    [
        "book",
        "upload",
        "key",
        "metadata",
        "undo",
        "tools",
        "day",
        "project",
        "object",
        "downloads",
        "several",
        "webgl_loss",
        "mobile",
        "studio",
        "docs",
    ],
)
def test_the_browser_has_nothing_to_complain_of(visits: Visit, feature: str) -> None:
    """No script error, nothing the content policy stops, nothing from another host."""
    assert visits(feature)["complaints"] == []


class TestUpload:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("upload")

    def test_the_first_view_is_small(self, seen: Seen) -> None:
        assert [path for path in seen["firstRequests"] if path.startswith("v1/")] == ["v1/model"]
        served = [BUNDLE / (path or "index.html") for path in seen["firstRequests"] if path != "v1/model"]
        pictures = [file for file in served if file.suffix in {".jpg", ".webp"}]
        assert len(pictures) == 8
        assert sum(file.stat().st_size for file in pictures) < FIRST_PICTURES
        texts = [file for file in served if file not in pictures]
        assert len(texts) >= 3
        assert sum(len(gzip.compress(file.read_bytes())) for file in texts) < FIRST_VIEW

    def test_axe_finds_nothing_serious(self, seen: Seen) -> None:
        assert seen["faults"] == []

    def test_every_format_has_the_same_metadata(self, seen: Seen) -> None:
        assert {name: rows[:2] for name, rows in seen["metadata"].items() if rows[:2] != METADATA} == {}
        assert {rows[2] for rows in seen["metadata"].values()} == {"20 mm (as of a 35 mm camera)"}
        assert set(SAVE_OPTIONS) <= set(seen["metadata"])

    def test_what_the_file_does_not_say_is_not_listed(self, seen: Seen) -> None:
        assert seen["metadataOfNone"] == [[], False]

    def test_every_format_is_shown_upright(self, seen: Seen) -> None:
        assert {name: shown for name, shown in seen["upright"].items() if shown != [240, 320, "0.75"]} == {}
        assert seen["upright"].keys() == seen["metadata"].keys()

    def test_what_lies_inside_a_border_is_shown_alone(self, seen: Seen) -> None:
        shown = seen["letterbox"]
        assert shown["size"] == list(SIZE)
        assert shown["aspect"] == str(SIZE[0] / SIZE[1])
        assert min(shown["edges"]) > 40  # no bar above or below

    def test_heic_is_shown_as_the_service_decodes_it(self, seen: Seen) -> None:
        if "heic" not in seen:
            pytest.skip("needs pillow_heif")
        width, height, status = seen["heic"]
        assert (width, height) == SIZE
        assert "The service decoded it" in status

    def test_a_text_file_is_refused_with_a_sentence(self, seen: Seen) -> None:
        assert seen["error"] == "The photo cannot be read. notes.txt: This is a text, not a photo."
        assert seen["previousAnswer"] == [seen["title"], f"Below is still the answer for {PHOTO.name}.", ""]

    def test_an_error_goes_with_the_next_change_or_success(self, seen: Seen) -> None:
        assert seen["errorAfterChange"] == [False, False]
        assert not seen["errorAfterModel"]

    def test_one_of_several_that_is_no_photo_is_named(self, seen: Seen) -> None:
        assert "Photo 2 of 2, notes.txt: " in seen["errorOfOne"]

    def test_more_photos_than_are_taken_are_refused_with_a_sentence(self, seen: Seen) -> None:
        detail = "At most 8 photos are taken here, and the form holds more."
        assert seen["errorOfMany"] == f"These photos cannot be taken. {detail}"

    def test_another_try_is_for_the_photo_on_show(self, seen: Seen) -> None:
        assert seen["again"] == [[PHOTO.name, False]] * 2

    def test_a_missing_example_is_refused_as_a_missing_answer(self, seen: Seen) -> None:
        down, busy = seen["missingExamples"]
        assert down.startswith("The service did not answer. Check your connection")
        assert busy.startswith("The service answered 503.")

    def test_text_that_is_dropped_or_pasted_is_refused_with_a_sentence(self, seen: Seen) -> None:
        rest = "is no file. Save the photo, then choose or drop the file."
        assert seen["noFile"] == [f"That did not work. What you {did} {rest}" for did in ("dropped", "pasted")]
        assert seen["textInField"] == [True, False]

    def test_an_example_may_be_dragged_and_is_answered_whatever_else_is_wrong(self, seen: Seen) -> None:
        assert seen["meanwhile"] == ["Looking at garden_windows.jpg…", ""]
        assert seen["dragged"] == ["garden_windows.jpg", False]

    def test_the_example_chosen_last_is_shown_however_late_the_first_comes(self, seen: Seen) -> None:
        assert seen["underway"] == "Looking at brick_street.jpg…"
        status, shown = seen["overtaken"]
        assert status.startswith("shore_dusk.jpg: answered in ")
        assert shown == "shore_dusk.jpg"

    def test_a_file_that_changes_on_its_disk_stays_the_one_on_show(self, seen: Seen) -> None:
        assert seen["changedFile"] == "saved"

    def test_a_long_name_stays_on_a_phone(self, seen: Seen) -> None:
        assert seen["overflow"] == 0


class TestBook:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("book")

    def test_all_of_it_is_from_the_service(self, seen: Seen) -> None:
        assert seen["requests"] == []

    def test_axe_finds_nothing(self, seen: Seen) -> None:
        assert (seen["searchFaults"], seen["phoneFaults"]) == ([], [])

    def test_the_search_is_worked_by_keys(self, seen: Seen) -> None:
        assert "found" in seen["count"]
        assert seen["closed"]
        assert seen["focused"].startswith("lighting envmap · Command line")
        assert seen["copied"].startswith("lighting envmap [OPTIONS]")

    def test_a_phone_has_the_contents_folded_and_scrolls_down_alone(self, seen: Seen) -> None:
        assert seen["titles"][1] == "Command line"
        assert (seen["folded"], seen["overflow"]) == (True, 0)


def test_a_key_that_no_request_can_carry_is_refused_beside_its_field(visits: Visit) -> None:
    seen = visits("key")
    assert seen["badKey"]["form"]
    assert "no request can carry" in seen["badKey"]["note"]
    assert seen["badKey"]["stored"] == 0
    assert seen["sentKeys"] == [None, "Bearer key"]


def test_the_reference_lists_routes_readably_and_gives_a_first_answer(visits: Visit) -> None:
    seen = visits("docs")
    assert (seen["faults"], seen["status"]) == ([], "200")


class TestMetadata:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("metadata")

    def test_they_are_shown(self, seen: Seen) -> None:
        assert seen["rows"] == ["2024-08-10 14:28:12 (no time zone)", "20 mm (as of a 35 mm camera)"]

    def test_they_are_corrected_in_the_page(self, seen: Seen) -> None:
        (request,) = seen["requests"]
        assert {"latitude=41.91", "longitude=12.48", "utc_offset=%2B02%3A00"} <= set(urlsplit(request).query.split("&"))
        before, corrected, after = seen["evidence"]
        assert "time and place" in corrected
        assert "time and place" not in before == after
        assert seen["time"] == "2024-08-10T14:28:12"
        assert seen["marked"] == [False, True]
        clicked, keyed = (list(map(float, place)) for place in seen["places"])
        assert clicked == pytest.approx([41.9, 12.2], abs=1.5)  # of a map on which a pixel is a degree
        assert keyed == pytest.approx([clicked[0] + 0.5, clicked[1] - 10])
        assert seen["placeSaid"] == f"{keyed[0]:.1f}° N, {keyed[1]:.1f}° E"
        assert "dark" in seen["night"]
        assert seen["nightInSight"]

    def test_the_headline_is_as_soft_as_the_answer(self, seen: Seen) -> None:
        assert seen["titles"] == [
            "No direct sun",
            "Sun probably right of the camera",
            "This does not look like an outdoor daylight photo",
        ]
        assert seen["warnings"] == ["The clock and the pixels disagree."]
        line, share, grey = seen["pale"]
        assert line == share == grey

    def test_axe_finds_nothing_serious(self, seen: Seen) -> None:
        assert seen["faults"] == []


class TestTools:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("tools")

    def test_an_unsure_answer_has_suns_to_pick_from(self, seen: Seen) -> None:
        pressed, picked, undone = seen["picked"]
        assert (seen["chips"], pressed) == (3, "true")
        assert picked != undone

    def test_they_are_on_the_photo_and_on_the_compass_too(self, seen: Seen) -> None:
        assert seen["chipsElsewhere"] == [[seen["picked"][1], True]] * 2  # the sun's own mark is there then

    def test_the_sun_follows_a_shadow_while_it_is_drawn(self, seen: Seen) -> None:
        before, live = seen["live"]
        assert before != live
        assert seen["loupe"]

    def test_a_drawn_shadow_is_evidence_until_it_is_undone(self, seen: Seen) -> None:
        unsure, with_shadow, undone = seen["trust"]
        assert unsure.startswith("Unsure: draw a shadow")
        assert with_shadow == "Sure"
        assert undone == unsure
        assert seen["drawn"] == ["Shadow \N{MULTIPLICATION SIGN}"]
        assert seen["asked"] >= 1

    def test_a_drawn_shadow_may_be_a_guess(self, seen: Seen) -> None:
        sure, asked, guessed, undone = seen["guess"]
        assert sure == undone == [False, 0]
        assert re.fullmatch(r"doubt:(\d+\.\d,){3}\d+\.\d", asked)
        assert guessed == [True, 1]  # and dashed

    def test_a_tap_adds_the_border_of_a_lit_side_and_the_sun_follows_it(self, seen: Seen) -> None:
        text, direction, is_guess_hidden, dragged, moved = seen["border"]
        assert text.startswith("lit:")
        shaded, lit, border = (float(text.removeprefix("lit:").split(",")[i]) for i in (0, 2, 4))
        assert border == pytest.approx(shaded + 0.05 / 0.08 * (lit - shaded), abs=2)
        assert is_guess_hidden
        assert dragged != direction
        assert float(moved.split(",")[4]) < border

    def test_every_kind_of_shadow_is_drawn(self, seen: Seen) -> None:
        with_top, *others = seen["otherShadows"]
        assert len(with_top.split(",")) == 6
        counts = {prefix: rest.count(",") + 1 for prefix, rest in (text.split(":") for text in others)}
        assert counts == {"own": 2, "head": 2, "line": 4, "lit": 4}

    def test_a_thing_of_known_size_is_stated(self, seen: Seen) -> None:
        assert seen["size"] == [["Size \N{MULTIPLICATION SIGN}"], True]

    def test_the_estimated_horizon_is_dragged_as_a_whole_by_its_ends_and_by_keys(self, seen: Seen) -> None:
        assert seen["grips"] == ["Horizon: left end", "Horizon", "Horizon: right end"]
        assert seen["dragged"] == [True, 0]  # the line follows before anything is asked
        whole, tilted, keyed = (tuple(map(float, line.split(","))) for line in seen["horizons"])
        assert tilted[:2] == whole[:2]
        assert tilted[3] < whole[3]
        assert keyed[2:] == tilted[2:]
        assert keyed[1] > tilted[1]
        assert seen["focused"] == "Horizon: left end"
        assert seen["gripsOfPlace"] == 0

    def test_each_drag_of_the_horizon_is_one_step(self, seen: Seen) -> None:
        assert seen["horizonUndone"] == [1, 2]  # the size alone, and with the horizon

    def test_two_upright_edges_tell_the_camera_and_can_be_dragged_again(self, seen: Seen) -> None:
        chips, lines, evidence, moved = seen["upright"]
        assert chips == [f"{name} \N{MULTIPLICATION SIGN}" for name in ("Horizon", "Edges", "Size")]
        assert [len(line.split(",")) for line in lines.split(";")] == [4, 4]
        assert "the lines that you drew" in evidence
        (first, second), (first_moved, second_moved) = lines.split(";"), moved.split(";")
        assert first_moved == first
        assert second_moved.split(",")[:2] == second.split(",")[:2]
        assert float(second_moved.split(",")[2]) < float(second.split(",")[2])

    def test_the_camera_follows_edges_while_they_are_drawn(self, seen: Seen) -> None:
        before, while_first, with_first, while_second, with_both = map(read_path, seen["cameras"][:5])
        assert before != while_first
        assert while_first == pytest.approx(with_first, abs=1)  # pixels, against the service's answer
        assert while_second == pytest.approx(with_both, abs=1)

    def test_two_level_edges_are_stated_together(self, seen: Seen) -> None:
        asked, lines = seen["level"]
        assert asked == "Now along another level edge of the same wall."
        *uprights, level = lines.split(";")
        assert len(uprights) == 2
        assert level.startswith("level:")
        assert len(level.split(",")) == 8

    def test_the_sun_is_dragged_on_the_map(self, seen: Seen) -> None:
        before, dragged, undone = seen["map"]
        assert dragged == pytest.approx([90, 45], abs=1)
        assert before == undone


class TestDay:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("day")

    def test_the_sun_of_midwinter_in_rome(self, seen: Seen) -> None:
        (first, rising), (last, setting), (_, noonward) = seen["hours"]
        assert ("07:30" <= first <= "07:50", "16:30" <= last <= "16:50") == (True, True)
        assert max(rising, setting) < 3 < noonward < 25
        assert "relit: a guess" in seen["note"]

    def test_without_a_place_a_sentence_says_what_is_missing(self, seen: Seen) -> None:
        sentence, slider = seen["withoutPlace"]
        assert "latitude and longitude" in sentence
        assert not slider


class TestProject:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("project")

    def test_it_holds_the_edits_and_the_checksum(self, seen: Seen, folder: Path) -> None:
        assert seen["name"] == "brick_street.project.json"
        project = json.loads((folder / "street.project.json").read_text())
        assert project["photo"] == {
            "name": STREET.name,
            "bytes": STREET.stat().st_size,
            "crc32": zlib.crc32(STREET.read_bytes()),
        }
        assert project["user_input"] == {"camera_height": "3"}
        assert project["edits"]["parameters"]["sun_azimuth"] == -180

    def test_it_opens_on_its_photo_now_or_when_that_comes(self, seen: Seen) -> None:
        assert seen["azimuths"] == ["-180"] * 3

    def test_another_photo_or_file_is_refused_with_a_sentence(self, seen: Seen) -> None:
        another, no_project = seen["refused"]
        rest = "and this is another photo. Choose brick_street.jpg to see them."
        assert another == f"That did not work. These edits are of brick_street.jpg, {rest}"
        assert no_project == "That did not work. This is no project that was saved here, or it was damaged."

    def test_a_link_opens_its_example_and_is_never_sent(self, seen: Seen) -> None:
        said, link = seen["copied"]
        assert said == "The link is copied. It holds your edits, not the photo."
        assert "#edits/" in link
        assert seen["followed"] == ["brick_street.jpg", "3"]
        assert seen["sent"] == []

    def test_answers_are_undone_and_redone_without_asking_again(self, seen: Seen) -> None:
        assert seen["restated"] == ["3", "3", "", "3", "3"]
        assert seen["asked"] == []


class TestUndo:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("undo")

    def test_sixty_key_presses_make_at_most_two_requests(self, seen: Seen) -> None:
        assert len(seen["requests"]) <= 2

    def test_they_are_undone_in_one_step(self, seen: Seen) -> None:
        pressed, undone, redone = seen["keys"]
        assert undone != pressed == redone

    def test_a_slow_drag_of_a_slider_is_one_step(self, seen: Seen) -> None:
        start, first, second, undone, undone_twice = seen["slider"]
        assert len({start[0], first[0], second[0]}) == 3
        assert (undone, undone_twice) == (first, start)

    def test_a_slow_drag_on_the_dome_is_one_step(self, seen: Seen) -> None:
        start, dragged, undone = seen["dome"]
        assert dragged != start == undone

    def test_keys_undo_from_a_chooser_too(self, seen: Seen) -> None:
        start, changed, undone = seen["chooser"]
        assert undone == start != changed


class TestObject:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("object")

    def test_the_wipe_shows_the_photo_without_it(self, seen: Seen, folder: Path) -> None:
        with_object, without = (read_rgb(folder / f"wipe-{value}.png") for value in (0, 100))
        height, width, _ = without.shape
        row, column = int(seen["wipe"][1] * height) - 8, int(seen["wipe"][0] * width)
        place = np.s_[row - 6 : row, column - 9 : column - 3]  # left of the edge of the shade
        assert np.abs(without[place] - SUNLIT).max() < 12
        assert np.abs(with_object[place] - without[place]).mean() > 15

    @pytest.mark.parametrize("suffix", ["webp", "gif"])
    def test_a_turntable_is_an_animated_webp_or_gif(self, seen: Seen, folder: Path, suffix: str) -> None:
        assert f"small-turntable.{suffix}" in seen["turntables"]
        with Image.open(folder / f"turntable.{suffix}") as turntable:
            assert (turntable.format, turntable.info["loop"]) == (suffix.upper(), 0)
            frames = [np.asarray(frame.convert("RGB"), np.float64) for frame in ImageSequence.Iterator(turntable)]
            assert turntable.info["duration"] == 80
        assert len(frames) == 36
        assert np.abs(frames[9] - frames[0]).max() > 40  # the teapot's spout is elsewhere
        assert np.abs(frames[9] - frames[0])[0].max() < 12  # the sky is not

    def test_a_click_moves_it_there(self, seen: Seen) -> None:
        assert np.allclose(seen["clicked"], [0.44, 0.85], atol=0.01)
        assert "away, if the camera was 1.6 m above the ground" in seen["scene"]

    def test_a_drag_rotates_it_and_leaves_it_where_it_is(self, seen: Seen) -> None:
        rotation, foot = seen["dragged"]
        assert float(rotation) > 10
        assert foot == seen["clicked"]

    def test_keys_move_rotate_and_scale_it(self, seen: Seen) -> None:
        (rotation, foot, _), (before, start) = seen["keyed"], seen["dragged"]
        assert float(rotation) == pytest.approx(float(before) + 10, abs=1)
        assert foot[0] > start[0]
        assert foot[1] < start[1]

    def test_it_does_not_go_into_the_sky(self, seen: Seen) -> None:
        note, foot = seen["sky"]
        assert "below the horizon" in note
        assert foot == seen["keyed"][1]

    def test_what_stands_in_the_shade_is_put_into_the_sun(self, seen: Seen) -> None:
        """The right half of the ground is in shade."""
        shaded, before, still, after = seen["shade"]
        assert (shaded, still) == (True, False)
        assert before == pytest.approx(0.85, abs=0.01)
        assert after < 0.5 or after == before

    def test_all_of_it_is_undone(self, seen: Seen) -> None:
        undo, foot = seen["back"]
        assert not undo
        assert foot != seen["clicked"]

    def test_a_slow_drag_on_the_object_is_one_step(self, seen: Seen) -> None:
        start, dragged, undone, more = seen["slowDrag"]
        assert float(dragged) > float(start) + 10
        assert undone == start
        assert not more

    def test_the_shadow_darkens_lit_ground_and_ends_where_the_photo_is_in_shade(self, seen: Seen, folder: Path) -> None:
        """The sun is to the left: the shadow runs to the right, from the lit half into the half in shade."""
        assert seen["clicked"]
        image = read_luminance(folder / "shadow.png")
        height, width = image.shape
        rows = slice(round(0.82 * height), round(0.88 * height))
        lit, shade = image[rows, round(0.2 * width)].mean(), image[rows, round(0.95 * width)].mean()
        shadow = image[rows, round(0.485 * width) : round(0.495 * width)]
        beyond = image[rows, round(0.53 * width) : round(0.6 * width)]
        assert np.median(shadow) < SHADOW_RATIO * lit
        assert beyond.min() > 0.85 * shade

    def test_its_light_follows_the_sun(self, seen: Seen) -> None:
        assert seen["before"] != seen["after"]

    def test_materials_look_different(self, seen: Seen) -> None:
        assert len(set(seen["materials"])) == 3

    def test_a_dropped_glb_replaces_it_in_its_own_material(self, seen: Seen, folder: Path) -> None:
        assert not seen["ownOffered"]
        assert seen["own"] == ["chair.glb", True]
        red, green, _ = np.moveaxis(read_rgb(folder / "own.png"), 2, 0)
        assert (green > red + 40).sum() > 50
        assert "cannot be read" in seen["brokenModel"]

    def test_its_own_model_is_as_high_as_it_stands(self, seen: Seen) -> None:
        (sphere, sphere_radius), (own, own_radius) = seen["heights"]
        assert sphere == pytest.approx(sphere_radius, rel=0.06)
        assert own == pytest.approx(own_radius / 4, rel=0.06)


def run_copied(copied: str, folder: Path) -> None:
    """Run in a folder what the page copied, a curl command or a Python program."""
    command = ["sh", "-c", copied] if copied.startswith("curl ") else [sys.executable, "-c", copied]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run(command, cwd=folder, env=environment, check=True, timeout=120, capture_output=True)


class TestDownloads:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("downloads")

    def test_a_photo_is_answered(self, seen: Seen, folder: Path) -> None:
        assert seen["title"].startswith("Sun ")
        assert {"Sun azimuth", "Turbidity", "Vertical field of view"} <= set(seen["numbers"])
        assert "are for this photo" in seen["note"]
        record = json.loads((folder / "estimate.json").read_text())
        assert len(record.pop("light_probe")["coefficients"]) == 9
        assert record_with_coefficients(Lighting.from_dict(record)) == record

    def test_the_dome_is_read_by_keyboard(self, seen: Seen) -> None:
        assert "within 10°" in seen["readout"]
        assert seen["changed"]

    def test_a_slider_moves_the_sun(self, seen: Seen, folder: Path) -> None:
        assert seen["slider"] == "straight behind"
        assert "no WebGL" in seen["sceneNote"]
        text = (folder / "edited.json").read_text()
        assert Lighting.from_dict(json.loads(text)).sun_azimuth == -180
        assert not {"radius_50", "radius_90"} & set(json.loads(text)["sun"])
        assert "light_probe" not in json.loads(text)  # the estimate's
        assert json.loads(text)["sun"]["visibility"] in (0, 1)

    def test_the_map_has_the_sun_where_the_slider_put_it(self, seen: Seen, folder: Path) -> None:
        assert seen["exr"] == "railway_field.exr"
        image, _ = read_exr(folder / "map.exr")
        assert image.shape == (512, 1024, 3)
        _, column, _ = np.unravel_index(int(image.argmax()), image.shape)
        assert min(column, 1023 - column) <= 2
        assert decode_hdr((folder / "map.hdr").read_bytes()).shape == (256, 512, 3)
        with Image.open(folder / "map.png") as image_file:
            assert image_file.size == (512, 256)

    def test_every_scene_and_the_preview_are_downloaded(self, seen: Seen, folder: Path) -> None:
        assert seen["targets"] == [*EXPORTERS, *MAP_FORMATS]
        assert re.fullmatch(r"Saved railway_field-\w+\.zip \([\d.]+\s[kM]B\)\.", seen["saved"])
        for tool in EXPORTERS:
            with zipfile.ZipFile(folder / f"{tool}.zip") as scene:
                assert any(name.endswith((".png", ".glb", ".html", ".unitypackage")) for name in scene.namelist())
        with Image.open(folder / "preview.png") as image_file:
            assert image_file.width == 1600

    def test_what_the_service_makes_is_offered(self, seen: Seen) -> None:
        """By a name for people where the page knows one."""
        assert seen["offered"] == ["USD", "A toy", "map (.exr)", "map (.jxl)"]

    def test_the_preview_is_offered_while_it_shows_the_light_on_show(self, seen: Seen) -> None:
        (alone, _), (toned, why_toned), (changed, _), (reset, _), (together, why_together) = seen["preview"]
        assert (alone, toned, changed, reset, together) == (True, False, True, True, False)
        assert "color or softness" in why_toned
        assert "estimated together" in why_together
        (request,) = seen["previewOfChange"]
        assert "sun=-180%2C" in request
        assert "exposure=0&haze=" in request

    def test_what_is_copied_runs(self, seen: Seen, url: str, folder: Path) -> None:
        """The commands as curl, the programs in Python, for the estimate and for the light that was changed."""
        target = folder / "railway_field.exr"
        assert url in seen["curl"]
        assert "sun_azimuth=-180" in seen["changedCurl"]
        maps = []
        for kind in ("curl", "python", "changedCurl", "changedPython"):
            target.unlink(missing_ok=True)
            run_copied(seen[kind], folder)
            maps.append(read_exr(target)[0])
        assert np.allclose(maps[0], maps[1], rtol=1e-3)
        assert np.allclose(maps[2], maps[3], rtol=1e-3)
        assert not np.allclose(maps[0], maps[2], rtol=1e-3)
        assert "light.replace(sun=(-180" in seen["changedPython"]
        assert len(seen["changedPython"].splitlines()) <= 6

    def test_without_the_table_of_the_sky_no_file_states_darkness(self, seen: Seen) -> None:
        assert "The sky's table could not be loaded" in seen["errorWithoutTable"]
        assert min(seen["irradianceAfterAll"]) > 0
        assert not seen["errorAfterAll"]


def estimated_together(files: list[Path]) -> NDArray[np.float32]:
    """The map of the last of several photos, by the library: their light and camera, the place as it alone has it."""
    match, estimator = has_opencv(), Estimator()
    photos = [read_photo(file, target=MATCH_SIDE if match else TARGET) for file in files]
    light, photo = estimator.estimate_views(photos, register=match)[-1].lighting, read_photo(files[-1])
    alone = estimator(photo).edit({}, photo_exposure=light.exposure)
    return alone.replace(lighting=light).envmap(512, sun=light.sun_shines)


class TestSeveral:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("several")

    def test_photos_that_come_at_once_are_a_table_with_trust(self, seen: Seen) -> None:
        notes, street, field = seen["table"]
        assert notes == ["notes.txt", "notes.txt: This is a text, not a photo.", ""]
        assert street[0] == STREET.name
        assert field[0] == PHOTO.name
        assert {street[2], field[2]} <= {"sure", "unsure", "no sun"}
        assert all("sun" in row[1].casefold() for row in (street, field))
        assert seen["faults"] == []

    def test_each_opens_as_one_and_keeps_its_edits(self, seen: Seen) -> None:
        first, second, again = seen["opened"]
        assert (first[0], second[0]) == (STREET.name, PHOTO.name)
        assert again == [STREET.name, "-180"]
        assert seen["asked"] == 3  # once for each

    def test_photos_are_answered_together(self, seen: Seen) -> None:
        assert len(seen["together"]) == 2
        assert "other photos" in seen["evidence"]
        assert seen["second"] == [DATED, "true"]

    def test_their_files_and_copies_hold_the_light_that_the_page_shows(self, seen: Seen, folder: Path) -> None:
        stated = Lighting.from_dict(json.loads((folder / "together.json").read_text()))
        image, lighting = read_exr(folder / "together.exr")
        irradiances = ("exposure", "sun_irradiance", "sky_irradiance", "sky_cover", "ground_color")
        for name in ("sun_azimuth", *irradiances, "camera_elevation", "camera_roll", "vertical_fov"):
            assert getattr(lighting, name) == pytest.approx(getattr(stated, name), rel=1e-5), name
        np.testing.assert_allclose(image, estimated_together([PHOTO, folder / DATED]), rtol=2e-2, atol=2e-3)
        (folder / DATED.replace("jpg", "json")).write_bytes((folder / "together.json").read_bytes())
        for copied in seen["copies"]:
            run_copied(copied, folder)
            np.testing.assert_allclose(read_exr(folder / DATED.replace("jpg", "exr"))[0], image, atol=2e-3)

    def test_a_copy_goes_away_with_what_it_is_of(self, seen: Seen) -> None:
        assert seen["copyShown"] == [True, False]

    def test_that_photos_are_matched_is_promised_where_the_service_does_it(self, seen: Seen) -> None:
        with_opencv, without = seen["promises"]
        assert "estimated together, and what they show in common tells how they are turned." in with_opencv
        assert "in common" not in without
        assert "this service does not compare their pixels." in without

    def test_one_photo_is_not_rotated(self, seen: Seen) -> None:
        assert seen["rotatedAlone"] is False

    @pytest.mark.needs("cv2")
    def test_overlapping_photos_are_rotated_as_they_show(self, seen: Seen) -> None:
        first, second, _ = seen["rotated"]
        assert first["button"].startswith("Photo 1, sun ")
        assert second["button"].startswith("Photo 2, 25° right of photo 1, sun ")
        assert first["sentence"] == "How the photos are turned follows from what they show in common."
        assert re.search(r"in common: this one (24\.[5-9]|25\.[0-5])° right of photo 1\.$", second["sentence"])
        for shown in (first, second):
            assert 49 <= float(shown["numbers"]["Vertical field of view"].rstrip("°")) <= 51
        assert first["numbers"]["Sun azimuth"] != second["numbers"]["Sun azimuth"]
        assert first["numbers"]["Sun elevation"] == second["numbers"]["Sun elevation"]

    @pytest.mark.needs("cv2")
    def test_a_photo_without_anything_in_common_has_a_sentence_that_says_so(self, seen: Seen) -> None:
        stranger = seen["rotated"][2]
        assert re.match(r"Photo 3, perhaps (\d+° (left|right) of|as) photo 1, sun ", stranger["button"])
        assert stranger["sentence"].startswith("It overlaps no other photo")

    @pytest.mark.needs("cv2")
    def test_files_hold_the_camera_that_is_shown(self, seen: Seen, folder: Path) -> None:
        assert seen["rotated"]
        shown = json.loads((folder / "first.json").read_text())["camera"]
        _, lighting = read_exr(folder / "first.exr")
        with zipfile.ZipFile(folder / "first.zip") as archive:
            scene = json.loads(archive.read("lighting.json"))["camera"]
        assert lighting is not None
        for camera in (scene, lighting.to_dict()["camera"]):
            assert {name: camera[name] for name in ("elevation", "roll", "vertical_fov")} == pytest.approx(
                {name: shown[name] for name in ("elevation", "roll", "vertical_fov")}, rel=1e-5
            )


class TestWebglLoss:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("webgl_loss")

    def test_a_stage_that_is_not_loaded_is_no_lack_of_webgl(self, seen: Seen) -> None:
        assert seen["sceneNote"].startswith("The object could not be loaded")

    def test_the_object_comes_back_with_the_memory_of_its_canvas(self, seen: Seen, folder: Path) -> None:
        assert seen["complaints"] == []
        lit, gone, back = (read_rgb(folder / f"{name}.png") for name in ("lit", "gone", "back"))
        assert np.abs(lit - gone).max() > 60
        assert np.abs(lit - back).max() < 10


class TestMobile:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("mobile")

    def test_an_example_is_answered_on_a_narrow_screen_by_keyboard(self, seen: Seen) -> None:
        assert len(seen["examples"]) == 6
        assert seen["title"]
        assert seen["overflow"] == [0, 0]

    def test_axe_finds_nothing_serious(self, seen: Seen) -> None:
        assert seen["faults"] == []

    def test_what_is_no_photo_of_daylight_has_its_headline_alone(self, seen: Seen) -> None:
        assert seen["folded"] == [True, False, False]

    def test_what_takes_a_mouse_or_keys_is_not_offered(self, seen: Seen) -> None:
        title, scene, dome = seen["touch"]
        assert title == "Choose a photo"
        assert "No firm, level ground" in scene  # a drawing
        assert scene.endswith(" Tap the photo to move it, drag to turn it.")
        assert dome == "Rings hold 50 and 90 % of the probability. Drag the sun."

    def test_how_the_camera_was_held_is_as_the_answer_has_it(self, seen: Seen) -> None:
        (used, _, _), _ = seen["tilt"]
        assert re.fullmatch(r"looks (9|10)° up with a roll of [23]°, by the file and the picture", used)

    def test_where_the_picture_contradicts_it_a_warning_names_both(self, seen: Seen) -> None:
        _, (refused, warnings, _) = seen["tilt"]
        assert refused == "not used, see the warning"
        assert any("elevation, 80° up, was not used" in text for text in warnings)

    def test_it_is_visible_on_a_phone(self, seen: Seen) -> None:
        """Within the 360 pixels of the screen, and nothing runs over them."""
        for _, _, (left, right, overflow) in seen["tilt"]:
            assert 0 <= left < right <= 360
            assert overflow == 0


class TestStudio:
    @pytest.fixture
    def seen(self, visits: Visit) -> Seen:
        return visits("studio")

    def test_every_light_control_has_the_whole_picture_beside_it(self, seen: Seen) -> None:
        assert {view["size"]: view["hidden"] for view in seen["views"] if view["hidden"]} == {}

    def test_targets_are_as_large_as_fingers(self, seen: Seen) -> None:
        assert {view["size"]: view["targets"] for view in seen["views"] if view["targets"]} == {}

    def test_axe_finds_nothing_at_any_width(self, seen: Seen) -> None:
        assert {view["size"]: view["faults"] for view in seen["views"] if view["faults"]} == {}

    def test_nothing_runs_over_the_side(self, seen: Seen) -> None:
        assert [view["overflow"] for view in seen["views"]] == [0] * 4

    def test_a_finger_drags_the_sun_on_the_compass(self, seen: Seen) -> None:
        azimuth, elevation = seen["compass"]
        assert azimuth == pytest.approx(0, abs=2)
        assert elevation == pytest.approx(90 - 0.2 * 244 / 100 * 90, abs=3)
        assert seen["scrolled"][0] == seen["scrolled"][1]

    def test_the_sun_in_the_picture_is_where_it_is_dragged(self, seen: Seen) -> None:
        """A quarter of the picture below its upper edge, at 60 deg from edge to edge."""
        elevation = np.degrees(np.arctan(0.5 * np.tan(np.radians(30))))
        dragged, keyed, said = seen["inside"]
        assert dragged == pytest.approx([0, elevation], abs=1)
        assert keyed == pytest.approx([5, elevation + 1], abs=1)
        assert re.fullmatch(r"[456]° right, 1[678]° high", said)

    def test_a_sun_outside_of_the_picture_is_dragged_by_its_arrow(self, seen: Seen) -> None:
        """Half a width to the left takes it about 90 deg to the left."""
        (azimuth, elevation), keyed, _ = seen["outside"]
        assert azimuth == pytest.approx(60, abs=6)
        assert 20 < elevation < 70
        assert keyed == pytest.approx([azimuth + 5, elevation + 1], abs=0.6)

    def test_the_map_on_show_is_the_one_that_is_saved(self, seen: Seen, folder: Path) -> None:
        assert seen["mapNote"].startswith("This is the map that you download.")
        shown, saved = (read_rgb(folder / f"{name}-map.png") for name in ("shown", "saved"))
        assert shown.shape == (256, 512, 3)
        assert np.abs(shown - saved).max() <= 1

    def test_a_city_and_the_camera_height_go_to_the_service(self, seen: Seen) -> None:
        assert seen["city"] == ["Munich (München), Germany", "48.14", "11.58"]
        (request,) = seen["corrected"]
        assert {"latitude=48.14", "longitude=11.58", "camera_height=3"} <= set(urlsplit(request).query.split("&"))
