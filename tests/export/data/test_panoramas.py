"""Tests of panoramas."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from export.data.panoramas import (
    LABELS_PATCH,
    DataError,
    Panorama,
    decode_srgb,
    is_permissive,
    read_index,
    read_linear_panorama,
    read_picture,
    read_table,
    write_table,
)
from export.data.rendered_panoramas import _blocked, _hit_ball, _hit_box, render_folder, render_panorama
from lighting.color import luminance
from lighting.geometry import direction, latlong_directions, latlong_pixel
from lighting.records import GROUND_ALBEDO
from lighting.sky.clear_sky import sky_radiance
from tests.helpers.panoramas import ROW, write_index

PATCH_HEADER = "name,sun,sun_azimuth,sun_elevation,sun_uncertainty,direct,reason"


def test_five_columns_are_enough(tmp_path: Path) -> None:
    (panorama,) = read_index(write_index(tmp_path, ROW))
    assert panorama == Panorama("a", (tmp_path / "a.png").resolve(), "ldr", "here", "train")
    assert panorama.sun == "unknown"
    assert panorama.sun_azimuth is None


def test_all_columns_of_a_rendered_folder(tmp_path: Path) -> None:
    render_folder(tmp_path, 8, 16)
    panoramas = read_index(tmp_path)
    assert [p.name for p in panoramas] == [f"rendered_{number:04d}" for number in range(8)]
    assert {p.sun for p in panoramas} >= {"visible", "none"}
    assert all((p.sun_azimuth is None) == (p.sun == "none") for p in panoramas)
    assert len(read_index(tmp_path, "val")) == 2
    assert all(p.split == "train" for p in read_index(tmp_path, "train"))


def test_an_empty_number_is_none_and_a_number_is_read(tmp_path: Path) -> None:
    row = {**ROW, "sun": "visible", "sun_azimuth": "-12.5", "sun_elevation": "40", "sun_uncertainty": ""}
    (panorama,) = read_index(write_index(tmp_path, row))
    assert (panorama.sun_azimuth, panorama.sun_elevation, panorama.sun_uncertainty) == (-12.5, 40.0, None)


@pytest.mark.parametrize(
    ("licence", "permissive"),
    [
        ("Poly Haven CC0", True),
        ("CC0 (Poly Haven; inferred from file name)", True),
        ("CC-BY 3.0", True),
        ("cc by 4.0", True),
        ("MIT", True),
        ("Apache-2.0", True),
        ("public domain", True),
        ("", False),
        ("none stated", False),
        ("as repo", False),
        ("as repo (MIT)", False),
        ("unknown", False),
        ("unknown (shipped MIT; likely Poly Haven)", False),
        ("CC BY-NC 4.0", False),
        ("CC-BY-SA 4.0", False),
        ("CC_BY_ND", False),
        ("non-commercial research use", False),
        ("permitted", False),
    ],
)
def test_permissive_licences(licence: str, permissive: bool) -> None:
    assert is_permissive(licence) is permissive


@pytest.mark.parametrize(
    ("notes", "altered"),
    [
        ("", False),
        ("nadir logo; sun behind a tree", False),
        ("strong HDR tone mapping", True),
        ("some drone with filled zenith", True),
        ("sky above el 30 synthetic fill", True),
        ("violet colour cast", True),
        ("sky may be replaced", True),
    ],
)
def test_notes_tell_of_an_altered_sky(tmp_path: Path, notes: str, altered: bool) -> None:
    (panorama,) = read_index(write_index(tmp_path, {**ROW, "notes": notes}))
    assert panorama.sky_is_altered is altered


def test_licensed_only_keeps_permissive_rows(tmp_path: Path) -> None:
    rows = [{**ROW, "name": name, "licence": licence} for name, licence in (("a", "CC0"), ("b", "none stated"))]
    write_index(tmp_path, *rows)
    assert [p.name for p in read_index(tmp_path, licensed_only=True)] == ["a"]
    assert len(read_index(tmp_path)) == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "raw"}, "line 2: kind is 'raw'"),
        ({"split": "test"}, "split is 'test'"),
        ({"name": ""}, "the column name is empty"),
        ({"file": "b.png"}, "there is no picture"),
        ({"sun": "bright"}, "sun is 'bright'"),
        ({"sun_azimuth": "north"}, "sun_azimuth is 'north', not a number from -180 to 180"),
        ({"sun_elevation": "91"}, "sun_elevation is '91'"),
        ({"sun_elevation": "nan"}, "sun_elevation is 'nan'"),
        ({"sun_uncertainty": "-1"}, "sun_uncertainty is '-1'"),
    ],
)
def test_bad_rows_are_refused_in_a_sentence(tmp_path: Path, change: dict[str, str], message: str) -> None:
    with pytest.raises(DataError, match=message) as caught:
        read_index(write_index(tmp_path, {**ROW, **change}))
    assert str(caught.value).endswith(".")


def test_a_missing_folder_index_or_column_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no folder"):
        read_index(tmp_path / "nowhere")
    with pytest.raises(DataError, match=r"has no panoramas\.csv"):
        read_index(tmp_path)
    with pytest.raises(DataError, match="no column place, split"):
        read_index(write_index(tmp_path, {key: ROW[key] for key in ("name", "file", "kind")}))


def test_an_index_that_is_not_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "panoramas.csv").write_bytes(b"name\xff\xfe\x00")
    with pytest.raises(DataError, match="cannot be read"):
        read_index(tmp_path)


def test_a_place_in_both_splits_is_refused(tmp_path: Path) -> None:
    write_index(tmp_path, ROW, {**ROW, "name": "b", "split": "val"})
    with pytest.raises(DataError, match="here is in both splits"):
        read_index(tmp_path, "train")


def test_a_name_that_appears_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="appears twice"):
        read_index(write_index(tmp_path, ROW, ROW))


def patch_with(monkeypatch: pytest.MonkeyPatch, folder: Path, *lines: str, header: str = PATCH_HEADER) -> None:
    """Corrections that stand in for those of the project."""
    path = folder / "labels_patch.csv"
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    monkeypatch.setattr("export.data.panoramas.LABELS_PATCH", path)


VISIBLE_ROW = {**ROW, "sun": "visible", "sun_azimuth": "10", "sun_elevation": "40"}
VISIBLE_ROW |= {"sun_uncertainty": "3", "direct": "yes"}


def test_the_projects_own_patch_can_be_read(tmp_path: Path) -> None:
    assert LABELS_PATCH.read_text(encoding="utf-8").splitlines()[0] == PATCH_HEADER
    assert read_index(write_index(tmp_path, ROW))


def test_a_patch_changes_the_fields_that_it_fills_and_ignores_unknown_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    patch_with(monkeypatch, tmp_path, "a,,-170,,,partly,half a turn off", "b,,1,2,3,,of another folder")
    (panorama,) = read_index(write_index(tmp_path, VISIBLE_ROW))
    assert (panorama.sun, panorama.sun_azimuth, panorama.sun_elevation) == ("visible", -170.0, 40.0)
    assert (panorama.sun_uncertainty, panorama.direct) == (3.0, "partly")


def test_a_patch_fills_columns_that_the_index_lacks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    patch_with(monkeypatch, tmp_path, "a,inferred,20,30,5,no,from shadows")
    (panorama,) = read_index(write_index(tmp_path, ROW))
    assert (panorama.sun, panorama.sun_azimuth, panorama.direct) == ("inferred", 20.0, "no")


@pytest.mark.parametrize("sun", ["none", "unknown"])
def test_a_sun_that_is_taken_back_loses_its_direction(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sun: str
) -> None:
    patch_with(monkeypatch, tmp_path, f"a,{sun},,,,,a lamp")
    (panorama,) = read_index(write_index(tmp_path, VISIBLE_ROW))
    assert panorama.sun == sun
    assert panorama.sun_azimuth is panorama.sun_elevation is panorama.sun_uncertainty is None


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["b,,200,,,,turned"], "labels_patch.csv, line 2: sun_azimuth is '200', not a number from -180 to 180"),
        (["b,bright,,,,,seen"], "line 2: sun is 'bright'"),
        (["b,,,,,maybe,seen"], "line 2: direct is 'maybe'"),
        (["b,,,,,no,"], "line 2: a correction needs"),
        ([",,,,,no,seen"], "line 2: a correction needs"),
        (["b,,,,,no,seen", "b,,,,,yes,seen"], "line 3: the panorama b is already corrected"),
    ],
)
def test_a_malformed_patch_is_refused_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: list[str], message: str
) -> None:
    patch_with(monkeypatch, tmp_path, *lines)
    with pytest.raises(DataError, match=message) as caught:
        read_index(write_index(tmp_path, ROW))
    assert str(caught.value).endswith(".")


def test_a_patch_without_its_columns_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    patch_with(monkeypatch, tmp_path, header="name,azimuth,reason")
    with pytest.raises(DataError, match="has no column sun, sun_azimuth"):
        read_index(write_index(tmp_path, ROW))


def test_an_ldr_picture_is_read_and_made_linear(tmp_path: Path) -> None:
    (panorama,) = read_index(write_index(tmp_path, ROW))
    picture = read_picture(panorama)
    assert picture.dtype == np.uint8
    assert picture.shape == (4, 8, 3)
    linear = read_linear_panorama(panorama, 2)
    assert linear.dtype == np.float32
    assert linear.shape == (2, 4, 3)
    np.testing.assert_allclose(linear[0, 0], decode_srgb(np.array([10, 20, 30], np.uint8)), rtol=1e-6)


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_an_hdr_picture_is_read_and_cleaned(tmp_path: Path, channels: int, kind: type) -> None:
    import OpenEXR

    pixels: NDArray[np.floating[Any]] = np.full((4, 8, channels), 0.5, kind)
    pixels[0, 0, :3] = (np.inf, np.nan, -1.0)
    file = OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGBA"[:channels]: pixels})
    file.write(str(tmp_path / "a.exr"))
    panorama = Panorama("a", tmp_path / "a.exr", "hdr", "here", "train")
    read = read_picture(panorama)
    assert read.dtype == np.float32
    assert read.shape == (4, 8, 3)
    assert read[0, 0].tolist() == [65504.0, 0.0, 0.0]
    assert np.all(read[1:] == 0.5)
    assert np.array_equal(read_linear_panorama(panorama, 4), read)


@pytest.mark.parametrize(("kind", "message"), [("ldr", "cannot be read"), ("hdr", "cannot be read")])
def test_a_damaged_picture_is_refused(tmp_path: Path, kind: str, message: str) -> None:
    (tmp_path / "a").write_bytes(b"not a picture")
    with pytest.raises(DataError, match=message):
        read_picture(Panorama("a", tmp_path / "a", kind, "here", "train"))


def test_a_picture_of_another_shape_is_refused(tmp_path: Path) -> None:
    Image.new("RGB", (9, 4)).save(tmp_path / "a.png")
    with pytest.raises(DataError, match="9 x 4 pixels"):
        read_picture(Panorama("a", tmp_path / "a.png", "ldr", "here", "train"))


def test_a_table_survives_its_file_and_makes_its_folder(tmp_path: Path) -> None:
    path = tmp_path / "new" / "table.csv"
    write_table(path, ["name", "note"], [["a", 'with, comma and "quotes"'], ["b", ""]])
    assert read_table(path, ["note"]) == [
        {"name": "a", "note": 'with, comma and "quotes"'},
        {"name": "b", "note": ""},
    ]


def test_short_rows_are_filled_and_a_byte_order_mark_is_no_part_of_a_name(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(b"\xef\xbb\xbfname,note\na\n")
    assert read_table(path, ["name"]) == [{"name": "a", "note": ""}]


def test_missing_columns_and_files_are_named(tmp_path: Path) -> None:
    write_table(tmp_path / "table.csv", ["name"], [])
    with pytest.raises(DataError, match="has no column place, split"):
        read_table(tmp_path / "table.csv", ["name", "place", "split"])
    with pytest.raises(DataError, match="cannot be read"):
        read_table(tmp_path / "none.csv")


def test_a_table_that_fails_midway_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        write_table(tmp_path / "table.csv", ["x"], ([1 / x] for x in (1, 0)))
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_missing_or_in_the_way_is_named_once(tmp_path: Path) -> None:
    missing = tmp_path / "none.csv"
    with pytest.raises(DataError) as refused:
        read_table(missing)
    assert str(refused.value) == f"{missing} cannot be read: No such file or directory."
    with pytest.raises(DataError) as refused:
        write_table(tmp_path, ["x"], [])
    assert str(refused.value).count(str(tmp_path)) == 1


def test_a_box_and_a_ball_cast_shadows_away_from_the_sun() -> None:
    box = partial(_hit_box, low=np.array([4.0, 0.0, -1.0]), high=np.array([6.0, 10.0, 1.0]))
    ball = partial(_hit_ball, center=np.array([0.0, 3.0, 20.0]), radius=2.0)
    points = np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 0.0, 5.0], [-3.0, 1.3, 20.0], [3.0, 1.3, 20.0]])
    hidden = _blocked(points, direction(90.0, 30.0), [(box, np.full(3, 0.5)), (ball, np.full(3, 0.5))])
    assert hidden.tolist() == [True, False, False, True, False]


def test_the_same_seed_gives_the_same_pixels() -> None:
    first, again, other = (render_panorama(seed, 32) for seed in (1, 1, 2))
    assert np.array_equal(first.linear, again.linear)
    assert not np.array_equal(first.linear, other.linear)


def test_the_sky_is_the_model_times_the_exposure() -> None:
    scene = render_panorama(0, 32, things=0)
    assert scene.sun_azimuth is not None
    assert scene.sun_elevation is not None
    assert scene.turbidity is not None
    sun = direction(scene.sun_azimuth, scene.sun_elevation)
    towards = latlong_directions(32)[:15]
    far = towards @ sun < 0.7
    expected = sky_radiance(towards[far], sun, scene.turbidity, GROUND_ALBEDO) * scene.exposure
    np.testing.assert_allclose(scene.linear[:15][far], expected, rtol=1e-4)


def test_the_sun_is_the_brightest_spot_and_clipped_in_the_picture() -> None:
    scene = render_panorama(0, 64, things=0)
    x, y = latlong_pixel(direction(scene.sun_azimuth or 0.0, scene.sun_elevation or 0.0), 64)
    row, column = np.unravel_index(int(luminance(scene.linear).argmax()), (64, 128))
    assert scene.sun_visible
    assert abs(column + 0.5 - x) <= 1
    assert abs(row + 0.5 - y) <= 1
    assert scene.picture[row, column].min() == 255


def test_an_overcast_sky_has_no_sun_and_is_brightest_overhead() -> None:
    scene = render_panorama(3, 64, overcast=True)
    assert scene.sun_azimuth is scene.sun_elevation is scene.turbidity is None
    assert not scene.sun_visible
    assert luminance(scene.linear[0]).mean() > 1.5 * luminance(scene.linear[29]).mean()


def test_some_crowded_scenes_hide_the_sun() -> None:
    visible = [render_panorama(seed, 16, things=40).sun_visible for seed in range(12)]
    assert any(visible)
    assert not all(visible)


def test_a_folder_is_written_that_can_be_read(tmp_path: Path) -> None:
    render_folder(tmp_path, 6, 16, seed=5)
    panoramas = read_index(tmp_path)
    assert len(panoramas) == 6
    assert {p.split for p in panoramas} == {"train", "val"}
    assert np.array_equal(read_picture(panoramas[2]), render_panorama(7, 16).picture)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["panoramas", "panoramas.csv"]


@pytest.mark.parametrize("turbidity", [2.0, 6.0])
def test_turbidity_can_be_chosen(turbidity: float) -> None:
    assert render_panorama(0, 16, turbidity=turbidity).turbidity == turbidity
