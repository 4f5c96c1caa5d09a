"""Which places a run holds out."""

from pathlib import Path

from export.data.panoramas import Panorama
from export.training.sources import split_places


def test_places_are_held_out_whole_and_by_name() -> None:
    panoramas = [
        Panorama(f"{place}-{i}", Path("x"), "ldr", f"place {place}", "train") for place in range(60) for i in range(3)
    ]
    kept, held_out = split_places(panoramas, 0.2)
    assert {p.place for p in kept}.isdisjoint({p.place for p in held_out})
    assert 3 < len({p.place for p in held_out}) < 24
    assert [p.name for p in split_places(panoramas[:90], 0.2)[1]] == [p.name for p in held_out if p in panoramas[:90]]
