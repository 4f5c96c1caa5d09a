"""The pictures of the book: which the command makes, and how it writes them."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scripts.gallery import EXAMPLES, draw_gallery_row
from scripts.make_pictures import IMAGES, PICTURES, write_picture
from scripts.make_world_map import copies, path_of, rings, unwrap

OTHERS = {  # pictures that another command makes, or a hand
    "reliability.png": "python -m export evaluate --card",
    "how-it-works.svg": "a hand",
    "draw-a-shadow.webp": "a hand, in the page",
}


def test_the_command_makes_every_picture() -> None:
    there = {file.relative_to(IMAGES).as_posix() for file in IMAGES.rglob("*") if file.is_file()}
    assert there - set(OTHERS) == {f"{name}.webp" for name in PICTURES}


def test_the_gallery_shows_twelve_photos_by_their_names() -> None:
    page = (IMAGES.parent / "README.md").read_text(encoding="utf-8")
    shown = re.findall(r"\(images/(gallery/\w+)\.webp\)", page)
    assert len(shown) == 12
    assert shown == [name for name in PICTURES if name.startswith("gallery/")]


def test_a_picture_is_small_and_one_of_frames_moves(tmp_path: Path) -> None:
    gray, red = (Image.new("RGB", (2400, 600), color) for color in ("gray", "red"))
    write_picture(gray, tmp_path / "still.webp")
    write_picture([gray, red, gray], tmp_path / "moving.webp")
    with Image.open(tmp_path / "still.webp") as still, Image.open(tmp_path / "moving.webp") as moving:
        assert (still.format, still.size) == ("WEBP", (1200, 300))
        assert (moving.n_frames, moving.info["loop"]) == (3, 0)  # type: ignore[attr-defined]


@pytest.mark.slow
def test_a_row_of_the_gallery_begins_with_the_photo() -> None:
    row = draw_gallery_row("park_evening")
    with Image.open(EXAMPLES / "park_evening.jpg") as photo:
        small = photo.resize((344, 258))
    assert row.size == (344 + 6 + 516 + 6 + 344, 258)
    assert np.abs(np.asarray(row, dtype=float)[:, :344] - np.asarray(small, dtype=float)).mean() < 3.0


def test_an_outline_across_the_edge_is_at_both() -> None:
    ring = [(1790, 0), (-1790, 0), (-1790, 10), (1790, 10), (1790, 0)]
    points = unwrap(ring)
    assert points == [(1790, 0), (1810, 0), (1810, 10), (1790, 10), (1790, 0)]
    assert list(copies(points)) == [[(x - 3600, y) for x, y in points], points]


def test_land_around_the_pole_reaches_the_lower_edge() -> None:
    points = unwrap([(-1800, 700), (0, 650), (1750, 700), (-1800, 700)])
    assert points == [(-1800, 700), (0, 650), (1750, 700), (1800, 700), (1800, 900), (-1800, 900), (-1800, 700)]


def test_arcs_become_a_path() -> None:
    transform = {"scale": [1, 1], "translate": [-180, -90]}
    arcs = [[[180, 90], [1, 0]], [[180, 90], [0, 1], [1, -1]]]  # two ways from one point to another
    geometry = {"type": "MultiPolygon", "arcs": [[[0, ~1]]]}
    (ring,) = rings({"transform": transform, "arcs": arcs, "objects": {"land": {"geometries": [geometry]}}})
    assert path_of(ring) == "M0 0l10 0-10-10z"
