"""Cubemaps beside a glTF."""

import json
import re
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.envmap.latlong import FACES
from lighting.files.radiance_hdr import decode_hdr
from lighting.geometry import sample_latlong
from lighting.light_probe import shader_harmonics
from lighting.scene import CUBE_FACES
from lighting.scene.cubemap import _encode_ktx1, _encode_ktx2, encode_cubemap, encode_filament
from tests.helpers.requirements import require
from tests.helpers.scenes import cube_directions, save_files, sunlit_scene


def test_the_faces_are_the_map(tmp_path: Path) -> None:
    scene = sunlit_scene()
    save_files(tmp_path, encode_cubemap(scene))
    assert CUBE_FACES == FACES
    faces = np.array([decode_hdr((tmp_path / f"{name}.hdr").read_bytes()) for name in FACES])
    shown = sample_latlong(scene.environment, cube_directions(faces.shape[1]))
    assert (np.abs(faces - shown) <= np.maximum(0.02 * np.abs(shown), 0.02)).all()
    assert (tmp_path / "environment.ktx2").read_bytes().startswith(b"\xabKTX 20")


def test_filament_gets_harmonics_in_three_files(tmp_path: Path) -> None:
    scene = sunlit_scene()
    save_files(tmp_path, encode_filament(scene))
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


RNG = np.random.default_rng(1)
LEVELS = [np.asarray(10.0 ** RNG.uniform(-3, 4, (6, size, size, 3)), dtype=np.float32) for size in (4, 2)]


def unpacked(words: NDArray[np.uint32]) -> NDArray[np.float32]:
    """What 11, 11 and 10 bits of float hold: a half float without sign and with less mantissa."""
    bits = [(words & 0x7FF) << 4, (words >> 11 & 0x7FF) << 4, (words >> 22) << 5]
    return np.stack([channel.astype(np.uint16).view(np.float16) for channel in bits], axis=-1).astype(np.float32)


def test_ktx_1_holds_packed_floats_and_texts() -> None:
    data = _encode_ktx1(LEVELS, {"sh": "1 2 3\n"})
    assert data[:12] == b"\xabKTX 11\xbb\r\n\x1a\n"
    header = struct.unpack_from("<13I", data, 12)
    assert header[:6] == (0x04030201, 0x8C3A, 1, 0x1907, 0x8C3A, 0x8C3A)  # as cmgen's files
    assert header[6:12] == (4, 4, 0, 0, 6, 2)
    (length,) = struct.unpack_from("<I", data, 64)
    assert data[68 : 68 + length] == b"sh\x001 2 3\n\x00"
    position = 64 + header[12]
    for faces in LEVELS:
        (size,) = struct.unpack_from("<I", data, position)
        assert size == 4 * faces[0, ..., 0].size
        words = np.frombuffer(data, "<u4", 6 * size // 4, position + 4)
        assert unpacked(words).reshape(faces.shape) == pytest.approx(faces, rel=0.017, abs=1e-6)
        position += 4 + 6 * size
    assert position == len(data)


def test_packed_floats_end_at_their_largest_value() -> None:
    data = _encode_ktx1([np.full((6, 1, 1, 3), 1e6, np.float32)], {})
    assert unpacked(np.frombuffer(data, "<u4", 6, len(data) - 24)) == pytest.approx(64512, rel=0.02)


def read_by_node(script: str, file: Path) -> dict[str, Any]:
    """What a script of tests/node prints about a file."""
    command = [require("node"), str(Path(require("tests/node")).with_name(script)), str(file)]
    done = subprocess.run(command, capture_output=True, check=True)
    return dict(json.loads(done.stdout))


def test_filaments_own_loader_reads_ktx_1(tmp_path: Path) -> None:
    file = tmp_path / "a.ktx"
    file.write_bytes(_encode_ktx1(LEVELS, {"sh": "1 2 3\n"}))
    read = read_by_node("filament.cjs", file)
    assert (read["format"], read["width"], read["cubemap"], read["sh"]) == (0x8C3A, 4, True, "1 2 3\n")
    for faces, words in zip(LEVELS, read["levels"], strict=True):
        assert unpacked(np.array(words, np.uint32)).reshape(faces.shape) == pytest.approx(faces, rel=0.017, abs=1e-6)


def test_ktx_2_is_read_by_another_program(tmp_path: Path) -> None:
    file = tmp_path / "a.ktx2"
    file.write_bytes(_encode_ktx2(LEVELS))
    read = read_by_node("ktx.mjs", file)
    assert (read["format"], read["width"], read["height"], read["faces"]) == (97, 4, 4, 6)
    assert read["descriptor"]["colorModel"] == read["descriptor"]["transferFunction"] == 1
    for faces, numbers in zip(LEVELS, read["levels"], strict=True):
        pixels = np.array(numbers, np.uint16).view(np.float16).reshape(*faces.shape[:3], 4)
        assert pixels[..., :3] == pytest.approx(faces, rel=1e-3, abs=1e-6)
        assert (pixels[..., 3] == 1).all()
