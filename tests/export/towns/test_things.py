"""The things that stand in a place."""

import numpy as np
import pytest

from export.towns.mesh import Mesh
from export.towns.things import STONE, car, colour, ground, house, person, roof, spot, tree, wall


def generator() -> np.random.Generator:
    return np.random.default_rng(4)


@pytest.mark.parametrize("seed", range(4))
def test_houses_cars_and_people_stand_on_the_ground_where_they_are_put(seed: int) -> None:
    rng, centre = np.random.default_rng(seed), np.array([20.0, -30.0])
    for things in (house(rng, centre, 30.0), car(rng, centre, 30.0), person(rng, centre)):
        corners = np.concatenate([mesh.corners.reshape(-1, 3) for mesh in things])
        assert corners[:, 1].min() == pytest.approx(0.0, abs=1e-9)
        middle = (corners.max(axis=0) + corners.min(axis=0))[[0, 2]] / 2
        assert np.abs(middle - centre).max() < 1.5


def test_a_tree_has_a_trunk_to_the_ground_and_leaves_above_it() -> None:
    leaves, trunk = tree(generator(), np.array([5.0, 5.0]))
    assert len(leaves.corners) >= 700
    assert trunk.corners[..., 1].min() == 0.0
    assert leaves.corners[..., 1].mean() > 0.3 * trunk.corners[..., 1].max()


def test_a_roof_rises_over_its_box() -> None:
    size = np.array([10.0, 6.0, 8.0])
    corners = roof(size, 2.5, 0.0, np.zeros(2), np.ones(3)).corners
    assert corners[..., 1].max() == pytest.approx(8.5)
    assert np.abs(corners[..., 2]).max() == pytest.approx(4.5)  # eaves of half a metre


def test_colours_are_albedos_and_spots_lie_between_their_distances() -> None:
    rng = generator()
    albedos = np.array([colour(rng, STONE) for _ in range(50)])
    assert albedos.min() >= 0.02
    assert albedos.max() <= 0.85
    far = np.array([np.linalg.norm(spot(rng, 5.0, 30.0)) for _ in range(200)])
    assert far.min() >= 5.0
    assert far.max() <= 30.0
    assert np.median(far) < 17.5  # more often near than far


def test_the_ground_is_level_around_the_camera_and_reaches_far() -> None:
    mesh: Mesh = ground(generator())
    reach = np.hypot(mesh.corners[..., 0], mesh.corners[..., 2])
    assert np.abs(mesh.corners[..., 1][reach < 60]).max() == 0.0
    assert reach.max() == pytest.approx(900.0)
    low = wall(generator(), 0.0).corners[..., 1]
    assert 0.5 <= low.max() <= 2.2
