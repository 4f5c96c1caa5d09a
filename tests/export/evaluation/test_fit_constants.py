"""The fits of the constants of light: what made the samples is found, and the reports name it."""

from pathlib import Path

import numpy as np
import pytest

from export.__main__ import FITS as NAMES
from export.crops.photos import PHOTOS
from export.crops.targets import clear_sun_to_sky_ratio
from export.data.panoramas import DataError
from export.evaluation import fit_constants as module
from export.evaluation.fit_constants import (
    FIT_REPORTS,
    HIDDEN_TEMPERATURES,
    SUN_POWERS,
    GroundSamples,
    SkySamples,
    SunSample,
    fit_ground_share,
    fit_sky_trust,
    stops_over_clear,
    sun_color_errors,
)
from export.evaluation.metrics import clustered_error
from lighting.color import luminance
from lighting.model import Model
from tests.conftest import encode, scene


def grounds(share: float, darker: float, noise: float = 0.0) -> GroundSamples:
    """Crops whose true ground is that share of the network's, the less the cloudier, and some noise."""
    rng = np.random.default_rng(3)
    photo, network = rng.normal(0, 1, 500), rng.normal(0, 1, 500)
    weather, cover = np.repeat(["overcast", "sunny"], 250), np.repeat([0.4, 0.0], 250)
    true = photo + (1 - cover) * share * (network + darker - photo) + rng.normal(0, noise, 500)
    return GroundSamples(photo, network, true, cover, weather, np.arange(500).astype(str))


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_share_that_made_them_is_found(share: float) -> None:
    found, darker = fit_ground_share(grounds(share, 0.4))
    assert found == pytest.approx(share)
    if share:
        assert darker == pytest.approx(0.4)


def test_in_doubt_the_network_counts_for_less() -> None:
    assert 0.3 <= fit_ground_share(grounds(0.5, 0.2, noise=1.0))[0] < 0.5


def test_more_crops_of_the_same_places_leave_as_much_doubt() -> None:
    one, again = grounds(0.5, 0.2, noise=1.0), np.repeat(np.arange(500), 8)
    photo, network, true, cover = (values[again] for values in (one.photo, one.network, one.true, one.cover))
    more = GroundSamples(photo, network, true, cover, one.weather[again], one.place[again])
    assert fit_ground_share(more) == fit_ground_share(one)
    error, expected = one.errors(0.0, 0.0), pytest.approx(one.errors(0.0, 0.0).std() / np.sqrt(500))
    assert clustered_error(error, one.place) == expected
    assert clustered_error(error[again], more.place) == expected


def test_errors_are_sizes_in_stops() -> None:
    photo, network, true = (np.array([value, value]) for value in (1.0, 3.0, 0.0))
    one = GroundSamples(
        photo, network, true, np.array([0.0, 0.5]), np.array(["sunny", "overcast"]), np.array(["a", "b"])
    )
    assert one.errors(0.0, 0.0) == pytest.approx([1.0, 1.0])
    assert one.errors(0.5, -6.0) == pytest.approx([1.0, 0.0])


@pytest.mark.slow
def test_places_that_the_network_saw_do_not_count(data: Path, lit_network: Path) -> None:
    assert "| train | " in FIT_REPORTS["ground"](Model.load(lit_network), data, data / "labels.csv")
    with pytest.raises(DataError, match="No crop of the panoramas of train that are sunny or overcast shows ground"):
        FIT_REPORTS["ground"](Model.load(lit_network), data, data / "labels.csv", seen=data)


def test_the_report_names_the_fit_and_each_weather(monkeypatch: pytest.MonkeyPatch, lit_network: Path) -> None:
    monkeypatch.setattr(module, "_sample_grounds", lambda *_: grounds(0.3, 0.4))
    report = FIT_REPORTS["ground"](Model.load(lit_network), Path("data"), Path("labels.csv"))
    assert report.startswith("Share of the network: 0.3 x (1 - cover), 0.4 stops brighter")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in report.splitlines()[4:]]
    assert [row[:3] for row in rows] == [
        [part, kind, "250"] for part in ("train", "val") for kind in ("overcast", "sunny")
    ]
    assert [float(row[4]) for row in rows] == [0.0] * 4


TRUST = np.array([0.1, 0.6])


def skies(noise: float = 0.0) -> SkySamples:
    """Crops whose true sky is what TRUST makes of the picture's."""
    rng = np.random.default_rng(5)
    ratio = np.exp(rng.normal(0, 0.3, (400, 3)))
    ratio /= ratio[:, 1:2]
    cover, said = rng.uniform(0, 1, 400), rng.uniform(0.2, 1.0, (400, 3))
    true = said * ratio ** (TRUST[0] + TRUST[1] * cover**2)[:, None] * np.exp(rng.normal(0, noise, (400, 3)))
    return SkySamples(ratio, cover, said, true)


@pytest.mark.parametrize(("noise", "tolerance"), [(0.0, 1e-6), (0.1, 0.05)])
def test_the_trust_that_made_them_is_found(noise: float, tolerance: float) -> None:
    assert fit_sky_trust(skies(noise)) == pytest.approx(TRUST, abs=tolerance)


def test_brightness_that_was_said_wrong_does_not_matter() -> None:
    known = skies()
    assert fit_sky_trust(SkySamples(known.ratio, known.cover, known.predicted / 3, known.true)) == pytest.approx(
        TRUST, abs=1e-6
    )


def test_sky_errors_are_angles_between_colours() -> None:
    known = skies()
    assert known.errors(TRUST) == pytest.approx(np.zeros(400), abs=1e-4)
    grey_for_red = SkySamples(np.ones((1, 3)), np.zeros(1), np.ones((1, 3)), np.array([[1.0, 0.0, 0.0]]))
    assert grey_for_red.errors(TRUST) == pytest.approx(np.degrees(np.arccos(3**-0.5)))


def test_crops_without_sky_are_left_out() -> None:
    known = skies()
    known.ratio[::2] = np.nan
    assert len(known.with_sky.cover) == 200


@pytest.mark.slow
def test_the_report_names_the_fit_and_each_kind_of_sky(data: Path, lit_network: Path) -> None:
    report = FIT_REPORTS["sky-color"](Model.load(lit_network), data, data / "labels.csv")
    assert report.startswith("Power of the ratio: ")
    assert [line.split("|")[1].strip() for line in report.splitlines()[4:]] == ["train", "val"]  # one cover in all


CYAN, WHITE, GREY_SKY = np.array([2.2, 3.0, 3.3]), np.full(3, 3.0), np.full(3, 0.5)


def sun(place: str, true: np.ndarray, elevation: float = 60.0, *, unclipped: bool = False) -> SunSample:
    """A sun that is said to be cyan."""
    return SunSample(place, true, CYAN, true * np.sin(np.radians(elevation)) + GREY_SKY, GREY_SKY, elevation, unclipped)


def test_a_white_sun_that_is_said_to_be_cyan_errs_the_less_the_nearer_it_comes_to_white() -> None:
    found = [sun_color_errors([sun("a", WHITE)], power) for power in (0.0, 0.5, 1.0)]
    assert found[0][0] > found[1][0] > found[2][0] == pytest.approx(0.0, abs=1e-4)
    assert found[0][1] > found[1][1] > found[2][1] == pytest.approx(0.0, abs=1e-4)


def test_places_count_alike() -> None:
    right, wrong = sun("a", CYAN), sun("b", WHITE)
    assert sun_color_errors([right, right, right, wrong], 0.0) == pytest.approx(sun_color_errors([wrong], 0.0) / 2)


def test_the_report_has_a_row_for_each_power(monkeypatch: pytest.MonkeyPatch, lit_network: Path) -> None:
    monkeypatch.setattr(module, "take_hdr_crops", lambda *given: given[-1])
    monkeypatch.setattr(module, "_sample_suns", lambda _, part: [sun("a", CYAN if part == "train" else WHITE)])
    report = FIT_REPORTS["sun-color"](Model.load(lit_network), Path("data"), Path("labels.csv"))
    assert report.startswith("Error of color in 1 crops of `train`, 1 crops of `val`")
    assert "| 0 | 0.0\N{DEGREE SIGN} / 0.0\N{DEGREE SIGN} | " in report
    assert report.count("\n| 0") == len(SUN_POWERS)


def test_suns_known_to_be_unclipped_stand_once_more(monkeypatch: pytest.MonkeyPatch, lit_network: Path) -> None:
    monkeypatch.setattr(module, "take_hdr_crops", lambda *given: given[-1])
    monkeypatch.setattr(module, "_sample_suns", lambda *_: [sun("a", WHITE), sun("b", CYAN, unclipped=True)])
    report = FIT_REPORTS["sun-color"](Model.load(lit_network), Path("data"), Path("labels.csv"))
    assert "2 crops of `train`, 1 crops of `train, unclipped`, 2 crops of `val`" in report
    assert report.splitlines()[4].split("|")[3].strip() == "0.0\N{DEGREE SIGN} / 0.0\N{DEGREE SIGN}"


BLUE_SKY = np.array([0.2, 0.3, 0.5])
HEADER = "file,group,sun_azimuth,sun_elevation,direct,hfov,expected_azimuth_error"


@pytest.mark.parametrize("elevation", [2.0, 30.0, 80.0])
def test_a_clear_sky_s_own_ratio_is_none_over_it(elevation: float) -> None:
    clear = float(luminance(clear_sun_to_sky_ratio(round(elevation))))
    suns = [luminance(BLUE_SKY) * clear * factor * np.ones(3) for factor in (1.0, 2.0, 0.5)]
    assert stops_over_clear(suns, [BLUE_SKY] * 3, [elevation] * 3) == pytest.approx([0.0, 1.0, -1.0], abs=1e-6)


def test_photos_in_direct_sun_alone_count(tmp_path: Path, lit_network: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A quarter of the way between two photos of one light lies at half the distance from the other quarter."""
    rows = ["a.jpg,x,0,40,yes,60,15", "a.jpg,x,0,40,no,60,15", "a.jpg,x,0,0.5,yes,60,15", "a.jpg,y,0,20,yes,60,15"]
    (tmp_path / "a.jpg").write_bytes(encode(scene(320, 240)))
    (tmp_path / PHOTOS).write_text("\n".join([HEADER, *rows]) + "\n")
    monkeypatch.setattr(module, "_panorama_sun_stops", lambda *_: np.zeros(3))
    report = FIT_REPORTS["sun-power"](Model.load(lit_network), tmp_path, Path("labels.csv"))
    (row,) = (line.split(" | ") for line in report.splitlines() if line.startswith("| photos"))
    low, high = (float(end) for end in row[3].removesuffix(" |").split(" to "))
    ratio = luminance(clear_sun_to_sky_ratio(40)) / luminance(clear_sun_to_sky_ratio(20))
    assert row[1] == "2"
    assert 2 * (high - low) == pytest.approx(abs(np.log2(ratio)), abs=0.03)


@pytest.mark.parametrize("row", ["a.jpg,x,0,40,no,60,15", "a.jpg,x,0,0.5,yes,60,15"])
def test_a_folder_without_a_photo_in_direct_sun_is_named(
    tmp_path: Path, lit_network: Path, row: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.jpg").write_bytes(encode(scene(320, 240)))
    (tmp_path / PHOTOS).write_text(f"{HEADER}\n{row}\n")
    monkeypatch.setattr(module, "_panorama_sun_stops", lambda *_: np.zeros(3))
    with pytest.raises(DataError, match=r"No photo of .* was taken in direct sun"):
        FIT_REPORTS["sun-power"](Model.load(lit_network), tmp_path, Path("labels.csv"))


def test_a_folder_without_an_unclipped_sun_is_named(data: Path, lit_network: Path) -> None:
    with pytest.raises(DataError, match="no sunny HDR panorama in `train` whose sun is unclipped"):
        FIT_REPORTS["sun-power"](Model.load(lit_network), data, data / "labels.csv")


def test_the_report_says_what_is_missing(monkeypatch: pytest.MonkeyPatch, lit_network: Path) -> None:
    monkeypatch.setattr(module, "_panorama_sun_stops", lambda *_: np.array([-1.0, 0.1, 0.4]))
    monkeypatch.setattr(module, "_photo_sun_stops", lambda *_: np.array([-0.5, -0.2, 0.2, -0.2]))
    report = FIT_REPORTS["sun-power"](Model.load(lit_network), Path("data"), Path("labels.csv"))
    assert report.startswith("A sun that shines is understated by 0.30 stops")
    assert "| photos, as said | 4 | -0.20 | -0.28 to -0.10 |" in report


def test_radii_of_photos_are_reported_by_temperature(network: Path, tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(encode(scene(64, 48)))
    (tmp_path / "photos.csv").write_text("file,sun_azimuth,sun_elevation\na.jpg,20,30\na.jpg,-90,50\na.jpg,,40\n")
    lines = FIT_REPORTS["photo-radii"](Model.load(network), tmp_path, Path("labels.csv")).splitlines()
    assert [line.split(" | ")[2] for line in lines if " all " in line] == ["2"] * len(HIDDEN_TEMPERATURES)
    (tmp_path / "photos.csv").write_text("file,sun_azimuth,sun_elevation\na.jpg,,40\n")
    with pytest.raises(DataError, match="no photo whose sun is known"):
        FIT_REPORTS["photo-radii"](Model.load(network), tmp_path, Path("labels.csv"))


def test_the_command_knows_every_fit() -> None:
    assert tuple(FIT_REPORTS) == NAMES
