"""Transfer functions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.colour import luminance, srgb_decode, srgb_encode, tone_map


@pytest.mark.parametrize(
    ("encoded", "linear"),
    [(0.0, 0.0), (0.02, 0.001547988), (0.04045, 0.003130805), (0.5, 0.214041140), (0.8, 0.603827339), (1.0, 1.0)],
)
def test_srgb_has_the_standards_values(encoded: float, linear: float) -> None:
    assert srgb_decode(encoded) == pytest.approx(linear, rel=1e-6)
    assert srgb_encode(linear) == pytest.approx(encoded, rel=1e-5)


@given(st.floats(0, 1))
def test_srgb_round_trip(value: float) -> None:
    assert srgb_encode(srgb_decode(value)) == pytest.approx(value, abs=1e-6)
    assert srgb_decode(srgb_encode(value)) == pytest.approx(value, abs=1e-6)


def test_srgb_rises_everywhere() -> None:
    value = np.linspace(0, 1, 10001)
    assert (np.diff(srgb_decode(value)) > 0).all()
    assert (np.diff(srgb_encode(value)) > 0).all()


def test_encoding_clips() -> None:
    assert srgb_encode([-1.0, 2.0, np.inf]) == pytest.approx([0.0, 1.0, 1.0])


def test_decoding_keeps_float32() -> None:
    assert srgb_decode(np.zeros(3, dtype=np.float32)).dtype == np.float32


def test_luminance_of_the_primaries() -> None:
    assert luminance(np.eye(3)) == pytest.approx([0.2126, 0.7152, 0.0722])
    assert luminance(np.full((4, 2, 3), 0.5)) == pytest.approx(np.full((4, 2), 0.5))


def test_tone_map_scales_encodes_and_clips() -> None:
    image = np.array([[[0.0, 0.107020570, 0.5], [-1.0, 40000.0, 0.0015654]]], dtype=np.float32)
    picture = tone_map(image, exposure=2.0)
    assert picture.dtype == np.uint8
    assert picture.tolist() == [[[0, 128, 255], [0, 255, 10]]]
