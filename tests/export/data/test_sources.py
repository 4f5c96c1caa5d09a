"""The list of what was learnt from: the one in the repository, and how it is made."""

import csv
import hashlib
import re
from collections import Counter
from pathlib import Path

import pytest
from click.testing import CliRunner

from export.__main__ import export_cli
from export.data.panoramas import DataError, is_permissive, read_table
from export.data.sources import list_sources
from tests.helpers.pages import ROOT

LISTED = ROOT / "export" / "data" / "sources.csv"
INDEX = """name,file,kind,place,split,sun,sun_azimuth,sun_elevation,licence,source,notes
a,a.webp,ldr,square,train,visible,10,30,CC0 (Poly Haven),me/tour:pano/a.jpg,
b,b.webp,ldr,lane,val,none,,,none stated,me/tour:tiles/2-lane,stitched from cube tiles
"""
PHOTOS = """file,sun_azimuth,sun_elevation,licence,source,label_source
p.jpg,,12,,you/blog:img/p.jpg@0123abcdef,exif_compass
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("a.webp", "b.webp", "p.jpg"):
        (tmp_path / name).write_bytes(name.encode())
    (tmp_path / "panoramas.csv").write_text(INDEX, encoding="utf-8")
    (tmp_path / "photos_train.csv").write_text(PHOTOS, encoding="utf-8")
    (tmp_path / "photos.csv").write_text("file,group\na.webp,walk\n", encoding="utf-8")
    return tmp_path


def test_each_picture_of_the_folder_is_a_row_with_its_address_licence_and_checksum(folder: Path) -> None:
    out = folder / "list.csv"
    (part := folder / "part").mkdir()
    (part / "panoramas.csv").write_text(INDEX, encoding="utf-8")
    taught = ["--taught", "1.0.0", str(part), "--taught", "2.0.0", str(folder)]
    result = CliRunner().invoke(export_cli, ["data", "list", "--data", str(folder), "--out", str(out), *taught])
    assert "2 panoramas and 2 photos, 2 of them to learn from; 1 state a permissive licence." in result.output
    a, b, p, bare = read_table(out)
    assert (a["address"], a["path"], a["stitched"], a["permissive"]) == (
        "https://github.com/me/tour",
        "pano/a.jpg",
        "no",
        "yes",
    )
    assert [row["networks"] for row in (a, b, p, bare)] == ["1.0.0 2.0.0", "", "2.0.0", ""]
    assert (a["split"], a["sun"], a["sun_azimuth"], a["sun_elevation"]) == ("train", "visible", "10", "30")
    assert a["sha256"] == hashlib.sha256(b"a.webp").hexdigest()
    assert (b["split"], b["stitched"], b["path"]) == ("val", "yes", "tiles/2-lane")
    assert (p["table"], p["split"], p["path"], p["version"]) == ("photos_train.csv", "train", "img/p.jpg", "0123abcdef")
    assert (bare["split"], bare["sun"], bare["licence"], bare["address"]) == ("val", "unknown", "unknown", "")
    assert (p["sun"], p["sun_elevation"], p["label"], p["licence"]) == ("known", "12", "exif_compass", "unknown")


def test_a_photo_that_is_not_there_is_named(folder: Path) -> None:
    (folder / "p.jpg").unlink()
    with pytest.raises(DataError, match=r"p\.jpg cannot be read"):
        list_sources(folder, folder / "list.csv")
    assert not (folder / "list.csv").exists()


@pytest.mark.parametrize(
    ("path", "notes", "stitched"),
    [
        ("panos/01.tiles/pano_r.jpg", "", True),
        ("cube/Park2/posx.jpg", "LDR; cube to equirect", True),
        ("media/panorama_42_0", "drone", True),
        ("hdri/forest_1k.hdr", "held as LDR cube elsewhere", False),
        ("pano.jpg", "pool deck; sun on the tiles", False),
        ("", "", False),
    ],
)
def test_panoramas_made_of_tiles_say_so(folder: Path, path: str, notes: str, stitched: bool) -> None:
    row = f"a,a.webp,ldr,square,train,visible,10,30,none stated,me/tour:{path},{notes}"
    (folder / "panoramas.csv").write_text(f"{INDEX.splitlines()[0]}\n{row}\n", encoding="utf-8")
    list_sources(folder, folder / "list.csv")
    assert read_table(folder / "list.csv")[0]["stitched"] == ("yes" if stitched else "no")


def test_sources_are_split_into_address_path_and_version(folder: Path) -> None:
    source = "pypi-open3d-cpu:a.hdr"
    (folder / "panoramas.csv").write_text(INDEX.replace("me/tour:pano/a.jpg", source), encoding="utf-8")
    list_sources(folder, folder / "list.csv")
    row = read_table(folder / "list.csv")[0]
    assert (row["address"], row["path"], row["version"]) == ("https://pypi.org/project/open3d-cpu/", "a.hdr", "")


def test_the_list_in_the_repository_holds_all_that_is_learnt_from() -> None:
    with LISTED.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    panoramas = [row for row in rows if row["table"] == "panoramas.csv"]
    assert {row["table"] for row in rows} == {"panoramas.csv", "photos_train.csv", "photos.csv", "unsuitable.csv"}
    assert len({row["file"] for row in rows}) == len(rows) > 2000
    assert all(re.fullmatch(r"[0-9a-f]{64}", row["sha256"]) for row in rows)
    assert all(row["licence"] and (row["permissive"] == "yes") == is_permissive(row["licence"]) for row in rows)
    assert {row["split"] for row in rows} == {"train", "val"}
    train, val = ({row["place"] for row in panoramas if row["split"] == split} for split in ("train", "val"))
    assert not train & val
    assert {row["stitched"] for row in panoramas} == {"yes", "no"}
    commits = {(row["address"], row["commit"]) for row in rows if row["commit"]}
    assert len(commits) == len(dict(commits)) > 10
    assert all(re.fullmatch("[0-9a-f]{40}", commit) for _, commit in commits)
    newest = [row["table"] for row in rows if "4.0.0" in row["networks"].split()]
    assert Counter(newest) == {"panoramas.csv": 1233, "photos_train.csv": 516, "unsuitable.csv": 48}
    assert {row["split"] for row in rows if row["networks"]} == {"train"}
    assert all(row["address"].startswith("https://") and row["path"] for row in panoramas)
    for row in rows:
        if row["sun_elevation"]:
            assert -90 <= float(row["sun_elevation"]) <= 90
