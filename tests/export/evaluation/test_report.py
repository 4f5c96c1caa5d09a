"""Tests of the report."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.data.panoramas import DataError
from export.evaluation.metrics import answers_from_sun, camera_figures, sun_figures
from export.evaluation.report import (
    format_report,
    in_view_report,
    median_by_scene,
    photo_bias,
    photo_figures,
    photo_report,
    stated_figures,
    sun_bins,
)
from lighting.geometry import angles, direction
from lighting.model import Model
from tests.helpers.panoramas import truth_of


def test_figures_are_rounded_as_the_tables_show_them() -> None:
    truth = truth_of(2)
    count = len(truth.sun)
    ones = np.ones(count)
    said = answers_from_sun(
        direction(np.linspace(-170, 170, count), np.full(count, 33.3)),
        radius_50=40 * ones,
        radius_90=90 * ones,
        nll=ones,
        camera=truth.camera + 1.23,
        visibility=ones,
        turbidity=4.56 * ones,
        exposure=0.3 * ones,
    )
    stated = stated_figures(truth, said)
    sun, camera = sun_figures(truth, said), camera_figures(truth, said)
    assert stated["crops"] == count
    assert stated["sun_median"] == round(sun["median"], 1)
    assert stated["sun_elevation_median"] == 6.7
    assert stated["camera_elevation_median"] == round(camera["elevation"], 1) == 1.2
    assert stated["turbidity_median"] == 1.6


def test_a_protocol_without_suns_has_no_figures_of_suns() -> None:
    truth = truth_of(1, scored=False)
    assert stated_figures(truth, answers_from_sun(truth.sun, camera=truth.camera))["sun_median"] is None


def test_a_scene_counts_once_however_many_photos_it_has() -> None:
    assert median_by_scene(np.array([1.0, 1.0, 1.0, 9.0, 5.0]), np.array(["a", "a", "a", "b", "c"])) == 5.0


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
    figures, trust = text.split("Trust and candidates, 1 photos")
    assert figures.splitlines()[-2].startswith("| tiny | ")
    assert trust.splitlines()[-1].startswith(("| sure | 1 ", "| unsure | 1 ", "| no sun | 1 "))


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


def turned(by: float) -> np.ndarray:
    azimuth, elevation = angles(truth_of(4).sun)
    return direction(azimuth + by, elevation)


def test_each_crop_is_in_one_bin_of_elevation_and_one_of_view() -> None:
    truth = truth_of(4, elevation=45.0)
    found = sun_bins(truth)
    assert list(found) == ["sun 45 to 90°", "sky in view"]  # empty bins are left out; a bin begins at its lower end
    assert all(chosen.all() for chosen in found.values())


def test_intervals_compare_ours_with_each_other_method() -> None:
    truth = truth_of(4)
    said = {name: answers_from_sun(turned(by), camera=truth.camera) for name, by in (("ours", 10.0), ("worse", 40.0))}
    ours, worse = format_report("paper", truth, said, said).split("bootstrap over")[1].splitlines()[4:6]
    assert ours.split(" | ")[3] == ""
    low, high = (float(end) for end in worse.split(" | ")[3].split(" to "))
    assert low <= high < 0  # ours has the smaller error


def test_a_protocol_counts_its_crops_and_names_every_method() -> None:
    truth = truth_of(4)
    camera = {"camera": truth.camera, "exposure": truth.exposure}
    said = {"ours": answers_from_sun(turned(10.0), **camera), "other": answers_from_sun(turned(40.0))}
    alone = {"ours": said["ours"]}
    text = format_report("paper", truth, said, alone)
    assert "## Protocol `paper`: 32 crops, 32 with a sun to score (4 panoramas of 2 places)" in text
    assert sum(line.startswith("| other |") for line in text.splitlines()) == 3  # it says nothing of the camera
    assert sum(line.startswith("| ours |") for line in text.splitlines()) > 4
    assert "by the networks alone, without the straight lines" in text
    assert "32 crops of 4 panoramas" in in_view_report(truth, said, "| what metadata add |")
