"""ONNX files, whichever network they hold."""

from pathlib import Path

import pytest

from lighting.errors import ModelError
from lighting.onnx_session import create_session, describe_onnx_error, packaged_network


def test_a_file_that_is_missing_or_no_network_is_named(tmp_path: Path) -> None:
    file = tmp_path / "x.onnx"
    with pytest.raises(ModelError, match=r"There is no network at .*x\.onnx"):
        create_session(file, 1)
    file.write_bytes(b"no network")
    with pytest.raises(ModelError, match=r"x\.onnx is not an ONNX network"):
        create_session(file, 1)


def test_a_package_holds_one_network_of_a_name(tmp_path: Path) -> None:
    for count in (1, 2):
        (tmp_path / f"a-{count}.onnx").touch()
        (tmp_path / f"b-{count}.onnx").touch()
        if count == 1:
            assert packaged_network(tmp_path, "a").name == "a-1.onnx"
    with pytest.raises(ModelError, match="it holds 2"):
        packaged_network(tmp_path, "a")
    with pytest.raises(ModelError, match="it holds 0"):
        packaged_network(tmp_path, "c")


@pytest.mark.parametrize(
    ("message", "reason"),
    [("[E:1] Load model from x failed:Protobuf parsing failed.\nmore", "Protobuf parsing failed."), ("", "OSError.")],
)
def test_the_reason_is_the_last_clause(message: str, reason: str) -> None:
    assert describe_onnx_error(OSError(message)) == reason
