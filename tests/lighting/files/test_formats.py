"""Maps by suffix: Radiance HDR for other readers, PNG for the eye."""

import io
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.color import tone_map
from lighting.envmap.render import render
from lighting.errors import EnvironmentMapError
from lighting.files import _format_of, encode_envmap, write_envmap
from lighting.files.exr import read_exr
from lighting.records import Lighting

Map = NDArray[np.float32]

LIGHT = Lighting(sun_azimuth=30.0, sun_elevation=33.0, turbidity=3.0, exposure=0.5)


@pytest.fixture(scope="module")
def image() -> Map:
    return render(LIGHT, 64)


def decode_hdr(data: bytes) -> Map:
    """A reader of its own for what we write: run-length coded scanlines, top to bottom, left to right."""
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


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".png", ".EXR"])
def test_a_path_holds_what_encoding_gives(tmp_path: Path, image: Map, suffix: str) -> None:
    target = tmp_path / f"map{suffix}"
    write_envmap(target, image, LIGHT)
    assert target.read_bytes() == encode_envmap(image, LIGHT, suffix[1:].lower())
    assert list(tmp_path.iterdir()) == [target]


def test_exr_holds_the_lighting(image: Map) -> None:
    read, lighting = read_exr(io.BytesIO(encode_envmap(image, LIGHT, compression="none")))
    np.testing.assert_array_equal(read, image)
    assert lighting == LIGHT


def test_hdr_comes_back_the_right_way_round(image: Map) -> None:
    assert rgbe_error(decode_hdr(encode_envmap(image, LIGHT, "hdr")), image) <= 1 / 255


def test_hdr_holds_the_extremes() -> None:
    image = np.zeros((4, 256, 3), dtype=np.float32)[:, :8]
    image[0, 0] = [1e9, 1.0, 0.0]
    image[1, 1] = [1e-12, 3e-12, 0.0]
    image[2, 2] = [0.999999, 0.5, 0.25]
    image[3, 3] = [-1.0, 1e-45, 1e-45]
    read = decode_hdr(encode_envmap(image, None, "hdr"))
    assert rgbe_error(read[[0, 1, 2], [0, 1, 2]], image[[0, 1, 2], [0, 1, 2]]) <= 1 / 255
    assert not read[3].any()


def test_hdr_codes_noise_and_flat_rows() -> None:
    noise = np.random.default_rng(0).random((140, 280, 3), dtype=np.float32)
    noise[70:] = 0.25
    data = encode_envmap(noise, None, "hdr")
    assert rgbe_error(decode_hdr(data), noise) <= 1 / 255
    assert len(data) < 1.02 * 70 * 280 * 4 + 70 * 30


def test_mitsuba_reads_the_hdr(tmp_path: Path, image: Map) -> None:
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    write_envmap(tmp_path / "map.hdr", image, LIGHT)
    assert rgbe_error(np.array(mitsuba.Bitmap(str(tmp_path / "map.hdr"))), image) <= 1 / 255


def test_png_is_the_tone_mapped_map(image: Map) -> None:
    with Image.open(io.BytesIO(encode_envmap(image, LIGHT, "png"))) as picture:
        assert picture.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(picture), tone_map(image))


@pytest.mark.parametrize("name", ["map", "map.jpg", ".exr", "map.exr.txt"])
def test_other_suffixes_are_one_sentence(tmp_path: Path, image: Map, name: str) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^The name '.*' must end in \.exr, \.hdr or \.png\.$"):
        write_envmap(tmp_path / name, image, LIGHT)
    assert list(tmp_path.iterdir()) == []


def test_format_of_a_path() -> None:
    assert [_format_of("a/b.EXR"), _format_of(Path("x.y.hdr")), _format_of("p.png")] == ["exr", "hdr", "png"]


def test_an_unknown_format_is_one_sentence(image: Map) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^The format 'tiff' is not known; .* exr, hdr or png\.$"):
        encode_envmap(image, LIGHT, "tiff")


@pytest.mark.parametrize("suffix", ["exr", "hdr", "png"])
def test_failures_are_one_sentence_and_leave_nothing(tmp_path: Path, image: Map, suffix: str) -> None:
    with pytest.raises(EnvironmentMapError, match="cannot be written: No such file or directory"):
        write_envmap(tmp_path / "none" / f"map.{suffix}", image)
    with pytest.raises(EnvironmentMapError, match="has the shape"):
        write_envmap(tmp_path / f"map.{suffix}", image[:, :5])
    assert list(tmp_path.iterdir()) == []
