"""Probes on disk."""

from pathlib import Path

import numpy as np
import pytest

from lighting.errors import ProbeError
from lighting.files.exr import read_attributes, read_exr
from lighting.probe.develop import Probe
from lighting.probe.folders import probes_in
from lighting.probe.write import target_of, write_probe
from tests.lighting.probe.test_develop import MOMENT, clipped  # noqa: F401


def test_the_header_says_when_and_what_the_sun_rests_on(tmp_path: Path, clipped: Probe) -> None:  # noqa: F811
    path = write_probe(clipped, tmp_path / "a.exr")
    header = read_attributes(path)
    assert header["lighting.time"] == "2024-06-01T09:00:00+00:00"
    assert header["capDate"] == "2024:06:01 09:00:00"
    assert (header["lighting.sun_azimuth"], header["lighting.sun_elevation"]) == pytest.approx(MOMENT.sun, abs=1e-3)
    assert (header["lighting.sun_clipped"], header["lighting.sun_estimated"]) == (1, 0)
    assert "clipped" in header["comments"]
    assert not any("latitude" in name for name in header)
    np.testing.assert_allclose(read_exr(path)[0], clipped.image, rtol=2.0**-14)  # as `zip` rounds


def test_a_folder_is_filled_in_the_layout(tmp_path: Path, clipped: Probe) -> None:  # noqa: F811
    path = write_probe(clipped, tmp_path / "sky")
    assert path == tmp_path / "sky/20240601/090000/envmap.exr"
    assert probes_in(tmp_path / "sky")[0].time == MOMENT.time


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path, clipped: Probe) -> None:  # noqa: F811
    (tmp_path / "file").write_text("")
    with pytest.raises(ProbeError, match="cannot be made"):
        write_probe(clipped, tmp_path / "file")


def test_a_folder_stays_one_whatever_its_name(tmp_path: Path) -> None:
    (tmp_path / "sky.exr").mkdir()
    assert target_of(tmp_path / "sky.exr", MOMENT.time) == tmp_path / "sky.exr/20240601/090000/envmap.exr"
    assert target_of(tmp_path / "probe.exr", MOMENT.time) == tmp_path / "probe.exr"
