"""Cubemaps beside a glTF."""

import json
import re
import struct
from pathlib import Path

import numpy as np
import pytest

from lighting.envmap.latlong import FACES, cubemap_directions
from lighting.files.radiance_hdr import decode_hdr
from lighting.geometry import sample_latlong
from lighting.light_probe import shader_harmonics
from lighting.scene import CUBE_FACES
from lighting.scene.cubemap import write_cubemap, write_filament
from tests.helpers.scenes import sunlit_scene


def test_the_faces_are_the_map(tmp_path: Path) -> None:
    scene = sunlit_scene()
    write_cubemap(scene, tmp_path)
    assert CUBE_FACES == FACES
    faces = np.array([decode_hdr((tmp_path / f"{name}.hdr").read_bytes()) for name in FACES])
    shown = sample_latlong(scene.environment, cubemap_directions(faces.shape[1]))
    assert faces == pytest.approx(shown, rel=0.02, abs=0.02)
    assert (tmp_path / "environment.ktx2").read_bytes().startswith(b"\xabKTX 20")


def test_filament_gets_harmonics_in_three_files(tmp_path: Path) -> None:
    scene = sunlit_scene()
    write_filament(scene, tmp_path)
    expected = shader_harmonics(scene.light_probe.coefficients)
    lines = (tmp_path / "sh.txt").read_text().splitlines()
    assert [re.findall(r"-?\d+\.\d+", line.split("//")[0]) for line in lines] == [
        [f"{value:.15f}" for value in row] for row in expected
    ]
    assert lines[1].endswith("// L1-1, irradiance, pre-scaled base")
    light = json.loads((tmp_path / "light.json").read_text())
    assert light["indirectLight"]["irradiance"] == pytest.approx(expected.ravel(), rel=1e-5)
    data = (tmp_path / "environment_ibl.ktx").read_bytes()
    (length,) = struct.unpack_from("<I", data, 64)
    key, text, _ = data[68 : 68 + length].split(b"\0")
    assert key == b"sh"
    assert np.array(text.split(), dtype=float) == pytest.approx(expected.ravel(), rel=1e-5)
    size, *_, levels, _ = struct.unpack_from("<13I", data, 12)[6:]
    assert size >> levels - 1 == 16
