"""The page in Chromium where things go otherwise: other formats, refusals, slow drags. Driven by details.mjs."""

import json
import re
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ExifTags, Image

from lighting import read_exr
from lighting.geometry import camera_axes
from lighting.turns import has_opencv
from tests.lighting.photo.held import phone
from tests.lighting.turns.cameras import picture, texture
from tests.server import test_page as page

url = page.url  # the fixture

SIZE = (320, 240)
FACTS = ["2024-08-10 14:28:12 (time zone by GPS)", "41.9058°\N{NO-BREAK SPACE}N, 12.4824°\N{NO-BREAK SPACE}E"]
SAVED: dict[str, dict[str, Any]] = {
    "jpg": {},
    "png": {},
    "webp": {},
    "tif": {},
    "avif": {},
    "lossless.webp": {"lossless": True},
}


def photo(orientation: int = 1) -> tuple[Image.Image, Image.Exif]:
    """A small photo and the EXIF block of the original, with another orientation."""
    with Image.open(page.NOON) as original:
        said = original.getexif()
        said[ExifTags.Base.Orientation] = orientation
        return original.convert("RGB").resize(SIZE), said


def in_every_format(folder: Path, orientation: int) -> dict[str, str]:
    """Files of the same photo and metadata, by suffix."""
    files = {}
    for suffix, options in SAVED.items():
        files[suffix] = str(folder / f"way{orientation}.{suffix}")
        picture, said = photo(orientation)  # anew, since Pillow takes the orientation out of what it writes to an AVIF
        picture.save(files[suffix], exif=said, **options)
    with suppress(ImportError):
        import pillow_heif

        files["heic"] = str(folder / f"way{orientation}.heic")
        picture, said = photo(orientation)
        pillow_heif.from_pillow(picture).save(files["heic"], exif=said.tobytes())
    return files


def held(folder: Path) -> list[str]:
    """The photo as of a phone that says that it looked 10 deg up, and 80 deg up, both with a roll of 3 deg."""
    files = []
    for elevation in (10.0, 80.0):
        files.append(str(folder / f"held{elevation:.0f}.jpg"))
        across, above, into = camera_axes(0.0, elevation, 3.0)[:, 1]
        with Image.open(page.NOON) as original:
            original.convert("RGB").resize(SIZE[::-1]).save(files[-1], exif=phone(-across, -above, into, 1))
    return files


def overlapping(folder: Path) -> list[str]:
    """Two photos that overlap, the second turned by 25 deg, and one of another place."""
    files = []
    for number, (seed, azimuth) in enumerate([(0, 0.0), (0, 25.0), (1, 0.0)]):
        files.append(str(folder / f"view{number}.png"))
        Image.fromarray(picture(texture(seed), (azimuth, 2.0, 0.0), 50.0)).save(files[-1])
    return files


def files_for(folder: Path) -> dict[str, Any]:
    """What the visitor brings along, by name."""
    (folder / "notes.txt").write_text("This is no photo.", encoding="utf-8")
    (folder / "wide.glb").write_bytes(page.triangle_model(4))
    page.halves().save(folder / "small.png")
    return {
        "formats": in_every_format(folder, 1),
        "upright": in_every_format(folder, 6),
        "turned": overlapping(folder),
        "held": held(folder),
        "folder": str(folder),
        **{"photo": str(page.PHOTO), "other": str(page.NOON), "small": str(folder / "small.png")},
        **{"textFile": str(folder / "notes.txt"), "model": str(folder / "wide.glb")},
    }


@pytest.fixture(scope="module")
def visit(url: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a visitor saw, and the folder with what they downloaded."""
    folder = tmp_path_factory.mktemp("details")
    return {**page.visited("details.mjs", url, files_for(folder)), "folder": folder}


def pixels(file: Path) -> NDArray[np.float64]:
    """A picture's 8-bit values (H, W, 3)."""
    with Image.open(file) as picture:
        return np.asarray(picture.convert("RGB"), dtype=np.float64)


pytestmark = [pytest.mark.slow, page.in_chromium]


class TestFormats:
    def test_every_format_says_the_same(self, visit: dict[str, Any]) -> None:
        assert {name: facts[:2] for name, facts in visit["facts"].items() if facts[:2] != FACTS} == {}
        lens = {(facts[3], facts[4]) for facts in visit["facts"].values()}
        assert lens == {("20 mm (as of a 35 mm camera)", "SONY ILCE-9M2")}
        assert set(SAVED) <= set(visit["facts"])

    def test_what_only_the_service_reads_is_not_called_absent(self, visit: dict[str, Any]) -> None:
        time, place, heading, lens, *_ = visit["unread"]
        assert (time, place, lens) == ("read by the service",) * 3
        assert heading == "not in the file"

    def test_every_format_is_shown_upright(self, visit: dict[str, Any]) -> None:
        assert {name: shown for name, shown in visit["upright"].items() if shown != [240, 320, "0.75"]} == {}
        assert visit["upright"].keys() == visit["facts"].keys()


class TestHowTheCameraWasHeld:
    def test_it_is_told_as_the_answer_has_it(self, visit: dict[str, Any]) -> None:
        (used, _, _), _ = visit["held"]
        assert re.fullmatch(r"looks (9|10)° up with a roll of [23]°, by the file and the picture", used)

    def test_where_the_picture_contradicts_it_that_is_said(self, visit: dict[str, Any]) -> None:
        _, (refused, warnings, _) = visit["held"]
        assert refused == "not used, see the warning"
        assert any("What the metadata say of it was not used." in text for text in warnings)

    def test_it_is_seen_on_a_phone(self, visit: dict[str, Any]) -> None:
        """Within the 360 pixels of the screen, and nothing runs over them."""
        for _, _, (left, right, overflow) in visit["held"]:
            assert 0 <= left < right <= 360
            assert overflow == 0


class TestRefusals:
    def test_another_try_is_for_the_photo_on_show(self, visit: dict[str, Any]) -> None:
        assert visit["again"] == [[page.PHOTO.name, False]] * 2

    def test_a_key_that_no_request_can_carry_is_refused_beside_its_field(self, visit: dict[str, Any]) -> None:
        assert visit["badKey"]["form"]
        assert "no request can carry" in visit["badKey"]["words"]
        assert visit["badKey"]["stored"] == 0
        assert visit["sentKeys"] == [None, "Bearer key"]

    def test_a_missing_example_is_told_as_a_missing_answer(self, visit: dict[str, Any]) -> None:
        down, busy = visit["missing"]
        assert down.startswith("The service did not answer. Check your connection")
        assert busy.startswith("The service answered 503.")

    def test_an_error_goes_with_the_next_success(self, visit: dict[str, Any]) -> None:
        assert not visit["errorAfterModel"]

    def test_text_that_is_dropped_or_pasted_is_refused_in_words(self, visit: dict[str, Any]) -> None:
        after = "is no file. Save the photo, then choose its file or drop it here."
        assert visit["noFile"] == [f"That did not work. What you {did} {after}" for did in ("dropped", "pasted")]
        assert visit["textInField"] == [True, False]

    def test_an_example_may_be_dragged_and_is_looked_at_whatever_else_is_wrong(self, visit: dict[str, Any]) -> None:
        assert visit["meanwhile"] == ["Looking at garden_noon.jpg…", ""]
        assert visit["dragged"] == ["garden_noon.jpg", False]


class TestOnAPhone:
    def test_what_takes_a_mouse_or_keys_is_not_offered(self, visit: dict[str, Any]) -> None:
        title, scene, dome = visit["touch"]
        assert title == "Choose a photo"
        assert scene == "Tap the ground to move it, drag to turn it."
        assert dome == "Rings hold 50 and 90 % of the probability. Tap to move the sun."


class TestWhatGoesMissing:
    def test_the_example_chosen_last_is_shown_however_late_the_first_comes(self, visit: dict[str, Any]) -> None:
        assert visit["onTheWay"] == "Looking at golden_hour.jpg…"
        status, shown = visit["overtaken"]
        assert status.startswith("snow_field.jpg: answered in ")
        assert shown == "snow_field.jpg"

    def test_without_the_table_of_the_sky_it_is_said_and_no_file_states_darkness(self, visit: dict[str, Any]) -> None:
        assert "The table of the sky could not be loaded" in visit["noTable"]
        assert min(visit["powerAfterAll"]) > 0
        assert not visit["errorAfterAll"]

    def test_a_file_that_changes_on_its_disk_stays_the_one_on_show(self, visit: dict[str, Any]) -> None:
        assert visit["changedFile"] == "saved"

    def test_a_long_name_stays_on_a_phone(self, visit: dict[str, Any]) -> None:
        assert visit["overflow"] == 0

    def test_keys_undo_from_a_chooser_too(self, visit: dict[str, Any]) -> None:
        start, changed, undone = visit["undone"]
        assert undone == start != changed

    def test_a_stage_that_is_not_loaded_is_no_lack_of_webgl(self, visit: dict[str, Any]) -> None:
        assert visit["noStage"].startswith("What draws the object could not be loaded")

    def test_the_object_comes_back_with_the_memory_of_its_canvas(self, visit: dict[str, Any]) -> None:
        lit, gone, back = (pixels(visit["folder"] / f"{name}.png") for name in ("lit", "gone", "back"))
        assert np.abs(lit - gone).max() > 60
        assert np.abs(lit - back).max() < 10


class TestGestures:
    def test_a_slow_drag_of_a_slider_is_one_step(self, visit: dict[str, Any]) -> None:
        start, first, second, undone, undone_twice = visit["slider"]
        assert len({start[0], first[0], second[0]}) == 3
        assert (undone, undone_twice) == (first, start)

    def test_a_slow_drag_on_the_dome_is_one_step(self, visit: dict[str, Any]) -> None:
        start, dragged, undone = visit["dome"]
        assert dragged != start == undone

    def test_a_slow_drag_on_the_stage_is_one_step(self, visit: dict[str, Any]) -> None:
        start, dragged, undone, more = visit["turns"]
        assert float(dragged) > float(start) + 10
        assert undone == start
        assert not more


def test_the_preview_is_offered_while_it_shows_the_light_on_show(visit: dict[str, Any]) -> None:
    (alone, _), (changed, why_changed), (reset, _), (together, why_together) = visit["preview"]
    assert (alone, changed, reset, together) == (True, False, True, False)
    assert "the light was changed" in why_changed
    assert "estimated together" in why_together


def test_an_own_object_is_as_high_as_it_stands(visit: dict[str, Any]) -> None:
    (sphere, round_), (own, round_again) = visit["heights"]
    assert sphere == pytest.approx(round_, rel=0.06)
    assert own == pytest.approx(round_again / 4, rel=0.06)


def test_the_browser_has_nothing_to_complain_of(visit: dict[str, Any]) -> None:
    assert visit["complaints"] == []


def test_that_photos_are_matched_is_promised_where_the_service_does_it(visit: dict[str, Any]) -> None:
    with_opencv, without = visit["promises"]
    assert "answered together, and turned by what they show in common. None is kept." in with_opencv
    assert "in common" not in without
    assert "this service does not compare their pixels. None is kept." in without


@pytest.mark.skipif(not has_opencv(), reason="OpenCV is not installed")
class TestTurns:
    def test_overlapping_photos_are_turned_as_they_show(self, visit: dict[str, Any]) -> None:
        first, second, _ = visit["turned"]
        assert first["button"].startswith("Photo 1, sun ")
        assert second["button"].startswith("Photo 2, 25° right of photo 1, sun ")
        assert first["said"] == "How the photos are turned was found in what they show in common."
        assert re.search(r"in common: this one (24\.[5-9]|25\.[0-5])° right of photo 1\.$", second["said"])
        for shown in (first, second):
            assert 49 <= float(shown["numbers"]["Vertical field of view"].rstrip("°")) <= 51
        assert first["numbers"]["Sun azimuth"] != second["numbers"]["Sun azimuth"]
        assert first["numbers"]["Sun elevation"] == second["numbers"]["Sun elevation"]

    def test_a_photo_in_which_nothing_of_the_others_is_found_says_so(self, visit: dict[str, Any]) -> None:
        stranger = visit["turned"][2]
        assert re.match(r"Photo 3, perhaps (\d+° (left|right) of|as) photo 1, sun ", stranger["button"])
        assert stranger["said"].startswith("Nothing in it was found in the other photos")

    def test_files_hold_the_camera_that_is_shown(self, visit: dict[str, Any]) -> None:
        folder = visit["folder"]
        shown = json.loads((folder / "first.json").read_text())["camera"]
        _, held = read_exr(folder / "first.exr")
        with zipfile.ZipFile(folder / "first.zip") as archive:
            scene = json.loads(archive.read("lighting.json"))["camera"]
        assert held is not None
        for camera in (scene, held.to_dict()["camera"]):
            assert {name: camera[name] for name in ("elevation", "roll", "vertical_fov")} == pytest.approx(
                {name: shown[name] for name in ("elevation", "roll", "vertical_fov")}, rel=1e-5
            )

    def test_one_photo_is_not_turned(self, visit: dict[str, Any]) -> None:
        assert visit["turnedAlone"] is False
