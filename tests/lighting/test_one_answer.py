"""One photo has one answer, whichever command, function or process gives it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

from lighting.estimator import Estimator
from lighting.files.exr import read_exr_attributes
from lighting.model import Model
from lighting.photo.reader import read_photo
from lighting.records import Lighting
from server.app import create_app
from server.settings import Settings
from tests.helpers.processes import run_command

PHOTO = Path(__file__).parents[2] / "examples" / "wide_street.jpg"


def answer_of(model: Model) -> dict[str, Any]:
    return Estimator(model)(read_photo(PHOTO)).lighting.to_dict()


def plain(record: dict[str, Any]) -> dict[str, Any]:
    """A record without the sky's coefficients, which follow from the rest."""
    return Lighting.from_dict(record).to_dict()


def numbers(record: Any) -> list[float]:
    """All numbers of a record, in its order."""
    if isinstance(record, dict | list):
        return [n for part in (record.values() if isinstance(record, dict) else record) for n in numbers(part)]
    return [float(record)] if isinstance(record, int | float) else []


@pytest.mark.slow
def test_commands_of_one_photo_give_one_answer(tmp_path: Path) -> None:
    """To the last digit: the network begins early or late, and answers alone."""
    expected = answer_of(Model.load(for_one_photo=True))
    printed = json.loads(run_command("estimate", PHOTO, "--json").stdout)["lighting"]
    assert run_command("envmap", PHOTO, "-o", tmp_path / "sky.exr", "--height", "64").returncode == 0
    written = json.loads(read_exr_attributes(tmp_path / "sky.exr")["lighting.json"])
    assert plain(printed) == expected
    assert plain(written) == expected


@pytest.mark.slow
def test_several_photos_have_the_answer_of_one_that_python_gives(tmp_path: Path) -> None:
    """A network prepared for many photos gives the same as one for a single photo but for the sixth digit."""
    expected = answer_of(Model.load())
    lines = run_command("estimate", PHOTO, PHOTO, "--json").stdout.splitlines()
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.jpg").write_bytes(PHOTO.read_bytes())
    assert run_command("batch", tmp_path / "photos", tmp_path / "out", "-q").returncode == 0
    lines += (tmp_path / "out" / "lighting.jsonl").read_bytes().splitlines()
    assert [plain(json.loads(line)["lighting"]) for line in lines] == [expected] * 3
    alone = answer_of(Model.load(for_one_photo=True))
    np.testing.assert_allclose(numbers(alone), numbers(expected), rtol=1e-5, atol=1e-5)


@pytest.mark.slow
def test_the_service_has_the_answer_of_one_that_python_gives() -> None:
    model = Model.load()
    with TestClient(create_app(Settings(), Estimator(model))) as client:
        answer = client.post("/v1/lighting", files={"photo": (PHOTO.name, PHOTO.read_bytes(), "image/jpeg")})
    assert answer.status_code == 200
    assert plain(answer.json()) == answer_of(model)
