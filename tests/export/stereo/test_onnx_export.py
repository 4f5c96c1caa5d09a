"""The comparison of torch with an ONNX file."""

import torch

from export.stereo.onnx_export import TOLERANCE, _parity, _Served
from export.stereo.train import NormalsNetwork
from lighting.stereo.network import BY_IMAGE, SHARED, _packaged_network


def test_a_file_of_another_network_differs() -> None:
    assert _parity(NormalsNetwork().eval(), _packaged_network()) > 10 * TOLERANCE


def test_what_is_served_has_every_image() -> None:
    torch.manual_seed(0)
    network = NormalsNetwork().eval()
    by_image, shared = torch.randn(1, 4, BY_IMAGE, 16, 16), torch.rand(1, SHARED, 16, 16)
    with torch.inference_mode():
        served, whole = _Served(network)(by_image, shared), network(by_image, torch.ones(1, 4), shared)
    assert torch.equal(served[0], whole[0])
    assert torch.equal(served[1], whole[1])
