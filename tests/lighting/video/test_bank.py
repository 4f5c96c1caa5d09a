"""Which keyframes of a stream are remembered."""

import numpy as np
import pytest

from lighting.geometry import Floats
from lighting.turns.rays import rotation_about
from lighting.video.bank import BANK, FIRST, Bank, Kept
from lighting.video.follow import Key
from tests.lighting.video.clips import orientation


def key(number: int, stretch: int = 0) -> Key:
    return Key(number, stretch, number, 0.1 * number, np.zeros((2, 2), np.uint8))


def around(count: int) -> list[Floats]:
    """Orientations that are 15 deg or more apart: rounds at three elevations."""
    return [orientation(20.0 * (i % 18), 30.0 * (i // 18) - 30.0) for i in range(count)]


def filled(chains: list[int]) -> Bank:
    bank = Bank()
    for number, chain in enumerate(chains):
        bank.add(Kept(key(number), around(54)[number], chain))
    return bank


def test_a_chain_has_one_keyframe_of_a_direction() -> None:
    bank = Bank()
    for number, chain in enumerate((FIRST, FIRST, 1)):
        bank.add(Kept(key(number), orientation(5.0 * number), chain))
    assert [kept.key.number for kept in bank.kept] == [0, 2]


@pytest.mark.parametrize("chains", [[FIRST] * 40, [FIRST] * 5 + [1] * 49, [FIRST] * 30 + list(range(1, 25))])
def test_memory_is_bounded_and_the_first_frame_stays(chains: list[int]) -> None:
    bank = filled(chains)
    assert len(bank.kept) == BANK
    assert bank.kept[0].key.number == 0
    assert bank.kept[-1].key.number == len(chains) - 1


def test_a_stretch_that_is_not_linked_does_not_push_out_what_it_could_be_linked_by() -> None:
    bank = filled([FIRST] * 20 + [1] * 34)
    assert sum(kept.chain == FIRST for kept in bank.kept) == BANK // 2
    left = filled([FIRST] * 20 + [1] * 6 + [2] * 20)
    assert [sum(kept.chain == c for kept in left.kept) for c in (FIRST, 1, 2)] == [16, 0, 16]


def test_all_strangers_have_their_turn_and_the_nearest_are_always_compared() -> None:
    bank, seen = filled([FIRST] * 30), set[int]()
    for number in range(30, 60):
        now = {kept.key.number for kept in bank.strangers(key(number, 1), around(1)[0], 1)}
        assert {0, 1, 17} <= now
        assert len(now) == 6
        seen |= now
    assert seen == set(range(30))
    assert not bank.own(key(60, 1), around(1)[0], 1, 180.0)
    assert not bank.strangers(key(60), around(1)[0], FIRST)


def test_a_chain_that_is_joined_is_turned() -> None:
    bank, turn = filled([FIRST, 1, 1]), rotation_about(np.array([0.0, 1.0, 0.0]))
    bank.join(1, FIRST, turn)
    assert {kept.chain for kept in bank.kept} == {FIRST}
    for kept, before, turned in zip(bank.kept, around(3), (np.eye(3), turn, turn), strict=True):
        np.testing.assert_allclose(kept.orientation, before @ turned)
