"""The whole preview and its words."""

from io import BytesIO

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.envmap.render import render
from lighting.geometry import Floats, direction
from lighting.preview import picture as module
from lighting.preview.drawing import BACKGROUND, TextStyle, text_width
from lighting.preview.panels import CAPTION, GAP, MARGIN, WARNING_LINE, WIDTH, lay_out
from lighting.preview.picture import (
    MAP_HEIGHT,
    _draw_headline,
    _draw_preview,
    _format_numbers,
    _warning_lines,
    draw_preview_pixels,
    encode_preview_png,
)
from lighting.records import EvidenceKind, Lighting
from lighting.sun_grid import soft_label
from tests.helpers.scenes import GRAY, GRID, Bytes, amber, estimate, outdoors, photo, small_map


def draw(lighting: Lighting, width: int = 320, height: int = 240, probability: Floats | None = None) -> Bytes:
    return _draw_preview(photo(width, height), estimate(lighting, probability), small_map(lighting))


def part(picture: Bytes, name: str, aspect: float) -> NDArray[np.int64]:
    """The pixels of one panel."""
    box = getattr(lay_out(aspect, 9), name)
    return picture[box.y : box.y + box.height, box.x : box.x + box.width].astype(np.int64)


@pytest.mark.parametrize("side", [-1, 1])
def test_compass_of_the_picture_is_warm_on_the_suns_side(side: int) -> None:
    lighting = outdoors(170.0, 80.0, sun_visibility=0.1)
    probability = soft_label(direction(side * 60.0, 35.0), 40.0, GRID)
    panel = part(draw(lighting, probability=probability), "compass", 4 / 3)
    warm = np.argwhere(panel[..., 0] - panel[..., 2] > 60) - np.array(panel.shape[:2]) / 2
    assert np.sign(warm[:, 1].mean()) == side
    assert warm[:, 0].mean() < 0


@pytest.mark.parametrize(("width", "height"), [(640, 480), (480, 640), (640, 360), (1, 1), (900, 100), (30, 400)])
def test_any_shape_of_photo_has_its_place(width: int, height: int) -> None:
    picture = draw(outdoors(100.0, 30.0, radius_50=9.0, radius_90=30.0), width, height)
    assert picture.dtype == np.uint8
    assert picture.shape[1:] == (1600, 3)
    assert 1000 < len(picture) < 1600
    panel = part(picture, "photo", width / height)
    scale = min(panel.shape[1] / width, panel.shape[0] / height)
    shown = (np.abs(panel - GRAY).max(axis=-1) < 3).sum()
    assert shown > 0.6 * width * height * scale**2
    assert (picture[:, -20:] == np.array(BACKGROUND)).all()


@pytest.mark.parametrize(("width", "height"), [(640, 480), (480, 640)])
def test_warnings_move_the_panels_down_and_change_nothing_else(width: int, height: int) -> None:
    plain = draw(outdoors(100.0, 30.0), width, height)
    warned = draw(outdoors(100.0, 30.0, warnings=("The photo may be cropped.",)), width, height)
    top = lay_out(width / height, 9).photo.y - CAPTION
    assert np.array_equal(warned[top + WARNING_LINE :], plain[top:])
    assert np.array_equal(warned[: top - WARNING_LINE], plain[: top - WARNING_LINE])
    assert (warned[top - WARNING_LINE : top + WARNING_LINE] != np.array(BACKGROUND)).any()


def test_the_file_holds_the_drawing_with_the_lights_own_map() -> None:
    answer = estimate(outdoors(100.0, 30.0))
    expected = _draw_preview(photo(320, 240), answer, render(answer.lighting, MAP_HEIGHT))
    with Image.open(BytesIO(encode_preview_png(draw_preview_pixels(photo(320, 240), answer)))) as picture:
        assert picture.format == "PNG"
        assert np.array_equal(np.asarray(picture), expected)


def test_numbers_say_which_way_the_camera_looks() -> None:
    values = dict(_format_numbers(outdoors(camera_elevation=-3.14, camera_roll=-0.04, radius_50=9.5, radius_90=131.0)))
    assert values["Camera elevation"] == "3.1° down"
    assert values["Camera roll"] == "0.0°"
    assert values["50 % / 90 % within"] == "9.5° / 131°"


@pytest.mark.parametrize(("azimuth", "words"), [(-0.2, "ahead"), (179.9, "behind"), (-120.0, "120° left")])
def test_numbers_fit_their_column(azimuth: float, words: str) -> None:
    assert dict(_format_numbers(outdoors(azimuth)))["Sun azimuth"] == words


def test_a_level_camera_looks_neither_down_nor_turned() -> None:
    values = dict(_format_numbers(outdoors(camera_elevation=-0.04, camera_roll=-0.04)))
    assert (values["Camera elevation"], values["Camera roll"]) == ("0.0° up", "0.0°")


@pytest.mark.parametrize(("visibility", "gold"), [(0.9, True), (0.1, False)])
def test_headline_is_in_the_suns_colour_only_with_direct_sun(visibility: float, gold: bool) -> None:
    canvas = Image.new("RGB", (WIDTH, 140))
    _draw_headline(canvas, outdoors(sun_visibility=visibility))
    assert (len(amber(np.asarray(canvas).astype(np.int64))) > 100) == gold


@pytest.mark.parametrize(
    ("radius", "visibility", "words"),
    [
        (30.0, 0.9, "Sun 150° right (behind), 40° high"),
        (120.0, 0.9, "Sun perhaps 150° right (behind), 40° high"),
        (30.0, 0.1, "an overcast or shaded scene; if the sun shone, it would be 150° right (behind), 40° high"),
        (
            120.0,
            0.1,
            "an overcast or shaded scene; if the sun shone, it would perhaps be 150° right (behind), 40° high",
        ),
        (20.0, 0.1, "No direct sun"),
        (20.0, 0.4, "Probably no direct sun"),
    ],
)
def test_what_is_not_certain_is_not_stated_plainly(
    monkeypatch: pytest.MonkeyPatch, radius: float, visibility: float, words: str
) -> None:
    written: list[str] = []

    def note(_canvas: Image.Image, _spot: object, text: str, _style: TextStyle) -> None:
        written.append(text)

    monkeypatch.setattr(module, "draw_text", note)
    _draw_headline(Image.new("RGB", (WIDTH, 140)), outdoors(radius_90=radius, sun_visibility=visibility))
    assert words in written


def test_warnings_stand_in_lines_that_fit_the_picture() -> None:
    short, long = "The photo may be cropped.", "Twilight mowed the whole wide world. " * 9
    lines = _warning_lines(outdoors(warnings=(short, long)))
    assert lines[0] == f"Warning: {short}"
    assert " ".join(lines[1:]) == f"Warning: {long.strip()}"
    assert len(lines) > 3
    assert max(text_width(line, 18) for line in lines) <= WIDTH - 2 * MARGIN
    assert _warning_lines(outdoors()) == []


@pytest.mark.parametrize("suitable", [0.1, 0.9])
@pytest.mark.parametrize("radius", [30.0, 120.0])
def test_the_title_leaves_room_for_what_is_beside_it(
    monkeypatch: pytest.MonkeyPatch, suitable: float, radius: float
) -> None:
    written: dict[float, float] = {}  # width of the first line's text by its x

    def write(_canvas: Image.Image, spot: tuple[float, float], text: str, style: TextStyle) -> None:
        if spot[1] < MARGIN + 20:
            written[spot[0]] = text_width(text, style.size)

    monkeypatch.setattr(module, "draw_text", write)
    sun = outdoors(150.0, suitable=suitable, radius_90=radius, evidence=tuple(EvidenceKind), camera_heading=115.0)
    _draw_headline(Image.new("RGB", (WIDTH, 140)), sun)
    assert written[MARGIN] + GAP + written[WIDTH - MARGIN] <= WIDTH - 2 * MARGIN
