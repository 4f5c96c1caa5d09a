"""Which places a run holds out, and which photos it learns from."""

from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from export.data.panoramas import Panorama
from export.data.photos import COLUMNS, PHOTOS
from export.data.tables import DataError
from export.training.config import TrainConfig
from export.training.sources import split_places, training_photos


def test_places_are_held_out_whole_and_by_name() -> None:
    panoramas = [
        Panorama(f"{place}-{i}", Path("x"), "ldr", f"place {place}", "train") for place in range(60) for i in range(3)
    ]
    kept, held_out = split_places(panoramas, 0.2)
    assert {p.place for p in kept}.isdisjoint({p.place for p in held_out})
    assert 3 < len({p.place for p in held_out}) < 24
    assert [p.name for p in split_places(panoramas[:90], 0.2)[1]] == [p.name for p in held_out if p in panoramas[:90]]


def test_a_run_on_permissive_data_alone_learns_from_no_other_photo(tmp_path: Path) -> None:
    Image.new("RGB", (40, 32)).save(tmp_path / "a.png")
    rows = [f"a.png,{licence},1,2,yes,50,15,{licence}" for licence in ("none stated", "GPL", "CC0")]
    (tmp_path / PHOTOS).write_text("\n".join([",".join([*COLUMNS, "licence"]), *rows]), encoding="utf-8")
    config = TrainConfig(str(tmp_path), "labels.csv", "out", photos_share=0.5)
    assert len(training_photos(config)) == 3
    assert [p.row.licence for p in training_photos(replace(config, licensed_only=True))] == ["CC0"]
    assert training_photos(replace(config, photos_share=0.0)) == []
    (tmp_path / PHOTOS).unlink()
    with pytest.raises(DataError, match="no photo to learn from"):
        training_photos(config)
