"""Brackets: their files, moments and groups; and folders of probes."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import ExifTags

from lighting.errors import EnvironmentMapError, PhotoError, ProbeError
from lighting.files.exr import write_exr
from lighting.fusion.user_input import UserInput
from lighting.photo.linear import LinearPhoto
from lighting.probe.bracket import (
    TIME_ATTRIBUTE,
    BracketFiles,
    group_brackets,
    list_pictures,
    make_bracket,
    probe_path,
    probes_in,
    read_bracket,
    read_bracket_files,
)
from tests.helpers.photos import taken, write_png16

PIXELS = np.full((40, 40, 3), 1000, np.uint16)


def put(folder: Path, name: str, camera: dict[int, Any] | None = None) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return write_png16(folder / name, PIXELS, camera)


def when(shot: BracketFiles, **stated: Any) -> datetime:
    instant = shot.instants(UserInput(**stated)).likeliest
    assert instant is not None
    return instant.utc_time


def test_files_are_split_where_their_times_leave_a_gap(tmp_path: Path) -> None:
    names = {"d": "11:02:03", "a": "11:00:00", "b": "11:00:02", "c": "11:02:00"}
    files = [put(tmp_path, f"{name}.png", taken(0.1, f"2024:06:01 {time}")) for name, time in names.items()]
    shots = group_brackets(files)
    assert [[file.stem for file in shot.files] for shot in shots] == [["a", "b"], ["c", "d"]]
    assert when(shots[1]) == datetime(2024, 6, 1, 9, 2, tzinfo=UTC)


def test_each_folder_is_a_bracket_and_may_be_named_by_its_time(tmp_path: Path) -> None:
    put(tmp_path / "20240601" / "113000", "a.png")
    put(tmp_path / "20240601" / "113200", "a.png")
    shots = group_brackets([tmp_path / "20240601" / "113000", tmp_path / "20240601" / "113200"])
    assert shots[1].metadata.local_time == datetime(2024, 6, 1, 11, 32)
    assert when(shots[1], utc_offset=2.0) == datetime(2024, 6, 1, 9, 32, tzinfo=UTC)
    with pytest.raises(ProbeError, match="no known zone"):
        when(shots[1])
    assert when(shots[1], latitude=48.14, longitude=11.58) == datetime(2024, 6, 1, 9, 32, tzinfo=UTC)


def test_a_time_that_is_nowhere_is_asked_for(tmp_path: Path) -> None:
    shot = read_bracket_files([put(tmp_path, "a.png")])
    with pytest.raises(ProbeError, match="does not say when"):
        when(shot, utc_offset=0.0)
    with pytest.raises(ProbeError, match="folder of its own"):
        group_brackets([tmp_path / "a.png"])


def test_the_place_is_read_as_well(tmp_path: Path) -> None:
    from PIL import Image

    from tests.conftest import munich

    Image.fromarray((PIXELS >> 8).astype(np.uint8)).save(tmp_path / "a.jpg", exif=munich())
    shot = read_bracket_files([tmp_path / "a.jpg"])
    assert shot.metadata.latitude == pytest.approx(48.1375, abs=1e-3)
    assert when(shot) == datetime(2024, 6, 1, 7, 10, tzinfo=UTC)


def test_a_folder_without_pictures_is_said(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("none")
    with pytest.raises(ProbeError, match="no pictures"):
        list_pictures(tmp_path)


def photo(value: float, size: int = 40, exposure: float | None = None) -> LinearPhoto:
    return LinearPhoto(np.full((size, size, 3), value, np.float32), 0.98, 1 / 255, exposure)


def test_exposures_are_ordered_by_exif_where_all_have_it() -> None:
    bracket = make_bracket([photo(0.1, exposure=1.0), photo(0.9, exposure=0.1)], ["a", "b"])
    assert bracket.names == ("b", "a")


def test_exposures_are_ordered_by_brightness_where_one_has_no_exif() -> None:
    bracket = make_bracket([photo(0.9, exposure=0.1), photo(0.1)], ["a", "b"])
    assert bracket.names == ("b", "a")


def test_one_exposure_is_no_bracket(tmp_path: Path) -> None:
    with pytest.raises(ProbeError, match="only one"):
        read_bracket([tmp_path / "a.png"])
    with pytest.raises(ProbeError, match="there are none"):
        read_bracket([])
    with pytest.raises(ProbeError, match="at least one"):
        make_bracket([])


def test_an_exposure_that_is_given_twice_is_refused(tmp_path: Path) -> None:
    twice = tmp_path / ".." / tmp_path.name / "a.png"
    with pytest.raises(ProbeError, match="is given twice"):
        read_bracket([tmp_path / "a.png", tmp_path / "b.png", twice])


def test_exposures_of_different_sizes_are_refused() -> None:
    with pytest.raises(ProbeError, match="differ in size: 40 x 40, 50 x 50 pixels"):
        make_bracket([photo(0.1), photo(0.2, size=50)])


def test_warnings_of_the_files_come_once() -> None:
    warned = replace(photo(0.1), warnings=("rough",))
    assert make_bracket([warned, warned]).warnings == ("rough",)


def test_files_of_several_kinds_are_read(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", np.full((32, 64, 3), 0.25, np.float32))
    write_png16(tmp_path / "b.png", np.full((32, 64, 3), 40000, np.uint16), taken(0.5))
    bracket = read_bracket([tmp_path / "b.png", tmp_path / "a.exr"])
    assert bracket.names == ("a.exr", "b.png")
    assert bracket.photos[1].pixels.mean() == pytest.approx(40000 / 65535)
    assert bracket.photos[1].exposure == pytest.approx(0.5)
    with pytest.raises(PhotoError, match="linear"):
        read_bracket([tmp_path / "b.png", tmp_path / "a.exr"], "srgb")


def test_files_with_and_without_an_offset_are_compared_by_the_cameras_clock(tmp_path: Path) -> None:
    """The offset was read as a gap of two hours."""
    seconds = {"a": 0, "b": 2, "c": 4, "d": 120, "e": 122}
    files = []
    for index, (name, after) in enumerate(seconds.items()):
        camera = taken(0.1, f"2024:06:01 11:{after // 60:02d}:{after % 60:02d}")
        if index % 2:
            del camera[ExifTags.Base.OffsetTimeOriginal]
        files.append(put(tmp_path, f"{name}.png", camera))
    shots = group_brackets(files)
    assert [[file.stem for file in shot.files] for shot in shots] == [["a", "b", "c"], ["d", "e"]]
    assert [when(shot) for shot in shots] == [datetime(2024, 6, 1, 9, minute, tzinfo=UTC) for minute in (0, 2)]


def test_a_stated_offset_wins_over_the_files_and_says_so(tmp_path: Path) -> None:
    shot = read_bracket_files([put(tmp_path, "a.png", taken(0.1))])
    found = shot.instants(UserInput(utc_offset=5.0))
    assert found.likeliest is not None
    assert found.likeliest.utc_time == datetime(2024, 6, 1, 6, 0, tzinfo=UTC)
    assert "+05:00, replaced the file's, +02:00" in found.warnings[0]


MAP = np.ones((16, 32, 3), np.float32)
NOON = datetime(2024, 6, 1, 12, 0, 30, tzinfo=UTC)


def put_folder(folder: Path, name: str, time: str | None = None) -> Path:
    path = folder / name / "envmap.exr"
    path.parent.mkdir(parents=True)
    write_exr(path, MAP, attributes={} if time is None else {TIME_ATTRIBUTE: time})
    return path


def test_folders_are_named_by_utc() -> None:
    local = NOON.astimezone(timezone(timedelta(hours=2)))
    assert probe_path("sky", local) == Path("sky/20240601/120030/envmap.exr")


def test_probes_come_by_time_and_their_header_wins_over_names(tmp_path: Path) -> None:
    late = put_folder(tmp_path, "20240601/090000", NOON.isoformat())
    early = put_folder(tmp_path, "20240601/110000")
    (tmp_path / "notes").mkdir()
    probes = probes_in(tmp_path)
    assert [probe.path for probe in probes] == [early, late]
    assert probes[1].time == NOON
    assert probes[0].time == datetime(2024, 6, 1, 11, tzinfo=UTC)


def test_names_may_be_in_another_zone(tmp_path: Path) -> None:
    put_folder(tmp_path, "20240601/140000")
    assert probes_in(tmp_path, timezone(timedelta(hours=2)))[0].time == datetime(2024, 6, 1, 12, tzinfo=UTC)


def test_what_holds_no_probes_is_said(tmp_path: Path) -> None:
    with pytest.raises(ProbeError, match="no folder"):
        probes_in(tmp_path / "none")
    with pytest.raises(ProbeError, match="holds no probe"):
        probes_in(tmp_path)
    put_folder(tmp_path, "20241399/000000")
    with pytest.raises(ProbeError, match="not named by a time"):
        probes_in(tmp_path)


def test_a_header_without_a_time_in_it_is_named(tmp_path: Path) -> None:
    path = put_folder(tmp_path, "20240601/140000", "noon")
    with pytest.raises(ProbeError) as refused:
        probes_in(tmp_path)
    assert str(refused.value) == f"{path}: lighting.time is 'noon', which is no time."


def test_a_damaged_probe_is_said(tmp_path: Path) -> None:
    put_folder(tmp_path, "20240601/140000").write_bytes(b"nothing")
    with pytest.raises(EnvironmentMapError, match="not an OpenEXR"):
        probes_in(tmp_path)
