"""What people read outside the book is short: warnings, errors, help, docstrings, problems, settings and the page."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from inspect import cleandoc
from pathlib import Path

import click
import pytest

from export.__main__ import export_cli
from scripts.book import count_words
from tests.helpers.pages import ROOT
from tests.helpers.processes import list_commands

LONGEST_SENTENCE, LONGEST_NOTE, MEAN_SENTENCE = 30, 15, 15  # words; a warning or a sentence of the page is a note
WEB = ROOT / "server" / "web"
SENTENCE_END = re.compile(r"(?<=[.!?])[\"'”)\]]*\s+(?=[\"'“(\[`]*[A-Z0-9`_*-])|\n\s*\n|\n\s*-\s")
LITERAL = re.compile(r'"((?:[^"\\\n]|\\.)*)"|`((?:[^`\\]|\\.)*)`')
COMMENT = re.compile(r"/\*.*?\*/|^\s*//[^\n]*", re.DOTALL | re.MULTILINE)
PLACEHOLDER = re.compile(r"\$\{[^{}]*(?:\{[^{}]*\}[^{}]*)*\}")
ENTRY = re.compile(r"\n(?= {4,}(?:\*{0,2}\w+(?: \([^)\n]*\))?:|\w+ = |\[\d\])|\d\. )")  # of lists, formulas, references
MANY_FIGURES = 8
CODE = re.compile(r"[{}<>]|;.*;")  # of which templates of files consist
OTHERS = {  # functions that give warnings by another name, and the constants that they fill in
    "lighting/fusion/metadata_prior.py": {"observations_single", "observations_multi", "_prior"},
    "lighting/stereo/output.py": {"_doubt_model"},
}


def modules(*folders: str) -> list[str]:
    """The modules of folders, by their paths."""
    return sorted(path.relative_to(ROOT).as_posix() for folder in folders for path in (ROOT / folder).glob("**/*.py"))


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


def warnings(tree: ast.Module, module: str) -> tuple[str, ...]:
    """The sentences that a module gives as warnings: of functions named so, of `CodedWarning`, and by constants."""
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


def long_sentences(text: str) -> list[str]:
    """The sentences of a text that are too long."""
    parts = (" ".join(part.split()) for part in SENTENCE_END.split(text))
    return [part for part in parts if len(part.split()) > LONGEST_SENTENCE]


def strings(tree: ast.AST) -> Iterator[str]:
    """The strings of a module without its docstrings; a placeholder is one word."""
    nodes = [tree]
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.JoinedStr | ast.Constant):
            yield from written(node)
        elif not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            nodes += ast.iter_child_nodes(node)


def docstrings(module: ast.Module) -> Iterator[str]:
    """The docstrings of a module and of its classes, functions and members; each entry of a list stands by itself."""
    bodies = [module.body]
    while bodies:
        for statement in bodies.pop():
            if isinstance(statement, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef | ast.If):
                bodies.append(statement.body)
            elif isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                yield ENTRY.sub("\n\n", cleandoc(str(statement.value.value)))


def is_prose(text: str) -> bool:
    """Whether a text is long enough for a long sentence: no template of a file, row of figures or command lines."""
    is_command = text.lstrip().startswith("lighting ")
    return len(text) > 100 and not is_command and not CODE.search(text) and text.count("0") < MANY_FIGURES


def helps(command: click.Command) -> Iterator[str]:
    """The help of a command, of its options and of the commands below it."""
    yield command.help or ""
    for parameter in command.params:
        yield getattr(parameter, "help", None) or ""
    for below in command.commands.values() if isinstance(command, click.Group) else ():
        yield from helps(below)


def page_literals(path: Path) -> Iterator[str]:
    """The sentences that a module of the page holds as literals; a placeholder is one word."""
    for groups in LITERAL.findall(COMMENT.sub("", path.read_text(encoding="utf-8"))):
        text = PLACEHOLDER.sub("0", "".join(groups)).strip()
        if text.endswith(".") and " " in text and not CODE.search(text):
            yield text


@cache
def found() -> tuple[list[str], list[str], list[str]]:
    """The warnings, the long texts and the docstrings of all modules."""
    warned: list[str] = []
    long: list[str] = []
    documented: list[str] = []
    for module in modules("lighting", "server", "export"):
        tree = ast.parse((ROOT / module).read_bytes())
        warned += warnings(tree, module) if not module.startswith("export") else ()
        long += [text for text in strings(tree) if is_prose(text)]
        documented += docstrings(tree)
    return warned, long, documented


def test_a_warning_is_one_short_sentence() -> None:
    warned, _, _ = found()
    assert len(warned) > 25
    for beginning in ("Probably not an outdoor", "The sun is clipped", "The zoom is unknown", "Your offset from UTC"):
        assert any(text.startswith(beginning) for text in warned), beginning
    assert [text for text in warned if len(text.split()) > LONGEST_NOTE] == []


def test_errors_problems_and_settings_have_no_long_sentence() -> None:
    _, long, _ = found()
    assert len(long) > 30
    assert [sentence for text in long for sentence in long_sentences(text)] == []


def test_docstrings_have_no_long_sentence() -> None:
    _, _, documented = found()
    assert len(documented) > 1500
    assert [sentence for text in documented for sentence in long_sentences(text)] == []


@pytest.mark.parametrize("folder", ["lighting", "server", "export"])
def test_docstrings_of_a_module_have_short_sentences(folder: str) -> None:
    """In the mean of each module."""
    means = {}
    for module in modules(folder):
        texts = docstrings(ast.parse((ROOT / module).read_bytes()))
        lengths = [count_words(part) for text in texts for part in SENTENCE_END.split(text) if count_words(part)]
        means[module] = sum(lengths) / max(len(lengths), 1)
    assert {module: mean for module, mean in means.items() if mean > MEAN_SENTENCE} == {}


def test_help_has_no_long_sentence() -> None:
    texts = [text for command in (*list_commands().values(), export_cli) for text in helps(command)]
    assert len(texts) > 300
    assert [sentence for text in texts for sentence in long_sentences(text)] == []


def test_notes_of_the_page_are_short() -> None:
    notes = [text for path in (WEB / "src").glob("**/*.ts") for text in page_literals(path)]
    assert len(notes) > 25
    assert [text for text in notes if len(text.split()) > LONGEST_NOTE] == []


def test_the_page_has_no_long_sentence() -> None:
    text = re.sub(
        r"</(?:p|li|label|summary|h\d|button|span)>", "\n\n", (WEB / "index.html").read_text(encoding="utf-8")
    )
    assert long_sentences(re.sub(r"<[^>]+>", "", text)) == []
