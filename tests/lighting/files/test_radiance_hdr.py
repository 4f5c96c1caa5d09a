"""Radiance files against those that this project writes, and a plain one."""

from pathlib import Path

import numpy as np
import pytest

from lighting.errors import EnvironmentMapError
from lighting.files import write_envmap
from lighting.files.radiance_hdr import decode_hdr

MAP = np.geomspace(1e-6, 1e5, 3 * 16 * 32, dtype=np.float32).reshape(16, 32, 3)


def test_what_is_written_is_read_to_its_eight_bits(tmp_path: Path) -> None:
    write_envmap(tmp_path / "a.hdr", MAP)
    read = decode_hdr((tmp_path / "a.hdr").read_bytes())
    assert np.all(np.abs(read - MAP) <= MAP.max(axis=-1, keepdims=True) / 250)


def test_a_plain_file_is_read_as_well(tmp_path: Path) -> None:
    pixels = bytes([128, 64, 32, 129] * 4)
    (tmp_path / "a.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 4\n" + pixels)
    assert decode_hdr((tmp_path / "a.hdr").read_bytes()) == pytest.approx(np.tile([1.0, 0.5, 0.25], (1, 4, 1)))


def test_exposures_of_the_header_are_taken_off(tmp_path: Path) -> None:
    header = b"#?RADIANCE\nEXPOSURE=4\nFORMAT=32-bit_rle_rgbe\nEXPOSURE= 5.0e-01\n\n-Y 1 +X 4\n"
    (tmp_path / "a.hdr").write_bytes(header + bytes([128, 64, 32, 129] * 4))
    assert decode_hdr((tmp_path / "a.hdr").read_bytes()) == pytest.approx(np.tile([0.5, 0.25, 0.125], (1, 4, 1)))


@pytest.mark.parametrize(
    ("line", "said"),
    [("FORMAT=32-bit_rle_xyze", "holds X, Y and Z"), ("EXPOSURE=0", "damaged"), ("EXPOSURE=-", "damaged")],
)
def test_other_colours_and_no_exposure_are_refused(tmp_path: Path, line: str, said: str) -> None:
    (tmp_path / "a.hdr").write_bytes(f"#?RADIANCE\n{line}\n\n-Y 1 +X 1\n".encode() + bytes([128, 64, 32, 129]))
    with pytest.raises(EnvironmentMapError, match=said):
        decode_hdr((tmp_path / "a.hdr").read_bytes())


@pytest.mark.parametrize("size", ["-Y 0 +X 0", "-Y 4 +X 0", "-Y 0 +X 4"])
def test_a_file_without_pixels_is_refused(tmp_path: Path, size: str) -> None:
    (tmp_path / "a.hdr").write_bytes(f"#?RADIANCE\n\n{size}\n".encode())
    with pytest.raises(EnvironmentMapError, match=r"^The HDR picture is cut short or damaged\.$"):
        decode_hdr((tmp_path / "a.hdr").read_bytes())


@pytest.mark.parametrize("keep", [20, 90, 400])
def test_a_file_that_is_cut_short_is_refused(tmp_path: Path, keep: int) -> None:
    write_envmap(tmp_path / "a.hdr", MAP)
    (tmp_path / "b.hdr").write_bytes((tmp_path / "a.hdr").read_bytes()[:keep])
    with pytest.raises(EnvironmentMapError):
        decode_hdr((tmp_path / "b.hdr").read_bytes())
