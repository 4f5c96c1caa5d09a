"""`lighting estimate --together` with matches."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import encode, munich
from tests.helpers.cameras import picture, texture
from tests.helpers.processes import invoke_command

pytestmark = pytest.mark.needs("cv2")
AHEAD, ASIDE = (0.0, 2.0, 0.0), (25.0, -1.0, 1.0)


def write(folder: Path, name: str, camera: tuple[float, float, float], seed: int = 0) -> Path:
    path = folder / name
    noted = munich(DateTimeOriginal="2024:06:01 09:10:00", GPSImgDirection=None, FocalLengthIn35mmFilm=None)
    path.write_bytes(encode(picture(texture(seed), camera, 52.0), exif=noted.tobytes(), quality=95))
    return path


@pytest.fixture
def pair(tmp_path: Path) -> list[Path]:
    return [write(tmp_path, "a.jpg", AHEAD), write(tmp_path, "b.jpg", ASIDE)]


def test_photos_taken_together_are_turned_by_what_they_show(pair: list[Path], network: Path) -> None:
    result = invoke_command("estimate", "--together", "--json", "--no-exif", "--model", network, *pair)
    first, second = (json.loads(line)["lighting"] for line in result.stdout.splitlines())
    assert first["evidence"] == ["pixels", "turns", "other photos"]
    assert second["camera"]["relative_heading"] == pytest.approx(25.0, abs=0.5)
    assert [r["camera"]["vertical_fov"] for r in (first, second)] == pytest.approx([52.0, 52.0], abs=0.5)
    off = second["sun"]["azimuth"] - first["sun"]["azimuth"] + second["camera"]["relative_heading"]
    assert np.cos(np.radians(off)) == pytest.approx(1.0, abs=1e-4)


def test_headings_that_are_given_win(pair: list[Path], network: Path) -> None:
    result = invoke_command(
        "estimate", "--together", "--headings", "0,90", "--json", "--no-exif", "--model", network, *pair
    )
    assert all(
        json.loads(line)["lighting"]["evidence"] == ["pixels", "other photos"] for line in result.stdout.splitlines()
    )


def test_photos_of_different_places_are_said_to_share_nothing(tmp_path: Path, network: Path) -> None:
    strangers = [write(tmp_path, "a.jpg", AHEAD), write(tmp_path, "b.jpg", AHEAD, seed=1)]
    result = invoke_command("estimate", "--together", "--no-exif", "--model", network, *strangers)
    assert result.exit_code == 0
    assert result.stderr.count("It overlaps no other photo") == 2


def test_without_opencv_a_warning_says_what_is_missing(
    pair: list[Path], network: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lighting.registration.features.has_opencv", lambda: False)
    result = invoke_command("estimate", "--together", "--no-exif", "--model", network, *pair)
    assert result.exit_code == 0
    assert result.stderr.count("OpenCV is not installed: pip install 'outdoor-lighting[all]'.") == 1
    assert "turns" not in result.stdout
