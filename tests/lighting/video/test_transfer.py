"""HDR curves against the values that the recommendations print."""

import numpy as np
import pytest

from lighting.colour import srgb_encode
from lighting.video.transfer import hlg_decode, pq_decode, to_srgb


def test_pq_reaches_the_levels_of_bt2408() -> None:
    """Table 1 of the report: 58 % is 203 cd/m2, 75 % 983 cd/m2, 38 % 26 cd/m2 (18 % grey)."""
    light = pq_decode([0.38, 0.58, 0.75, 1.0]) * 203.0
    np.testing.assert_allclose(light, [26, 203, 983, 10000], rtol=0.03)  # signals are rounded to per cents


def test_hlg_is_one_at_diffuse_white_and_twelve_times_its_knee_at_the_top() -> None:
    assert hlg_decode(0.75) == pytest.approx(1.0)
    assert hlg_decode(1.0) / hlg_decode(0.5) == pytest.approx(12.0, rel=1e-4)
    assert hlg_decode(0.38) == pytest.approx(0.18, abs=0.01)  # BT.2408: 18 % grey


@pytest.mark.parametrize("curve", ["hlg", "pq"])
def test_grey_stays_grey_and_white_is_white(curve: str) -> None:
    signal = {"hlg": 0.75, "pq": 0.5807}[curve]
    coded = np.full((2, 2, 3), round(signal * 65280), dtype=np.uint16)
    assert np.all(to_srgb(coded, curve, 9) >= 254)
    darker = to_srgb(coded // 2, curve, 9)
    assert np.ptp(darker) <= 1
    assert darker.max() < 200


def test_dark_greys_are_no_darker_than_their_light() -> None:
    coded = np.repeat(np.arange(200, 8000, dtype=np.uint16)[:, None], 3, axis=1)
    wanted = 255.0 * srgb_encode(hlg_decode(coded / 65280.0))
    assert np.mean(to_srgb(coded, "hlg", 1) - wanted) == pytest.approx(0.0, abs=0.05)


def test_primaries_of_bt2020_are_more_saturated_than_those_of_bt709() -> None:
    coded = np.array([[[40000, 25000, 25000]]], dtype=np.uint16)
    wide, narrow = (to_srgb(coded, "hlg", primaries)[0, 0].astype(int) for primaries in (9, 1))
    assert wide[0] > narrow[0]
    assert wide[1] < narrow[1]
