"""By how much a network understates a sun that shines."""

from pathlib import Path

import numpy as np
import pytest

from export.crops import clear_ratio
from export.data import PHOTOS, DataError
from export.evaluation import sun_power as module
from export.evaluation.sun_power import of_panoramas, of_photos, over_clear, sun_power_report
from lighting.colour import luminance
from lighting.model import Model
from tests.conftest import encode, scene

SKY = np.array([0.2, 0.3, 0.5])
HEADER = "file,group,sun_azimuth,sun_elevation,direct,hfov,expected_azimuth_error"


@pytest.mark.parametrize("elevation", [2.0, 30.0, 80.0])
def test_a_clear_sky_s_own_ratio_is_none_over_it(elevation: float) -> None:
    clear = float(luminance(clear_ratio(round(elevation))))
    suns = [luminance(SKY) * clear * factor * np.ones(3) for factor in (1.0, 2.0, 0.5)]
    assert over_clear(suns, [SKY] * 3, [elevation] * 3) == pytest.approx([0.0, 1.0, -1.0], abs=1e-6)


def test_photos_in_direct_sun_alone_count(tmp_path: Path, lit_network: Path) -> None:
    rows = ["a.jpg,x,0,40,yes,60,15", "a.jpg,x,0,40,no,60,15", "a.jpg,x,0,0.5,yes,60,15", "a.jpg,y,0,20,yes,60,15"]
    (tmp_path / "a.jpg").write_bytes(encode(scene(320, 240)))
    (tmp_path / PHOTOS).write_text("\n".join([HEADER, *rows]) + "\n")
    high, low = of_photos(Model.load(lit_network), tmp_path)
    assert low - high == pytest.approx(np.log2(luminance(clear_ratio(40)) / luminance(clear_ratio(20))), abs=1e-6)


@pytest.mark.parametrize("row", ["a.jpg,x,0,40,no,60,15", "a.jpg,x,0,0.5,yes,60,15"])
def test_a_folder_without_a_photo_in_direct_sun_is_named(tmp_path: Path, lit_network: Path, row: str) -> None:
    (tmp_path / "a.jpg").write_bytes(encode(scene(320, 240)))
    (tmp_path / PHOTOS).write_text(f"{HEADER}\n{row}\n")
    with pytest.raises(DataError, match=r"No photo of .* was taken in direct sun"):
        of_photos(Model.load(lit_network), tmp_path)


def test_a_folder_without_an_unclipped_sun_is_named(data: Path) -> None:
    with pytest.raises(DataError, match="no sunny HDR panorama in `train` whose sun is unclipped"):
        of_panoramas(data, data / "labels.csv")


def test_the_report_says_what_is_missing(monkeypatch: pytest.MonkeyPatch, lit_network: Path) -> None:
    monkeypatch.setattr(module, "of_panoramas", lambda *_: np.array([-1.0, 0.1, 0.4]))
    monkeypatch.setattr(module, "of_photos", lambda *_: np.array([-0.5, -0.2, 0.2, -0.2]))
    report = sun_power_report(Model.load(lit_network), Path("data"), Path("labels.csv"))
    assert report.startswith("A sun that shines is understated by 0.30 stops")
    assert "| photos, as said | 4 | -0.20 | -0.28 to -0.10 |" in report
