"""What packing does to the values, above all to the sun's."""

import ctypes
import io
import os
import signal
import subprocess
import sys
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from lighting.envmap import render
from lighting.errors import EnvironmentMapError
from lighting.files import read_exr, write_exr
from lighting.files.compression import _SET_EFFORT, COMPRESSIONS, MANTISSA, pack_in_threads, round_in_place, rounded
from lighting.geometry import latlong_solid_angle
from lighting.records import Lighting

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
    back = read_exr(io.BytesIO(packed(image, compression)))[0]
    disc = image.max(axis=-1) > 0.01 * image.max()
    rows = np.broadcast_to(latlong_solid_angle(len(image))[:, None], disc.shape)[disc]
    before, after = ((rows[:, None] * values[disc]).sum(axis=0, dtype=np.float64) for values in (image, back))
    assert image.max() > 65504  # more than half floats hold
    np.testing.assert_allclose(after, before, rtol=1e-3 if compression not in EXACT else 0)


@pytest.mark.parametrize("compression", EXACT)
def test_exact_means_exact(image: NDArray[np.float32], compression: str) -> None:
    np.testing.assert_array_equal(read_exr(io.BytesIO(packed(image, compression)))[0], image)


@pytest.mark.parametrize(("compression", "most"), [("zip", 2.0 ** -(MANTISSA + 1)), ("pxr24", 2.0**-16)])
def test_no_value_changes_by_more_than_is_said(image: NDArray[np.float32], compression: str, most: float) -> None:
    back = read_exr(io.BytesIO(packed(image, compression)))[0]
    assert np.abs(back - image).max() > 0
    np.testing.assert_allclose(back, image, rtol=most)


def test_rounding_shrinks_the_file(image: NDArray[np.float32]) -> None:
    assert len(packed(image, "zip")) < 0.3 * len(packed(image, "none"))  # without it 0.5


def test_rounding_leaves_what_has_no_neighbour() -> None:
    largest = np.finfo(np.float32).max
    values = np.array([0.0, -0.0, 1.0, -1.5, np.inf, -np.inf, np.nan, largest, -largest, 1e-42], dtype=np.float32)
    out = rounded(values)
    np.testing.assert_array_equal(out[:9], values[:9])
    assert np.signbit(out[1])
    assert abs(out[9] - values[9]) < 1e-42


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
    assert hasattr(ctypes.CDLL(OpenEXR.__file__), _SET_EFFORT)


def test_the_same_bytes_whatever_the_threads(image: NDArray[np.float32]) -> None:
    first = packed(image, "zip")
    threads = OpenEXR.global_thread_count()
    assert threads > 0
    OpenEXR.set_global_thread_count(1)
    try:
        assert packed(image, "zip") == first
    finally:
        OpenEXR.set_global_thread_count(threads)


@pytest.mark.parametrize(("asked", "threads"), [(1, 0), (2, 2), (3, 3)])
def test_the_number_of_threads_that_was_asked_for_stays(image: NDArray[np.float32], asked: int, threads: int) -> None:
    packed(image, "zip")
    before = OpenEXR.global_thread_count()
    try:
        pack_in_threads(asked)
        packed(image, "zip")
        assert OpenEXR.global_thread_count() == threads
    finally:
        pack_in_threads(before)


def test_the_first_map_does_not_undo_it() -> None:
    code = (
        "import OpenEXR, numpy as np\nfrom lighting.files import compression as c\nc.pack_in_threads(1)\n"
        "c.packed_with(np.zeros((2, 4, 3), np.float32), 'zip')\nprint(OpenEXR.global_thread_count())"
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
    packed(image, "zip")
    before = OpenEXR.global_thread_count()
    try:
        pack_in_threads(2)
        child = os.fork()
        if child == 0:
            os._exit(0)
        os.waitpid(child, 0)
        assert OpenEXR.global_thread_count() == 2
    finally:
        pack_in_threads(before)


def test_values_are_rounded_in_place_once() -> None:
    """As they are in an array of their own; what is rounded already is not copied, which large maps would feel."""
    values = np.random.default_rng(3).lognormal(sigma=3, size=(70, 140, 3)).astype(np.float32)
    values[1, :3, 0] = np.finfo(np.float32).max, np.inf, -1.2345
    values[2, 0, 0] = np.nan
    expected = rounded(values)
    assert expected is not values
    round_in_place(values)
    np.testing.assert_array_equal(values, expected)
    assert values[1, 0, 0] == np.finfo(np.float32).max
    tame = values[3:]
    assert rounded(tame) is tame
