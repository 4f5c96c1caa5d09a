"""Tests of dataset."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from PIL import Image

from export.crops.crops import load_sources
from export.crops.photos import PHOTO_COLUMNS, PHOTOS
from export.data.panoramas import DataError, Panorama, read_index
from export.training.dataset import TrainConfig, TrainingCrops, split_places, training_photos
from export.training.loop import _Run
from tests.helpers.panoramas import EXAMPLES_SPEC, source


def test_a_crop_number_is_the_same_crop_every_time(config: TrainConfig) -> None:
    sources = load_sources(read_index(config.data, "train"), config.labels)
    spec = _Run(config).spec
    one, two = TrainingCrops(sources, spec, config)[5], TrainingCrops(sources, spec, config)[5]
    for a, b in zip(one, two, strict=True):
        torch.testing.assert_close(a, b, equal_nan=True)


def test_the_light_around_two_places_that_share_a_crop_is_in_the_exposure_of_each(config: TrainConfig) -> None:
    one, other = source(place="a"), source(place="b")
    other = replace(other, panorama=replace(other.panorama, name="q", path=Path("q")))
    brighter = replace(other, levels=tuple(10 * level for level in other.levels))  # as its camera exposes, no change
    both = replace(config, joined=1.0, surroundings=True)
    same, scaled = (TrainingCrops([one, second], EXAMPLES_SPEC, both) for second in (other, brighter))
    for index in range(4):
        assert len(same._draw_sources(index)) == 2
        torch.testing.assert_close(same[index].photo, scaled[index].photo)
        torch.testing.assert_close(same[index].surroundings, scaled[index].surroundings, rtol=1e-4, atol=1e-4)


def test_sun_targets_narrow_while_the_run_goes_on(config: TrainConfig) -> None:
    settings = replace(config, crops=100, first_width=20.0)
    crops = TrainingCrops([source(place="a")], EXAMPLES_SPEC, settings)
    usual = TrainingCrops([source(place="a")], EXAMPLES_SPEC, replace(settings, first_width=0.0))
    peaks = [float(crops[index].sun.max()) for index in (0, 30, 60, 99)]
    assert peaks[0] < 0.5 * peaks[1] < 0.5 * peaks[2]
    torch.testing.assert_close(crops[99].sun, usual[99].sun)


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
    (tmp_path / PHOTOS).write_text("\n".join([",".join([*PHOTO_COLUMNS, "licence"]), *rows]), encoding="utf-8")
    config = TrainConfig(str(tmp_path), "labels.csv", "out", photos_share=0.5)
    assert len(training_photos(config)) == 3
    assert [p.row.licence for p in training_photos(replace(config, licensed_only=True))] == ["CC0"]
    assert training_photos(replace(config, photos_share=0.0)) == []
    (tmp_path / PHOTOS).unlink()
    with pytest.raises(DataError, match="no photo to learn from"):
        training_photos(config)
