"""Measured skies at the moments of photos."""

from pathlib import Path

import numpy as np
import pytest

from lighting.errors import EnvironmentMapError
from lighting.files.exr import write_exr
from lighting.stereo.normals.probes import nearest_skies


def fill(folder: Path) -> None:
    """Probes at 10, 10:30 and 11 h, each brighter than the one before."""
    for level, name in enumerate(("100000", "103000", "110000"), 1):
        (folder / "20260621" / name).mkdir(parents=True)
        image = np.full((8, 16, 3), level, dtype=np.float32)
        image[2, 8] = 1000
        write_exr(folder / "20260621" / name / "envmap.exr", image)


def test_each_photo_gets_the_nearest_probe(tmp_path: Path) -> None:
    fill(tmp_path)
    times = np.array(["2026-06-21T10:56", "2026-06-21T10:03", "2026-06-21T10:28"], dtype="datetime64[us]")
    skies = nearest_skies(tmp_path, times, 0.0)
    np.testing.assert_allclose(skies.radiance[:, -1].mean(axis=(1, 2)), [3, 1, 2], rtol=1e-3)
    earlier = np.asarray(times - np.timedelta64(2, "h"), dtype="datetime64[us]")
    shifted = nearest_skies(tmp_path, earlier, 2.0)  # the folders tell a clock at UTC+2
    np.testing.assert_allclose(shifted.radiance, skies.radiance)


def test_a_photo_without_a_probe_near_is_named(tmp_path: Path) -> None:
    fill(tmp_path)
    with pytest.raises(EnvironmentMapError, match="within 10 minutes of 2026-06-21 10:15"):
        nearest_skies(tmp_path, np.array(["2026-06-21T10:15"], dtype="datetime64[us]"), 0.0)
