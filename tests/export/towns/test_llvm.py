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


def test_an_llvm_that_ends_the_process_is_not_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """LLVM 15 cannot compile Mitsuba's kernels on processors with AVX-512, whoever names it."""
    folder = tmp_path / "x86_64-linux-gnu"
    folder.mkdir()
    (folder / "libLLVM-15.so.1").touch()
    monkeypatch.setenv(VARIABLE, "")
    with pytest.raises(DataError, match="needs LLVM 16 or newer: install libllvm19"):
        find_llvm(tmp_path)
    monkeypatch.setenv(VARIABLE, str(folder / "libLLVM-15.so.1"))
    with pytest.raises(DataError, match="needs LLVM 16 or newer"):
        find_llvm()
