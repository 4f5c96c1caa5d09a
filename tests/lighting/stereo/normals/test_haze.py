"""The turbidity found from a ball's photos against the one that they were made with."""

import pytest

from lighting.stereo.days import in_grey
from lighting.stereo.normals.frame import Pose
from lighting.stereo.normals.haze import fitted_turbidity
from lighting.stereo.normals.solve import Session
from lighting.stereo.skies import clear_skies
from tests.lighting.stereo.sphere import ball, june_suns, photos


@pytest.mark.parametrize("truth", [2.4, 5.5])
def test_it_finds_what_the_photos_were_made_with(truth: float) -> None:
    normals, mask, _ = ball(32)
    images = photos(normals, mask, in_grey(clear_skies(june_suns(), truth, height=32)), Pose())

    def session(turbidity: float) -> Session:
        return Session(images, mask, in_grey(clear_skies(june_suns(), turbidity, height=16)), Pose())

    # noise of 1 % and coarse skies; an error of 2 is what bends normals by degrees
    assert abs(fitted_turbidity(session) - truth) < 1.0
