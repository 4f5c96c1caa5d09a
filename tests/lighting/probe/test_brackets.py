"""Which files make a bracket, and when it was taken."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lighting.errors import ProbeError
from lighting.probe.brackets import pictures_in, shot_of, shots_of
from tests.pictures import taken, write_png16

PIXELS = np.full((40, 40, 3), 1000, np.uint16)


def put(folder: Path, name: str, camera: dict[int, Any] | None = None) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return write_png16(folder / name, PIXELS, camera)


def test_files_are_split_where_their_times_leave_a_gap(tmp_path: Path) -> None:
    names = {"d": "11:02:03", "a": "11:00:00", "b": "11:00:02", "c": "11:02:00"}
    files = [put(tmp_path, f"{name}.png", taken(0.1, f"2024:06:01 {time}")) for name, time in names.items()]
    shots = shots_of(files)
    assert [[file.stem for file in shot.files] for shot in shots] == [["a", "b"], ["c", "d"]]
    assert shots[1].aware(None) == datetime(2024, 6, 1, 9, 2, tzinfo=UTC)


def test_each_folder_is_a_bracket_and_may_be_named_by_its_time(tmp_path: Path) -> None:
    put(tmp_path / "20240601" / "113000", "a.png")
    put(tmp_path / "20240601" / "113200", "a.png")
    shots = shots_of([tmp_path / "20240601" / "113000", tmp_path / "20240601" / "113200"])
    assert shots[1].time == datetime(2024, 6, 1, 11, 32)
    assert shots[1].aware(2.0) == datetime(2024, 6, 1, 9, 32, tzinfo=UTC)
    with pytest.raises(ProbeError, match="no known zone"):
        shots[1].aware(None)


def test_a_time_that_is_nowhere_is_asked_for(tmp_path: Path) -> None:
    shot = shot_of([put(tmp_path, "a.png")])
    with pytest.raises(ProbeError, match="does not say when"):
        shot.aware(0.0)
    with pytest.raises(ProbeError, match="folder of its own"):
        shots_of([tmp_path / "a.png"])


def test_the_place_is_read_as_well(tmp_path: Path) -> None:
    from PIL import Image

    from tests.conftest import munich

    Image.fromarray((PIXELS >> 8).astype(np.uint8)).save(tmp_path / "a.jpg", exif=munich())
    shot = shot_of([tmp_path / "a.jpg"])
    assert shot.latitude == pytest.approx(48.1375, abs=1e-3)
    assert shot.aware(None) == datetime(2024, 6, 1, 7, 10, tzinfo=UTC)


def test_a_folder_without_pictures_is_said(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("none")
    with pytest.raises(ProbeError, match="no pictures"):
        pictures_in(tmp_path)
