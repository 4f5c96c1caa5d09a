"""The picture of rendered places."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.data.tables import DataError
from export.towns import dataset
from export.training import samples


@pytest.mark.usefixtures("llvm")
def test_samples_are_one_crop_of_each_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(samples, "DOWN", 1)
    dataset.synthesize(tmp_path / "towns", 8, 16)
    samples.write_samples(tmp_path / "towns", tmp_path / "samples.jpg")
    with Image.open(tmp_path / "samples.jpg") as picture:
        assert picture.size == (8 * 224, 168)
        tiles = np.asarray(picture, float).reshape(168, 8, 224, 3).mean(axis=(0, 2, 3))
    assert len(np.unique(np.round(tiles))) > 4
    monkeypatch.setattr(samples, "DOWN", 2)
    with pytest.raises(DataError, match="holds 8 places; the picture shows 16"):
        samples.write_samples(tmp_path / "towns", tmp_path / "more.jpg")
    assert not (tmp_path / "more.jpg").exists()
