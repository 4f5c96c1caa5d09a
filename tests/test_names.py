"""One name, one thing: public names and constants are unique, and docstrings say what parameters are."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.helpers.pages import ROOT

PACKAGES = ("lighting", "server", "export")

Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


@cache
def public_definitions() -> tuple[tuple[str, Definition], ...]:
    """Each public top-level function and class, with its file."""
    return tuple(_public_definitions())


def _public_definitions() -> Iterator[tuple[str, Definition]]:
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if "node_modules" in path.parts:
                continue
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, Definition) and not node.name.startswith("_"):
                    yield path.relative_to(ROOT).as_posix(), node


def undocumented(node: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    """The parameters that a function's docstring does not list."""
    arguments = node.args
    names = [a.arg for a in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    names += [a.arg for a in (arguments.vararg, arguments.kwarg) if a is not None]
    _, _, listed = (ast.get_docstring(node) or "").partition("Args:\n")
    lines = [line.strip().lstrip("*") for line in listed.splitlines()]
    told = {name.strip().lstrip("*") for line in lines if ":" in line for name in line.split(":")[0].split(",")}
    return [name for name in names if not name.startswith("_") and name not in told]


def test_no_public_name_stands_twice() -> None:
    homes = defaultdict(list)
    for home, node in public_definitions():
        homes[node.name].append(f"{home}:{node.lineno}")
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}


def public_constants(node: ast.stmt) -> Iterator[str]:
    """The names in capital letters that a statement gives a value."""
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    for name in (name for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)):
        if name.id.isupper() and not name.id.startswith("_"):
            yield name.id


def test_no_public_constant_has_two_homes() -> None:
    homes = defaultdict(set)
    for path in (
        path for package in PACKAGES for path in (ROOT / package).rglob("*.py") if "node_modules" not in path.parts
    ):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            for name in public_constants(node):
                homes[name].add(path.relative_to(ROOT).as_posix())
    assert {name: sorted(places) for name, places in homes.items() if len(places) > 1} == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_docstrings_list_every_parameter(package: str) -> None:
    missing = {
        f"{home}:{node.name}": names
        for home, node in public_definitions()
        if home.startswith(package) and not isinstance(node, ast.ClassDef)
        if not any("click" in ast.unparse(decorator) for decorator in node.decorator_list)  # --help shows it
        if (names := undocumented(node))
    }
    assert missing == {}


def test_packages_have_no_doors() -> None:
    full = {
        "lighting/__init__.py",
        "lighting/sky/__init__.py",
        "lighting/scene/__init__.py",
        "lighting/files/__init__.py",
    }
    full |= {"lighting/cli/__init__.py", "export/__init__.py", "export/stereo/__init__.py"}  # groups of commands
    for package in PACKAGES:
        for path in (ROOT / package).rglob("__init__.py"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            if path.relative_to(ROOT).as_posix() not in full:
                assert not any(isinstance(node, Definition | ast.Assign) for node in tree.body if not is_alias(node)), (
                    path
                )


def is_alias(node: ast.stmt) -> bool:
    """Whether a statement is the way to names that have changed."""
    return isinstance(node, ast.FunctionDef) and node.name == "__getattr__"


def test_the_tests_do_not_import_each_other() -> None:
    for path in (ROOT / "tests").rglob("test_*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                modules = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
                parts = {Path(*module.split(".")).name for module in modules if module.startswith("tests.")}
                assert not any(part.startswith("test_") for part in parts), path
