"""The fit of how far the sky's colour in a photo may be trusted."""

from pathlib import Path

import numpy as np
import pytest

from export.evaluation.sky_colour import Skies, errors, fit_trust, sky_report
from lighting.model import Model

TRUST = np.array([0.1, 0.6])


def skies(noise: float = 0.0) -> Skies:
    """Crops whose true sky is what TRUST makes of the picture's."""
    rng = np.random.default_rng(5)
    ratio = np.exp(rng.normal(0, 0.3, (400, 3)))
    ratio /= ratio[:, 1:2]
    cover, said = rng.uniform(0, 1, 400), rng.uniform(0.2, 1.0, (400, 3))
    true = said * ratio ** (TRUST[0] + TRUST[1] * cover**2)[:, None] * np.exp(rng.normal(0, noise, (400, 3)))
    return Skies(ratio, cover, said, true)


@pytest.mark.parametrize(("noise", "tolerance"), [(0.0, 1e-6), (0.1, 0.05)])
def test_the_trust_that_made_them_is_found(noise: float, tolerance: float) -> None:
    assert fit_trust(skies(noise)) == pytest.approx(TRUST, abs=tolerance)


def test_brightness_that_was_said_wrong_does_not_matter() -> None:
    known = skies()
    assert fit_trust(Skies(known.ratio, known.cover, known.said / 3, known.true)) == pytest.approx(TRUST, abs=1e-6)


def test_errors_are_angles_between_colours() -> None:
    known = skies()
    assert errors(known, TRUST) == pytest.approx(np.zeros(400), abs=1e-4)
    grey_for_red = Skies(np.ones((1, 3)), np.zeros(1), np.ones((1, 3)), np.array([[1.0, 0.0, 0.0]]))
    assert errors(grey_for_red, TRUST) == pytest.approx(np.degrees(np.arccos(3**-0.5)))


def test_crops_without_sky_are_left_out() -> None:
    known = skies()
    known.ratio[::2] = np.nan
    assert len(known.seen.cover) == 200


@pytest.mark.slow
def test_the_report_names_the_fit_and_each_kind_of_sky(data: Path, lit_network: Path) -> None:
    report = sky_report(Model.load(lit_network), data, data / "labels.csv")
    assert report.startswith("Power of the ratio: ")
    assert [line.split("|")[1].strip() for line in report.splitlines()[4:]] == ["train", "val"]  # one cover in all
