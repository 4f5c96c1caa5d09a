"""Tests of procedural towns."""

import numpy as np
import pytest

from export.data import procedural_towns
from export.data.procedural_towns import (
    _KINDS,
    _STONE,
    Mesh,
    _box,
    _car,
    _color,
    _ground,
    _house,
    _join,
    _person,
    _roof,
    _rotate,
    _spot,
    _translate,
    _tree,
    _wall,
)
from tests.helpers.panoramas import ALBEDO, NOTHING, plain


def test_a_box_stands_on_the_ground_and_turns() -> None:
    box = _box(np.array([10.0, -4.0]), np.array([2.0, 3.0, 6.0]), 90.0, np.array(ALBEDO)).corners.reshape(-1, 3)
    np.testing.assert_allclose(box.min(axis=0), [7, 0, -5], atol=1e-9)
    np.testing.assert_allclose(box.max(axis=0), [13, 3, -3], atol=1e-9)


def test_meshes_join_turn_and_move() -> None:
    joined = _join([plain(), NOTHING])
    assert len(joined.corners) == len(joined.albedo) == 6
    np.testing.assert_allclose(_rotate(np.array([0.0, 2.0, 1.0]), 90.0), [1, 2, 0], atol=1e-12)
    np.testing.assert_allclose(_translate(np.array([1.0, 2.0, 3.0]), np.array([10.0, 20.0])), [11, 2, 23])


def test_a_seed_gives_one_place() -> None:
    (a, b), (c, d) = (procedural_towns.random_town(np.random.default_rng(5)) for _ in range(2))
    for one, other in ((a, c), (b, d)):
        np.testing.assert_array_equal(one.corners, other.corners)
        np.testing.assert_array_equal(one.albedo, other.albedo)


@pytest.mark.parametrize("kind", _KINDS)
def test_every_kind_of_place_is_sound(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(procedural_towns, "_KINDS", (kind,))
    for seed in range(4):
        for mesh in procedural_towns.random_town(np.random.default_rng(seed)):
            assert mesh.corners.shape == (len(mesh.albedo), 4, 3)
            assert np.isfinite(mesh.corners).all()
            assert ((mesh.albedo > 0) & (mesh.albedo < 0.9)).all()
            near = np.hypot(mesh.corners[..., 0], mesh.corners[..., 2]) < 50
            assert (mesh.corners[..., 1][near] > -1.0).all()


def generator() -> np.random.Generator:
    return np.random.default_rng(4)


@pytest.mark.parametrize("seed", range(4))
def test_houses_cars_and_people_stand_on_the_ground_where_they_are_put(seed: int) -> None:
    rng, centre = np.random.default_rng(seed), np.array([20.0, -30.0])
    for things in (_house(rng, centre, 30.0), _car(rng, centre, 30.0), _person(rng, centre)):
        corners = np.concatenate([mesh.corners.reshape(-1, 3) for mesh in things])
        assert corners[:, 1].min() == pytest.approx(0.0, abs=1e-9)
        middle = (corners.max(axis=0) + corners.min(axis=0))[[0, 2]] / 2
        assert np.abs(middle - centre).max() < 1.5


def test_a_tree_has_a_trunk_to_the_ground_and_leaves_above_it() -> None:
    leaves, trunk = _tree(generator(), np.array([5.0, 5.0]))
    assert len(leaves.corners) >= 700
    assert trunk.corners[..., 1].min() == 0.0
    assert leaves.corners[..., 1].mean() > 0.3 * trunk.corners[..., 1].max()


def test_a_roof_rises_over_its_box() -> None:
    size = np.array([10.0, 6.0, 8.0])
    corners = _roof(size, 2.5, 0.0, np.zeros(2), np.ones(3)).corners
    assert corners[..., 1].max() == pytest.approx(8.5)
    assert np.abs(corners[..., 2]).max() == pytest.approx(4.5)  # eaves of half a metre


def test_colours_are_albedos_and_spots_lie_between_their_distances() -> None:
    rng = generator()
    albedos = np.array([_color(rng, _STONE) for _ in range(50)])
    assert albedos.min() >= 0.02
    assert albedos.max() <= 0.85
    far = np.array([np.linalg.norm(_spot(rng, 5.0, 30.0)) for _ in range(200)])
    assert far.min() >= 5.0
    assert far.max() <= 30.0
    assert np.median(far) < 17.5  # more often near than far


def test_the_ground_is_level_around_the_camera_and_reaches_far() -> None:
    mesh: Mesh = _ground(generator())
    reach = np.hypot(mesh.corners[..., 0], mesh.corners[..., 2])
    assert np.abs(mesh.corners[..., 1][reach < 60]).max() == 0.0
    assert reach.max() == pytest.approx(900.0)
    low = _wall(generator(), 0.0).corners[..., 1]
    assert 0.5 <= low.max() <= 2.2
