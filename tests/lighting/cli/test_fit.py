"""`lighting estimate --together` with matches, and `--fit`."""

import json
from pathlib import Path

import numpy as np
import pytest

from lighting.cli.fit import fit_in_words
from lighting.evidence import Fit, Range
from tests.conftest import encode, munich
from tests.lighting.cli.runners import run
from tests.lighting.turns.cameras import picture, texture

pytest.importorskip("cv2")
AHEAD, ASIDE = (0.0, 2.0, 0.0), (25.0, -1.0, 1.0)


def write(folder: Path, name: str, camera: tuple[float, float, float], seed: int = 0, hour: int = 9) -> Path:
    path = folder / name
    noted = munich(DateTimeOriginal=f"2024:06:01 {hour:02}:10:00", GPSImgDirection=None, FocalLengthIn35mmFilm=None)
    path.write_bytes(encode(picture(texture(seed), camera, 52.0), exif=noted.tobytes(), quality=95))
    return path


@pytest.fixture
def pair(tmp_path: Path) -> list[Path]:
    return [write(tmp_path, "a.jpg", AHEAD), write(tmp_path, "b.jpg", ASIDE)]


def test_photos_taken_together_are_turned_by_what_they_show(pair: list[Path], network: Path) -> None:
    result = run("estimate", "--together", "--json", "--no-exif", "--model", network, *pair)
    first, second = (json.loads(line)["lighting"] for line in result.stdout.splitlines())
    assert first["evidence"] == ["pixels", "turns", "other photos"]
    assert second["camera"]["relative_heading"] == pytest.approx(25.0, abs=0.5)
    assert [r["camera"]["vertical_fov"] for r in (first, second)] == pytest.approx([52.0, 52.0], abs=0.5)
    off = second["sun"]["azimuth"] - first["sun"]["azimuth"] + second["camera"]["relative_heading"]
    assert np.cos(np.radians(off)) == pytest.approx(1.0, abs=1e-4)


def test_headings_that_are_given_win(pair: list[Path], network: Path) -> None:
    result = run("estimate", "--together", "--headings", "0,90", "--json", "--no-exif", "--model", network, *pair)
    assert all(
        json.loads(line)["lighting"]["evidence"] == ["pixels", "other photos"] for line in result.stdout.splitlines()
    )


def test_photos_of_different_places_are_said_to_share_nothing(tmp_path: Path, network: Path) -> None:
    strangers = [write(tmp_path, "a.jpg", AHEAD), write(tmp_path, "b.jpg", AHEAD, seed=1)]
    result = run("estimate", "--together", "--no-exif", "--model", network, *strangers)
    assert result.exit_code == 0
    assert result.stderr.count("Nothing in it was found in the other photos") == 2


def test_without_opencv_a_warning_says_what_is_missing(
    pair: list[Path], network: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lighting.turns.has_opencv", lambda: False)
    result = run("estimate", "--together", "--no-exif", "--model", network, *pair)
    assert result.exit_code == 0
    assert result.stderr.count("OpenCV is not installed: pip install 'outdoor-lighting[turns]'.") == 1
    assert "turns" not in result.stdout


@pytest.mark.parametrize("kind", ["heading", "latitude", "time"])
def test_a_fit_says_one_thing_of_all_photos(kind: str, tmp_path: Path, network: Path) -> None:
    day = [write(tmp_path, f"{hour}.jpg", AHEAD, hour=hour) for hour in (9, 12, 15)]
    result = run("estimate", "--together", "--fit", kind, "--json", "--model", network, *day)
    assert result.exit_code == 0, result.output
    (line,) = result.stdout.splitlines()
    asked = {"heading": set(), "latitude": {"latitude"}, "time": {"day_of_year", "clock_shift"}}[kind]
    assert set(json.loads(line)["fit"]) == {"heading"} | asked


def test_a_fit_needs_what_it_rests_on(pair: list[Path], network: Path) -> None:
    alone = run("estimate", "--fit", "heading", "--model", network, *pair)
    assert alone.exit_code == 2
    assert "--fit needs --together" in alone.stderr
    result = run("estimate", "--together", "--fit", "heading", "--no-exif", "--model", network, *pair)
    assert result.exit_code == 1
    assert "when and where they were taken" in result.stderr


def test_what_speaks_against_a_fit_stands_beside_it(tmp_path: Path, network: Path) -> None:
    day = [write(tmp_path, f"{hour}.jpg", AHEAD, hour=hour) for hour in (9, 12)]
    asked = ["--together", "--fit", "latitude", "--lat", "48", "--lon", "11", "--model", str(network)]
    said, quiet = run("estimate", *asked, *day), run("estimate", *asked, "--quiet", *day)
    assert "Warning: The latitude that was given was not used" in said.stderr
    assert quiet.stderr == ""
    assert quiet.stdout == said.stdout


def test_a_fit_in_words() -> None:
    found = Fit(213.4, 4.0, 12.0, Range(47.2, ((44.0, 50.0),), ((39.0, 54.0),)))
    assert fit_in_words(found) == (
        "the first photo looks to 213° from true north (50 % within 4°, 90 % within 12°); "
        "latitude 47° (50 % 44° to 50°, 90 % 39° to 54°)"
    )
    day = Range(172.0, ((147.0, 199.0),), ((119.0, 227.0),))
    words = fit_in_words(Fit(0.0, 1.0, 2.0, None, day, Range(-0.5, ((-1.0, 0.0),), ((-2.0, 0.5),))))
    assert "date 21 June (50 % 27 May to 18 July, 90 % 29 April to 15 August)" in words
    assert "clock -0.5 h (50 % -1.0 h to +0.0 h, 90 % -2.0 h to +0.5 h)" in words
    winter = Range(340.0, ((1.0, 11.0), (330.0, 365.0)), ((1.0, 31.0), (100.0, 110.0), (320.0, 365.0)))
    words = fit_in_words(Fit(0.0, 1.0, 2.0, None, winter))
    assert "(50 % 26 November to 11 January, 90 % 10 April to 20 April or 16 November to 31 January)" in words
    words = fit_in_words(Fit(0.0, 1.0, 2.0, utc_minus_clock=Range(-1.5, ((-2.0, -1.0),), ((-2.5, -0.5),))))
    assert words.endswith(
        "UTC is the photos' clock -1.5 h, zone and error together (50 % -2.0 h to -1.0 h, 90 % -2.5 h to -0.5 h)"
    )
