"""The folder of rendered places."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from export.__main__ import export_cli
from export.crops.cameras import Camera
from export.crops.crops import _load_source, crop_panorama
from export.data import town_dataset
from export.data.labels import read_labels, write_labels
from export.data.panoramas import read_index
from export.networks.outdoor import network_specs
from lighting.geometry import angle_between, direction
from lighting.probe.sun_detection import find_sun


@pytest.mark.usefixtures("llvm")
def test_a_folder_is_filled_gone_on_with_and_read(tmp_path: Path) -> None:
    run = CliRunner().invoke
    folder = tmp_path / "towns"
    command = ["synthesize", "--out", str(folder), "--height", "32", "--count"]
    assert run(export_cli, [*command, "2"]).exit_code == 0
    before = (folder / "panoramas" / "town_00000.exr").stat().st_mtime_ns
    assert run(export_cli, [*command, "4"]).exit_code == 0
    assert (folder / "panoramas" / "town_00000.exr").stat().st_mtime_ns == before
    panoramas, labels = read_index(folder, "train"), read_labels(folder / town_dataset.LABELS)
    assert [p.name for p in panoramas] == [label.name for label in labels] == [f"town_{i:05d}" for i in range(4)]
    write_labels(labels[:2], folder / town_dataset.LABELS)  # as if killed between the index and the labels
    assert run(export_cli, [*command, "4"]).exit_code == 0
    assert len(read_index(folder, "train")) == len(read_labels(folder / town_dataset.LABELS)) == 4
    again = town_dataset._render_town(1, 32)
    assert again.label.sun_elevation == pytest.approx(labels[1].sun_elevation, rel=1e-5)
    crop = crop_panorama(
        _load_source(panoramas[1], labels[1]), Camera(20, 0, 0, 60, 4 / 3), network_specs("0")["outdoor"]
    )
    assert np.isfinite(crop.linear).all()


@pytest.mark.parametrize(
    ("share", "numbers"), [(0.2, [4, 9]), (0.5, [1, 3, 5, 7, 9]), (0.0, []), (1.0, list(range(10)))]
)
def test_a_share_of_the_towns_is_held_out_evenly(share: float, numbers: list[int]) -> None:
    assert [number for number in range(10) if town_dataset._split_of(number, share) == "val"] == numbers


@pytest.mark.usefixtures("llvm")
def test_visible_suns_are_found_where_the_labels_have_them() -> None:
    errors = []
    for number in range(7):
        rendered = town_dataset._render_town(number, 64)
        label, found = rendered.label, find_sun(rendered.radiance)
        if rendered.sun_visible:
            assert found is not None
            errors.append(angle_between(found.direction, direction(label.sun_azimuth, label.sun_elevation)))
    assert len(errors) >= 4
    assert np.median(errors) < 1.5
