"""Pictures of surfaces against shadows and brightnesses known in closed form."""

import numpy as np

from export.stereo.shading import Material, cast_shadows, shade
from export.stereo.surfaces import of_height
from lighting.stereo.mean_light import Skies
from lighting.stereo.normals.frame import Pose


def test_a_wall_casts_a_shadow_as_long_as_the_sun_is_low() -> None:
    height = np.zeros((40, 80), dtype=np.float32)
    height[:, :10] = 12.0
    surface = of_height(height, np.ones_like(height, dtype=bool))
    sun = np.array([-1.0, 0.0, 0.5])  # from the left, falling one pixel in two
    pixels = np.array([[20, column] for column in range(12, 80)])
    lit = cast_shadows(surface, pixels, (sun / np.linalg.norm(sun))[None])[:, 0]
    edge = 12 + int(np.flatnonzero(lit)[0])
    assert abs(edge - (10 + 24)) <= 3
    assert lit[edge - 12 :].all()


def test_shading_is_lamberts_under_a_single_light() -> None:
    light = np.array([[0.6, 0.0, 0.8]])
    skies = Skies(np.zeros((1, 4, 8, 1), np.float32), light, np.full((1, 1), np.pi))
    normals = np.array([[0, 0, 1], [0.6, 0, 0.8], [-0.8, 0, 0.6]], dtype=np.float32)
    matt = Material(np.full(3, 0.5, np.float32))
    np.testing.assert_allclose(shade(normals, skies, Pose(), matt, None)[:, 0, 0], [0.4, 0.5, 0.0], atol=1e-3)
    shadow = shade(normals, skies, Pose(), matt, np.zeros((3, 1), dtype=bool))
    np.testing.assert_allclose(shadow, 0, atol=1e-6)
    glossy = shade(normals, skies, Pose(), Material(matt.albedo, 0.1), None)
    assert (glossy[:2] > shade(normals, skies, Pose(), matt, None)[:2]).all()
