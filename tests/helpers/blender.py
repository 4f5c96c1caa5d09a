"""The Python that has Blender's module bpy, for the tests that need Blender."""

import os
import sys
from importlib.util import find_spec

import pytest

PYTHON = sys.executable if find_spec("bpy") else os.environ.get("BLENDER_PYTHON", "")  # empty if there is none

needs_blender = pytest.mark.skipif(not PYTHON, reason="no Python with Blender's module bpy; BLENDER_PYTHON names one")
