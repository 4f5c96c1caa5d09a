"""The Prague sky against radiances of the data set that its table was made from."""

import numpy as np
import pytest

from lighting.envmap.latlong import irradiance_from_rows, row_irradiance
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, direction, latlong_directions
from lighting.sky.prague import prague_radiance, visibility_from_turbidity
from tests.data.prague_reference import ELEVATIONS, REFERENCE, TURBIDITIES, VISIBILITIES


@pytest.fixture(scope="module")
def reference() -> dict[str, Floats]:
    with np.load(REFERENCE, allow_pickle=False) as archive:
        return {name: archive[name].astype(np.float64) for name in archive.files}


def test_the_table_is_the_data_set_within_a_tenth_of_a_stop(reference: dict[str, Floats]) -> None:
    """A quarter of the directions lie within 5 deg of the horizon, where the set changes fastest."""
    stops = np.empty_like(reference["radiance"])
    for t, turbidity in enumerate(TURBIDITIES):
        for e, elevation in enumerate(ELEVATIONS):
            sky = prague_radiance(reference["directions"][e], direction(20.0, elevation), turbidity)
            stops[t, e] = np.abs(np.log2(sky / reference["radiance"][t, e]))
    assert np.quantile(stops, 0.99) < 0.1
    assert stops.max() < 0.25
    assert np.median(stops, axis=(0, 2, 3)).max() < 0.02  # of each sun


def test_turbidity_maps_to_visibility() -> None:
    visibilities = [visibility_from_turbidity(turbidity) for turbidity in TURBIDITIES]
    assert visibilities == pytest.approx(VISIBILITIES, rel=1e-4)
    assert visibility_from_turbidity(1.0) == visibility_from_turbidity(4.0) == 131.8


@pytest.mark.parametrize("elevation", np.arange(-4.2, 90.1, 2.9))
def test_every_sky_is_smooth_and_mirrored_about_the_sun(elevation: float) -> None:
    """Between its suns the data set has coloured arcs, which the table does not."""
    image = prague_radiance(latlong_directions(64)[:32], direction(0.0, elevation), 8.0)
    assert image.min() > 0
    assert image == pytest.approx(image[:, ::-1], rel=1e-5)
    chroma = np.log2(image[..., [0, 2]] / image[..., [1]])
    away = chroma[:, :16]  # more than 90 deg from the sun's side, where nothing changes fast
    assert np.abs(np.diff(away, axis=0)).max() < 0.6
    assert np.abs(np.diff(away, axis=1)).max() < 0.1


def test_twilight_fades() -> None:
    levels = []
    for elevation in (5.0, 1.0, 0.0, -1.0, -2.5, -4.2):
        sky = prague_radiance(latlong_directions(32)[:16].astype(np.float32), direction(0.0, elevation), 5.0)
        assert sky.dtype == np.float32
        levels.append(irradiance_from_rows(row_irradiance(32)[:16], np.asarray(sky, dtype=np.float32))[1])
    assert all(np.diff(levels) < 0)
    assert 20 < levels[2] / levels[-1] < 200  # civil twilight lies a factor of a hundred below sunset


def test_the_sun_may_not_be_lower() -> None:
    with pytest.raises(
        ParameterError, match=r"^The sun is 4\.5 deg below the horizon; the Prague sky reaches"
    ) as caught:
        prague_radiance(direction(0.0, 10.0), direction(0.0, -4.5), 3.0)
    assert caught.value.code == ErrorCode.NIGHT
    assert caught.value.field == "sun_direction"


def test_nothing_shines_from_below_the_horizon() -> None:
    assert not prague_radiance(direction(0.0, -0.1), direction(0.0, 10.0), 3.0).any()
    assert prague_radiance(direction(0.0, 0.0), direction(0.0, 10.0), 3.0).all()
