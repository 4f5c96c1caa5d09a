"""LLVM, where there is one that Mitsuba can use."""

import pytest

from export.data.tables import DataError
from export.towns.llvm import find_llvm


@pytest.fixture
def llvm() -> None:
    try:
        find_llvm()
    except DataError as error:
        pytest.skip(str(error))
