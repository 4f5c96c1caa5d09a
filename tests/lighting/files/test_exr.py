"""EXR files: what is in them, who can read them, and what happens when they are bad."""

import io
import json
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from lighting import __version__
from lighting.envmap import render
from lighting.errors import EnvironmentMapError, ParameterError
from lighting.files import full_record
from lighting.files.compression import rounded
from lighting.files.exr import read_exr, read_map, write_exr
from lighting.ranges import RANGES
from lighting.records import Lighting

LIGHT = Lighting(
    sun_azimuth=-41.2,
    sun_elevation=33.0,
    turbidity=3.4,
    exposure=0.021,
    radius_50=9.5,
    radius_90=31.0,
    camera_roll=-0.6,
)


@pytest.fixture(scope="module")
def image() -> NDArray[np.float32]:
    """Rounded as `zip` does, which then changes nothing."""
    return rounded(render(LIGHT, 32))


@pytest.fixture(scope="module")
def data(image: NDArray[np.float32]) -> bytes:
    stream = io.BytesIO()
    write_exr(stream, image, LIGHT)
    return stream.getvalue()


def encoded(channels: dict[str, NDArray[Any]], **header: Any) -> bytes:
    stream = io.BytesIO()
    required = {"compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File({**required, **header}, channels).write(stream)
    return stream.getvalue()


@contextmanager
def file_size_limit(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond so many bytes, as on a full disk."""
    resource = pytest.importorskip("resource")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)


# Writing and reading back


def test_round_trip_is_exact(tmp_path: Path, image: NDArray[np.float32]) -> None:
    write_exr(tmp_path / "map.exr", image, LIGHT, compression="none")
    read, lighting = read_exr(tmp_path / "map.exr")
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read, image)
    assert lighting == LIGHT


def test_round_trip_through_a_stream(image: NDArray[np.float32], data: bytes) -> None:
    read, lighting = read_exr(io.BytesIO(data))
    np.testing.assert_array_equal(read, image)
    assert lighting == LIGHT


def test_a_stream_that_cannot_seek_will_do(image: NDArray[np.float32]) -> None:
    reader, writer = os.pipe()
    with os.fdopen(reader, "rb") as source, os.fdopen(writer, "wb") as target:
        small = image[:, ::8][::8]
        write_exr(target, small, compression="none")
        target.close()
        np.testing.assert_array_equal(read_exr(source)[0], small)


def test_without_lighting_there_is_none(image: NDArray[np.float32]) -> None:
    stream = io.BytesIO()
    write_exr(stream, image)
    assert read_exr(io.BytesIO(stream.getvalue()))[1] is None


def test_any_float_layout_is_accepted(image: NDArray[np.float32]) -> None:
    stream = io.BytesIO()
    write_exr(stream, image.astype(np.float64)[:, ::-1], compression="none")
    np.testing.assert_array_equal(read_exr(io.BytesIO(stream.getvalue()))[0], image[:, ::-1])


def test_header(data: bytes) -> None:
    header = OpenEXR.File(io.BytesIO(data)).header()
    assert header["envmap"] == OpenEXR.ENVMAP_LATLONG
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["software"] == f"outdoor-lighting {__version__}"
    assert header["chromaticities"] == pytest.approx((0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329))
    for name in RANGES:
        assert header[f"lighting.{name}"] == pytest.approx(getattr(LIGHT, name), rel=1e-6)
    assert header["lighting.sun_direction"] == pytest.approx(LIGHT.sun_direction, abs=1e-6)
    assert json.loads(header["lighting.json"]) == full_record(LIGHT)


def test_header_of_what_more_is_known(image: NDArray[np.float32]) -> None:
    known = replace(LIGHT, evidence=("pixels", "time+place"), warnings=("Hm.",), camera_heading=123.0, latitude=48.0)
    stream = io.BytesIO()
    write_exr(stream, image, known)
    header = OpenEXR.File(io.BytesIO(stream.getvalue())).header()
    assert header["lighting.evidence"] == "pixels, time+place"
    assert header["lighting.camera_heading"] == 123.0
    assert header["lighting.latitude"] == 48.0
    assert "lighting.longitude" not in header
    assert read_exr(io.BytesIO(stream.getvalue()))[1] == known


def test_channels_are_32_bit_r_g_b(data: bytes) -> None:
    channels = OpenEXR.File(io.BytesIO(data), separate_channels=True).channels()
    assert sorted(channels) == ["B", "G", "R"]
    assert all(channel.pixels.dtype == np.float32 for channel in channels.values())


def test_mitsuba_reads_it(tmp_path: Path, image: NDArray[np.float32]) -> None:
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    write_exr(tmp_path / "map.exr", image, LIGHT, compression="none")
    np.testing.assert_array_equal(np.array(mitsuba.Bitmap(str(tmp_path / "map.exr"))), image)


# Reading what others wrote


def test_half_floats_are_read(image: NDArray[np.float32]) -> None:
    half = np.minimum(image, 100).astype(np.float16)
    read, lighting = read_exr(io.BytesIO(encoded({"RGB": half})))
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read, half.astype(np.float32))
    assert lighting is None


def test_alpha_and_mixed_types_are_read(image: NDArray[np.float32]) -> None:
    planes = {name: np.ascontiguousarray(image[..., i]) for i, name in enumerate("RGB")}
    data = encoded({**planes, "R": planes["R"].astype(np.float16), "A": np.ones_like(planes["R"])})
    np.testing.assert_array_equal(read_exr(io.BytesIO(data))[0][..., 1:], image[..., 1:])


def test_missing_channels_are_named(image: NDArray[np.float32]) -> None:
    data = encoded({"G": np.ascontiguousarray(image[..., 0]), "Z": np.ascontiguousarray(image[..., 1])})
    with pytest.raises(EnvironmentMapError, match=r"^The EXR file has no channel R, B; it needs R, G and B\.$"):
        read_exr(io.BytesIO(data))


@pytest.mark.parametrize(
    "text", ["{", "[]", "{}", '{"sun": {"azimuth": 0, "elevation": 200}, "sky": {}}', "3", 100_000 * "["]
)
def test_a_damaged_record_is_one_sentence(image: NDArray[np.float32], text: str) -> None:
    data = encoded({"RGB": image}, **{"lighting.json": text})
    with pytest.raises(EnvironmentMapError, match=r"^The EXR file's lighting\.json cannot be read: "):
        read_exr(io.BytesIO(data))


# Bad files


@pytest.mark.parametrize("content", [b"", b"v/1", b"\x89PNG\r\n\x1a\n", b"#?RADIANCE\n\n-Y 2 +X 4\n"])
def test_other_files_are_refused(content: bytes) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^The file is not an OpenEXR image\.$"):
        read_exr(io.BytesIO(content))


@pytest.mark.parametrize("source", [None, 3, b"v/1\x01", io.StringIO("v/1")], ids=["none", "number", "bytes", "text"])
def test_what_is_neither_a_path_nor_a_binary_stream_is_refused(source: Any) -> None:
    with pytest.raises(EnvironmentMapError, match=r"An EXR is read from a path or a binary stream, not|open as text"):
        read_exr(source)


@pytest.mark.parametrize("target", [None, 3, b"map.exr"], ids=["none", "number", "bytes"])
def test_nothing_is_written_to_what_is_neither(image: NDArray[np.float32], target: Any) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^An EXR is written to a path or a binary stream, not [a-zA-Z]+\.$"):
        write_exr(target, image)


@pytest.mark.parametrize("share", [0.001, 0.01, 0.05, 0.2, 0.5, 0.9, 0.999])
def test_cut_files_are_refused_quietly(data: bytes, share: float, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^The EXR file is cut short or damaged\.$"):
        read_exr(io.BytesIO(data[: max(5, int(share * len(data)))]))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("packing", [OpenEXR.NO_COMPRESSION, OpenEXR.ZIP_COMPRESSION, OpenEXR.PIZ_COMPRESSION])
def test_rows_may_be_stored_from_the_bottom_up(image: NDArray[np.float32], packing: Any) -> None:
    data = encoded({"RGB": image}, compression=packing, lineOrder=OpenEXR.DECREASING_Y)
    np.testing.assert_array_equal(read_exr(io.BytesIO(data))[0], image)
    with pytest.raises(EnvironmentMapError, match=r"^The EXR file is cut short or damaged\.$"):
        read_exr(io.BytesIO(data[:-1]))


@pytest.mark.parametrize("order", [OpenEXR.INCREASING_Y, OpenEXR.DECREASING_Y])
@pytest.mark.parametrize("missing", [0, 7, 31])
def test_a_chunk_that_was_never_written_is_noticed(
    image: NDArray[np.float32], order: Any, missing: int, capfd: pytest.CaptureFixture[str]
) -> None:
    """Its place in the table is 0, as programs leave it that were stopped while they wrote."""
    data = bytearray(encoded({"RGB": image}, compression=OpenEXR.NO_COMPRESSION, lineOrder=order))
    row = 8 + 12 * image.shape[1]
    table = len(data) - (row + 8) * len(image)
    data[table + 8 * missing : table + 8 * missing + 8] = bytes(8)
    with pytest.raises(EnvironmentMapError, match=r"^The EXR file is cut short or damaged\.$"):
        read_exr(io.BytesIO(data))
    assert capfd.readouterr() == ("", "")


def test_a_damaged_header_is_refused_in_plain_words(data: bytes) -> None:
    spoilt = bytearray(data)
    spoilt[data.index(b"channels") + 12] = 0xFF
    with pytest.raises(
        EnvironmentMapError, match=r"^The EXR file cannot be read: it is damaged or of an unknown kind\.$"
    ):
        read_exr(io.BytesIO(spoilt))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_map_of_numbers_that_are_not_finite_is_named(
    tmp_path: Path, image: NDArray[np.float32], value: float
) -> None:
    spoilt = image.copy()
    spoilt[3, 4, 1] = value
    write_exr(tmp_path / "a.exr", spoilt)
    with pytest.raises(EnvironmentMapError, match=r"a\.exr: The map holds values that are not finite numbers\.$"):
        read_map(tmp_path / "a.exr")
    write_exr(tmp_path / "a.exr", image, compression="none")
    np.testing.assert_array_equal(read_map(tmp_path / "a.exr"), image)


def test_what_is_no_map_is_named_once(tmp_path: Path, image: NDArray[np.float32]) -> None:
    (tmp_path / "a.exr").write_bytes(encoded({"RGB": np.ascontiguousarray(image[:, :5])}))
    with pytest.raises(EnvironmentMapError, match=r"a\.exr: An environment map has the shape"):
        read_map(tmp_path / "a.exr")
    with pytest.raises(EnvironmentMapError, match=r"^[^:]*none\.exr cannot be read: No such file or directory\.$"):
        read_map(tmp_path / "none.exr")


def test_any_cut_is_refused(data: bytes) -> None:
    for length in (*range(5, 200, 7), *range(200, len(data), 997), len(data) - 1):
        with pytest.raises(EnvironmentMapError):
            read_exr(io.BytesIO(data[:length]))


def test_damaged_headers_raise_nothing_else(data: bytes) -> None:
    rng = np.random.default_rng(5)
    refused = 0
    for _ in range(200):
        damaged = bytearray(data)
        for position in rng.integers(4, 600, 3):
            damaged[position] = rng.integers(256)
        try:
            read_exr(io.BytesIO(bytes(damaged)))
        except EnvironmentMapError as error:
            refused += "\n" not in str(error)
    assert refused > 20


def test_missing_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(EnvironmentMapError, match=r"none\.exr cannot be read: No such file or directory\.$"):
        read_exr(tmp_path / "none.exr")


# Failing writes


def test_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).random((64, 128, 3), dtype=np.float32)
    target = tmp_path / "map.exr"
    with (
        pytest.raises(EnvironmentMapError, match=r"map\.exr cannot be written: [A-Z][^.]*\.$"),
        file_size_limit(20_000),
    ):
        write_exr(target, noise, LIGHT)
    assert list(tmp_path.iterdir()) == []


def test_a_failing_write_keeps_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "map.exr"
    target.write_bytes(b"old")
    noise = np.random.default_rng(0).random((64, 128, 3), dtype=np.float32)
    with pytest.raises(EnvironmentMapError), file_size_limit(20_000):
        write_exr(target, noise)
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_missing_folder_is_one_sentence(tmp_path: Path, image: NDArray[np.float32]) -> None:
    with pytest.raises(EnvironmentMapError, match=r"map\.exr cannot be written: No such file or directory\.$"):
        write_exr(tmp_path / "none" / "map.exr", image)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_an_unwritable_folder_is_one_sentence(tmp_path: Path, image: NDArray[np.float32]) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(EnvironmentMapError, match=r"map\.exr cannot be written: Permission denied\.$"):
        write_exr(tmp_path / "map.exr", image)
    tmp_path.chmod(0o700)


@pytest.mark.parametrize("shape", [(4, 8), (4, 8, 4), (8, 8, 3), (0, 0, 3)])
def test_other_shapes_are_refused(tmp_path: Path, shape: tuple[int, ...]) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^An environment map has the shape \(H, 2H, 3\), not "):
        write_exr(tmp_path / "map.exr", np.zeros(shape, dtype=np.float32))
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_map_or_no_lighting_is_refused(tmp_path: Path, image: NDArray[np.float32]) -> None:
    for thing in ("sky.exr", [[0.0]], None):
        with pytest.raises(EnvironmentMapError, match="has the shape"):
            write_exr(tmp_path / "a.exr", cast(Any, thing))
    with pytest.raises(ParameterError, match="A Lighting is needed, not dict"):
        write_exr(tmp_path / "a.exr", image, cast(Any, {"sun": {}}))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("attributes", [{"place": {"a": 1}}, {"": 1.0}, {"compression": "foo"}, {3: 4.0}])
def test_attributes_that_no_exr_can_have_are_refused(
    tmp_path: Path, image: NDArray[np.float32], attributes: dict[Any, Any]
) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^The attributes cannot be those of an EXR: "):
        write_exr(tmp_path / "a.exr", image, attributes=attributes)
    assert not list(tmp_path.iterdir())


def test_header_of_the_strength_of_the_light(image: NDArray[np.float32]) -> None:
    known = replace(LIGHT, sun_irradiance=(3.0, 2.0, 1.0), sky_irradiance=(0.4, 0.5, 0.8), sky_cover=0.2, suitable=0.9)
    stream = io.BytesIO()
    write_exr(stream, image, known)
    header = OpenEXR.File(io.BytesIO(stream.getvalue())).header()
    assert header["lighting.sun_irradiance"] == pytest.approx((3.0, 2.0, 1.0))
    assert header["lighting.sky_cover"] == pytest.approx(0.2)
    assert header["lighting.sky_model"] == "hosek-wilkie"
    assert "lighting.ground_color" not in header
    assert read_exr(io.BytesIO(stream.getvalue()))[1] == known
