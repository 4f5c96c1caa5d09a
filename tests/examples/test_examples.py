"""The example photos: their table, how they were exposed, and what is kept of the photographs among them."""

import base64
import io
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import ExifTags, Image

from examples.make_examples import COLUMNS, EXAMPLES, HERE, add_grain, develop, enlarge, truth
from examples.reduce_photos import PHOTOS, SHOWN, THUMB, reduce_photo, thumbnail
from scripts.examples import measure_example, read_suns
from tests.conftest import encode, exif, scene
from tests.helpers.pages import ROOT

LARGEST = 450_000  # bytes of one example that the page offers


def test_the_table_beside_the_photos_is_that_of_the_script() -> None:
    rows = read_suns()
    assert tuple(rows[0]) == COLUMNS
    assert [row["file"] for row in rows] == [example.file for example in EXAMPLES]
    for row, example in zip(rows, EXAMPLES, strict=True):
        assert float(row["vertical_fov"]) == example.vertical_fov
        with Image.open(HERE / example.file) as photo:
            assert photo.size == (example.width, example.height)


def test_the_first_example_of_readme_is_sure_and_right() -> None:
    """`python -m scripts.examples` says how the others do."""
    (name,) = set(re.findall(r"examples/(\w+\.jpg)", (ROOT / "README.md").read_text(encoding="utf-8")))
    answer = measure_example(next(row for row in read_suns() if row["file"] == name))
    assert answer.estimate.lighting.radius_90 <= 30
    assert answer.error <= answer.estimate.lighting.radius_50
    assert answer.estimate.lighting.sun_visibility > 0.5


def test_the_sun_is_told_from_where_the_camera_points() -> None:
    row = {"sun_azimuth": "170.0", "sun_elevation": "30.0", "direct": "1"}
    assert truth(EXAMPLES[2], row)[:4] == (EXAMPLES[2].file, "venetian_crossroads", -50.0, "30.0")
    assert truth(EXAMPLES[2], {**row, "sun_azimuth": ""})[2] == ""


def test_direct_sunlight_is_told_by_eye_where_the_row_says_otherwise() -> None:
    row = {"sun_azimuth": "", "sun_elevation": "", "direct": "no"}
    assert truth(replace(EXAMPLES[0], direct="partly"), row)[4] == "partly"
    assert truth(replace(EXAMPLES[0], direct=""), row)[4] == "no"


def test_development_keeps_the_order_of_brightness() -> None:
    ramp = develop(np.linspace(0.0, 5.0, 200, dtype=np.float32))
    assert np.all(np.diff(ramp) >= 0)
    assert ramp[0] == pytest.approx(0.0, abs=1e-3)
    assert ramp[-1] == pytest.approx(255.0, abs=1.0)


def test_enlarging_wraps_at_the_seam() -> None:
    image = np.zeros((8, 32, 3), dtype=np.float32)
    image[:, 0] = image[:, -1] = 1.0
    large = enlarge(image)
    assert large.shape == (32, 128, 3)
    assert large[:, 0].min() > 0.9
    assert large[:, -1].min() > 0.9


def test_grain_is_faint_and_repeatable() -> None:
    grey = Image.new("RGB", (64, 64), (128, 128, 128))
    one, same = (np.asarray(add_grain(grey, 3), dtype=int) for _ in range(2))
    assert np.array_equal(one, same)
    assert 0.8 < (one - 128).std() < 1.6


def test_the_photographs_say_when_they_were_taken() -> None:
    for name in PHOTOS:
        with Image.open(HERE / "rome" / name) as photo:
            camera = photo.getexif().get_ifd(ExifTags.IFD.Exif)
        assert camera[ExifTags.Base.DateTimeOriginal].startswith("2024:08:10")


def test_every_example_of_the_page_has_a_small_copy() -> None:
    for shown in SHOWN:
        with Image.open(HERE / "thumbs" / Path(shown).name) as picture:
            assert picture.size == THUMB
            assert not picture.getexif()


def test_an_example_of_the_page_is_small() -> None:
    for shown in SHOWN:
        assert (HERE / shown).stat().st_size < LARGEST


def test_reducing_keeps_size_and_exif(tmp_path: Path) -> None:
    taken = exif(camera={ExifTags.Base.DateTimeOriginal: "2024:08:10 12:00:00"})
    (tmp_path / "a.jpg").write_bytes(encode(scene(320, 240), exif=taken, quality=95))
    reduce_photo(tmp_path / "a.jpg", tmp_path / "b.jpg")
    thumbnail(tmp_path / "a.jpg", tmp_path / "c.jpg")
    with Image.open(tmp_path / "b.jpg") as photo, Image.open(tmp_path / "c.jpg") as small:
        assert photo.size == (320, 240)
        assert photo.getexif().get_ifd(ExifTags.IFD.Exif)[ExifTags.Base.DateTimeOriginal] == "2024:08:10 12:00:00"
        assert small.size == THUMB


NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
RUN = "import sys, nbformat; from pathlib import Path; from scripts.run_notebook import run_notebook\n"
RUN += "nbformat.write(run_notebook(Path(sys.argv[1])), sys.argv[2])"


def texts(notebook: Any) -> list[str]:
    """What the cells print."""
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", [])]
    return ["".join(output["text"]) for output in outputs if output["output_type"] == "stream"]


def pictures(notebook: Any) -> list[tuple[int, int]]:
    """The sizes of the pictures that the cells show."""
    outputs = [output.get("data", {}) for cell in notebook["cells"] for output in cell.get("outputs", [])]
    shown = ["".join(data[kind]) for data in outputs for kind in data if kind.startswith("image/")]
    return [Image.open(io.BytesIO(base64.b64decode(picture))).size for picture in shown]


@pytest.mark.slow
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.name)
@pytest.mark.needs("nbclient")
def test_a_notebook_gives_what_it_shows(file: Path, tmp_path: Path) -> None:
    """Where this fails, run `python -m scripts.run_notebook NAME`."""
    again = tmp_path / "again.ipynb"
    done = subprocess.run(
        [sys.executable, "-c", RUN, file, again], cwd=ROOT, capture_output=True, text=True, timeout=200, check=False
    )
    assert done.returncode == 0, done.stderr
    stored, fresh = (json.loads(path.read_text(encoding="utf-8")) for path in (file, again))
    assert texts(fresh) == texts(stored)
    assert pictures(fresh) == pictures(stored)
    assert len(pictures(stored)) >= 3
    assert file.stat().st_size < 500_000
