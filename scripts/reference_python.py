"""The page of the Python package: its public names with their signatures, parameters and errors, from docstrings."""

import inspect
import re
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from types import FunctionType
from typing import Any

import lighting
from lighting.video.stream import Tracker
from scripts.markdown import WRITTEN, escape_marks, write_table

_SECTION = re.compile(r"^(Args|Returns|Raises|References):$", re.MULTILINE)
_ENTRY = re.compile(r"^ {4}(\S[^:]*): ", re.MULTILINE)
_PLAIN_TYPES = (  # how a reader writes what annotations spell out
    (re.compile(r"\*<class '([\w.]+)'>"), r"Unpack[\1]"),  # as Python 3.11 has it
    (re.compile(r"\bForwardRef\('([^']+)'\)"), r"\1"),
    (re.compile(r"\bnumpy\.ndarray\[.*?dtype\[numpy\.(\w+)(?:\[[\w.]+\])?\]\]"), r"NDArray[\1]"),
    (re.compile(r"\b(?:numpy\.typing\.)?NDArray\[(?:numpy|np)\.(\w+)(?:\[(?:typing\.)?Any\])?\]"), r"NDArray[\1]"),
    (re.compile(r"\b(?:[a-z_]+\.)+(?=[A-Z])"), ""),
    (re.compile(r"\bImage\.Image\b"), "Image"),
    (re.compile(r"['\"]"), ""),
)


def write_python() -> str:
    """Return the page of the public names, functions first."""
    names = [name for name in lighting.__all__ if name != "__version__"]
    things = sorted(((name, getattr(lighting, name)) for name in names), key=lambda pair: inspect.isclass(pair[1]))
    entries = [(f"lighting.{name}", thing) for name, thing in things]
    entries.append((f"{Tracker.__module__}.{Tracker.__name__}", Tracker))
    anchors = list(_anchors([name for name, _ in entries]))
    index = [f"- [`{n}`](#{to}): {_summary(thing)}" for (n, thing), to in zip(entries, anchors, strict=True)]
    head = f"""# Python

The public names of the package, with their parameters. [Fields](fields.md) lists what records hold, and
[exceptions](exceptions.md) what `LightingError` can be.
{WRITTEN}
"""
    return "\n".join([head, *index, "", *(line for name, thing in entries for line in _section(name, thing))])


def _anchors(names: Sequence[str]) -> Iterator[str]:
    """The fragments of headings: `estimate` and `Estimate` differ by a number."""
    slugs = [name.lower().replace(".", "") for name in names]
    for number, slug in enumerate(slugs):
        before = slugs[:number].count(slug)
        yield f"{slug}-{before}" if before else slug


def _summary(thing: Any) -> str:
    text = inspect.cleandoc(thing.__doc__ or "").partition("\n\n")[0]
    return escape_marks(" ".join(text.split()))


def _section(name: str, thing: Any) -> Iterator[str]:
    yield from (f"## {name}", "")
    if not inspect.isclass(thing):
        yield from _describe_call(name.rpartition(".")[2], thing)
        return
    yield from _paragraphs(inspect.getdoc(thing) or "")
    if hasattr(thing, "__dataclass_fields__"):
        yield from (f"[Its fields](fields.md#{name.rpartition('.')[2].lower()})", "")
        yield from _list_properties(thing)
    else:
        yield from _describe_call(name.rpartition(".")[2], thing.__init__)
    for method, function in _methods(thing):
        own_name = name.rpartition(".")[2]
        yield from (f"### {own_name}.{method}", "")
        yield from _describe_call(own_name.lower() if method == "__call__" else method, function)


def _list_properties(kind: type) -> list[str]:
    """The table of what is derived from the fields."""
    found = {name: value for base in reversed(kind.__mro__) for name, value in vars(base).items()}
    derived = {name: value for name, value in found.items() if isinstance(value, property | cached_property)}
    rows = [
        (f"`{name}`", f"`{_type(inspect.signature(_getter(value)).return_annotation)}`", _summary(value))
        for name, value in derived.items()
        if not name.startswith("_")
    ]
    return write_table(("property", "type", "meaning"), rows) if rows else []


def _getter(value: Any) -> Any:
    return value.fget if isinstance(value, property) else value.func


def _methods(kind: type) -> Iterator[tuple[str, Callable[..., Any]]]:
    """The public methods of a class itself, as they are called, in the order of their definition."""
    for name in vars(kind):
        static = inspect.getattr_static(kind, name)
        if name == "__call__" or (not name.startswith("_") and isinstance(static, classmethod | FunctionType)):
            yield name, getattr(kind, name)


def _describe_call(name: str, function: Callable[..., Any]) -> Iterator[str]:
    """The signature of a function, what it does, and tables of its parameters and errors."""
    signature = inspect.signature(function)
    parameters = [p for p in signature.parameters.values() if p.name not in ("self", "cls")]
    plain = signature.replace(parameters=list(map(_plain_parameter, parameters)), return_annotation=signature.empty)
    text, sections = _split_docstring(inspect.getdoc(function) or "")
    quoted = str(plain).replace("'", '"')  # as ruff writes it
    yield from ("```python", f"{name}{quoted}", "```", "")
    yield from _paragraphs(text)
    told = dict(_entries(sections.get("Args", "")))
    if parameters:
        rows = ((f"`{p.name}`", _default(p), f"`{_type(p.annotation)}`", told.get(p.name, "")) for p in parameters)
        yield from write_table(("parameter", "default", "type", "meaning"), rows)
    if "Returns" in sections:
        yield from (f"Returns {escape_marks(_flow(sections['Returns']))}", "")
    elif signature.return_annotation not in (None, "None", signature.empty) and name != "__init__":
        yield from (f"Returns `{_type(signature.return_annotation)}`.", "")
    if "Raises" in sections:
        yield from write_table(("raises", "when"), ((f"`{e}`", text) for e, text in _entries(sections["Raises"])))


class _Default:
    """A default, whose repr is what the page writes."""

    def __init__(self, value: object) -> None:
        self.value = value

    def __repr__(self) -> str:
        return _value(self.value)


def _plain_parameter(parameter: inspect.Parameter) -> inspect.Parameter:
    """A parameter without its type."""
    default = parameter.default if parameter.default is parameter.empty else _Default(parameter.default)
    return parameter.replace(annotation=parameter.empty, default=default)


def _value(value: object) -> str:
    return f"{type(value).__name__}()" if hasattr(value, "__dataclass_fields__") else repr(value)


def _default(parameter: inspect.Parameter) -> str:
    if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
        return ""
    return "required" if parameter.default is parameter.empty else f"`{_value(parameter.default)}`"


def _type(annotation: Any) -> str:
    text = annotation.__name__ if isinstance(annotation, type) and "[" not in str(annotation) else str(annotation)
    for pattern, plain in _PLAIN_TYPES:
        text = pattern.sub(plain, text)
    return text


def _split_docstring(docstring: str) -> tuple[str, dict[str, str]]:
    """The text before the sections, and the sections by their names."""
    text, *parts = _SECTION.split(docstring)
    return text, dict(zip(parts[::2], parts[1::2], strict=True))


def _entries(section: str) -> Iterator[tuple[str, str]]:
    """The entries `name: text` of a section."""
    parts = _ENTRY.split(section)[1:]
    for name, text in zip(parts[::2], parts[1::2], strict=True):
        yield name, escape_marks(_flow(text))


def _flow(text: str) -> str:
    return " ".join(text.split())


def _paragraphs(text: str) -> Iterator[str]:
    body = text.partition("\n\nFields:\n")[0]
    for paragraph in filter(None, body.strip().split("\n\n")):
        yield from (escape_marks(_flow(paragraph)), "")
