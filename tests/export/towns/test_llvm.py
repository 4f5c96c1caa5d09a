"""Which LLVM is taken."""

from pathlib import Path

import pytest

from export.data.tables import DataError
from export.towns.llvm import VARIABLE, find_llvm


def test_without_llvm_one_sentence_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with pytest.raises(DataError, match="libllvm"):
        find_llvm(tmp_path)


def test_the_newest_llvm_is_taken_unless_one_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "x86_64-linux-gnu"
    folder.mkdir()
    for name in ("libLLVM-9.so", "libLLVM-15.so", "libLLVM.so.19.1", "libLLVM-C.so"):
        (folder / name).touch()
    monkeypatch.setenv(VARIABLE, "/elsewhere/libLLVM.so")
    assert find_llvm(tmp_path) == "/elsewhere/libLLVM.so"
    monkeypatch.setenv(VARIABLE, "")
    assert find_llvm(tmp_path) == str(folder / "libLLVM.so.19.1")
