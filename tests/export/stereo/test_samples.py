"""Training samples."""

import numpy as np

from export.stereo.samples import CROP, samples


def test_samples_are_the_same_for_the_same_seed() -> None:
    first, second = (next(samples([], seed=5)) for _ in range(2))
    assert first.truth.shape == (3, CROP, CROP)
    np.testing.assert_array_equal(first.by_image, second.by_image)
    inside = first.shared[-1] > 0
    np.testing.assert_allclose(np.linalg.norm(first.truth[:, inside].astype(float), axis=0), 1, atol=2e-3)
