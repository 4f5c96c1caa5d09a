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
from lighting.files import check_map_name, encode_envmap, write_envmap
from lighting.files.exr import read_exr
from lighting.records import Lighting

Map = NDArray[np.float32]

LIGHT = Lighting(sun_azimuth=30.0, sun_elevation=33.0, turbidity=3.0, exposure=0.5)


@pytest.fixture(scope="module")
def image() -> Map:
    return render(LIGHT, 64)


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


def test_png_is_the_tone_mapped_map(image: Map) -> None:
    with Image.open(io.BytesIO(encode_envmap(image, LIGHT, "png"))) as picture:
        assert picture.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(picture), tone_map(image))


@pytest.mark.parametrize("name", ["map", "map.jpg", ".exr", "map.exr.txt"])
def test_other_suffixes_are_one_sentence(tmp_path: Path, image: Map, name: str) -> None:
    with pytest.raises(EnvironmentMapError, match=r"^The name '.*' must end in \.exr, \.hdr or \.png\.$"):
        write_envmap(tmp_path / name, image, LIGHT)
    assert list(tmp_path.iterdir()) == []


def testcheck_map_name_a_path() -> None:
    assert [check_map_name("a/b.EXR"), check_map_name(Path("x.y.hdr")), check_map_name("p.png")] == [
        "exr",
        "hdr",
        "png",
    ]


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
