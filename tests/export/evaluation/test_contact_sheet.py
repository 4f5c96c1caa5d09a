"""The sheet of failures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.evaluation.contact_sheet import ACROSS, PICTURE, SAID, TRUE, sheet, write_sheet
from tests.export.evaluation.examples import FAILURE


def test_the_sheet_shows_each_picture_with_both_suns(tmp_path: Path) -> None:
    grey = np.full((30, 40, 3), 128, np.uint8)
    found = [replace(FAILURE, sun=(90.0, 0.0), said=(-90.0, 0.0))] * (ACROSS + 1)
    whole = sheet(found, [grey] * len(found))
    assert whole.width == ACROSS * (PICTURE[0] + 4)
    assert whole.height == 2 * sheet(found[:1], [grey]).height
    first = np.asarray(whole)[: PICTURE[1], : PICTURE[0]]
    assert (first[5, 5] == 128).all()
    middle = {c: np.argwhere((first == c).all(axis=-1)).mean(axis=0) for c in (TRUE, SAID)}
    assert middle[TRUE][1] > middle[SAID][1] + 40
    assert middle[TRUE][0] == pytest.approx(middle[SAID][0], abs=1)
    write_sheet(tmp_path / "s.png", found, [grey] * len(found))
    with Image.open(tmp_path / "s.png") as again:
        assert again.size == whole.size
