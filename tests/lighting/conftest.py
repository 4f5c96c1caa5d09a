"""What several tests of commands are given."""

import json
from pathlib import Path

import pytest

from lighting.estimator import Estimator
from lighting.model import Model
from lighting.photo.reader import read_photo
from lighting.records import Lighting
from tests.helpers.processes import LIGHTING


@pytest.fixture
def record_path(tmp_path: Path) -> Path:
    path = tmp_path / "lighting.json"
    path.write_text(json.dumps(LIGHTING.to_dict()))
    return path


@pytest.fixture
def expected(network: Path, photo_path: Path) -> Lighting:
    return Estimator(Model.load(network))(read_photo(photo_path)).lighting
