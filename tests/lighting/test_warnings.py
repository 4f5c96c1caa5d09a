"""Warnings are one short sentence: all that the code can give, found in its syntax tree."""

import ast
from collections.abc import Iterator
from functools import cache

import pytest

from tests.helpers.pages import ROOT

MOST_WORDS = 15
MODULES = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "lighting").glob("**/*.py"))
OTHERS = {  # functions that give warnings by another name, and the constants that they fill in
    "lighting/fusion/metadata_prior.py": {"observations_single", "observations_multi", "_prior"},
    "lighting/stereo/output.py": {"_doubt_model"},
}


def written(node: ast.AST) -> Iterator[str]:
    """The text of a string or an f-string; a placeholder is one word."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        yield "".join(
            part.value if isinstance(part, ast.Constant) and isinstance(part.value, str) else "0"
            for part in node.values
        )


def is_warned(function: ast.FunctionDef, module: str) -> bool:
    return "warning" in function.name or function.name in OTHERS.get(module, ())


def is_yield(statement: ast.AST) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Yield)


@cache
def sentences(module: str) -> tuple[str, ...]:
    """The sentences that a module gives as warnings: of functions named so, of `CodedWarning`, and by constants."""
    tree = ast.parse((ROOT / module).read_text(encoding="utf-8"))
    constants = {
        target.id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    roots: list[ast.AST] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and is_warned(node, module):
            roots += [part for part in node.body if not isinstance(part, ast.Raise | ast.Expr) or is_yield(part)]
        elif isinstance(node, ast.FunctionDef):
            coded = [c for c in ast.walk(node) if isinstance(c, ast.Call) and ast.unparse(c.func) == "CodedWarning"]
            named = {part.id for call in coded for part in ast.walk(call.args[0]) if isinstance(part, ast.Name)}
            roots += coded
            roots += [
                a.value for a in ast.walk(node) if isinstance(a, ast.Assign) and ast.unparse(a.targets[0]) in named
            ]
    nodes = [node for root in roots for node in ast.walk(root)]
    nodes += [constants[node.id] for node in nodes if isinstance(node, ast.Name) and node.id in constants]
    texts = (text for node in nodes for text in written(node))
    return tuple(dict.fromkeys(text for text in texts if text[:1].isupper() and text.endswith(".")))


@pytest.mark.parametrize("module", [module for module in MODULES if sentences(module)])
def test_a_warning_has_at_most_fifteen_words(module: str) -> None:
    long = [text for text in sentences(module) if len(text.split()) > MOST_WORDS]
    assert long == []


def test_the_warnings_are_found() -> None:
    found = [text for module in MODULES for text in sentences(module)]
    assert len(found) > 25
    for beginning in ("Probably not an outdoor", "The sun is clipped", "The zoom is unknown", "The camera's clock was"):
        assert any(text.startswith(beginning) for text in found), beginning
