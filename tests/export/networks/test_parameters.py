"""Raw values and parameters."""

import torch

from export.networks.parameters import decode, encode


def test_encode_and_decode_are_inverse() -> None:
    parameters = torch.tensor([[1.0, 0.01, -35.0, -10.0, 25.0], [10.0, 40.0, 35.0, 10.0, 90.0]])
    raw = torch.cat([encode(parameters), torch.zeros(2, 1)], dim=1)
    torch.testing.assert_close(decode(raw)[:, :5], parameters)
    assert (decode(raw)[:, 5] == 0.5).all()
