"""Which LLVM Mitsuba's `llvm` variants compile their kernels with; towns, tests and benchmarks all ask here."""

import os
import re
from pathlib import Path

from export.data import DataError

OLDEST = 16  # LLVM 15 ends the process on AVX-512 processors: "LLVM ERROR: Cannot select ... fminimum"
VARIABLE = "DRJIT_LIBLLVM_PATH"  # read by Dr.Jit, which Mitsuba is built on

_VERSION = re.compile(r"LLVM(?:-|\.so\.)(\d+)")


def find_llvm(root: Path = Path("/usr/lib")) -> str:
    """The library that DRJIT_LIBLLVM_PATH names, or else the newest under `root`, which the variable then names.

    Raises DataError if Mitsuba is not installed, if there is no LLVM, or if its file name says that it is too old.
    """
    try:
        import mitsuba  # noqa: F401
    except ImportError as error:
        raise DataError("Places are rendered by Mitsuba 3: pip install mitsuba.") from error
    named = os.environ.get(VARIABLE)
    newest = Path(named) if named else max(root.glob("*/libLLVM*.so*"), key=_version, default=Path())
    if _version(newest) < OLDEST and not (named and not _version(newest)):
        raise DataError(f"Mitsuba needs LLVM {OLDEST} or newer: install libllvm19, or let {VARIABLE} name one.")
    os.environ[VARIABLE] = str(newest)
    return str(newest)


def _version(library: Path) -> int:
    """The major version in a library's file name; 0 if there is none."""
    found = _VERSION.search(library.name)
    return int(found[1]) if found else 0
