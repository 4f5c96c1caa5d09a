"""Where training asks for the sun in the picture."""

from export.crops.seen_sun import where_seen
from export.networks.specs import specs
from tests.export.crops.examples import VIEWS, crop

SPEC = specs("0")["outdoor"]


def test_a_sun_outside_the_picture_is_seen_nowhere_and_an_unknown_one_asks_nothing() -> None:
    assert where_seen(crop(VIEWS[0], 120.0, 17.0), SPEC, True)[0] == 1.0
    assert where_seen(crop(VIEWS[0], float("nan"), float("nan")), SPEC, False)[0] == 1.0
    assert where_seen(crop(VIEWS[0], 8.0, 17.0), SPEC, None).sum() == 0.0
