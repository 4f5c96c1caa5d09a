"""Labels survive their file, and bad files are refused."""

import dataclasses
import math
from pathlib import Path

import pytest

from export.data.labels import Label, read_labels, write_labels
from export.data.tables import DataError

LABEL = Label("a", -12.5, 40.0, 2.0, "given", -12.0, 41.0, 3.2, 5.1, 0.12, True, "yes")


def test_labels_survive_a_file(tmp_path: Path) -> None:
    none = dataclasses.replace(LABEL, name="b", sun_source="none", sun_azimuth=math.nan, fit_ok=False, direct="")
    write_labels([LABEL, none], tmp_path / "labels.csv")
    first, second = read_labels(tmp_path / "labels.csv")
    assert first == LABEL
    assert math.isnan(second.sun_azimuth)
    assert dataclasses.replace(second, sun_azimuth=0.0) == dataclasses.replace(none, sun_azimuth=0.0)


def test_labels_that_cannot_be_written_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(DataError, match="cannot be written"):
        write_labels([LABEL], tmp_path / "file" / "labels.csv")


@pytest.mark.parametrize(
    ("text", "message"),
    [(None, "cannot be read"), ("name,turbidity\na,3\n", "no column"), ("NUMBER", "cannot be read")],
)
def test_labels_that_cannot_be_read_are_refused(tmp_path: Path, text: str | None, message: str) -> None:
    path = tmp_path / "labels.csv"
    if text == "NUMBER":
        write_labels([LABEL], path)
        path.write_text(path.read_text().replace("3.2", "three"))
    elif text is not None:
        path.write_text(text)
    with pytest.raises(DataError, match=message):
        read_labels(path)
