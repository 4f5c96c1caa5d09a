"""The script that makes the table of coefficients."""

import struct
from pathlib import Path

import numpy as np
import pytest

from export.data.hosek_wilkie_table import TABLE, _installed_datasets, _make_table, _read_tensors


def tensor_file() -> bytes:
    values = np.arange(6, dtype="<f8").reshape(2, 3)
    field = struct.pack("<H", 4) + b"some" + struct.pack("<HBQ", 2, 11, 18 + 6 + 11 + 16) + struct.pack("<2Q", 2, 3)
    return b"tensor_file\0\x01\0" + struct.pack("<I", 1) + field + values.tobytes()


def test_reads_names_shapes_and_values() -> None:
    tensors = _read_tensors(tensor_file())
    assert list(tensors) == ["some"]
    assert tensors["some"].tolist() == [[0, 1, 2], [3, 4, 5]]


def test_refuses_other_files() -> None:
    with pytest.raises(ValueError, match="not a Mitsuba tensor file"):
        _read_tensors(b"PK\x03\x04")


def test_the_shipped_table_is_what_the_script_makes(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba")
    _make_table(_installed_datasets(), tmp_path / "table.f32")
    assert (tmp_path / "table.f32").read_bytes() == TABLE.read_bytes()
