"""Files that appear whole, folders for results, and names of maps."""

import io
import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.color import tone_map
from lighting.envmap.render import render
from lighting.errors import EnvironmentMapError, ParameterError
from lighting.files import (
    MAP_FORMATS,
    FileOptions,
    atomic_write,
    check_map_name,
    encode_envmap,
    encode_jpeg,
    stale_temporaries,
    write_envmap,
)
from lighting.files.exr import read_exr
from lighting.records import Lighting


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def write_and_fail(target: Path, error: BaseException) -> None:
    with atomic_write(target) as temporary:
        temporary.write_bytes(b"half")
        raise error


def test_the_file_appears_when_the_block_ends(tmp_path: Path) -> None:
    target = tmp_path / "map.exr"
    with atomic_write(target) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".exr"
        temporary.write_bytes(b"whole")
        assert not target.exists()
    assert target.read_bytes() == b"whole"
    assert names(tmp_path) == ["map.exr"]


@pytest.mark.parametrize("interruption", [ValueError, KeyboardInterrupt])
def test_a_failure_leaves_nothing(tmp_path: Path, interruption: type[BaseException]) -> None:
    with pytest.raises(interruption):
        write_and_fail(tmp_path / "map.exr", interruption())
    assert names(tmp_path) == []


def test_a_failure_keeps_what_was_there(tmp_path: Path) -> None:
    target = tmp_path / "map.exr"
    target.write_bytes(b"old")
    with pytest.raises(ValueError, match="half-way"):
        write_and_fail(target, ValueError("half-way"))
    assert target.read_bytes() == b"old"
    assert names(tmp_path) == ["map.exr"]


def test_an_existing_file_is_replaced(tmp_path: Path) -> None:
    target = tmp_path / "map.exr"
    target.write_bytes(b"old")
    with atomic_write(str(target)) as temporary:
        temporary.write_bytes(b"new")
    assert target.read_bytes() == b"new"


@pytest.mark.skipif(os.name != "posix", reason="permissions are POSIX")
def test_permissions_are_those_of_a_plain_file(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.write_bytes(b"")
    with atomic_write(tmp_path / "made") as temporary:
        temporary.write_bytes(b"")
    assert (tmp_path / "made").stat().st_mode == plain.stat().st_mode


@pytest.mark.skipif(os.name != "posix", reason="permissions are POSIX")
def test_a_private_file_stays_private(tmp_path: Path) -> None:
    target = tmp_path / "map.exr"
    target.touch(mode=0o600)
    with atomic_write(target) as temporary:
        temporary.write_bytes(b"new")
    assert (target.read_bytes(), target.stat().st_mode & 0o777) == (b"new", 0o600)


@pytest.mark.skipif(os.name != "posix", reason="links need rights elsewhere")
@pytest.mark.parametrize("exists", [True, False])
def test_a_link_stays_and_leads_to_the_new_file(tmp_path: Path, exists: bool) -> None:
    (tmp_path / "store").mkdir()
    stored, link = tmp_path / "store" / "map", tmp_path / "map.exr"
    if exists:
        stored.write_bytes(b"old")
    link.symlink_to(stored)
    with atomic_write(link) as temporary:
        assert (temporary.parent, temporary.suffix) == (stored.parent, ".exr")
        assert stale_temporaries(link) == [temporary]
        temporary.write_bytes(b"new")
    assert link.is_symlink()
    assert (names(stored.parent), stored.read_bytes()) == (["map"], b"new")


def test_a_missing_folder_is_an_oserror(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "missing" / "map.exr"):
        pass


def test_a_folder_in_the_way_is_an_oserror_and_stays(tmp_path: Path) -> None:
    (tmp_path / "map.exr").mkdir()
    with pytest.raises(OSError), atomic_write(tmp_path / "map.exr"):  # noqa: PT011
        pass
    assert names(tmp_path) == ["map.exr"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
@pytest.mark.parametrize("name", ["pipe.exr", "link.exr"])
def test_a_pipe_is_not_replaced(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "pipe.exr")
    (tmp_path / "link.exr").symlink_to("pipe.exr")
    with pytest.raises(OSError, match="it is a pipe or a device, not a file"), atomic_write(tmp_path / name):
        pass
    assert (tmp_path / "pipe.exr").is_fifo()
    assert names(tmp_path) == ["link.exr", "pipe.exr"]


def test_what_killed_processes_left_is_found_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "checkpoint.pt"
    assert stale_temporaries(tmp_path / "none" / "checkpoint.pt") == []
    with atomic_write(target) as temporary:
        assert stale_temporaries(target) == [temporary]
        assert stale_temporaries(tmp_path / "config.json") == []
    for name in (".notes.pt", "0123456789abcdef.pt", ".0123456789abcdef.pt.txt", ".0123456789abcdef0.pt"):
        (tmp_path / name).write_bytes(b"")
    assert stale_temporaries(target) == []


def test_jpeg_keeps_size_and_colour() -> None:
    with Image.open(io.BytesIO(encode_jpeg(np.full((24, 32, 3), (200, 120, 40), dtype=np.uint8), 90))) as picture:
        assert (picture.format, picture.size) == ("JPEG", (32, 24))
        assert np.abs(np.asarray(picture, dtype=int) - [200, 120, 40]).max() <= 4


Map = NDArray[np.float32]

LIGHT = Lighting(sun_azimuth=30.0, sun_elevation=33.0, turbidity=3.0, exposure=0.5)


@pytest.fixture(scope="module")
def image() -> Map:
    return render(LIGHT, 64)


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".png", ".EXR"])
def test_a_path_holds_what_encoding_gives(tmp_path: Path, image: Map, suffix: str) -> None:
    target = tmp_path / f"map{suffix}"
    write_envmap(target, image, LIGHT)
    assert target.read_bytes() == encode_envmap(image, LIGHT, FileOptions(suffix[1:].lower()))
    assert list(tmp_path.iterdir()) == [target]


def test_exr_holds_the_lighting(image: Map) -> None:
    read, lighting = read_exr(io.BytesIO(encode_envmap(image, LIGHT, FileOptions(compression="none"))))
    np.testing.assert_array_equal(read, image)
    assert lighting == LIGHT


def test_png_is_the_tone_mapped_map(image: Map) -> None:
    with Image.open(io.BytesIO(encode_envmap(image, LIGHT, FileOptions("png")))) as picture:
        assert picture.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(picture), tone_map(image))


@pytest.mark.parametrize("name", MAP_FORMATS)
def test_strips_make_the_file_of_the_whole_map(image: Map, name: str) -> None:
    options = FileOptions(name)
    parts = np.split(image, [16, 48])
    assert encode_envmap(lambda: iter(parts), options=options) == encode_envmap(image, options=options)


@pytest.mark.parametrize("name", MAP_FORMATS)
def test_strips_that_end_early_are_refused(image: Map, name: str) -> None:
    with pytest.raises(EnvironmentMapError):
        encode_envmap(lambda: iter([image[:16], image[16:32]]), options=FileOptions(name))


def test_strips_that_split_a_chunk_of_an_exr_are_refused(image: Map) -> None:
    with pytest.raises(EnvironmentMapError, match="strips have 64 rows; it needs 64, 16 or a multiple at a time"):
        encode_envmap(lambda: iter([image[:8], image[8:]]))


@pytest.mark.parametrize("name", ["map", "map.jpg", ".exr", "map.exr.txt"])
def test_other_suffixes_are_one_sentence(tmp_path: Path, image: Map, name: str) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^The name '.*' must end in \.exr, \.hdr or \.png\.$"):
        write_envmap(tmp_path / name, image, LIGHT)
    assert list(tmp_path.iterdir()) == []


def test_a_suffix_names_the_format() -> None:
    assert [check_map_name("a/b.EXR"), check_map_name(Path("x.y.hdr")), check_map_name("p.png")] == [
        "exr",
        "hdr",
        "png",
    ]


def test_an_unknown_format_is_one_sentence() -> None:
    with pytest.raises(ParameterError, match=r"^format is 'tiff'; .* exr, hdr, png\.$"):
        FileOptions("tiff")


@pytest.mark.parametrize("suffix", ["exr", "hdr", "png"])
def test_failures_are_one_sentence_and_leave_nothing(tmp_path: Path, image: Map, suffix: str) -> None:
    with pytest.raises(EnvironmentMapError, match="cannot be written: No such file or directory"):
        write_envmap(tmp_path / "none" / f"map.{suffix}", image)
    with pytest.raises(EnvironmentMapError, match="has the shape"):
        write_envmap(tmp_path / f"map.{suffix}", image[:, :5])
    assert list(tmp_path.iterdir()) == []
