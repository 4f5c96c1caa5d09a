"""Which option belongs to which tool; the modules keep to it."""

import inspect
import subprocess
import sys
from importlib import import_module

import pytest

from lighting import scene
from lighting.scene import TOOL_OF_OPTION, TOOLS, TOOLS_WITHOUT_MAP, UP_AXES, misplaced
from lighting.scene.parts import ENVIRONMENT


@pytest.mark.parametrize("tool", TOOLS)
def test_a_writer_takes_its_own_options_alone(tool: str) -> None:
    parameters = inspect.signature(import_module(f"lighting.scene.{tool}").write).parameters
    assert set(parameters) - {"scene", "folder"} == {name for name, owner in TOOL_OF_OPTION.items() if owner == tool}


def test_an_option_of_another_tool_is_named_with_its_tool() -> None:
    assert misplaced({"up_axis", "height"}, "gltf") == {"up_axis": "usd"}
    assert misplaced({"up_axis"}, "usd") == {}
    assert misplaced({"height"}, "blender") == {}
    assert UP_AXES == ("Y", "Z")


@pytest.mark.parametrize("tool", TOOLS)
def test_scenes_hold_a_map_unless_said_otherwise(tool: str) -> None:
    module = import_module(f"lighting.scene.{tool}")
    source = inspect.getsource(module)
    assert ("environment" in source or ENVIRONMENT in source) == (tool not in TOOLS_WITHOUT_MAP)


def test_the_door_opens_to_every_name_and_no_other() -> None:
    assert all(getattr(scene, name) is not None for name in scene.__all__)
    with pytest.raises(AttributeError, match="no attribute 'write_shared_files'"):
        scene.write_shared_files  # noqa: B018


def test_the_list_of_tools_needs_no_numpy() -> None:
    code = "import sys, lighting.scene; print(lighting.scene.TOOLS, 'numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == f"{TOOLS} False\n"
