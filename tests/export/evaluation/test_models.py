"""The networks that are compared."""

from pathlib import Path

import pytest

from export.data.tables import DataError
from export.evaluation.models import by_name
from lighting.model import Model
from tests.conftest import write_network


def test_networks_of_one_name_and_version_are_not_compared(tmp_path: Path) -> None:
    first, second = (Model.load(write_network(tmp_path / name)) for name in ("a.onnx", "b.onnx"))
    with pytest.raises(DataError, match="Two networks are"):
        by_name([first, second])
