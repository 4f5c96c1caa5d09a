"""The preview as a file."""

from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from lighting.model import Model
from lighting.photo import read_photo
from lighting.pipeline import Estimator
from lighting.preview import PHOTO_SIDE, preview_png


def test_the_file_is_a_png_that_shows_the_photo_and_follows_the_light(network: Path, photo_path: Path) -> None:
    estimator = Estimator(Model.load(network))
    picture = read_photo(photo_path, target=PHOTO_SIDE).pixels
    estimate = estimator(read_photo(photo_path))
    data = preview_png(picture, estimate)
    with Image.open(BytesIO(data)) as drawn:
        assert drawn.format == "PNG"
        assert min(drawn.size) > 300
    assert preview_png(picture, estimate) == data
    assert preview_png(np.zeros_like(picture), estimate) != data
