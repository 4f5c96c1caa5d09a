"""Sizes of pictures that are made smaller or larger."""

import pytest
from hypothesis import given
from hypothesis.strategies import integers

from lighting.sizes import fitting, scaled, shrunk

SIDES = integers(1, 20_000)


@pytest.mark.parametrize(
    ("size", "side", "expected"),
    [((4000, 3000), 448, (448, 336)), ((3000, 4001), 1024, (768, 1024)), ((300, 200), 300, (300, 200))],
)
def test_pictures_are_shrunk_and_never_grow(size: tuple[int, int], side: int, expected: tuple[int, int]) -> None:
    assert shrunk(*size, side) == expected


@given(SIDES, SIDES, SIDES)
def test_the_longer_side_is_what_is_asked_for(width: int, height: int, side: int) -> None:
    found = shrunk(width, height, side)
    assert max(found) == min(side, max(width, height))
    assert min(found) >= 1


@given(SIDES, SIDES, SIDES, SIDES)
def test_a_box_is_filled_one_way(width: int, height: int, most_width: int, most_height: int) -> None:
    found = fitting(width, height, most_width, most_height)
    assert 1 <= found[0] <= most_width
    assert 1 <= found[1] <= most_height
    assert found[0] == most_width or found[1] == most_height


def test_no_picture_is_empty() -> None:
    assert scaled(1000, 1, 0.01) == (10, 1)
