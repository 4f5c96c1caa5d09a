"""Types of options, and what several modules of options share: names of files and folders, errors as wrong usage."""

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from lighting.errors import LightingError, ParameterError
from lighting.fields import option_name
from lighting.files import is_address

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


Decorator = Callable[[Callable[..., None]], Callable[..., None]]


class Number(click.types.FloatParamType):
    """Any number; the library checks its range, and that it is finite."""

    def __init__(self, example: str) -> None:
        """Make a type of an option.

        Args:
            example: a number for the error about what is none.
        """
        self.example = example

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read a number; BadParameter for what is none.

        Args:
            value: as the user typed it.
            param: of click.
            ctx: of click.
        """
        try:
            return float(value)
        except ValueError:
            self.fail(f"{value!r} is not a number such as {self.example}.", param, ctx)


def _check_finite(_ctx: click.Context | None, _param: click.Parameter | None, value: float) -> float:
    if not math.isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number.")
    return value


class FiniteRange(click.FloatRange):
    """A range that nan is not in, which no comparison keeps out."""

    def convert(self, value: str | float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read a number; BadParameter for what is none, or out of the range.

        Args:
            value: as the user typed it.
            param: of click.
            ctx: of click.
        """
        number = Number(f"{self.min:g}").convert(value, param, ctx)
        _check_finite(ctx, param, number)
        return super().convert(number, param, ctx)


class FileName(click.ParamType):  # type: ignore[type-arg]  # as below
    """The name of a file or folder, or "-", as it was typed; shells complete it."""

    name = "file"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name; BadParameter for an address in the web.

        Args:
            value: as the user typed it.
            param: of click.
            ctx: of click.
        """
        if is_address(value):
            self.fail(f"{value} is an address; download it, and give the name of the file.", param, ctx)
        return value

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> "list[CompletionItem]":  # noqa: ARG002
        """Have the shell complete names of files.

        Args:
            ctx: of click.
            param: of click.
            incomplete: what was typed so far.
        """
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="file")]


class RegistryChoice(click.Choice):  # type: ignore[type-arg]  # which click before 8.4 knows none of
    """A name in a registry, which is read when it is needed: what was added to it meanwhile counts."""

    def __init__(self, names: Callable[[], Iterable[str]]) -> None:
        self.names, self.case_sensitive = names, True

    @property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(self.names())

    def get_missing_message(self, param: click.Parameter, ctx: click.Context | None = None) -> str:  # noqa: ARG002
        """Return what to type where an option is missing, such as "Type --for and one of blender, usd."

        Args:
            param: of click.
            ctx: of click.
        """
        return f"Type {param.opts[0]} and one of {', '.join(self.choices)}."

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Read a name; BadParameter for another one, with a similar one if there is any.

        Args:
            value: as the user typed it.
            param: of click.
            ctx: of click.
        """
        try:
            name: str = super().convert(value, param, ctx)
        except click.BadParameter as error:
            self.refuse(error.message, value, param, ctx)
        return name

    def refuse(self, sentence: str, value: str, param: click.Parameter | None, ctx: click.Context | None) -> NoReturn:
        """Raise BadParameter, with a similar name if there is any.

        Args:
            sentence: what is wrong.
            value: as the user typed it.
            param: of click.
            ctx: of click.
        """
        from difflib import get_close_matches

        near = get_close_matches(str(value).lower(), self.choices, n=1)
        self.fail(f"{sentence} Did you mean {near[0]}?" if near else sentence, param, ctx)


_FILE_SUFFIXES = (  # in which no folder's name ends
    ".exr", ".hdr", ".png", ".jpg", ".jpeg", ".json", ".jsonl", ".csv", ".parquet", ".zip", ".mp4", ".mov", ".py",
    ".blend", ".usd", ".usda", ".usdc", ".usdz", ".gltf", ".glb", ".fbx", ".obj", ".tscn", ".xml",
)  # fmt: skip


def check_folder_name(_ctx: click.Context, _param: click.Parameter, name: str | None) -> str | None:
    """Refuse what names no folder, as an empty variable of a shell, which would be the current one.

    Args:
        _ctx: of click.
        _param: of click.
        name: of the folder; None where not stated.
    """
    if name == "":
        raise click.BadParameter("the name of the folder is empty.")
    if name == "-":
        raise click.BadParameter("the results are a folder, which stdout cannot be.")
    if name and (path := Path(name)).suffix.lower() in _FILE_SUFFIXES and not path.exists():
        raise click.BadParameter(f"the results are a folder, and {name} is a file's name; try {path.with_suffix('')}.")
    return name


def check_file_name(_ctx: click.Context, _param: click.Parameter, name: str | None) -> str | None:
    """Refuse an empty name, as an empty variable of a shell is.

    Args:
        _ctx: of click.
        _param: of click.
        name: of the file; None where not stated.
    """
    if name == "":
        raise click.BadParameter("the name of the file is empty.")
    return name


def add_options(command: Callable[..., None], *options: Decorator) -> Callable[..., None]:
    """Return a command with options, which its help shows in this order.

    Args:
        command: a function that takes their values by name.
        *options: decorators of click.
    """
    for option in reversed(options):
        command = option(command)
    return command


@contextmanager
def usage_errors(kind: type[LightingError] = ParameterError) -> Iterator[None]:
    """Turn errors into wrong usage, with the option in place of the field.

    Args:
        kind: of error.
    """
    try:
        yield
    except kind as error:
        raise click.UsageError(str(error.renamed(option_name))) from error
