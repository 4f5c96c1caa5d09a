"""Skies fitted to rendered panoramas."""

import numpy as np
import pytest

from export.data.pictures import decode
from export.data.synthetic import render_panorama
from lighting.geometry import angle_between, direction, latlong_directions
from lighting.probe.sky_fit import fit_sky, sky_mask
from tests.lighting.probe.examples import sun_of


def test_the_fit_ignores_clouds_and_white_balance() -> None:
    scene = render_panorama(4, 64)
    picture = decode(scene.picture) * np.array([0.92, 1.0, 1.06], np.float32)
    cloud = angle_between(latlong_directions(64), direction((scene.sun_azimuth or 0.0) + 120.0, 50.0)) < 25.0
    picture[cloud] = picture[cloud] * 0.5 + np.array([0.3, 0.3, 0.32], np.float32)
    fit = fit_sky(np.minimum(picture, 1.0), sun_of(scene))
    assert fit is not None
    assert scene.turbidity is not None
    assert abs(fit.turbidity - scene.turbidity) < 1.0
    assert fit.exposure == pytest.approx(scene.exposure, rel=0.1)


def test_a_sky_unlike_the_model_is_not_trusted() -> None:
    scene = render_panorama(0, 64, things=0)
    painted = decode(scene.picture)[::-1].copy()
    painted[:32] = np.linspace(0.8, 0.05, 32, dtype=np.float32)[:, None, None] * np.array([0.3, 0.5, 0.9], np.float32)
    fit = fit_sky(painted, sun_of(scene))
    assert fit is not None
    assert not fit.ok


def test_the_sky_mask_leaves_out_the_ground_the_sun_and_the_buildings() -> None:
    scene = render_panorama(4, 64)
    mask = sky_mask(decode(scene.picture), sun_of(scene))
    assert mask.any()
    assert not mask[32:].any()
    assert not mask[angle_between(latlong_directions(64), sun_of(scene)) < 19.0].any()
