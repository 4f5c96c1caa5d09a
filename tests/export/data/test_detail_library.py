"""What ships of panoramas as detail: only those that may, exposed as photos are, without their suns."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import lighting.envmap.detail_library as detail_library
from export.data.detail_library import (
    _continue_lawn,
    _remove_glare,
    balance_library,
    level_views,
    library_pictures,
    make_detail_library,
    read_detail_library,
    write_detail_library,
)
from lighting.envmap.appearance import KIND_FEATURES, PLACE_KINDS
from lighting.envmap.library_picture import detail_picture
from lighting.geometry import angle_between, direction, latlong_directions


def test_a_sun_leaves_a_smooth_sky() -> None:
    linear = np.full((64, 128, 3), 0.5, np.float32)
    linear[32:] = 0.2
    sun = direction(30.0, 40.0)
    distance = angle_between(latlong_directions(64), sun)
    linear[distance < 4] = 1.0
    tree = distance < 2.9
    linear[tree] = 0.05
    _remove_glare(linear, sun)
    ring = (distance > 4) & (distance < 12)
    assert linear[ring].min() > 0.45
    assert np.ptp(linear[(distance < 4) & ~tree]) < 0.1
    assert (linear[tree] == np.float32(0.05)).all()
    assert (linear[32:] == np.float32(0.2)).all()


def test_a_lawn_goes_on_over_the_pit_under_it() -> None:
    linear = np.arange(180, dtype=np.float32)[:, None, None].repeat(2, axis=1).repeat(3, axis=2)
    _continue_lawn(linear, -10, -30)
    assert (linear[:120, 0, 0] == np.arange(120)).all()
    assert (linear[120:140, 0, 0] == np.arange(119, 99, -1)).all()
    assert (linear[140:160, 1, 2] == np.arange(100, 120)).all()
    assert (linear[160:, 1, 2] == np.arange(119, 99, -1)).all()


def test_the_library_is_made_of_the_rows_of_train_that_may_ship(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("export.data.detail_library.PICTURE_ROWS", 96)
    rng = np.random.default_rng(0)
    rows = ["name,file,kind,place,split,sun,sun_azimuth,sun_elevation,direct,licence"]
    for name, split, licence in (
        ("a", "train", "CC0 (Poly Haven)"),
        ("b", "train", "none stated"),
        ("c", "val", "Poly Haven CC0"),
        ("d", "train", "Poly Haven CC0 (inferred)"),
        ("e", "train", "CC0 (Poly Haven; inferred from file name)"),
        ("f", "train", "unknown (shipped MIT with Open3D; likely Poly Haven)"),
        ("g", "train", "CC0"),
    ):
        Image.fromarray(rng.integers(0, 255, (96, 192, 3), dtype=np.uint8)).save(tmp_path / f"{name}.png")
        rows.append(f"{name},{name}.png,ldr,{name},{split},visible,-20,30,yes,{licence}")
    (tmp_path / "panoramas.csv").write_text("\n".join(rows))
    table, pictures = make_detail_library(tmp_path)
    assert table["name"].tolist() == ["a", "d", "e"]
    weights = np.zeros((KIND_FEATURES + 1, len(PLACE_KINDS)), np.float32)
    write_detail_library(tmp_path / "detail.npy", table, weights, pictures)
    assert read_detail_library(tmp_path / "detail.npy")[2] == pictures
    decoded, *_ = library_pictures(table, pictures)
    assert decoded.shape == (96, 192, 3)
    assert len(list(level_views(decoded))) == 12
    monkeypatch.setattr(detail_library, "LIBRARY_PATH", tmp_path / "detail.npy")
    detail_library.load_detail_library.cache_clear()
    try:
        library = detail_library.load_detail_library()
        picture = detail_picture(detail_library.DetailChoice(0, False, 0.0), 96)
    finally:
        detail_library.load_detail_library.cache_clear()
    assert library.names == ("a", "d", "e")
    assert library.sunlit.tolist() == [True] * 3
    assert library.sun_azimuth.tolist() == [-20.0] * 3
    assert picture.columns(slice(0, 192)).shape == (96, 192, 3)
    assert np.isfinite(library.features).all()
    assert library.kind.tolist() == ["city"] * 3


def test_no_panorama_is_chosen_for_too_many_photos() -> None:
    costs = np.random.default_rng(2).random((200, 60))
    costs[:, 7] -= 0.6  # suits nearly every photo
    extra = balance_library(costs)
    used = np.bincount((costs + extra).argmin(axis=1), minlength=60)
    assert np.bincount(costs.argmin(axis=1))[7] > 100
    assert used.max() <= 0.08 * 200
    assert used[7] > 0
    assert extra.argmax() == 7
    assert np.median(extra) == 0


def test_what_does_not_fit_is_not_chosen_for_the_sake_of_balance() -> None:
    costs = np.full((100, 10), 20.0)
    costs[:, 3] = 0.0
    assert ((costs + balance_library(costs)).argmin(axis=1) == 3).all()
