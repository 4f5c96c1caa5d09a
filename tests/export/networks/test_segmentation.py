"""The branch that says what a canvas shows: its heads, its run, and the networks that may have it."""

from pathlib import Path

import pytest
import torch

from export.data.panoramas import DataError
from export.networks.outdoor import Outdoor, network_specs
from export.networks.segmentation import SegmentationBranch, SegmentationHead
from export.networks.weights import write_run

SPECS = network_specs("1.0.0")


def test_only_a_run_of_segments_is_read(tmp_path: Path) -> None:
    branch = SegmentationBranch(SegmentationHead(16), pretrained=False).eval()
    write_run(tmp_path / "segments", {"spec": {}}, branch.state_dict())
    maps = torch.rand(1, 24, 16, 16)
    with torch.inference_mode():
        assert torch.equal(SegmentationBranch.read(tmp_path / "segments")(maps), branch(maps))
    write_run(tmp_path / "other", {"spec": {}}, {"sun.weight": torch.zeros(1)})
    with pytest.raises(DataError, match="is not a run of `segments`"):
        SegmentationBranch.read(tmp_path / "other")


def test_a_network_that_begins_otherwise_gets_no_branch() -> None:
    with pytest.raises(DataError, match="does not begin with ImageNet's weights"):
        SegmentationBranch.check_beginning(Outdoor(SPECS["outdoor"]), 64, 64)


def test_a_network_with_the_pretrained_beginning_may_have_it() -> None:
    SegmentationBranch.check_beginning(Outdoor(SPECS["outdoor"], pretrained=True), 64, 64)
