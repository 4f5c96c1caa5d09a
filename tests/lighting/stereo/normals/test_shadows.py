"""Cast shadows that begin or end during a day."""

import numpy as np

from lighting.stereo.days import in_grey
from lighting.stereo.normals.frame import Pose
from lighting.stereo.normals.search import candidates, search
from lighting.stereo.normals.shadows import patterns, search_shadowed, shadowed
from lighting.stereo.skies import clear_skies
from tests.lighting.stereo.sphere import angles, june_suns


def test_a_shadow_in_the_morning_is_found() -> None:
    skies = in_grey(clear_skies(june_suns()))
    truth = np.array([[0.0, 0.5, 0.866], [0.3, 0.3, 0.9]], dtype=np.float32)
    truth /= np.linalg.norm(truth, axis=1, keepdims=True)
    sunny, shade = candidates(skies, Pose(), 3000), shadowed(skies, Pose())
    assert shade is not None
    nearest = (truth @ shade.normals[:700].T).argmax(axis=1)
    hidden = next(row for row, lit in enumerate(patterns(8)) if (~lit).sum() == 3 and not lit[0])
    rows = hidden * 700 + nearest
    images = 0.5 * np.swapaxes(shade.brightness[:, rows], 0, 1).swapaxes(1, 2)
    noise = 0.01 * float(images.max())
    plain = search(images, sunny, noise)
    found = search_shadowed(images, sunny, shade, noise)
    assert angles(plain.normal, shade.normals[rows]).min() > 8
    assert angles(found.normal, shade.normals[rows]).max() < 3
    assert (found.residual < plain.residual).all()


def test_patterns_leave_three_photos_in_the_sun() -> None:
    lit = patterns(8)
    assert lit[0].all()
    assert len(lit) == 11
    assert lit.sum(axis=1).min() == 3
    assert shadowed(in_grey(clear_skies(june_suns()[:3])), Pose()) is None
