"""Pictures that the estimate is not for."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.crops.negatives import (
    SYNTHETIC_KINDS,
    TABLE,
    _synthesize,
    _Unsuitable,
    _vary,
    read_unsuitable,
    unsuitable_pictures,
)
from tests.helpers.panoramas import EXAMPLES_SPEC, source

CROP = np.tile(np.linspace(20, 220, 224).astype(np.uint8)[None, :, None], (168, 1, 3))


def test_listed_pictures_are_read_and_varied(tmp_path: Path) -> None:
    Image.new("RGB", (80, 60), (10, 90, 200)).save(tmp_path / "a.png")
    (tmp_path / TABLE).write_text("file,kind,source\na.png,indoor,somebody/photos:a.png\n", encoding="utf-8")
    (picture,) = read_unsuitable(tmp_path)
    assert (picture.kind, picture.group) == ("indoor", "somebody/photos")
    variant = _vary(picture.pixels, np.random.default_rng(0), EXAMPLES_SPEC)
    assert variant.shape == (168, 224, 3)
    assert variant[..., 2].mean() > variant[..., 0].mean()
    assert read_unsuitable(tmp_path / "elsewhere") == []


@pytest.mark.parametrize("kind", SYNTHETIC_KINDS)
def test_made_pictures_fit_the_canvas(kind: str) -> None:
    picture = _synthesize(kind, CROP, source(), np.random.default_rng(1), EXAMPLES_SPEC)
    assert picture.dtype == np.uint8
    assert max(picture.shape[:2]) <= EXAMPLES_SPEC.width


def test_what_is_made_is_what_it_is_called() -> None:
    rng = np.random.default_rng(2)
    side = _synthesize("on its side", CROP, source(), rng, EXAMPLES_SPEC)
    assert side.shape == (224, 168, 3)
    assert np.ptp(side[:, 0, 0].astype(int)) > 150
    assert _synthesize("night", CROP, source(), rng, EXAMPLES_SPEC).mean() < 0.5 * CROP.mean()
    assert _synthesize("black", CROP, source(), rng, EXAMPLES_SPEC).mean() < 12
    assert _synthesize("blown out", CROP, source(), rng, EXAMPLES_SPEC).mean() > 230
    assert _synthesize("whole panorama", CROP, source(), rng, EXAMPLES_SPEC).shape == (112, 224, 3)


def test_every_kind_gets_its_turn() -> None:
    crops = iter([(CROP, source())] * 2 * len(SYNTHETIC_KINDS))
    kinds = [
        kind for kind, _ in unsuitable_pictures([_Unsuitable("indoor", "somebody", CROP)], crops, 3, EXAMPLES_SPEC)
    ]
    assert kinds == ["indoor"] * 3 + [*SYNTHETIC_KINDS] * 2
