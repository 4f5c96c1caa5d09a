"""Procedural places."""

import numpy as np
import pytest

from export.towns import place
from export.towns.place import KINDS


def test_a_seed_gives_one_place() -> None:
    (a, b), (c, d) = (place.place(np.random.default_rng(5)) for _ in range(2))
    for one, other in ((a, c), (b, d)):
        np.testing.assert_array_equal(one.corners, other.corners)
        np.testing.assert_array_equal(one.albedo, other.albedo)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_place_is_sound(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(place, "KINDS", (kind,))
    for seed in range(4):
        for mesh in place.place(np.random.default_rng(seed)):
            assert mesh.corners.shape == (len(mesh.albedo), 4, 3)
            assert np.isfinite(mesh.corners).all()
            assert ((mesh.albedo > 0) & (mesh.albedo < 0.9)).all()
            near = np.hypot(mesh.corners[..., 0], mesh.corners[..., 2]) < 50
            assert (mesh.corners[..., 1][near] > -1.0).all()
