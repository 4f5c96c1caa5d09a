"""The network of normals before any training."""

from itertools import islice

import numpy as np
import torch

from export.stereo.network import NormalsNetwork
from export.stereo.samples import samples
from export.stereo.train import batch


def test_a_fresh_network_repeats_the_search_and_mirrors_with_its_input() -> None:
    chosen = list(islice(samples([], seed=3), 2))
    by_image, present, shared, _ = batch(chosen)
    network = NormalsNetwork().eval()
    with torch.inference_mode():
        normal, error = network(by_image, present, shared)
    inside = shared[:, -1] > 0
    cosine = (normal * shared[:, :3]).sum(dim=1)[inside]
    assert float(cosine.median()) > 0.98
    assert (error > 0).all()
    mirrored = batch(chosen, mirrored=True)
    np.testing.assert_allclose(mirrored[2][:, 0].flip(-1), -shared[:, 0])
    np.testing.assert_allclose(mirrored[3][:, 1].flip(-1), batch(chosen)[3][:, 1])
