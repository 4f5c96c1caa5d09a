"""Each figure of a map's looks against maps whose figure is known."""

from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import read_index
from export.reports import map_detail
from export.reports.map_detail import BANDS, FREQUENCIES, VIEW_AZIMUTHS, VIEW_PIXELS, _choose_views, report_map_detail
from lighting.geometry import direction, latlong_angles
from lighting.model import Model

HEIGHT = 180


def noise(seed: int = 0, height: int = HEIGHT) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.1, 0.9, (height, 2 * height, 3)).astype(np.float32)


def sine(amplitude: float, cycles: int, height: int = 512) -> np.ndarray:
    """Waves of the logarithm of luminance along the horizon, so many around it."""
    azimuth, _ = latlong_angles(height)
    row = 0.2 * np.exp(amplitude * np.sin(np.radians(azimuth) * cycles)) - 0.01
    return np.repeat(np.broadcast_to(row, (height, 2 * height))[..., None], 3, axis=2).astype(np.float32)


def test_the_true_map_has_no_errors_and_a_brighter_one_does() -> None:
    truth = noise()
    right = map_detail._map_errors(truth, truth)
    assert [right[name] for name in ("mirror", "roughness .2", "roughness .4", "diffuse")] == pytest.approx(
        [0, 0, 0, 0], abs=1e-6
    )
    brighter = map_detail._map_errors(np.float32(1.1) * truth, truth)
    assert brighter["mirror"] == pytest.approx(0.1, abs=1e-5)
    assert brighter["roughness .2"] == pytest.approx(0.1, abs=1e-5)
    assert brighter["diffuse"] == pytest.approx(0, abs=1e-5)
    assert brighter["angle"] == pytest.approx(0, abs=0.1)


def test_a_mirror_ball_sees_detail_that_a_diffuse_one_does_not() -> None:
    truth = np.full((HEIGHT, 2 * HEIGHT, 3), 0.5, np.float32)
    errors = map_detail._map_errors(noise(), truth)
    assert errors["mirror"] > 0.2 > 0.05 > errors["roughness .4"] > errors["diffuse"]


def test_the_change_of_a_diffuse_ball_is_a_share() -> None:
    before = noise()
    assert map_detail._diffuse_change(np.float32(1.02) * before, before) == pytest.approx(0.02, rel=1e-3)


def test_a_second_sun_counts_away_from_sun_and_photo() -> None:
    before = np.full((180, 360, 3), 0.5, np.float32)
    image, hidden = before.copy(), np.zeros((180, 360), bool)
    image[40:42, 100:102] = 2.0  # azimuth -79, elevation 49
    sun = direction(-79.0, 45.0)
    assert map_detail._second_sun(image, before, None, hidden) == pytest.approx(4.0)
    assert map_detail._second_sun(image, before, sun, hidden) == pytest.approx(1.0)
    hidden[40:42, 100:102] = True
    assert map_detail._second_sun(image, before, None, hidden) == pytest.approx(1.0)


def test_repetition_is_one_for_copies_and_less_for_noise() -> None:
    piece = noise()[:, :90]
    copies = np.concatenate([piece, piece[:, ::-1], piece, piece[:, ::-1]], axis=1)
    assert map_detail._repetition(copies) > 0.99
    assert map_detail._repetition(noise()) < 0.5
    assert map_detail._repetition(np.full((HEIGHT, 2 * HEIGHT, 3), 0.5, np.float32)) == 0.0


def test_power_lies_at_its_frequency_and_grows_by_6_db_with_twice_the_amplitude() -> None:
    cycles = 72  # around the horizon: 0.2 a degree there, where the middle band of the horizon lies
    low, high = map_detail._band_power(sine(0.1, cycles)), map_detail._band_power(sine(0.2, cycles))
    at = list(BANDS).index("horizon") * len(FREQUENCIES) + FREQUENCIES.index(0.2)
    assert high[at] - low[at] == pytest.approx(6.02, abs=0.1)
    assert low[at] > low[at - 1] + 20
    assert low[at] > low[at + 1] + 20


def test_views_show_what_lies_there() -> None:
    azimuth, _ = latlong_angles(HEIGHT)
    image = np.zeros((HEIGHT, 2 * HEIGHT, 3), np.float32)
    image[:, np.abs(azimuth) > 150] = [1, 0, 0]  # behind the camera
    image[:, np.abs(azimuth - 90) < 20] = [0, 1, 0]
    ball, *views = map_detail.looked_at(image)
    middle = VIEW_PIXELS // 2
    assert np.allclose(ball[middle, middle], [1, 0, 0], atol=1e-5)
    assert (ball[0] == 0).all()
    shown = dict(zip(VIEW_AZIMUTHS, views, strict=True))
    assert np.allclose(shown[180.0][middle, middle], [1, 0, 0], atol=1e-5)
    assert np.allclose(shown[90.0][middle, middle], [0, 1, 0], atol=1e-5)
    assert np.allclose(shown[-90.0][middle, middle], 0, atol=1e-5)


def test_the_kernel_distance_is_unbiased() -> None:
    rng = np.random.default_rng(0)
    same = [map_detail._kernel_distance(*rng.normal(size=(2, 40, 16))) for _ in range(200)]
    assert abs(np.mean(same)) < 3 * np.std(same) / np.sqrt(len(same))
    a, b = rng.normal(size=(40, 16)), rng.normal(1.0, 1.0, (40, 16))
    assert map_detail._kernel_distance(a, b) > np.mean(same) + 10 * np.std(same)


def test_places_are_in_one_half_only() -> None:
    rng = np.random.default_rng(0)
    features = np.repeat(rng.normal(size=(10, 1, 8)), 4, axis=0)  # four like pictures of each of ten places
    places = np.repeat(np.array([f"p{i}" for i in range(10)]), 4)
    distances = map_detail.distances_by_places(features, features, places, 30)
    assert distances.shape == (30,)
    assert distances.mean() > -1000 * 0.5  # the same place on both sides would be far below
    assert distances.std() > 0


def toy_features(pictures: list[np.ndarray]) -> np.ndarray:
    return np.array([[p.mean(), p.std(), np.abs(np.diff(p, axis=0)).mean()] for p in pictures])


def test_crops_are_of_as_many_places_as_there_are(data: Path) -> None:
    panoramas = read_index(data)
    places = {p.place for p in panoramas}
    first = _choose_views(panoramas, len(places))
    assert {p.place for p in first} == places
    assert _choose_views(panoramas[::-1], 3) != []


@pytest.mark.slow
def test_the_report_has_a_row_for_each_kind_of_map_and_keeps_what_is_estimated(
    data: Path, lit_network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("export.reports.map_detail._imagenet_features", lambda: toy_features)
    monkeypatch.setattr("export.reports.map_detail.MAP_ROWS", 192)
    model = Model.load(lit_network)
    report = report_map_detail(data, model, 4, "train", tmp_path / "cache")
    for row in ("| true panorama |", "| without detail |"):
        assert report.count(row) == 2
    kept = sorted((tmp_path / "cache").glob("*.npz"))
    assert len(kept) == 4
    before = [file.stat().st_mtime_ns for file in kept]
    assert report_map_detail(data, model, 4, "train", tmp_path / "cache").split("CPU")[0] == report.split("CPU")[0]
    assert [file.stat().st_mtime_ns for file in kept] == before
