"""The Python that has Blender's module bpy, for the tests that need Blender."""

import os
import sys
from collections.abc import Callable
from importlib.util import find_spec

import pytest

PYTHON = sys.executable if find_spec("bpy") else os.environ.get("BLENDER_PYTHON", "")  # empty if there is none

_REASON = "no Python with Blender's module bpy; BLENDER_PYTHON names one"


def needs_blender(test: Callable[..., None]) -> Callable[..., None]:
    """A test that is skipped where there is no such Python.

    Args:
        test: that runs it.
    """
    marked: Callable[..., None] = pytest.mark.blender(pytest.mark.skipif(not PYTHON, reason=_REASON)(test))
    return marked
