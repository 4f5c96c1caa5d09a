"""The report of shadows that a person marked, on a photo whose sun is known."""

from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import DataError
from export.reports import shadows as module
from export.reports.shadows import _gesture, _shadow_text, report_shadows
from lighting.fusion.marks import read_shadow
from lighting.model import Model
from tests.conftest import encode, scene

ROW = {"width": "64", "height": "48", "foot_x": "20", "foot_y": "40", "tip_x": "70", "tip_y": "44"}


@pytest.mark.parametrize(
    ("sure", "top", "text"),
    [
        ("yes", ("", ""), "20.0,40.0,64.0,44.0"),
        ("yes", ("21", "9"), "20.0,40.0,64.0,44.0,21.0,9.0"),
        ("no", ("", ""), "doubt:20.0,40.0,64.0,44.0"),
    ],
)
def test_a_row_is_a_mark_inside_of_its_picture(sure: str, top: tuple[str, str], text: str) -> None:
    assert _shadow_text({**ROW, "sure": sure, "top_x": top[0], "top_y": top[1]}) == text
    read_shadow(text)


def test_every_kind_of_mark_has_a_name_of_its_own() -> None:
    shadows = ["1,2,30,4", "1,2,30,4,5,6", "doubt:1,2,30,4", "own:7,8", "head:7,8", "line:1,2,30,4", "lit:1,2,30,4"]
    assert len({_gesture(read_shadow(text)) for text in [*shadows, "lit:1,2,30,4,20,3"]}) == 8


def make_data(folder: Path, marks: str) -> Path:
    (folder / "photo.jpg").write_bytes(encode(scene(64, 48)))
    columns = "file,width,height,foot_x,foot_y,tip_x,tip_y,top_x,top_y,sure,split,panorama,sun_azimuth,sun_elevation"
    rooms = ("yes", "a"), ("no", ""), ("no", "a")
    rows = [f"photo.jpg,64,48,20,40,30,44,,,{sure},train,{room},10,30" for sure, room in rooms]
    (folder / "shadows.csv").write_text(
        "\n".join([columns, *rows, "photo.jpg,64,48,20,40,30,44,,,yes,val,,,30"]) + "\n"
    )
    for name in ("photos.csv", "photos_train.csv"):
        (folder / name).write_text(f"file,sun_azimuth,sun_elevation\n{'photo.jpg,10,30' * (name == 'photos.csv')}\n")
    (folder / "marks.csv").write_text(f"file,sample,mark\n{marks}")
    return folder


def test_the_report_counts_photos_that_take_a_gesture(
    tmp_path: Path, network: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    marks = 'photo.jpg,random,"20,40,30,44"\nphoto.jpg,random,"20,0,30,44"\nother.jpg,random,\n'
    marks += 'photo.jpg,val,"doubt:20,40,30,44"\n'
    data = make_data(tmp_path, marks)
    monkeypatch.setattr(module, "PHOTO_MARKS", data / "marks.csv")
    report = report_shadows(Model.load(network), data)
    assert "Of 2 photos at random 1 take a gesture" in report  # the second mark lies over the horizon
    counts = dict(line.split(" | ")[:2] for line in report.splitlines() if line.startswith("| "))
    wanted = {"| all crops": "2", "| all crops, as lines": "2", "| photos, doubtful, train": "1", "| random, val": "1"}
    assert wanted.items() <= counts.items()
    assert counts["| shadow"] == counts["| shadow, doubted"] == counts["| all crops, doubtful"] == "1"
    assert counts["| every scene of val"] == counts["| crops and photos, doubtful"] == "2"
    assert not np.isnan(float(report.rsplit("|", 2)[1]))


def test_a_folder_without_the_table_is_told(tmp_path: Path, network: Path) -> None:
    with pytest.raises(DataError, match=r"shadows\.csv"):
        report_shadows(Model.load(network), tmp_path)
