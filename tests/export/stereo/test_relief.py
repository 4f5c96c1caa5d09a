"""Procedural shapes."""

import numpy as np

from export.stereo.relief import relief


def test_reliefs_have_unit_normals_where_their_mask_is() -> None:
    rng = np.random.default_rng(0)
    for _ in range(12):
        surface = relief(64, rng)
        length = np.linalg.norm(surface.normals, axis=-1)
        np.testing.assert_allclose(length[surface.mask], 1, rtol=1e-5)
        assert not length[~surface.mask].any()
        assert surface.mask.any()
