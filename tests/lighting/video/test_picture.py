"""Decoded pictures as sRGB: the values that the recommendations give for coded ones."""

import av
import numpy as np
import pytest

from lighting.video.picture import upright
from lighting.video.transfer import to_srgb

CODED = (
    (16, 128, 128),
    (30, 128, 128),
    (126, 128, 128),
    (235, 128, 128),
    (110, 96, 184),
    (140, 102, 78),
    (92, 192, 112),
)
BT709, BT601 = (0.2126, 0.0722), (0.299, 0.114)  # weights of red and blue


@pytest.mark.parametrize(("side", "off"), [(64, 1.1), (128, 2.1)])
@pytest.mark.parametrize(("matrix", "weights"), [(1, BT709), (5, BT601)])
@pytest.mark.parametrize("coded", CODED)
def test_colours_are_those_that_were_coded(
    coded: tuple[int, int, int], matrix: int, weights: tuple[float, float], side: int, off: float
) -> None:
    """Frames are reduced to a level; what is left as large goes through libswscale's own tables."""
    frame = av.VideoFrame(128, 128, "yuv420p")
    for plane, value in zip(frame.planes, coded, strict=True):
        plane.update(bytes([value]) * (plane.line_size * plane.height))
    frame.colorspace, frame.color_range = matrix, 1
    shown = upright(frame, side)
    assert shown.shape == (side, side, 3)
    np.testing.assert_allclose(shown.reshape(-1, 3).mean(axis=0), decoded(coded, weights), atol=off)


@pytest.mark.parametrize(("curve", "signal"), [(18, 0.75), (16, 0.5807)])
def test_diffuse_white_of_hdr_is_white(curve: int, signal: float) -> None:
    frame = av.VideoFrame(128, 128, "yuv420p10le")
    for plane, value in zip(frame.planes, (round(64 + 876 * signal), 512, 512), strict=True):
        plane.update(np.full(plane.buffer_size // 2, value, np.uint16).tobytes())
    frame.colorspace, frame.color_range, frame.color_trc, frame.color_primaries = 9, 1, curve, 9
    assert upright(frame, 64).min() >= 254


@pytest.mark.parametrize(("side", "stretch"), [(64, 1.0), (128, 1.0), (128, 0.5)])
def test_colours_of_hdr_are_its_own_at_every_size(side: int, stretch: float) -> None:
    coded, frame = (500, 560, 470), av.VideoFrame(128, 128, "yuv420p10le")
    for plane, value in zip(frame.planes, coded, strict=True):
        plane.update(np.full(plane.buffer_size // 2, value, np.uint16).tobytes())
    frame.colorspace, frame.color_range, frame.color_trc, frame.color_primaries = 9, 1, 18, 9
    signal = np.array(decoded((500 / 4, 560 / 4, 470 / 4), (0.2627, 0.0593))) / 255
    expected = to_srgb(np.round(signal * 65280).astype(np.uint16), "hlg", 9)
    shown = upright(frame, side, stretch)
    np.testing.assert_allclose(shown.reshape(-1, 3).mean(axis=0), expected, atol=0.6)


def decoded(coded: tuple[float, float, float], weights: tuple[float, float]) -> list[float]:
    """Red, green and blue of luma and both colour differences in the limited range of 8 bits."""
    luma, of_blue, of_red = (coded[0] - 16) / 219, (coded[1] - 128) / 224, (coded[2] - 128) / 224
    red, blue = luma + 2 * (1 - weights[0]) * of_red, luma + 2 * (1 - weights[1]) * of_blue
    green = (luma - weights[0] * red - weights[1] * blue) / (1 - sum(weights))
    return [float(np.clip(255 * value, 0, 255)) for value in (red, green, blue)]
