"""Scans of the real sky."""

from pathlib import Path

import numpy as np
import pytest

from export.probe.scans import COLUMNS, MODELS, WAVELENGTHS, along, read_scans, reduce, residuals
from lighting.probe.orientation import orient


def test_azimuths_of_the_clear_day_run_counter_clockwise_from_about_13_degrees() -> None:
    scans = read_scans()["2013-05-27"]
    found = orient(scans)
    assert found.sense == -1
    assert found.sure
    assert found.offset == pytest.approx(13, abs=5)
    assert np.median(found.offsets) == pytest.approx(13, abs=5)
    assert along(scans, found, 13) < 5  # each scan of the day


def test_the_clear_sky_is_near_the_models_and_far_from_overcast() -> None:
    scans = read_scans()["2013-05-27"][::5]
    errors = {name: float(np.median(residuals(scans, -1, 11.0, model))) for name, model in MODELS.items()}
    assert 0.08 < errors["Hosek-Wilkie, turbidity fitted"] < 0.2
    assert errors["CIE general sky, type fitted"] <= errors["CIE clear sky (type 12)"] < 0.2
    assert errors["CIE overcast sky"] > 0.5


def test_equal_energy_is_nearly_white(tmp_path: Path) -> None:
    header = [*COLUMNS[:3], *(f"radiance_{wavelength}" for wavelength in WAVELENGTHS)]
    row = ["2013-05-27T13:30:00Z", "10", "45", *["1"] * len(WAVELENGTHS)]
    (tmp_path / "in.csv").write_text(",".join(header) + "\n" + ",".join(row) + "\n", encoding="utf-8")
    reduce(tmp_path / "in.csv", tmp_path / "out.csv")
    _, values = (tmp_path / "out.csv").read_text(encoding="utf-8").split()
    red, green, blue = (float(value) for value in values.split(",")[3:])
    # The equal-energy spectrum is x = y = 1/3: 1.205, 0.948, 0.909 times its luminance in Rec.709.
    assert (red / green, blue / green) == pytest.approx((1.205 / 0.948, 0.909 / 0.948), abs=0.02)
    assert 20 * (0.2126 * red + 0.7152 * green + 0.0722 * blue) == pytest.approx(106.9, abs=0.5)  # the integral of y
