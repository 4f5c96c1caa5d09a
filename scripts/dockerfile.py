"""A Dockerfile as data: its stages and steps, and what .dockerignore lets through.

Reads what this project's Dockerfile uses, and says so about the rest: no heredocs, no ADD, no ONBUILD, no SHELL.
"""

import json
import os
import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

WORDS = ("FROM", "ARG", "ENV", "LABEL", "WORKDIR", "COPY", "RUN", "USER", "EXPOSE", "HEALTHCHECK", "ENTRYPOINT", "CMD")


class UnsupportedError(Exception):
    """The Dockerfile uses a feature that this module does not support."""


@dataclass(frozen=True)
class Step:
    """One instruction, its flags taken off."""

    word: str  # one of WORDS
    flags: dict[str, str]
    value: str
    line: int

    @property
    def argv(self) -> list[str]:
        """The command of an exec form; UnsupportedError for a shell form."""
        if not self.value.startswith("["):
            raise UnsupportedError(f"Line {self.line}: {self.word} is not in exec form.")
        command: list[str] = json.loads(self.value)
        return command

    @property
    def pairs(self) -> dict[str, str]:
        """The NAME=VALUE pairs of an ENV, LABEL or ARG; a name alone has the value ""."""
        parts = (word.partition("=") for word in shlex.split(self.value))
        return {name: value for name, _, value in parts}


@dataclass(frozen=True)
class Stage:
    """From one FROM to the next."""

    name: str
    base: str
    steps: list[Step] = field(default_factory=list)

    def last(self, word: str) -> Step | None:
        """The last step with this word, or None."""
        return next((step for step in reversed(self.steps) if step.word == word), None)


def read_stages(text: str) -> list[Stage]:
    """The stages of a Dockerfile's text, the last without a name of its own."""
    stages: list[Stage] = []
    for step in read_steps(text):
        if step.word == "FROM":
            base, *named = step.value.split()
            stages.append(Stage(named[1] if named else "", base))
        elif stages:
            stages[-1].steps.append(step)
        else:
            raise UnsupportedError(f"Line {step.line}: {step.word} before the first FROM.")
    return stages


def read_steps(text: str) -> list[Step]:
    """Every instruction in its order, lines joined and comments left out."""
    steps: list[Step] = []
    parts: list[str] = []
    start = 0
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        start = start if parts else number
        parts.append(line.strip().removesuffix("\\").strip())
        if not line.endswith("\\"):
            steps.append(_step(" ".join(parts), start))
            parts = []
    return steps


def _step(text: str, line: int) -> Step:
    word, _, rest = text.partition(" ")
    if word not in WORDS or "<<" in rest:
        raise UnsupportedError(f"Line {line}: {text.split('<<')[0]!r} is not supported.")
    flags = {}
    while match := re.match(r"--([a-z-]+)=(\S+)\s+", rest):
        flags[match[1]] = match[2]
        rest = rest[match.end() :]
    return Step(word, flags, rest, line)


def expand(value: str, environment: dict[str, str]) -> str:
    """The value with $NAME and ${NAME} filled in; a name without a value is empty."""
    return re.sub(r"\$(?:\{(\w+)\}|(\w+))", lambda match: environment.get(match[1] or match[2], ""), value)


def context_files(root: Path) -> list[Path]:
    """The files that .dockerignore lets through, relative to `root`."""
    rules = read_rules((root / ".dockerignore").read_text(encoding="utf-8"))
    found: list[Path] = []
    for folder, folders, files in os.walk(root):
        here = Path(folder).relative_to(root)
        folders[:] = [name for name in folders if passes(here / name, rules)]
        found += [here / name for name in files if passes(here / name, rules)]
    return sorted(found)


Rules = list[tuple[bool, re.Pattern[str]]]


def read_rules(text: str) -> Rules:
    """The lines of a .dockerignore: whether each lets through, and what it matches."""
    rules = []
    for line in filter(None, (line.strip() for line in text.splitlines())):
        pattern = line.removeprefix("!").strip("/")
        if line.startswith("#"):
            continue
        if line.startswith("!") and "/" in pattern:
            raise UnsupportedError(f"{line!r}: only what lies in the root can be let through.")
        rules.append((line.startswith("!"), _pattern(pattern)))
    return rules


def _pattern(glob: str) -> re.Pattern[str]:
    parts = {"**/": "(?:.*/)?", "**": ".*", "*": "[^/]*", "?": "[^/]"}
    words = re.split(r"(\*\*/|\*\*|\*|\?)", glob)
    return re.compile("".join(parts.get(word, re.escape(word)) for word in words))


def passes(path: Path, rules: Rules) -> bool:
    """Whether the last rule that matches the path or a folder above it lets it through; with none it passes."""
    ways = [str(path), *map(str, path.parents)][: len(path.parts)]
    return next((lets for lets, rule in reversed(rules) if any(map(rule.fullmatch, ways))), True)
