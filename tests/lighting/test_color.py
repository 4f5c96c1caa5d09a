"""Tests of color."""

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lighting.color as color
from lighting.color import (
    CHROMATICITIES,
    chromaticities_to_rec709,
    luminance,
    max_channel,
    srgb_decode,
    srgb_encode,
    tone_map,
)
from lighting.errors import EnvironmentMapError
from lighting.files.exr import read_exr

ACESCG = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
ACES = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)


# Reflectance, and the 10-bit code value, or for DJI, Apple and ARRI the signal, that the papers of the makers have.
ANCHORS: dict[color.Curve, list[tuple[float, float]]] = {
    "d-log": [(0.0, 0.0929), (0.18, 0.3988)],
    "s-log3": [(0.0, 95 / 1023), (0.18, 420 / 1023), (0.9, 598 / 1023)],
    "v-log": [(0.0, 128 / 1023), (0.18, 433 / 1023), (0.9, 602 / 1023)],
    "c-log3": [(0.0, 128 / 1023), (0.18, 351 / 1023)],
    "n-log": [(0.18, 372 / 1023)],
    "f-log2": [(0.0, 95 / 1023), (0.18, 400 / 1023), (0.9, 570 / 1023)],
    "apple-log": [(0.0, 0.150477), (0.18, 0.488272)],
    "logc3": [(0.18, 400 / 1023)],
    "logc4": [(0.0, 95 / 1023), (0.18, 0.2784)],
}
IN_OCIO: dict[color.Curve, str] = {
    "s-log3": "SONY_SLOG3-SGAMUT3.CINE_to_ACES2065-1",
    "v-log": "PANASONIC_VLOG-VGAMUT_to_ACES2065-1",
    "c-log3": "CANON_CLOG3-CGAMUT_to_ACES2065-1",
    "apple-log": "APPLE_LOG_to_ACES2065-1",
    "logc3": "ARRI_ALEXA-LOGC-EI800-AWG_to_ACES2065-1",
    "logc4": "ARRI_LOGC4_to_ACES2065-1",
}


def test_logarithms_have_the_code_values_of_their_makers() -> None:
    assert set(ANCHORS) == set(color.LOG_CHROMATICITIES)
    for curve, anchors in ANCHORS.items():
        reflectance, signal = np.array(anchors).T
        np.testing.assert_allclose(color.DECODE_CURVES[curve](signal), reflectance, atol=0.003, err_msg=curve)


@pytest.mark.parametrize("curve", ANCHORS)
def test_a_logarithm_rises_without_a_step(curve: color.Curve) -> None:
    signal = np.linspace(0.0, 1.0, 4001)
    steps = np.diff(color.DECODE_CURVES[curve](signal))
    assert steps.min() > 0.0
    assert np.all(steps[1:] < 1.2 * steps[:-1] + 5e-4)


@pytest.mark.parametrize("curve", IN_OCIO)
def test_logarithms_and_their_colors_are_those_of_opencolorio(curve: color.Curve) -> None:
    """It adapts whites by CAT02, and this package by Bradford's matrix: hence the tolerance."""
    Ocio: Any = pytest.importorskip("PyOpenColorIO")
    signals = np.random.default_rng(0).uniform(0.2, 0.6, (200, 3)).astype(np.float32)
    transform = Ocio.BuiltinTransform(style=IN_OCIO[curve])
    aces = signals.copy()
    Ocio.Config.CreateRaw().getProcessor(transform).getDefaultCPUProcessor().applyRGB(aces)
    to_rec709 = chromaticities_to_rec709(ACES)
    own = chromaticities_to_rec709(color.LOG_CHROMATICITIES[curve])
    assert to_rec709 is not None
    assert own is not None
    expected = aces @ to_rec709.T
    np.testing.assert_allclose(
        color.DECODE_CURVES[curve](signals) @ own.T, expected, rtol=0.02, atol=0.02 * expected.max()
    )


def test_acescg_has_the_matrix_that_others_print() -> None:
    """That of S. Hill's fits of ACES and of many shaders after them, rounded to five digits."""
    published = np.array([[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]])
    matrix = chromaticities_to_rec709(ACESCG)
    assert matrix is not None
    np.testing.assert_allclose(matrix, published, atol=2e-4)


@pytest.mark.parametrize("primaries", [ACESCG, ACES, (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)])
def test_white_stays_white(primaries: tuple[float, ...]) -> None:
    matrix = chromaticities_to_rec709(primaries)
    assert matrix is not None
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, atol=1e-5)


def test_a_file_in_acescg_is_read_in_rec709_and_one_in_rec709_as_it_is(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).uniform(0.1, 1.0, (2, 4, 3)).astype(np.float32)
    for name, primaries in (("wide", ACESCG), ("plain", CHROMATICITIES)):
        header = {"type": OpenEXR.scanlineimage, "chromaticities": primaries}
        OpenEXR.File(header, {"RGB": pixels}).write(str(tmp_path / f"{name}.exr"))
    assert np.array_equal(read_exr(tmp_path / "plain.exr")[0], pixels)
    matrix = chromaticities_to_rec709(ACESCG)
    assert matrix is not None
    np.testing.assert_allclose(read_exr(tmp_path / "wide.exr")[0], pixels @ matrix.T, rtol=1e-5)


def test_primaries_of_no_colours_are_refused(tmp_path: Path) -> None:
    header = {"type": OpenEXR.scanlineimage, "chromaticities": (0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.0)}
    OpenEXR.File(header, {"RGB": np.ones((2, 4, 3), np.float32)}).write(str(tmp_path / "none.exr"))
    with pytest.raises(EnvironmentMapError, match="those of no colors"):
        read_exr(tmp_path / "none.exr")


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


def test_tone_map_encodes_and_clips() -> None:
    image = np.array([[[0.0, 0.21404114, 1.0], [-2.0, 80000.0, 0.0031308]]], dtype=np.float32)
    picture = tone_map(image)
    assert picture.dtype == np.uint8
    assert picture.tolist() == [[[0, 128, 255], [0, 255, 10]]]


@pytest.mark.parametrize(
    ("xy", "kelvin"),
    [((0.3127, 0.3290), 6504), ((0.3457, 0.3585), 5003), ((0.44757, 0.40745), 2856), ((0.29902, 0.31485), 7504)],
)
def test_the_color_temperatures_of_illuminants_are_those_of_the_cie(xy: tuple[float, float], kelvin: float) -> None:
    x, y = xy
    linear = np.linalg.solve(color._to_xyz(np.array(CHROMATICITIES).reshape(4, 2)), [x / y, 1.0, (1 - x - y) / y])
    assert color.color_temperature(linear) == pytest.approx(kelvin, rel=2e-3)


def test_color_temperatures_have_ends() -> None:
    assert color.color_temperature([0.0, 0.0, 0.0]) is None
    assert color.color_temperature([0.0, 0.0, 1.0]) == 40000.0
    assert color.color_temperature([0.2, 0.3, 0.9]) == 40000.0
    assert color.color_temperature([1.0, 0.2, 0.02]) == pytest.approx(1800, abs=100)


def test_the_largest_channel_is_numpys() -> None:
    image = np.random.default_rng(1).normal(size=(7, 5, 3)).astype(np.float32)
    assert np.array_equal(max_channel(image), image.max(axis=-1))
