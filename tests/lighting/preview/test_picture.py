"""The whole preview and its words."""

from dataclasses import replace
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.envmap.render import render
from lighting.errors import ParameterError
from lighting.estimator import Estimator
from lighting.files.deflate import encode_png
from lighting.geometry import Floats, Pinhole, angle_between, camera_pixel, direction
from lighting.map_options import MapOptions
from lighting.model import Model
from lighting.photo.reader import Photo, photo_from_array
from lighting.photo_estimate import Estimate
from lighting.preview import picture as module
from lighting.preview.compass import (
    _density,
    _draw_density,
    circle_around_sun,
    dome_pixels,
    draw_compass,
    draw_regions,
    frame_directions,
    split_at_seam,
)
from lighting.preview.drawing import BACKGROUND, MUTED, TEXT, TextStyle, text_width
from lighting.preview.picture import (
    PREVIEW_WIDTH,
    _format_photo_caption,
    _lay_out,
    draw_preview_pixels,
)
from lighting.records import EvidenceKind, Lighting
from lighting.sun_grid import grid_directions, soft_label
from tests.conftest import scene
from tests.helpers.scenes import GRAY, GRID, Bytes, amber, distribution, estimate, outdoors, photo, small_map

CAPTION = 32  # pixels: above each panel
GAP = 24  # between panels
LETTERS = 18
MARGIN = 40  # around all
WARNING_LINE = 26


def draw(lighting: Lighting, width: int = 320, height: int = 240, probability: Floats | None = None) -> Bytes:
    return draw_preview_pixels(photo(width, height), estimate(lighting, probability), small_map(lighting))


Written = list[tuple[tuple[float, float], str, TextStyle]]


def texts_of(monkeypatch: pytest.MonkeyPatch, lighting: Lighting) -> Written:
    """The texts beside a preview's panels: where they stand, and in which style."""
    written: Written = []

    def note(canvas: Image.Image, spot: tuple[float, float], text: str, style: TextStyle) -> None:
        if canvas.width == PREVIEW_WIDTH:
            written.append((spot, text, style))

    monkeypatch.setattr(module, "draw_text", note)
    draw(lighting)
    return written


def numbers_of(monkeypatch: pytest.MonkeyPatch, lighting: Lighting) -> dict[str, str]:
    """The numbers below the panels by their names."""
    texts = [text for _, text, _ in texts_of(monkeypatch, lighting)]
    return dict(pairwise(texts))


def part(picture: Bytes, name: str, aspect: float) -> NDArray[np.int64]:
    """The pixels of one panel."""
    box = getattr(_lay_out(aspect, 9), name)
    return picture[box.y : box.y + box.height, box.x : box.x + box.width].astype(np.int64)


@pytest.mark.parametrize("side", [-1, pytest.param(1, marks=pytest.mark.thorough)])
def test_compass_of_the_picture_is_warm_on_the_suns_side(side: int) -> None:
    lighting = outdoors(170.0, 80.0, sun_visibility=0.1)
    probability = soft_label(direction(side * 60.0, 35.0), 40.0, GRID)
    panel = part(draw(lighting, probability=probability), "compass", 4 / 3)
    warm = np.argwhere(panel[..., 0] - panel[..., 2] > 60) - np.array(panel.shape[:2]) / 2
    assert np.sign(warm[:, 1].mean()) == side
    assert warm[:, 0].mean() < 0


@pytest.mark.parametrize(
    ("width", "height"),
    [(640, 360), (30, 400), *(pytest.param(*size, marks=pytest.mark.thorough) for size in ((1, 1), (900, 100)))],
)
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


@pytest.mark.parametrize(("width", "height"), [(640, 480), pytest.param(480, 640, marks=pytest.mark.thorough)])
def test_warnings_move_the_panels_down_and_change_nothing_else(width: int, height: int) -> None:
    plain = draw(outdoors(100.0, 30.0), width, height)
    warned = draw(outdoors(100.0, 30.0, warnings=("The photo may be cropped.",)), width, height)
    top = _lay_out(width / height, 9).photo.y - CAPTION
    assert np.array_equal(warned[top + WARNING_LINE :], plain[top:])
    assert np.array_equal(warned[: top - WARNING_LINE], plain[: top - WARNING_LINE])
    assert (warned[top - WARNING_LINE : top + WARNING_LINE] != np.array(BACKGROUND)).any()


def test_the_file_holds_the_drawing_with_the_lights_own_map() -> None:
    light, shown = outdoors(100.0, 30.0), Photo(photo(320, 240), 320, 240, "PIXELS")
    answer = Estimate.of_photo(shown, estimate(light))
    expected = draw_preview_pixels(shown.pixels, answer, render(light, 512))
    with Image.open(BytesIO(encode_png(np.asarray(answer.preview())))) as picture:
        assert picture.format == "PNG"
        assert np.array_equal(np.asarray(picture), expected)


def test_numbers_say_which_way_the_camera_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    light = outdoors(camera_elevation=-3.14, camera_roll=-0.04, radius_50=9.5, radius_90=131.0)
    values = numbers_of(monkeypatch, light)
    assert values["Camera elevation"] == "3.1° down"
    assert values["Camera roll"] == "0.0°"
    assert values["50 % / 90 % within"] == "9.5° / 131°"


@pytest.mark.parametrize(("azimuth", "words"), [(-0.2, "ahead"), (179.9, "behind"), (-120.0, "120° left")])
def test_numbers_fit_their_column(monkeypatch: pytest.MonkeyPatch, azimuth: float, words: str) -> None:
    assert numbers_of(monkeypatch, outdoors(azimuth))["Sun azimuth"] == words


def test_a_level_camera_looks_neither_down_nor_turned(monkeypatch: pytest.MonkeyPatch) -> None:
    values = numbers_of(monkeypatch, outdoors(camera_elevation=-0.04, camera_roll=-0.04))
    assert (values["Camera elevation"], values["Camera roll"]) == ("0.0° up", "0.0°")


@pytest.mark.parametrize(("visibility", "gold"), [(0.9, True), (0.1, False)])
def test_headline_is_in_the_suns_colour_only_with_direct_sun(visibility: float, gold: bool) -> None:
    headline = draw(outdoors(sun_visibility=visibility))[: _lay_out(4 / 3, 9).photo.y - CAPTION]
    assert (len(amber(headline.astype(np.int64))) > 100) == gold


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
    written = texts_of(monkeypatch, outdoors(radius_90=radius, sun_visibility=visibility))
    assert any(text.startswith(words) for _, text, _ in written)


def test_warnings_stand_in_lines_that_fit_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    def notes(light: Lighting) -> list[str]:
        return [text for _, text, style in texts_of(monkeypatch, light) if style == TextStyle(18, TEXT)]

    short, long = "The photo may be cropped.", "Twilight mowed the whole wide world. " * 9
    lines = notes(outdoors(warnings=(short, long)))
    assert lines[0] == f"Warning: {short}"
    assert " ".join(lines[1:]) == f"Warning: {long.strip()}"
    assert len(lines) > 3
    assert max(text_width(line, 18) for line in lines) <= PREVIEW_WIDTH - 2 * MARGIN
    assert notes(outdoors()) == []


@pytest.mark.parametrize("suitable", [0.1, 0.9])
@pytest.mark.parametrize("radius", [30.0, 120.0])
def test_the_title_leaves_room_for_what_is_beside_it(
    monkeypatch: pytest.MonkeyPatch, suitable: float, radius: float
) -> None:
    drawn = (EvidenceKind.SHADOW, EvidenceKind.DRAWN_CAMERA)  # in one photo alone
    of_several = tuple(kind for kind in EvidenceKind if kind not in drawn)
    sun = outdoors(150.0, suitable=suitable, radius_90=radius, evidence=of_several, camera_heading=115.0)
    first = [(x, text_width(text, style.size)) for (x, y), text, style in texts_of(monkeypatch, sun) if y < MARGIN + 20]
    written = dict(first)
    assert written[MARGIN] + GAP + written[PREVIEW_WIDTH - MARGIN] <= PREVIEW_WIDTH - 2 * MARGIN


@pytest.mark.parametrize(("azimuth", "elevation"), [(60.0, 30.0), (-60.0, 30.0), (135.0, 20.0), (0.0, 60.0)])
def test_probability_peaks_at_its_place_on_the_compass(azimuth: float, elevation: float) -> None:
    cell = grid_directions(GRID)[np.argmax(grid_directions(GRID) @ direction(azimuth, elevation))]
    heat = np.asarray(_draw_density(distribution(soft_label(cell, 60.0, GRID)))).astype(int)
    row, column = np.unravel_index(np.argmax(heat.sum(axis=-1)), heat.shape[:2])
    x, y = (column + 0.5) / heat.shape[1] * 2 - 1, (row + 0.5) / heat.shape[0] * 2 - 1
    reach = (90 - elevation) / 90
    expected = (reach * np.sin(np.radians(azimuth)), -reach * np.cos(np.radians(azimuth)))
    np.testing.assert_allclose((x, y), expected, atol=0.12)


@pytest.mark.parametrize("layout", ["fibonacci:64", "fibonacci:2048", "rings:5x32"])
def test_density_integrates_to_one(layout: str) -> None:
    cells = grid_directions("fibonacci:4000").astype(np.float32)
    density = _density(cells, distribution(soft_label(direction(20.0, 60.0), 12.0, layout), layout))
    assert density.mean() * 2 * np.pi == pytest.approx(1.0, abs=0.04)


def test_even_probability_is_colder_than_a_sure_one() -> None:
    even = np.asarray(_draw_density(distribution()))
    sure = np.asarray(_draw_density(distribution(soft_label(direction(0.0, 50.0), 300.0, GRID))))
    assert even.sum(axis=-1).max() < 0.7 * sure.sum(axis=-1).max()


def test_sun_is_marked_at_its_place_on_the_compass() -> None:
    size = 500
    panel = np.asarray(draw_compass(estimate(outdoors(70.0, 30.0)), 4 / 3, size))
    spot = (amber(panel.astype(np.int64)).mean(axis=0) - size / 2) / (size / 2 - 44)
    reach = (90 - 30) / 90
    expected = (-reach * np.cos(np.radians(70.0)), reach * np.sin(np.radians(70.0)))
    np.testing.assert_allclose(spot, expected, atol=0.02)


@pytest.mark.parametrize("azimuth", [4.0, 40.0, 90.0, 130.0, 176.0, -90.0, -140.0])
def test_the_rings_degrees_are_not_where_the_regions_have_their_shares(azimuth: float) -> None:
    """Those stand on the sun's meridian, also beyond the zenith."""
    size = 500
    panel = np.asarray(draw_compass(estimate(outdoors(azimuth, 10.0)), 4 / 3, size)).astype(np.int64)
    letters = np.argwhere(np.abs(panel - np.array(TEXT)).max(axis=-1) < 8) - size / 2
    letters = letters[np.hypot(*letters.T) < 0.75 * (size / 2 - 44)]
    assert len(letters) > 20
    off = letters @ (np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth)))
    assert np.abs(off).min() > 20


@pytest.mark.parametrize("azimuth", [0.0, 180.0])
def test_a_sun_on_the_horizon_does_not_touch_the_word_beside_it(azimuth: float) -> None:
    size = 500
    low, high = (
        np.asarray(draw_compass(estimate(outdoors(azimuth, elevation)), 4 / 3, size)).astype(np.int64)
        for elevation in (0.0, 60.0)
    )
    words = np.array([MUTED if azimuth else TEXT])
    beyond = slice(size - 42, size) if azimuth else slice(42, 0, -1)  # from the circle outwards
    rays = np.flatnonzero((low != high)[beyond].any(axis=(1, 2)))
    letters = np.flatnonzero((np.abs(high - words).max(axis=-1) < 60)[beyond].any(axis=1))
    assert 10 < rays.max() < letters.min()


def test_no_region_strikes_the_degrees_out() -> None:
    """The second region passes through the degrees of the upper ring."""
    size, radius = 500, 500 / 2 - 44
    counts = []
    for radius_90 in (25.0, 54.0):
        lighting = outdoors(0.0, 45.0, radius_50=10.0, radius_90=radius_90)
        panel = np.asarray(draw_compass(estimate(lighting), 4 / 3, size)).astype(np.int64)
        columns = slice(round(size / 2 + radius / 3 + 4), round(size / 2 + radius / 3 + 40))
        degrees = panel[size // 2 - 18 : size // 2 - 2, columns]
        counts.append(int((np.abs(degrees - np.array(TEXT)).max(axis=-1) < 8).sum()))
    assert counts[0] == counts[1] > 20


@pytest.mark.parametrize("warnings", [0, 3])
@pytest.mark.parametrize("aspect", [0.4, 0.75, 0.89, 0.9, 1.0, 4 / 3, 16 / 9, 3.0])
def test_panels_do_not_overlap(aspect: float, warnings: int) -> None:
    plan = _lay_out(aspect, 9, warnings)
    covered = np.zeros((plan.height, PREVIEW_WIDTH), dtype=np.int64)
    for box in (plan.photo, plan.compass, plan.envmap, plan.spheres):
        assert min(box.width, box.height) > 300
        assert box.x + box.width <= PREVIEW_WIDTH - MARGIN
        covered[box.y : box.y + box.height, box.x : box.x + box.width] += 1
    assert covered.max() == 1
    for x, y in plan.cells:
        assert not covered[y : y + 50, x : x + 120].any()
        assert y + 50 < plan.height
        assert x + 120 < PREVIEW_WIDTH


@pytest.mark.parametrize("radius", [0.0, 9.0, 60.0, 110.0, 179.0])
@pytest.mark.parametrize(("azimuth", "elevation"), [(180.0, 20.0), (0.0, 90.0), (-3.0, 0.0)])
def test_regions_of_any_size_and_place_are_drawn(radius: float, azimuth: float, elevation: float) -> None:
    lighting = outdoors(azimuth, elevation, radius_50=radius, radius_90=radius)
    panel = part(draw(lighting), "envmap", 4 / 3)
    assert len(amber(panel)) > 30


def test_region_on_the_map_has_its_radius() -> None:
    lighting = outdoors(40.0, 20.0, radius_50=20.0)
    box = _lay_out(4 / 3, 9).envmap
    rows, columns = amber(part(draw(lighting), "envmap", 4 / 3)).T
    half_width = np.degrees(np.arcsin(np.sin(np.radians(20.0)) / np.cos(np.radians(20.0))))
    assert rows.max() == pytest.approx(box.height / 2, abs=3)
    assert columns.max() == pytest.approx((0.5 + (40.0 + half_width) / 360) * box.width, abs=3)
    assert columns.min() == pytest.approx((0.5 + (40.0 - half_width) / 360) * box.width, abs=3)


def drawn(lighting: Lighting) -> NDArray[np.int64]:
    return part(draw(lighting), "photo", 4 / 3)


@pytest.mark.parametrize(("elevation", "roll"), [(12.0, 0.0), (-9.0, 0.0), (6.0, 8.0), (0.0, -10.0)])
def test_horizon_lies_where_geometry_says(elevation: float, roll: float) -> None:
    lighting = outdoors(camera_elevation=elevation, camera_roll=roll, vertical_fov=60.0)
    panel = drawn(lighting)
    height, width = panel.shape[:2]
    for azimuth in (-12.0, 0.0, 15.0):
        x, y = camera_pixel(direction(azimuth, 0.0), Pinhole(width, height, 60.0, elevation=elevation, roll=roll))
        column = panel[:, int(x)].min(axis=-1)
        white = np.flatnonzero(column > 200)
        assert abs(white.mean() + 0.5 - y) < 1.5


@pytest.mark.parametrize("elevation", [60.0, 90.0, -90.0])
def test_horizon_out_of_view_is_not_drawn(elevation: float) -> None:
    panel = drawn(outdoors(camera_elevation=elevation, vertical_fov=40.0, sun_visibility=0.1))
    assert panel.min(axis=-1).max() < 230  # the arrow is paler than the line


def test_sun_in_view_is_marked_at_its_place() -> None:
    panel = drawn(outdoors(15.0, 14.0, camera_elevation=5.0, vertical_fov=60.0))
    height, width = panel.shape[:2]
    expected = camera_pixel(direction(15.0, 14.0), Pinhole(width, height, 60.0, elevation=5.0))[::-1]
    np.testing.assert_allclose(amber(panel).mean(axis=0), expected, atol=1.5)


@pytest.mark.parametrize(("azimuth", "side"), [(70.0, 1), (-70.0, -1), (120.0, 1), (-165.0, -1)])
def test_arrow_points_to_the_side_of_a_sun_out_of_view(azimuth: float, side: int) -> None:
    panel = drawn(outdoors(azimuth, 20.0))
    offset = amber(panel)[:, 1] - panel.shape[1] / 2
    assert (np.sign(offset) == side).all()
    assert np.abs(offset).max() > panel.shape[1] / 2 - 30


@pytest.mark.parametrize(("azimuth", "side"), [(120.0, -1), (-165.0, 1)])
def test_the_horizons_name_is_not_where_the_arrow_is(azimuth: float, side: int) -> None:
    panel = drawn(outdoors(azimuth, 20.0))
    white = np.argwhere(panel.min(axis=-1) > 200)
    line = int(np.median(white[:, 0]))
    letters = white[white[:, 0] < line - 6]
    assert len(letters) > 50
    assert (np.sign(letters[:, 1] - panel.shape[1] / 2) == side).all()


@pytest.mark.parametrize("elevation", [-4.0, 4.0])
@pytest.mark.parametrize("azimuth", [120.0, -165.0])
def test_the_horizon_does_not_cross_the_words_beside_the_arrow(azimuth: float, elevation: float) -> None:
    """It passes the arrow at the distance of its words, above or below."""
    panel = drawn(outdoors(azimuth, 20.0, camera_elevation=elevation, vertical_fov=60.0))
    line = np.median(np.argwhere(panel.min(axis=-1) > 200)[:, 0])
    assert 15 < abs(line - panel.shape[0] / 2) < 45
    assert np.abs(amber(panel)[:, 0] - line).min() > 6


@pytest.mark.parametrize(
    ("elevation", "fov", "balls", "caption"),
    [
        (0.0, 50.0, True, "Photo, with its horizon and three balls in its light"),
        (0.0, 50.0, False, "Photo, with its horizon"),
        (4.5, 6.9, False, "Photo"),
        (90.0, 50.0, False, "Photo"),
        (-60.0, 40.0, True, "Photo, with three balls in its light"),
        (0.0, 1.0, False, "Photo, with its horizon"),
    ],
)
def test_the_caption_names_what_is_seen(elevation: float, fov: float, balls: bool, caption: str) -> None:
    assert _format_photo_caption(Pinhole(400, 300, fov, elevation=elevation), 400, balls=balls) == caption


@pytest.mark.parametrize("aspect", [0.2, 0.5, 9 / 16, 2 / 3, 1.0, 3.0])
def test_the_caption_is_no_wider_than_the_panel(aspect: float) -> None:
    width = _lay_out(aspect, 9).photo.width
    assert text_width(_format_photo_caption(Pinhole(400, 300, 50.0), width, balls=True), LETTERS) <= width


@pytest.mark.parametrize("radius", [0.5, 30.0, 110.0])
def test_a_region_has_its_radius_all_around_the_sun(radius: float) -> None:
    lighting = outdoors(40.0, 20.0)
    rim = circle_around_sun(lighting, radius)
    np.testing.assert_allclose(angle_between(rim, lighting.sun_direction), radius, atol=1e-9)
    assert np.argmin(rim[:, 1]) in (0, 360)
    assert np.argmax(rim[:, 1]) == 180


def test_the_frame_runs_along_the_photos_border() -> None:
    lighting = outdoors(camera_elevation=7.0, camera_roll=3.0, vertical_fov=50.0)
    frame = frame_directions(lighting, 4 / 3)
    x, y = camera_pixel(frame, Pinhole(400, 300, 50.0, elevation=7.0, roll=3.0)).T
    on_border = np.minimum(np.minimum(x, 400 - x), np.minimum(y, 300 - y))
    np.testing.assert_allclose(on_border, 0.0, atol=1e-9)
    assert frame[0] == pytest.approx(frame[-1])


def test_a_line_is_cut_where_it_crosses_the_seam() -> None:
    line = np.array([[90.0, 1], [96, 2], [99, 3], [2, 4], [5, 5], [98, 6]])
    assert [len(piece) for piece in split_at_seam(line, 100.0)] == [3, 2]  # a single point is no line


@pytest.mark.parametrize("radii", [(7.0, 10.0), (13.0, 24.0), (20.0, 30.0)])
@pytest.mark.parametrize("azimuth", [-150.0, -91.0, -60.0, 0.0, 45.0, 80.0, 100.0, 179.0])
@pytest.mark.parametrize("elevation", [5.0, 40.0])
def test_the_shares_of_regions_do_not_cover_each_other(
    radii: tuple[float, float], azimuth: float, elevation: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: dict[str, NDArray[np.float64]] = {}
    monkeypatch.setattr(
        "lighting.preview.drawing.draw_text_inside",
        lambda picture, spot, share, size, color: written.__setitem__(share, np.asarray(spot)),  # noqa: ARG005
    )
    lighting = replace(outdoors(azimuth, elevation), radius_50=radii[0], radius_90=radii[1])
    draw_regions(Image.new("RGB", (480, 480)), lighting, lambda directions: dome_pixels(directions, 480, 196))
    across, down = np.abs(written["50 %"] - written["90 %"])
    assert across >= text_width("90 %", 15) or down >= 15


def test_each_of_the_suns_has_its_panel(network: Path) -> None:
    answer = Estimator(Model.load(network))(photo_from_array(scene(120, 90)))
    suns = answer.lighting.sun_candidates
    assert len(suns) > 1
    picture = np.asarray(answer.preview_candidates(MapOptions(64)))
    assert picture.shape[1] == PREVIEW_WIDTH
    panels = np.array_split(picture[:, 40:-40], len(suns), axis=1)
    assert not np.array_equal(panels[0][..., :400, :], panels[1][..., :400, :])
    with pytest.raises(ParameterError, match="pick"):
        answer.replace(sun=(10.0, 20.0)).preview_candidates(MapOptions(64))
