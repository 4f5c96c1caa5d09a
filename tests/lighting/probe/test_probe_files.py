"""Folders of probes."""

from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest

from lighting.errors import EnvironmentMapError, ProbeError
from lighting.files.exr import write_exr
from lighting.probe.probe_files import TIME_ATTRIBUTE, probe_path, probes_in

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
