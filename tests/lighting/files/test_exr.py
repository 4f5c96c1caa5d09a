"""Tests of exr."""

import ctypes
import io
import json
import os
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from lighting.color import COLOR_SPACES
from lighting.envmap.render import render
from lighting.errors import EnvironmentMapError, ParameterError
from lighting.fields import RANGES
from lighting.files import FileOptions, encode_envmap, read_envmap
from lighting.files.deflate import _round_to_half
from lighting.files.exr import (
    COMPRESSIONS,
    check_read_size,
    read_exr,
    read_exr_attributes,
    set_compression_threads,
    write_exr,
)
from lighting.geometry import latlong_solid_angle
from lighting.map_options import MAX_HEIGHT
from lighting.record_json import record_with_coefficients
from lighting.records import Lighting
from lighting.version import __version__

LIGHT = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=50.0)
EXACT = ("none",)


@pytest.fixture(scope="module")
def image() -> NDArray[np.float32]:
    return render(LIGHT, 128)


def packed(image: NDArray[np.float32], compression: str) -> bytes:
    stream = io.BytesIO()
    write_exr(stream, image, compression=compression)
    return stream.getvalue()


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_the_sun_keeps_its_energy(image: NDArray[np.float32], compression: str) -> None:
    image = image * np.float32(4)  # as bright as a measured one
    back = read_exr(io.BytesIO(packed(image, compression)))[0]
    disc = image.max(axis=-1) > 0.01 * image.max()
    rows = np.broadcast_to(latlong_solid_angle(len(image))[:, None], disc.shape)[disc]
    before, after = ((rows[:, None] * values[disc]).sum(axis=0, dtype=np.float64) for values in (image, back))
    assert image.max() > 65504  # more than half floats hold
    np.testing.assert_allclose(after, before, rtol=1e-3 if compression not in EXACT else 0)


@pytest.mark.parametrize("compression", EXACT)
def test_exact_means_exact(image: NDArray[np.float32], compression: str) -> None:
    np.testing.assert_array_equal(read_exr(io.BytesIO(packed(image, compression)))[0], image)


def textured(rows: int = 256, contrast: float = 0.2) -> NDArray[np.float32]:
    """A map with noise all over, as of leaves, and a sun."""
    noise = np.random.default_rng(1).normal(0, contrast, (rows, 2 * rows, 3))
    pixels = (np.array([0.3, 0.2, 0.1]) * np.exp(noise)).astype(np.float32)
    pixels[10, 20] = 65280.0
    return pixels


@pytest.mark.parametrize("contrast", [0.0, 0.2, 1.0])
def test_zip_holds_the_nearest_half_floats(contrast: float) -> None:
    pixels = textured(contrast=contrast)
    header, back = decoded(packed(pixels, "zip"))
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert back.dtype == np.float16
    np.testing.assert_array_equal(back, pixels.astype(np.float16))
    np.testing.assert_allclose(back, pixels, rtol=2.0**-11)


@pytest.mark.parametrize("rows", [2, 15, 16, 17, 33])
def test_the_last_chunk_may_be_lower(rows: int) -> None:
    values = np.random.default_rng(2).random((rows, 2 * rows, 3)).astype(np.float32) + 1
    np.testing.assert_array_equal(decoded(packed(values, "zip"))[1], values.astype(np.float16))


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("peak", [1.0, 1e6])
def test_a_file_of_strips_is_that_of_the_whole_map(compression: str, peak: float) -> None:
    whole = textured()
    whole[200] = peak
    stream = io.BytesIO()
    write_exr(stream, lambda: iter(np.split(whole, 4)), compression=compression)
    assert stream.getvalue() == packed(whole, compression)


def test_what_zip_makes_no_smaller_is_written_as_it_is() -> None:
    bits = np.random.default_rng(7).integers(0, 2**32, (32, 64, 3), dtype=np.uint32)
    back = decoded(packed(bits.view(np.float32), "zip"))[1]
    np.testing.assert_array_equal(back.view(np.uint32), bits)


def decoded(data: bytes) -> tuple[dict[str, Any], NDArray[Any]]:
    """As OpenEXR reads it."""
    file = OpenEXR.File(io.BytesIO(data))
    return file.header(), file.channels()["RGB"].pixels


def test_pxr24_changes_values_by_no_more_than_is_said(image: NDArray[np.float32]) -> None:
    back = read_exr(io.BytesIO(packed(image, "pxr24")))[0]
    assert np.abs(back - image).max() > 0
    np.testing.assert_allclose(back, image, rtol=2.0**-16)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -0.25, 65600.0])
def test_what_half_floats_do_not_hold_is_written_exactly(wrong: float) -> None:
    pixels = textured()
    pixels[3, 4, 1] = wrong
    back = decoded(packed(pixels, "zip"))[1]
    assert back.dtype == np.float32
    np.testing.assert_array_equal(back, pixels)


def test_dark_rows_are_written_exactly(image: NDArray[np.float32]) -> None:
    dark = image * np.float32(1e-9)
    np.testing.assert_array_equal(decoded(packed(dark, "zip"))[1], dark)


def test_zip_shrinks_the_file(image: NDArray[np.float32]) -> None:
    assert len(packed(image, "zip")) < 0.3 * len(packed(image, "none"))


@pytest.mark.parametrize("attributes", [{"compression": OpenEXR.PIZ_COMPRESSION}, {"lineOrder": OpenEXR.DECREASING_Y}])
def test_attributes_that_lay_chunks_otherwise_are_heeded(attributes: dict[str, Any]) -> None:
    values = textured()
    write_exr(stream := io.BytesIO(), values, attributes=attributes)
    header, back = decoded(stream.getvalue())
    assert header.items() >= attributes.items()
    np.testing.assert_array_equal(back, values)


def test_a_long_attribute_named_like_a_window_changes_nothing(image: NDArray[np.float32]) -> None:
    write_exr(stream := io.BytesIO(), image, attributes={"note": "dataWindow box2i", "comment": "displayWindow"})
    header, back = decoded(stream.getvalue())
    assert back.shape == image.shape
    assert (header["note"], header["comment"]) == ("dataWindow box2i", "displayWindow")


@pytest.mark.parametrize("name", ["zip-exact", "piz", "htj2k"])
def test_a_removed_name_says_what_to_use_instead(image: NDArray[np.float32], name: Any) -> None:
    with pytest.raises(EnvironmentMapError, match=f"^The compression '{name}' was removed; none changes no value"):
        packed(image, name)


def test_another_name_is_refused_in_a_sentence(image: NDArray[np.float32]) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^The compression 'dwaa' is not known; it must be one of zip, "):
        packed(image, "dwaa")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems' modules may hide the name")
def test_the_effort_of_zip_can_be_set() -> None:
    """A release of OpenEXR without that name would pack as well, but slower, and nobody would notice."""
    assert hasattr(ctypes.CDLL(OpenEXR.__file__), "_ZN7Imf_3_529setDefaultZipCompressionLevelEi")


@pytest.mark.parametrize("compression", ["zip", "pxr24"])
def test_the_same_bytes_whatever_the_threads(image: NDArray[np.float32], compression: str) -> None:
    first = packed(image, compression)
    set_compression_threads(1)
    try:
        assert packed(image, compression) == first
    finally:
        set_compression_threads(4)


@pytest.mark.parametrize(("asked", "threads"), [(1, 0), (2, 2), (3, 3)])
def test_the_number_of_threads_that_was_asked_for_stays(image: NDArray[np.float32], asked: int, threads: int) -> None:
    packed(image, "pxr24")
    before = OpenEXR.global_thread_count()
    try:
        set_compression_threads(asked)
        packed(image, "pxr24")
        assert OpenEXR.global_thread_count() == threads
    finally:
        set_compression_threads(before)


def test_the_first_map_does_not_undo_it() -> None:
    code = (
        "import OpenEXR, numpy as np\nfrom lighting.files import exr as c\nc.set_compression_threads(1)\n"
        "import io\nc.write_exr(io.BytesIO(), np.zeros((2, 4, 3)), compression='pxr24')\n"
        "print(OpenEXR.global_thread_count())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "0"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:This process.*fork:DeprecationWarning")
def test_a_forked_process_writes_too(image: NDArray[np.float32]) -> None:
    first = packed(image, "zip")
    child = os.fork()
    if child == 0:
        signal.alarm(20)
        os._exit(0 if packed(image, "zip") == first else 1)
    assert os.waitpid(child, 0)[1] == 0


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:This process.*fork:DeprecationWarning")
def test_a_fork_leaves_the_parents_threads_as_they_were(image: NDArray[np.float32]) -> None:
    packed(image, "pxr24")
    before = OpenEXR.global_thread_count()
    try:
        set_compression_threads(2)
        child = os.fork()
        if child == 0:
            os._exit(0)
        os.waitpid(child, 0)
        assert OpenEXR.global_thread_count() == 2
    finally:
        set_compression_threads(before)


RECORDED_LIGHT = Lighting(
    sun_azimuth=-41.2,
    sun_elevation=33.0,
    turbidity=3.4,
    exposure=0.021,
    radius_50=9.5,
    radius_90=31.0,
    camera_roll=-0.6,
)


@pytest.fixture(scope="module")
def rounded_map() -> NDArray[np.float32]:
    """Half floats, which `zip` does not change."""
    return render(RECORDED_LIGHT, 32).astype(np.float16).astype(np.float32)


@pytest.fixture(scope="module")
def data(rounded_map: NDArray[np.float32]) -> bytes:
    stream = io.BytesIO()
    write_exr(stream, rounded_map, RECORDED_LIGHT)
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


def test_round_trip_is_exact(tmp_path: Path, rounded_map: NDArray[np.float32]) -> None:
    write_exr(tmp_path / "map.exr", rounded_map, RECORDED_LIGHT, compression="none")
    read, lighting = read_exr(tmp_path / "map.exr")
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read, rounded_map)
    assert lighting == RECORDED_LIGHT


def test_round_trip_through_a_stream(rounded_map: NDArray[np.float32], data: bytes) -> None:
    read, lighting = read_exr(io.BytesIO(data))
    np.testing.assert_array_equal(read, rounded_map)
    assert lighting == RECORDED_LIGHT


def test_a_stream_that_cannot_seek_will_do(rounded_map: NDArray[np.float32]) -> None:
    reader, writer = os.pipe()
    with os.fdopen(reader, "rb") as source, os.fdopen(writer, "wb") as target:
        small = rounded_map[:, ::8][::8]
        write_exr(target, small, compression="none")
        target.close()
        np.testing.assert_array_equal(read_exr(source)[0], small)


def test_without_lighting_there_is_none(rounded_map: NDArray[np.float32]) -> None:
    stream = io.BytesIO()
    write_exr(stream, rounded_map)
    assert read_exr(io.BytesIO(stream.getvalue()))[1] is None


def test_any_float_layout_is_accepted(rounded_map: NDArray[np.float32]) -> None:
    stream = io.BytesIO()
    write_exr(stream, rounded_map.astype(np.float64)[:, ::-1], compression="none")
    np.testing.assert_array_equal(read_exr(io.BytesIO(stream.getvalue()))[0], rounded_map[:, ::-1])


def test_header(data: bytes) -> None:
    header = OpenEXR.File(io.BytesIO(data)).header()
    assert header["envmap"] == OpenEXR.ENVMAP_LATLONG
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["software"] == f"outdoor-lighting {__version__}"
    assert header["chromaticities"] == pytest.approx((0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329))
    for name in RANGES:
        assert header[f"lighting.{name}"] == pytest.approx(getattr(RECORDED_LIGHT, name), rel=1e-6)
    assert header["lighting.sun_direction"] == pytest.approx(RECORDED_LIGHT.sun_direction, abs=1e-6)
    assert json.loads(header["lighting.json"]) == record_with_coefficients(RECORDED_LIGHT)


def test_header_of_what_more_is_known(rounded_map: NDArray[np.float32]) -> None:
    known = replace(
        RECORDED_LIGHT, evidence=("pixels", "time+place"), warnings=("Hm.",), camera_heading=123.0, latitude=48.0
    )
    stream = io.BytesIO()
    write_exr(stream, rounded_map, known)
    header = OpenEXR.File(io.BytesIO(stream.getvalue())).header()
    assert header["lighting.evidence"] == "pixels, time+place"
    assert header["lighting.camera_heading"] == 123.0
    assert header["lighting.latitude"] == 48.0
    assert "lighting.longitude" not in header
    assert read_exr(io.BytesIO(stream.getvalue()))[1] == known


@pytest.mark.parametrize(("compression", "kind"), [("zip", np.float16), ("pxr24", np.float32), ("none", np.float32)])
def test_channels_are_r_g_b(image: NDArray[np.float32], compression: str, kind: type) -> None:
    channels = OpenEXR.File(io.BytesIO(packed(image, compression)), separate_channels=True).channels()
    assert sorted(channels) == ["B", "G", "R"]
    assert all(channel.pixels.dtype == kind for channel in channels.values())


@pytest.mark.parametrize("compression", ["none", "zip"])
def test_mitsuba_reads_it(tmp_path: Path, rounded_map: NDArray[np.float32], compression: str) -> None:
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    write_exr(tmp_path / "map.exr", rounded_map, RECORDED_LIGHT, compression=compression)
    np.testing.assert_array_equal(np.array(mitsuba.Bitmap(str(tmp_path / "map.exr"))), rounded_map)


# Reading what others wrote


def test_half_floats_are_read(rounded_map: NDArray[np.float32]) -> None:
    half = np.minimum(rounded_map, 100).astype(np.float16)
    read, lighting = read_exr(io.BytesIO(encoded({"RGB": half})))
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read, half.astype(np.float32))
    assert lighting is None


def test_alpha_and_mixed_types_are_read(rounded_map: NDArray[np.float32]) -> None:
    planes = {name: np.ascontiguousarray(rounded_map[..., i]) for i, name in enumerate("RGB")}
    data = encoded({**planes, "R": planes["R"].astype(np.float16), "A": np.ones_like(planes["R"])})
    np.testing.assert_array_equal(read_exr(io.BytesIO(data))[0][..., 1:], rounded_map[..., 1:])


def test_missing_channels_are_named(rounded_map: NDArray[np.float32]) -> None:
    data = encoded({"G": np.ascontiguousarray(rounded_map[..., 0]), "Z": np.ascontiguousarray(rounded_map[..., 1])})
    with pytest.raises(EnvironmentMapError, match=r"^The EXR file has no channel R, B; it needs R, G and B\.$"):
        read_exr(io.BytesIO(data))


@pytest.mark.parametrize(
    "text", ["{", "[]", "{}", '{"sun": {"azimuth": 0, "elevation": 200}, "sky": {}}', "3", 100_000 * "["]
)
def test_a_damaged_record_is_one_sentence(rounded_map: NDArray[np.float32], text: str) -> None:
    data = encoded({"RGB": rounded_map}, **{"lighting.json": text})
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
def test_nothing_is_written_to_what_is_neither(rounded_map: NDArray[np.float32], target: Any) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^An EXR is written to a path or a binary stream, not [a-zA-Z]+\.$"):
        write_exr(target, rounded_map)


@pytest.mark.parametrize("share", [0.001, 0.01, 0.05, 0.2, 0.5, 0.9, 0.999])
def test_cut_files_are_refused_quietly(data: bytes, share: float, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^The EXR file is cut short or damaged\.$"):
        read_exr(io.BytesIO(data[: max(5, int(share * len(data)))]))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("packing", [OpenEXR.NO_COMPRESSION, OpenEXR.ZIP_COMPRESSION, OpenEXR.PIZ_COMPRESSION])
def test_rows_may_be_stored_from_the_bottom_up(rounded_map: NDArray[np.float32], packing: Any) -> None:
    data = encoded({"RGB": rounded_map}, compression=packing, lineOrder=OpenEXR.DECREASING_Y)
    np.testing.assert_array_equal(read_exr(io.BytesIO(data))[0], rounded_map)
    with pytest.raises(EnvironmentMapError, match=r"^The EXR file is cut short or damaged\.$"):
        read_exr(io.BytesIO(data[:-1]))


@pytest.mark.parametrize("order", [OpenEXR.INCREASING_Y, OpenEXR.DECREASING_Y])
@pytest.mark.parametrize("missing", [0, 7, 31])
def test_a_chunk_that_was_never_written_is_noticed(
    rounded_map: NDArray[np.float32], order: Any, missing: int, capfd: pytest.CaptureFixture[str]
) -> None:
    """Its place in the table is 0, as programs leave it that were stopped while they wrote."""
    data = bytearray(encoded({"RGB": rounded_map}, compression=OpenEXR.NO_COMPRESSION, lineOrder=order))
    row = 8 + 12 * rounded_map.shape[1]
    table = len(data) - (row + 8) * len(rounded_map)
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
    tmp_path: Path, rounded_map: NDArray[np.float32], value: float
) -> None:
    spoilt = rounded_map.copy()
    spoilt[3, 4, 1] = value
    write_exr(tmp_path / "a.exr", spoilt)
    with pytest.raises(EnvironmentMapError, match=r"a\.exr: The map holds values that are not finite numbers\.$"):
        read_envmap(tmp_path / "a.exr")
    write_exr(tmp_path / "a.exr", rounded_map, compression="none")
    np.testing.assert_array_equal(read_envmap(tmp_path / "a.exr"), rounded_map)


def test_what_is_no_map_is_named_once(tmp_path: Path, rounded_map: NDArray[np.float32]) -> None:
    (tmp_path / "a.exr").write_bytes(encoded({"RGB": np.ascontiguousarray(rounded_map[:, :5])}))
    with pytest.raises(EnvironmentMapError, match=r"a\.exr: An environment map has the shape"):
        read_envmap(tmp_path / "a.exr")
    with pytest.raises(EnvironmentMapError, match=r"^[^:]*none\.exr cannot be read: No such file or directory\.$"):
        read_envmap(tmp_path / "none.exr")


def test_a_map_may_be_a_radiance_hdr(tmp_path: Path, rounded_map: NDArray[np.float32]) -> None:
    (tmp_path / "a.hdr").write_bytes(encode_envmap(rounded_map, options=FileOptions("hdr")))
    np.testing.assert_allclose(read_envmap(tmp_path / "a.hdr"), rounded_map, rtol=0.02, atol=0.02)
    (tmp_path / "a.hdr").write_bytes(b"#?RADIANCE\n\n-Y 8 +X 16\n")
    with pytest.raises(EnvironmentMapError, match=r"a\.hdr: The HDR picture is cut short or damaged\.$"):
        read_envmap(tmp_path / "a.hdr")


def layered(*layers: str, pixels: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
    """Channels of layers, of which the first holds the pixels and the others are brighter."""
    planes = {f"{layer}{name}": pixels[..., i] + k for k, layer in enumerate(layers) for i, name in enumerate("RGB")}
    return {name: np.ascontiguousarray(plane) for name, plane in planes.items()}


@pytest.mark.parametrize(
    "layers",
    [
        ("", "glow."),
        ("sky.",),
        ("ViewLayer.Combined.", "ViewLayer.DiffCol."),
        ("beauty.", "normal."),
        ("View Layer 2.RGBA.", "x.y."),
    ],
)
def test_colors_in_a_layer_are_read(layers: tuple[str, ...], rounded_map: NDArray[np.float32]) -> None:
    data = encoded(layered(*layers, pixels=rounded_map) | {"ViewLayer.Depth.Z": rounded_map[..., 0].copy()})
    np.testing.assert_array_equal(read_exr(io.BytesIO(data))[0], rounded_map)


def test_colors_in_a_part_are_read(tmp_path: Path, rounded_map: NDArray[np.float32]) -> None:
    """Blender 5 can write its passes as parts."""
    file = str(tmp_path / "a.exr")
    planes = [{"Z": rounded_map[..., 0].copy()}, layered("Combined.", pixels=rounded_map)]
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File([OpenEXR.Part(dict(header), part, name) for part, name in zip(planes, "ab", strict=True)]).write(file)
    np.testing.assert_array_equal(read_envmap(file), rounded_map)


def test_which_of_several_layers_counts_is_not_guessed(rounded_map: NDArray[np.float32]) -> None:
    data = encoded(layered("day.", "night.", pixels=rounded_map))
    with pytest.raises(EnvironmentMapError, match=r"several layers .* \(day, night\); keep one of them\.$"):
        read_exr(io.BytesIO(data))


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
        write_exr(target, noise, RECORDED_LIGHT)
    assert list(tmp_path.iterdir()) == []


def test_a_failing_write_keeps_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "map.exr"
    target.write_bytes(b"old")
    noise = np.random.default_rng(0).random((64, 128, 3), dtype=np.float32)
    with pytest.raises(EnvironmentMapError), file_size_limit(20_000):
        write_exr(target, noise)
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_missing_folder_is_one_sentence(tmp_path: Path, rounded_map: NDArray[np.float32]) -> None:
    with pytest.raises(EnvironmentMapError, match=r"map\.exr cannot be written: No such file or directory\.$"):
        write_exr(tmp_path / "none" / "map.exr", rounded_map)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_an_unwritable_folder_is_one_sentence(tmp_path: Path, rounded_map: NDArray[np.float32]) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(EnvironmentMapError, match=r"map\.exr cannot be written: Permission denied\.$"):
        write_exr(tmp_path / "map.exr", rounded_map)
    tmp_path.chmod(0o700)


@pytest.mark.parametrize("shape", [(4, 8), (4, 8, 4), (8, 8, 3), (0, 0, 3)])
def test_other_shapes_are_refused(tmp_path: Path, shape: tuple[int, ...]) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^An environment map has the shape \(H, 2H, 3\), not "):
        write_exr(tmp_path / "map.exr", np.zeros(shape, dtype=np.float32))
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_map_or_no_lighting_is_refused(tmp_path: Path, rounded_map: NDArray[np.float32]) -> None:
    for thing in ("sky.exr", [[0.0]], None):
        with pytest.raises(EnvironmentMapError, match=r"^An environment map (has the|is an array of) shape"):
            write_exr(tmp_path / "a.exr", cast("Any", thing))
    with pytest.raises(ParameterError, match="A Lighting is needed, not dict"):
        write_exr(tmp_path / "a.exr", rounded_map, cast("Any", {"sun": {}}))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("attributes", "told"),
    [
        ({"time": 2**40}, "time is 1099511627776, and whole numbers of an EXR have 32 bits"),
        ({"time": -(2**31) - 1}, "32 bits"),
        ({"time": np.int64(2**31)}, "32 bits"),
        ({"envmap": 0}, "envmap is 0"),
        ({"envmap": "latlong"}, "envmap is 'latlong'"),
        ({"place": (2**40, 1)}, "place is .*, which OpenEXR leaves out or writes as something else"),
        ({"steps": [1, 2, 3]}, "steps is"),
        ({"far": 1e300}, "far is"),
        ({"tiles": 1}, "tiles is"),
    ],
)
def test_attributes_that_would_be_written_as_others_are_refused(
    tmp_path: Path, rounded_map: NDArray[np.float32], attributes: dict[str, Any], told: str
) -> None:
    with pytest.raises(EnvironmentMapError, match=told):
        write_exr(tmp_path / "a.exr", rounded_map, attributes=attributes)
    assert not list(tmp_path.iterdir())


def test_the_largest_whole_numbers_of_an_exr_are_kept(tmp_path: Path, rounded_map: NDArray[np.float32]) -> None:
    numbers = {"high": 2**31 - 1, "low": -(2**31), "envmap": OpenEXR.ENVMAP_LATLONG, "pair": [1.5, -2.5], "n": "ü"}
    write_exr(tmp_path / "a.exr", rounded_map, attributes=numbers)
    read = read_exr_attributes(tmp_path / "a.exr")
    assert {name: read[name] for name in numbers} == numbers


@pytest.mark.parametrize("attributes", [{"place": {"a": 1}}, {"": 1.0}, {"compression": "foo"}, {3: 4.0}])
def test_attributes_that_no_exr_can_have_are_refused(
    tmp_path: Path, rounded_map: NDArray[np.float32], attributes: dict[Any, Any]
) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^The attributes cannot be those of an EXR: "):
        write_exr(tmp_path / "a.exr", rounded_map, attributes=attributes)
    assert not list(tmp_path.iterdir())


def test_header_of_the_strength_of_the_light(rounded_map: NDArray[np.float32]) -> None:
    known = replace(
        RECORDED_LIGHT, sun_irradiance=(3.0, 2.0, 1.0), sky_irradiance=(0.4, 0.5, 0.8), sky_cover=0.2, suitable=0.9
    )
    stream = io.BytesIO()
    write_exr(stream, rounded_map, known)
    header = OpenEXR.File(io.BytesIO(stream.getvalue())).header()
    assert header["lighting.sun_irradiance"] == pytest.approx((3.0, 2.0, 1.0))
    assert header["lighting.sky_cover"] == pytest.approx(0.2)
    assert header["lighting.sky_model"] == "hosek-wilkie"
    assert "lighting.ground_color" not in header
    assert read_exr(io.BytesIO(stream.getvalue()))[1] == known


# Pictures that unpack to more than a computer holds


@pytest.mark.parametrize(("width", "height", "refused"), [(17000, 8500, True), (17501, 8000, True), (32, 16, False)])
def test_what_a_header_announces_is_limited(width: int, height: int, refused: bool) -> None:
    """A few kilobytes can hold gigabytes of zeros."""
    stream = io.BytesIO()
    write_exr(stream, np.zeros((16, 32, 3), np.float32))
    window = b"dataWindow\0box2i\0\x10\0\0\0"
    first, _, rest = stream.getvalue().partition(window)
    changed = first + window + struct.pack("<4i", 0, 0, width - 1, height - 1) + rest[16:]
    if not refused:
        assert read_exr(io.BytesIO(changed))[0].shape == (height, width, 3)
        return
    words = f"of {width} x {height} pixels has more than the limit of 140 million"
    with pytest.raises(EnvironmentMapError, match=words):
        read_exr(io.BytesIO(changed))


def test_the_largest_map_may_be_read() -> None:
    check_read_size(2 * MAX_HEIGHT, MAX_HEIGHT, "map")


def test_many_channels_count(monkeypatch: pytest.MonkeyPatch) -> None:
    plane = np.zeros((8, 16), np.float32)
    names = ["R", "G", "B", "A", *(f"c{i}" for i in range(36))]
    file = encoded(dict.fromkeys(names, plane))
    monkeypatch.setattr("lighting.files.exr._MAX_READ_BYTES", 4 * plane.size * len(names))
    assert read_exr(io.BytesIO(file))[0].shape == (8, 16, 3)
    monkeypatch.setattr("lighting.files.exr._MAX_READ_BYTES", 4 * plane.size * len(names) - 1)
    with pytest.raises(EnvironmentMapError, match=r"40 channels take more than the limit of [\d.e-]+ GB\."):
        read_exr(io.BytesIO(file))


def test_a_deep_picture_is_refused(data: bytes) -> None:
    with pytest.raises(EnvironmentMapError, match="a deep picture"):
        read_exr(io.BytesIO(data[:5] + b"\x08" + data[6:]))


@pytest.mark.parametrize("colours", ["rec709", "acescg", "linear-p3"])
def test_maps_in_other_colours_are_what_other_programs_convert(colours: str, tmp_path: Path) -> None:
    """By OpenColorIO's own configuration, and OpenImageIO's reading of the header."""
    import OpenImageIO
    import PyOpenColorIO

    image = np.random.default_rng(5).uniform(0.1, 2.0, (8, 16, 3)).astype(np.float32)
    write_exr(tmp_path / "a.exr", image, compression="none", colors=colours)
    spaces = {"rec709": "Linear Rec.709 (sRGB)", "acescg": "ACEScg", "linear-p3": "Linear P3-D65"}
    config = PyOpenColorIO.Config.CreateFromBuiltinConfig("cg-config-v2.1.0_aces-v1.3_ocio-v2.3")
    processor = config.getProcessor(spaces["rec709"], spaces[colours]).getDefaultCPUProcessor()
    expected = np.array(processor.applyRGB(image.ravel().tolist())).reshape(image.shape)
    picture = OpenImageIO.ImageBuf(str(tmp_path / "a.exr"))
    assert picture.get_pixels(OpenImageIO.FLOAT) == pytest.approx(expected, rel=1e-3, abs=1e-4)
    names = {"rec709": "lin_rec709_scene", "acescg": "lin_ap1_scene", "linear-p3": "lin_p3d65_scene"}
    assert picture.spec().getattribute("colorInteropID") == names[colours]
    assert picture.spec().getattribute("chromaticities") == pytest.approx(COLOR_SPACES[colours][0])
    assert read_exr(tmp_path / "a.exr")[0] == pytest.approx(image, rel=1e-4, abs=1e-4)
    with pytest.raises(EnvironmentMapError, match="must be one of rec709, acescg, linear-p3"):
        write_exr(tmp_path / "a.exr", image, colors="srgb")


def test_views_of_an_array_are_written_as_they_read(tmp_path: Path, rounded_map: NDArray[np.float32]) -> None:
    """OpenEXR takes an array's memory as it lies."""
    alpha = np.concatenate([rounded_map, np.ones_like(rounded_map[..., :1])], axis=2)
    views = {
        "channels": alpha[..., :3],
        "reversed": np.ascontiguousarray(rounded_map[..., ::-1])[..., ::-1],
        "planes": np.ascontiguousarray(rounded_map.transpose(2, 0, 1)).transpose(1, 2, 0),
        "mirrored": np.ascontiguousarray(rounded_map[:, ::-1])[:, ::-1],
    }
    for name, view in views.items():
        assert not view.flags["C_CONTIGUOUS"]
        for compression in ("zip", "none"):
            write_exr(tmp_path / f"{name}.exr", view, compression=compression)
            np.testing.assert_array_equal(read_exr(tmp_path / f"{name}.exr")[0], rounded_map)


def test_half_floats_are_the_nearest_ones() -> None:
    """Also half way between two of them, where the even one counts, and among the smallest."""
    halves = np.arange(0, 0x7C00, dtype=np.uint16).view(np.float16).astype(np.float32)
    between = ((halves[1:].astype(np.float64) + halves[:-1]) / 2).astype(np.float32)
    beside = [np.nextafter(between, np.float32(end)) for end in (0, np.inf)]
    for values in (halves, between, *beside):
        for part in (values, values[values >= 2.0**-14]):
            np.testing.assert_array_equal(_round_to_half(part), part.astype(np.float16))
