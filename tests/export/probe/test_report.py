"""What `python -m export probe` measures, on less."""

from pathlib import Path

import numpy as np
import pytest

from export.data import DataError
from export.probe import report
from export.probe.report import ALPNACH, ALPNACH_CIRCLE, DAY, PLACE, SKY_FILL, measure, turned
from export.probe.synthetic import Camera, expose, gain_of, photograph
from lighting.envmap import sun_irradiance
from lighting.errors import ProbeError
from lighting.probe.align import yaw_rotation
from lighting.probe.develop import make_probe
from lighting.probe.exposures import bracket_of, read_bracket
from lighting.probe.lens import lens_of
from lighting.probe.ratios import exposed
from lighting.probe.settings import Moment, Settings

STACK = Path(__file__).parents[3].parent / "shared" / "stereo-data" / "fisheye_bracket"
MOMENT = Moment(DAY, *PLACE)
LENS = lens_of("equidistant", 400, 400)


@pytest.mark.parametrize("bits", [8, 12, 14])
def test_skies_exposed_for_are_within_two_percent_and_their_clipped_sun_is_said(bits: int) -> None:
    got = measure(Camera(bits, SKY_FILL), MOMENT, LENS, 40.0)
    assert got.sky < 0.02
    assert got.clipped
    assert got.turn < 0.3


@pytest.mark.parametrize("bits", [8, 12, 14])
def test_suns_exposed_for_are_within_three_percent(bits: int) -> None:
    got = measure(Camera(bits, 0.8), MOMENT, LENS, 200.0)
    assert not got.clipped
    assert got.sun < 0.03
    assert got.turn < 0.3
    assert got.sky < 0.02
    assert got.sky < got.alone * (0.5 if bits == 8 else 1.05)  # the sky is then a few of 8 bits' steps above black
    assert (got.steps < 3) == (bits == 8)


def test_a_photographed_sun_has_its_power() -> None:
    lighting = report.lighting_at(MOMENT)
    picture = photograph(lighting, LENS, yaw_rotation(0.0))
    probe = make_probe(bracket_of(expose(picture, Camera(noise=False), np.random.default_rng(0))), MOMENT, Settings())
    assert probe.spot is not None
    assert probe.spot.irradiance / gain_of(picture, Camera()) == pytest.approx(sun_irradiance(lighting), rel=0.02)


def test_turns_are_measured() -> None:
    assert turned(yaw_rotation(20.0), yaw_rotation(-10.0)) == pytest.approx(30.0)


@pytest.mark.skipif(not STACK.is_dir(), reason="the fisheye stack is not here")
def test_the_fisheye_stack_has_its_ratios_its_clipped_sun_and_its_lens_residual() -> None:
    bracket = read_bracket(sorted(STACK.glob("*_image.png")), "linear")
    ratios = [ratio.value for ratio in exposed(bracket).ratios if ratio is not None]
    # From the sixth exposure on the camera's times follow a 1-2-5 series; the shorter ones show the sun alone.
    assert ratios[5:] == pytest.approx([2, 2, 2.5, 2.5, 4, 2.5, 2], rel=0.05)
    told = Settings(centre=ALPNACH_CIRCLE[0], radius=ALPNACH_CIRCLE[1], height=64)
    probe = make_probe(bracket, ALPNACH, told)
    assert "clipped in every exposure" in probe.warnings[0]
    assert probe.off == pytest.approx(4.6, abs=1.0)
    with pytest.raises(ProbeError, match="only one"):
        read_bracket(sorted(STACK.glob("*_12_image.png")))


def test_a_folder_without_a_stack_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "0_image.png").touch()
    for folder in (tmp_path, tmp_path / "none"):
        with pytest.raises(DataError, match=r"holds no stack: it takes two exposures or more, named \*_image.png"):
            next(report.report(folder))
