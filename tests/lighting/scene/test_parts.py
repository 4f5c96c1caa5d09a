"""What the writers of several tools share."""

import json
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lighting.files import full_record, read_exr
from lighting.scene.parts import filled, lit_ground_png, plate_png, write_shared_files
from tests.scenes import PLAIN, plain_scene


def test_the_shared_files_hold_plate_map_and_record(tmp_path: Path) -> None:
    scene = plain_scene()
    write_shared_files(scene, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "environment.exr",
        "lighting.json",
        "lit_ground.png",
        "plate.png",
    ]
    assert json.loads((tmp_path / "lighting.json").read_text()) == full_record(scene.lighting)
    image, lighting = read_exr(tmp_path / "environment.exr")
    np.testing.assert_allclose(image, scene.environment, rtol=1e-4)
    assert lighting == scene.lighting


def test_the_plate_is_the_photo() -> None:
    with Image.open(BytesIO(plate_png(plain_scene()))) as plate:
        assert np.array_equal(np.asarray(plate), PLAIN)


def test_the_mask_is_white_in_the_sun_and_black_in_shade() -> None:
    lit = np.array([[0.0, 0.5, 1.0]], np.float32)
    with Image.open(BytesIO(lit_ground_png(replace(plain_scene(), lit_ground=lit)))) as mask:
        assert mask.mode == "L"
        assert np.asarray(mask).tolist() == [[0, 128, 255]]


def test_a_template_must_get_every_value() -> None:
    page = filled("viewer.html", {"scene": "{}", "three": "1", "viewer": "2"})
    assert "$" not in page
    with pytest.raises(KeyError):
        filled("viewer.html", {"scene": "{}"})
