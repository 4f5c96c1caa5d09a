"""Accuracy on photos: medians over scenes."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.data import DataError
from export.evaluation.photos import by_scene, photo_bias, photo_figures, photo_report
from lighting.geometry import direction
from lighting.model import Model


def test_a_scene_counts_once_however_many_photos_it_has() -> None:
    assert by_scene(np.array([1.0, 1.0, 1.0, 9.0, 5.0]), np.array(["a", "a", "a", "b", "c"])) == 5.0


def test_errors_cross_the_seam() -> None:
    truth, sun = direction([175.0], [30.0]), direction([-175.0], [34.0])
    figures = photo_figures(truth, sun, np.array(["a"]))
    assert figures["azimuth"] == pytest.approx(10.0)
    assert figures["elevation"] == pytest.approx(4.0)


def test_photos_without_a_known_sun_are_left_out(tmp_path: Path, network: Path) -> None:
    Image.new("RGB", (64, 48), (90, 120, 200)).save(tmp_path / "a.png")
    index = tmp_path / "photos.csv"
    index.write_text("file,group,sun_azimuth,sun_elevation\na.png,x,20,30\nnone.png,y,,\n", encoding="utf-8")
    text = photo_report(index, {"tiny": Model.load(network)})
    assert "All that have an azimuth: 1 scenes, 1 photos" in text
    assert text.splitlines()[-1].startswith("| tiny | ")


def test_low_suns_answered_high_show_as_a_bias() -> None:
    """Two scenes with direct sun at 8 deg, answered 6 and 10 deg too high; photos in shade do not count."""
    elevation = np.array([8.0, 8.0, 8.0])
    sun = direction([0.0, 50.0, 0.0], [14.0, 18.0, 80.0])
    found = photo_bias(elevation, sun, np.array(["a", "b", "c"]), np.array([True, True, False]))
    assert found["0 to 10°"] == pytest.approx(8.0)
    assert np.isnan(found["45 to 90°"])


def test_a_list_without_groups_is_refused(tmp_path: Path) -> None:
    (tmp_path / "photos.csv").write_text("file,sun_azimuth,sun_elevation\n", encoding="utf-8")
    with pytest.raises(DataError, match="no column group"):
        photo_report(tmp_path / "photos.csv", {})
