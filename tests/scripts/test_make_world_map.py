"""The page's small map: outlines across its edge and around a pole."""

from scripts.make_world_map import copies, path_of, rings, unwrap


def test_an_outline_across_the_edge_is_at_both() -> None:
    ring = [(1790, 0), (-1790, 0), (-1790, 10), (1790, 10), (1790, 0)]
    points = unwrap(ring)
    assert points == [(1790, 0), (1810, 0), (1810, 10), (1790, 10), (1790, 0)]
    assert list(copies(points)) == [[(x - 3600, y) for x, y in points], points]


def test_land_around_the_pole_reaches_the_lower_edge() -> None:
    points = unwrap([(-1800, 700), (0, 650), (1750, 700), (-1800, 700)])
    assert points == [(-1800, 700), (0, 650), (1750, 700), (1800, 700), (1800, 900), (-1800, 900), (-1800, 700)]


def test_arcs_become_a_path() -> None:
    transform = {"scale": [1, 1], "translate": [-180, -90]}
    arcs = [[[180, 90], [1, 0]], [[180, 90], [0, 1], [1, -1]]]  # two ways from one point to another
    geometry = {"type": "MultiPolygon", "arcs": [[[0, ~1]]]}
    (ring,) = rings({"transform": transform, "arcs": arcs, "objects": {"land": {"geometries": [geometry]}}})
    assert path_of(ring) == "M0 0l10 0-10-10z"
