"""Radiance files against those that this project writes, plain ones, and other readers."""

import io
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.envmap.render import render
from lighting.errors import EnvironmentMapError
from lighting.files import FileOptions, encode_envmap, write_envmap
from lighting.files.radiance_hdr import decode_hdr
from tests.helpers.predictions import model_light

Map = NDArray[np.float32]

LIGHT = model_light()
MAP = np.geomspace(1e-6, 1e5, 3 * 16 * 32, dtype=np.float32).reshape(16, 32, 3)


@pytest.fixture(scope="module")
def image() -> Map:
    return render(LIGHT, 64)


def decode_independently(data: bytes) -> Map:
    """Another reader of what we write: run-length coded scanlines, top to bottom, left to right."""
    head, _, body = data.partition(b"\n\n")
    size, _, body = body.partition(b"\n")
    assert head.startswith(b"#?RADIANCE\n")
    assert b"FORMAT=32-bit_rle_rgbe" in head.split(b"\n")
    down, height, right, width = size.split()
    assert (down, right) == (b"-Y", b"+X")
    stream = io.BytesIO(body)
    rows = [_decode_row(stream, int(width)) for _ in range(int(height))]
    assert stream.read() == b""
    rgbe = np.array(rows).transpose(0, 2, 1)
    return np.ldexp(rgbe[..., :3].astype(np.float32), rgbe[..., 3:].astype(np.int32) - 136)


def _decode_row(stream: io.BytesIO, width: int) -> list[NDArray[np.uint8]]:
    assert stream.read(4) == bytes((2, 2, width >> 8, width & 255))
    channels = []
    for _ in range(4):
        line = b""
        while len(line) < width:
            count = stream.read(1)[0]
            line += stream.read(1) * (count - 128) if count > 128 else stream.read(count)
        assert len(line) == width
        channels.append(np.frombuffer(line, np.uint8))
    return channels


def rgbe_error(read: Map, image: Map) -> float:
    """The largest error relative to each pixel's brightest channel, whose mantissa has 8 bits."""
    return float((np.abs(read - image).max(axis=-1) / image.max(axis=-1)).max())


def test_hdr_comes_back_the_right_way_round(image: Map) -> None:
    assert rgbe_error(decode_independently(encode_envmap(image, LIGHT, FileOptions("hdr"))), image) <= 1 / 255


def test_hdr_holds_the_extremes() -> None:
    image = np.zeros((4, 256, 3), dtype=np.float32)[:, :8]
    image[0, 0] = [1e9, 1.0, 0.0]
    image[1, 1] = [1e-12, 3e-12, 0.0]
    image[2, 2] = [0.999999, 0.5, 0.25]
    image[3, 3] = [-1.0, 1e-45, 1e-45]
    read = decode_independently(encode_envmap(image, None, FileOptions("hdr")))
    assert rgbe_error(read[[0, 1, 2], [0, 1, 2]], image[[0, 1, 2], [0, 1, 2]]) <= 1 / 255
    assert not read[3].any()


def test_hdr_codes_noise_and_flat_rows() -> None:
    noise = np.random.default_rng(0).random((140, 280, 3), dtype=np.float32)
    noise[70:] = 0.25
    data = encode_envmap(noise, None, FileOptions("hdr"))
    assert rgbe_error(decode_independently(data), noise) <= 1 / 255
    assert len(data) < 1.02 * 70 * 280 * 4 + 70 * 30


def test_mitsuba_reads_the_hdr(tmp_path: Path, image: Map) -> None:
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    write_envmap(tmp_path / "map.hdr", image, LIGHT)
    assert rgbe_error(np.array(mitsuba.Bitmap(str(tmp_path / "map.hdr"))), image) <= 1 / 255


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


def test_what_a_header_announces_is_limited() -> None:
    rows = b"\x02\x02\x3e\x80" + b"\xff\x01" * 504  # each kilobyte holds 16,000 pixels
    with pytest.raises(EnvironmentMapError, match="of 16000 x 9000 pixels has more than the limit of 140 million"):
        decode_hdr(b"#?RADIANCE\n\n-Y 9000 +X 16000\n" + rows)
    for size in ("-Y 1 +X 99999999999", f"-Y {'9' * 5000} +X 1"):
        with pytest.raises(EnvironmentMapError):
            decode_hdr(f"#?RADIANCE\n\n{size}\n".encode())
