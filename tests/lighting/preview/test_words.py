"""What the preview says in words."""

import numpy as np
import pytest
from PIL import Image

from lighting.drawing import Style, text_width
from lighting.preview import words as module
from lighting.preview.layout import GAP, MARGIN, WIDTH
from lighting.preview.words import draw_headline, numbers_of, warning_lines
from lighting.records import EvidenceKind
from tests.previews import amber, outdoors


def test_numbers_say_which_way_the_camera_looks() -> None:
    values = dict(numbers_of(outdoors(camera_elevation=-3.14, camera_roll=-0.04, radius_50=9.5, radius_90=131.0)))
    assert values["Camera elevation"] == "3.1° down"
    assert values["Camera roll"] == "0.0°"
    assert values["50 % / 90 % within"] == "9.5° / 131°"


@pytest.mark.parametrize(("azimuth", "words"), [(-0.2, "ahead"), (179.9, "behind"), (-120.0, "120° left")])
def test_numbers_fit_their_column(azimuth: float, words: str) -> None:
    assert dict(numbers_of(outdoors(azimuth)))["Sun azimuth"] == words


def test_a_level_camera_looks_neither_down_nor_turned() -> None:
    values = dict(numbers_of(outdoors(camera_elevation=-0.04, camera_roll=-0.04)))
    assert (values["Camera elevation"], values["Camera roll"]) == ("0.0° up", "0.0°")


@pytest.mark.parametrize(("visibility", "gold"), [(0.9, True), (0.1, False)])
def test_headline_is_in_the_suns_colour_only_with_direct_sun(visibility: float, gold: bool) -> None:
    canvas = Image.new("RGB", (WIDTH, 140))
    draw_headline(canvas, outdoors(sun_visibility=visibility))
    assert (len(amber(np.asarray(canvas).astype(np.int64))) > 100) == gold


@pytest.mark.parametrize(
    ("radius", "visibility", "words"),
    [
        (30.0, 0.9, "Sun 150° right (behind), 40° high"),
        (120.0, 0.9, "Sun perhaps 150° right (behind), 40° high"),
        (30.0, 0.1, "an overcast or shaded scene; if the sun shone, it would stand 150° right (behind), 40° high"),
        (
            120.0,
            0.1,
            "an overcast or shaded scene; if the sun shone, it would perhaps stand 150° right (behind), 40° high",
        ),
        (20.0, 0.1, "No direct sun"),
        (20.0, 0.4, "Probably no direct sun"),
    ],
)
def test_what_is_not_certain_is_not_stated_plainly(
    monkeypatch: pytest.MonkeyPatch, radius: float, visibility: float, words: str
) -> None:
    written: list[str] = []

    def note(_canvas: Image.Image, _spot: object, text: str, _style: Style) -> None:
        written.append(text)

    monkeypatch.setattr(module, "write", note)
    draw_headline(Image.new("RGB", (WIDTH, 140)), outdoors(radius_90=radius, sun_visibility=visibility))
    assert words in written


def test_warnings_stand_in_lines_that_fit_the_picture() -> None:
    short, long = "The photo may be cropped.", "Twilight mowed the whole wide world. " * 9
    lines = warning_lines(outdoors(warnings=(short, long)))
    assert lines[0] == f"Warning: {short}"
    assert " ".join(lines[1:]) == f"Warning: {long.strip()}"
    assert len(lines) > 3
    assert max(text_width(line, 18) for line in lines) <= WIDTH - 2 * MARGIN
    assert warning_lines(outdoors()) == []


@pytest.mark.parametrize("suitable", [0.1, 0.9])
@pytest.mark.parametrize("radius", [30.0, 120.0])
def test_the_title_leaves_room_for_what_is_beside_it(
    monkeypatch: pytest.MonkeyPatch, suitable: float, radius: float
) -> None:
    written: dict[float, float] = {}  # width of the first line's text by its x

    def write(_canvas: Image.Image, spot: tuple[float, float], text: str, style: Style) -> None:
        if spot[1] < MARGIN + 20:
            written[spot[0]] = text_width(text, style.size)

    monkeypatch.setattr(module, "write", write)
    sun = outdoors(150.0, suitable=suitable, radius_90=radius, evidence=tuple(EvidenceKind), camera_heading=115.0)
    draw_headline(Image.new("RGB", (WIDTH, 140)), sun)
    assert written[MARGIN] + GAP + written[WIDTH - MARGIN] <= WIDTH - 2 * MARGIN
