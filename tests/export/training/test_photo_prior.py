"""How much lower suns stand in photos than in crops."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import DataError
from export.data.photos import COLUMNS
from export.training.photo_prior import _fit_scale, describe_prior


@pytest.mark.parametrize("scale", [30.0, 75.0, 150.0])
def test_the_scale_that_made_the_photos_is_found(scale: float) -> None:
    rng = np.random.default_rng(0)
    crops, weights = rng.uniform(0, 80, 4000), rng.uniform(0.5, 2.0, 4000)
    chance = weights * np.exp(-crops / scale)
    photos = rng.choice(crops, 40000, p=chance / chance.sum())
    found, gain = _fit_scale(crops, weights, photos)
    assert found == pytest.approx(scale, rel=0.15)
    assert gain > 0


def test_photos_like_the_crops_need_the_widest_scale() -> None:
    crops = np.linspace(0, 80, 500)
    assert _fit_scale(crops, np.ones(500), crops)[0] == 300.0


def test_the_scale_is_fitted_to_the_scenes_of_a_folder(data: Path, tmp_path: Path) -> None:
    (tmp_path / "panoramas").symlink_to(data / "panoramas")
    shutil.copy(data / "panoramas.csv", tmp_path)
    (tmp_path / "a.jpg").touch()  # no picture is read
    rows = [f"a.jpg,{group},0,{elevation},yes,60,5" for group, elevation in (("a", 5), ("a", 7), ("b", 9))]
    (tmp_path / "photos_train.csv").write_text("\n".join([",".join(COLUMNS), *rows]))
    assert describe_prior(tmp_path, data / "labels.csv").startswith("2 scenes: exp(-elevation / ")


def test_data_without_photos_are_refused(data: Path) -> None:
    with pytest.raises(DataError, match=r"no photo to learn from in .*photos_train\.csv"):
        describe_prior(data, data / "labels.csv")
