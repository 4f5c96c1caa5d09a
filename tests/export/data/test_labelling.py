"""Which sun a label takes, and which sky it trusts."""

import dataclasses
import math
from pathlib import Path

import pytest

from export.data.labelling import label_panorama
from export.data.panoramas import Panorama, read_index
from export.data.synthetic import write_dataset


def test_a_given_sun_wins_over_the_found_one(tmp_path: Path) -> None:
    write_dataset(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    moved = dataclasses.replace(panorama, sun_azimuth=10.0, sun_elevation=20.0, sun_uncertainty=None)
    label = label_panorama(moved)
    assert (label.sun_azimuth, label.sun_elevation, label.sun_source) == (10.0, 20.0, "given")
    assert label.sun_uncertainty > 0
    assert label.found_azimuth == pytest.approx(panorama.sun_azimuth, abs=3.0)


@pytest.mark.parametrize(
    ("sun", "label", "source"), [("unknown", "", "found"), ("unknown", "by eye", "none"), ("none", "", "none")]
)
def test_a_found_sun_is_used_only_where_nobody_looked(tmp_path: Path, sun: str, label: str, source: str) -> None:
    write_dataset(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    bare = Panorama("a", panorama.path, "ldr", "here", "train", sun, label=label)
    labelled = label_panorama(bare)
    assert labelled.sun_source == source
    assert math.isnan(labelled.sun_azimuth) == (source == "none")
    assert math.isnan(labelled.turbidity) == (source == "none")
    assert not math.isnan(labelled.found_azimuth)


def test_the_fit_of_an_altered_sky_is_not_trusted(tmp_path: Path) -> None:
    write_dataset(tmp_path, 1, 64)
    (panorama,) = read_index(tmp_path)
    assert label_panorama(panorama).fit_ok
    assert not label_panorama(dataclasses.replace(panorama, notes="strong HDR tone mapping")).fit_ok
