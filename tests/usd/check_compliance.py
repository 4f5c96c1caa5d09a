"""Run by a Python with usd-core 25.11, the last one with ComplianceChecker: check a folder's scene.usda and scene.usdz.

PXR_PLUGINPATH_NAME=.../pxr/pluginfo/usdShaders/resources PYTHON check_compliance.py FOLDER

The wheel of 25.11 lacks the definitions of its shaders; the variable names those of a newer one. The stage holds
lights, which ARKit does not take: only the package is checked by ARKit's rules.
"""

import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from pxr import Sdr, Tf, UsdUtils

checkers: Any = UsdUtils


def main(folder: Path) -> None:
    """Exit with what is wrong."""
    with suppress(Tf.ErrorException):  # usdHydra's definitions are not in the wheel either
        Sdr.Registry()
    faults = []
    for name, is_arkit in (("scene.usda", False), ("scene.usdz", False), ("scene.usdz", True)):
        checker = checkers.ComplianceChecker(arkit=is_arkit)
        checker.CheckCompliance(str(folder / name))
        found = [*checker.GetErrors(), *checker.GetFailedChecks(), *checker.GetWarnings()]
        faults += [f"{name}: {fault}" for fault in found]
    sys.exit("\n".join(faults) or None)


main(Path(sys.argv[1]))
