"""Where the LLVM is that Mitsuba compiles its kernels with."""

import os
import re
from pathlib import Path

from export.data.panoramas import DataError

OLDEST = 15
VARIABLE = "DRJIT_LIBLLVM_PATH"  # what Dr.Jit, below Mitsuba, reads


def find_llvm(root: Path = Path("/usr/lib")) -> str:
    """The library that the environment names, or else the newest under `root`; DataError without Mitsuba or LLVM.

    The environment names it afterwards.
    """
    try:
        import mitsuba  # noqa: F401
    except ImportError as error:
        raise DataError("Places are rendered by Mitsuba 3: pip install mitsuba.") from error
    if not os.environ.get(VARIABLE):
        found = {int(m[1]): path for path in root.glob("*/libLLVM*.so*") if (m := _VERSION.search(path.name))}
        if not found or max(found) < OLDEST:
            raise DataError(f"Mitsuba needs LLVM {OLDEST} or newer: install libllvm19, or set {VARIABLE}.")
        os.environ[VARIABLE] = str(found[max(found)])
    return os.environ[VARIABLE]


_VERSION = re.compile(r"LLVM(?:-|\.so\.)(\d+)")
