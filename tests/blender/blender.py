"""Blender's command line by its module bpy, without a window, for a Python that has bpy.

PYTHON blender.py [--background] [FILE.blend] --python SCRIPT [-- ARGUMENTS]
"""

import runpy
import sys
from pathlib import Path

import bpy


def main() -> None:
    options = sys.argv[1 : sys.argv.index("--") if "--" in sys.argv else None]
    script = options[options.index("--python") + 1]
    bpy.ops.wm.read_factory_settings()
    for file in (option for option in options if option.endswith(".blend")):
        bpy.ops.wm.open_mainfile(filepath=str(Path(file).resolve()))
    runpy.run_path(script, run_name="__main__")


main()
