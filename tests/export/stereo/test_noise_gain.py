"""What an hour costs, and normals from noisy pixels."""

import numpy as np
import pytest

from export.stereo.noise_gain import LIFTS, _cost_of_an_hour, _estimates, _triplet
from lighting.geometry import angle_between
from lighting.stereo.light_vectors import clear_skies, sun_directions
from lighting.stereo.noise_gain import normals_of_interest
from lighting.stereo.schedule import gray_skies


def test_triplets_are_two_lights_on_the_plane_and_one_lifted() -> None:
    lights = _triplet(30, 20)
    np.testing.assert_allclose(np.linalg.norm(lights, axis=1), 1)
    assert angle_between(lights[0], lights[1]) == pytest.approx(30)
    np.testing.assert_allclose(lights[:, 1], [0, 0, np.sin(np.radians(20))], atol=1e-12)


@pytest.mark.parametrize("lift", LIFTS)
def test_an_hour_costs_five_to_seven_times_the_best_full_arc(lift: float) -> None:
    """However far the hour's third light is lifted, from 10 deg on."""
    assert 5 < _cost_of_an_hour(lift, 90) < 7.1


def test_an_hour_costs_less_where_the_full_arc_is_as_flat() -> None:
    assert _cost_of_an_hour(15, 15) == pytest.approx(1.0, abs=0.02)
    assert _cost_of_an_hour(75, 75) > 5


def test_faint_noise_leaves_normals_nearly_as_they_are() -> None:
    times = np.datetime64("2026-06-21T00:00") + np.arange(8, 17) * np.timedelta64(60, "m")
    skies = gray_skies(clear_skies(sun_directions(times, 47.0, 0.0), height=16))
    normals = normals_of_interest(None)[:10]
    found = _estimates(skies, normals, 1e-6, 2, np.random.default_rng(0))
    assert found.shape == (2, 10, 3)
    np.testing.assert_allclose(found, np.broadcast_to(normals, found.shape), atol=0.01)
