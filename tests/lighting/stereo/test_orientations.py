"""Orientations face where they say."""

import numpy as np

from lighting.geometry import direction
from lighting.stereo.orientations import half_sphere, named_normals, normals_of_interest


def test_orientations_face_where_they_say() -> None:
    names, normals = named_normals(90.0)
    np.testing.assert_allclose(normals[[name for name, *_ in names].index("towards 45°")], direction(45.0, 0.0))
    assert (normals_of_interest(90.0) @ direction(90.0, 0.0) > 0).all()
    seen = half_sphere(180.0, 21)
    np.testing.assert_allclose(seen[10, 10], direction(180.0, 0.0), atol=1e-9)
    assert seen[10, 20] @ direction(90.0, 0.0) > 0.9  # a camera that looks north has east at its right
    assert half_sphere(None, 21)[0, 10] @ direction(0.0, 0.0) > 0.9  # north is up in the view from above
