"""Edges of pictures that run about as the world's verticals would."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.evidence.lines import AROUND, Lines, edges_of
from lighting.geometry import Floats, up_in_camera

FOCAL = 300.0  # pixels
LEVEL = up_in_camera(0.0, 0.0)


def bar(leaning: float, width: float = 40.0, size: int = 120) -> NDArray[np.uint8]:
    """A smooth bright bar through the middle of a grey picture, leaning to the right by an angle [deg]."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    angle = np.radians(leaning)
    across = x * np.cos(angle) + y * np.sin(angle)
    return np.asarray(80 + 100 * np.clip(width / 2 + 0.5 - np.abs(across), 0, 1), dtype=np.uint8)


def found(grey: NDArray[np.uint8], up: Floats = LEVEL) -> Lines:
    return edges_of(grey, up, FOCAL).upright


def turned(angle: Floats, expected: float) -> Floats:
    """How far lines at angles [deg] are from one at another, whichever way they are followed."""
    return np.asarray(np.abs((angle - expected + 90.0) % 180.0 - 90.0))


@pytest.mark.parametrize("leaning", [-17.0, -3.0, 0.0, 0.5, 9.0, 20.0])
def test_both_edges_of_a_bar_lean_as_it_does(leaning: float) -> None:
    lines = found(bar(leaning))
    longest = lines.longest(2)
    assert longest.angle == pytest.approx([leaning] * 2, abs=0.2)
    assert longest.middle[:, 1] == pytest.approx([0.0, 0.0], abs=0.01)
    assert np.sort(longest.middle[:, 0]) == pytest.approx(
        np.array([-20, 20]) / np.cos(np.radians(leaning)) / 120, abs=0.02
    )
    assert (longest.length > 110).all()


def test_what_leans_too_far_or_lies_is_no_vertical() -> None:
    assert len(found(bar(AROUND + 12.0)).length) == 0
    assert len(found(bar(90.0)).length) == 0


@pytest.mark.parametrize("leaning", [90.0, 80.0, 60.0, -45.0, -70.0, AROUND + 12.0])
def test_what_leans_further_is_found_apart(leaning: float) -> None:
    edges = edges_of(bar(leaning), LEVEL, FOCAL)
    assert len(edges.upright.length) == 0
    longest = edges.other.longest(2)
    assert (turned(longest.angle, leaning) < 0.3).all()
    assert (longest.length > 100).all()


def test_a_corner_makes_two_edges() -> None:
    """Of a bright square, whose sides run both ways at 45 deg."""
    y, x = np.mgrid[:160, :160] - 79.5
    square = (80 + 100 * np.clip(50.5 - (np.abs(x) + np.abs(y)), 0, 1)).astype(np.uint8)
    sides = edges_of(square, LEVEL, FOCAL).other.longest(4)
    assert sorted(np.minimum(turned(sides.angle, 45.0), turned(sides.angle, -45.0)) < 1.0) == [True] * 4
    assert sorted(turned(sides.angle, 45.0) < 5.0) == [False, False, True, True]


def test_a_rolled_camera_expects_leaning_edges() -> None:
    """A camera that is turned clockwise sees verticals turned counter-clockwise: they lean to the left."""
    turned = up_in_camera(0.0, 30.0)
    assert len(found(bar(30.0), turned).length) == 0
    assert found(bar(-30.0), turned).longest(2).angle == pytest.approx([-30.0] * 2, abs=0.2)


def test_a_camera_that_looks_up_expects_verticals_that_lean_inwards() -> None:
    """Beside the middle of the picture: to the right of it, they lean to the left."""
    grey = bar(-28.0)
    shifted = np.pad(grey, ((0, 0), (400, 0)), mode="edge")
    up = up_in_camera(40.0, 0.0)
    assert len(found(shifted, up).length) >= 2
    assert len(found(shifted[:, ::-1].copy(), up_in_camera(-40.0, 0.0)).length) == 0


def test_dark_beside_bright_is_another_edge_than_bright_beside_dark() -> None:
    """The two sides of a thin bright wire stay apart."""
    lines = found(bar(2.0, width=3.0))
    assert len(lines.length) == 2
    assert lines.angle == pytest.approx([2.0] * 2, abs=0.5)


def test_a_shade_is_no_edge() -> None:
    ramp = np.tile(np.linspace(0, 255, 20), (60, 1))
    assert len(found(ramp.astype(np.uint8)).length) == 0


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (2, 2), (30, 50)])
def test_a_blank_picture_of_any_size_has_no_edges(shape: tuple[int, int]) -> None:
    lines = found(np.full(shape, 90, dtype=np.uint8))
    assert len(lines.length) == len(lines.angle) == len(lines.middle) == 0


def test_the_longest_are_kept() -> None:
    lines = Lines(np.arange(6.0).reshape(3, 2), np.array([1.0, 2.0, 3.0]), np.array([30.0, 10.0, 20.0]))
    assert sorted(lines.longest(2).angle) == [1.0, 3.0]
    assert lines.longest(3) is lines
