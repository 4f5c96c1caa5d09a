"""Regions of lat-long pictures."""

import numpy as np
import pytest

from lighting.probe.regions import connected, is_clipped, solid_angle


def test_regions_join_across_the_seam_and_at_corners() -> None:
    mask = np.zeros((6, 12), bool)
    mask[2, :2] = mask[2, -2:] = True  # one region across the seam
    mask[4, 5] = mask[5, 6] = True  # one region by a corner
    regions = connected(mask)
    assert regions[2, 0] == regions[2, -1] != 0
    assert regions[4, 5] == regions[5, 6] != regions[2, 0]
    assert len(np.unique(regions[mask])) == 2
    assert (regions[~mask] == 0).all()


def test_solid_angles_of_all_pixels_make_a_sphere() -> None:
    area = solid_angle(16)
    assert area.shape == (16, 32)
    assert area.sum() == pytest.approx(4 * np.pi)
    assert area[7, 0] > 9 * area[0, 0]


def test_values_above_white_were_not_clipped() -> None:
    picture = np.full((4, 8, 3), 1.0, np.float32)
    assert is_clipped(picture)
    assert not is_clipped(picture * 1.01)
