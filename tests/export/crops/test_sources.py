"""Panoramas in memory, and how often each is drawn."""

from pathlib import Path

import numpy as np
import pytest

from export.crops.cameras import Camera
from export.crops.crops import take
from export.crops.sources import load_source, sampling_weights
from export.data.panoramas import Panorama
from tests.export.crops.examples import SPEC, label, source


def test_large_places_and_common_elevations_are_drawn_less_each() -> None:
    crowd = [source(place="big") for _ in range(9)] + [source(place="small")]
    weights = sampling_weights(crowd)
    assert weights.sum() == pytest.approx(1.0)
    assert weights[-1] == pytest.approx(3 * weights[0])
    low = sampling_weights([source(place=str(i)) for i in range(16)] + [source(place="x", sun=label(elevation=5.0))])
    assert low[-1] == pytest.approx(8 * low[0])


def test_sources_are_halved_for_wide_views(tmp_path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (1536, 768), (10, 200, 30)).save(tmp_path / "p.png")
    loaded = load_source(Panorama("p", tmp_path / "p.png", "ldr", "a", "train"), label())
    assert [level.shape[0] for level in loaded.levels] == [768, 384, 192]
    assert all((level == [10, 200, 30]).all() for level in loaded.levels)
    crop = take(loaded, Camera(0.0, 0.0, 0.0, 80.0, 1.0), SPEC)
    assert np.ptp(crop.linear, axis=(0, 1)).max() < 1e-3
