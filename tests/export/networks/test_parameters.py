"""Raw values and parameters."""

import pytest
import torch

from export.networks.parameters import BINS, ROLL_SCALE, binned, decode, encode, expected, roll_spread


def test_encode_and_decode_are_inverse() -> None:
    parameters = torch.tensor([[1.0, 0.01, -35.0, -10.0, 25.0], [10.0, 40.0, 35.0, 10.0, 90.0]])
    raw = torch.cat([encode(parameters), torch.zeros(2, 1)], dim=1)
    torch.testing.assert_close(decode(raw)[:, :5], parameters)
    assert (decode(raw)[:, 5] == 0.5).all()


def test_the_mean_of_a_target_s_bins_is_the_target() -> None:
    camera = encode(torch.tensor([[1.0, 1.0, 12.3, -38.0, 91.0], [1.0, 1.0, -31.0, 0.4, 27.0]]))[:, 2:5]
    target = binned(camera)
    assert target.shape == (2, 3, BINS)
    torch.testing.assert_close(expected(target.clamp_min(1e-12).log()), camera, rtol=1e-3, atol=1e-3)


def test_the_spread_of_a_roll_is_what_its_bins_have_beyond_their_target() -> None:
    camera = encode(torch.tensor([[1.0, 1.0, 12.3, -8.0, 91.0], [1.0, 1.0, 12.3, 8.0, 91.0]]))[:, 2:5]
    one, other = binned(camera)
    sure, torn = ROLL_SCALE * roll_spread(torch.stack([one, 0.5 * (one + other)]).clamp_min(1e-12).log())
    assert float(sure) < 0.1
    assert float(torn) == pytest.approx(8.0, rel=0.01)
