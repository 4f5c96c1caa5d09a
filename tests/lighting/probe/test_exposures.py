"""Reading and ordering the exposures of a bracket."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lighting.errors import PhotoError, ProbeError
from lighting.files.exr import write_exr
from lighting.photo.linear import LinearPhoto
from lighting.probe.exposures import bracket_of, read_bracket
from tests.pictures import taken, write_png16


def photo(value: float, size: int = 40, exposure: float | None = None) -> LinearPhoto:
    return LinearPhoto(np.full((size, size, 3), value, np.float32), 0.98, 1 / 255, exposure)


def test_exposures_are_ordered_by_exif_where_all_have_it() -> None:
    bracket = bracket_of([photo(0.1, exposure=1.0), photo(0.9, exposure=0.1)], ["a", "b"])
    assert bracket.names == ("b", "a")


def test_exposures_are_ordered_by_brightness_where_one_has_no_exif() -> None:
    bracket = bracket_of([photo(0.9, exposure=0.1), photo(0.1)], ["a", "b"])
    assert bracket.names == ("b", "a")


def test_one_exposure_is_no_bracket(tmp_path: Path) -> None:
    with pytest.raises(ProbeError, match="only one"):
        read_bracket([tmp_path / "a.png"])
    with pytest.raises(ProbeError, match="there are none"):
        read_bracket([])
    with pytest.raises(ProbeError, match="at least one"):
        bracket_of([])


def test_an_exposure_that_is_given_twice_is_refused(tmp_path: Path) -> None:
    twice = tmp_path / ".." / tmp_path.name / "a.png"
    with pytest.raises(ProbeError, match="is given twice"):
        read_bracket([tmp_path / "a.png", tmp_path / "b.png", twice])


def test_exposures_of_different_sizes_are_refused() -> None:
    with pytest.raises(ProbeError, match="differ in size: 40 x 40, 50 x 50 pixels"):
        bracket_of([photo(0.1), photo(0.2, size=50)])


def test_warnings_of_the_files_come_once() -> None:
    warned = replace(photo(0.1), warnings=("rough",))
    assert bracket_of([warned, warned]).warnings == ("rough",)


def test_files_of_several_kinds_are_read(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", np.full((32, 64, 3), 0.25, np.float32))
    write_png16(tmp_path / "b.png", np.full((32, 64, 3), 40000, np.uint16), taken(0.5))
    bracket = read_bracket([tmp_path / "b.png", tmp_path / "a.exr"])
    assert bracket.names == ("a.exr", "b.png")
    assert bracket.photos[1].pixels.mean() == pytest.approx(40000 / 65535)
    assert bracket.photos[1].exposure == pytest.approx(0.5)
    with pytest.raises(PhotoError, match="linear"):
        read_bracket([tmp_path / "b.png", tmp_path / "a.exr"], "srgb")
