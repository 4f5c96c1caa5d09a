"""Options that several commands share: their types, and those of maps, files, outputs and networks."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import click

from lighting.cli.outputs import MAPS, OutputKind
from lighting.errors import EnvironmentMapError, LightingError, ParameterError
from lighting.fields import option_name
from lighting.files import FileOptions, is_address
from lighting.map_options import (
    MAX_HEIGHT,
    Adjustments,
    Around,
    MapOptions,
    Names,
    OptionText,
    around_of_switches,
    check_height,
    names_in,
    option_texts,
    parse_sun,
)

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

Decorator = Callable[[Callable[..., None]], Callable[..., None]]
_Value = TypeVar("_Value")


class Number(click.types.FloatParamType):
    """Any number; the library checks its range, and that it is finite."""

    def __init__(self, example: str) -> None:
        """Make a type of an option.

        Args:
            example: a number for the error about what is none.
        """
        self.example = example

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read a number; BadParameter for what is none."""
        try:
            return float(value)
        except ValueError:
            self.fail(f"{value!r} is not a number such as {self.example}.", param, ctx)


def number_option(example: str, metavar: str, text: str, *names: str, **settings: Any) -> Decorator:
    """Return an option that takes a Number.

    Args:
        example: as in Number.
        metavar: the unit, as the help names a value.
        text: what the help says.
        *names: of the option, and of the command's parameter.
        **settings: as click takes them, such as the default.
    """
    return click.option(*names, type=Number(example), metavar=metavar, help=text, **settings)


class FiniteRange(click.FloatRange):
    """A range that nan is not in, which no comparison keeps out."""

    def convert(self, value: str | float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read a number; BadParameter for what is none, or out of the range."""
        number = Number(f"{self.min:g}").convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{number} is not a finite number.", param, ctx)
        return super().convert(number, param, ctx)


class FileName(click.ParamType):  # type: ignore[type-arg]  # as below
    """The name of a file or folder, or "-", as it was typed; shells complete it."""

    name = "file"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name; BadParameter for an address in the web."""
        if is_address(value):
            self.fail(f"{value} is an address; download it, and give the name of the file.", param, ctx)
        return value

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> "list[CompletionItem]":  # noqa: ARG002
        """Have the shell complete names of files."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="file")]


class RegistryChoice(click.Choice):  # type: ignore[type-arg]  # which click before 8.4 knows none of
    """A name in a registry, which is read when it is needed: what was added to it meanwhile counts."""

    def __init__(self, registry: Names) -> None:
        self.registry, self.case_sensitive = registry, True

    @property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        return names_in(self.registry)

    def get_missing_message(self, param: click.Parameter, ctx: click.Context | None = None) -> str:  # noqa: ARG002
        """Return what to type where an option is missing."""
        return f"Type {param.opts[0]} and one of {', '.join(self.choices)}."

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Read a name; BadParameter for another one, with a similar one if there is any."""
        try:
            name: str = super().convert(value, param, ctx)
        except click.BadParameter as error:
            self.refuse(error.message, value, param, ctx)
        return name

    def refuse(self, sentence: str, value: str, param: click.Parameter | None, ctx: click.Context | None) -> NoReturn:
        """Raise BadParameter, with a similar name if there is any."""
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


def read_by(
    read: Callable[[str], _Value], sentence: str = "{error}"
) -> Callable[[click.Context, click.Parameter, str | None], _Value | None]:
    """Return a callback of an option that reads its text; BadParameter for what it is none of.

    Args:
        read: raises ValueError, such as ParameterError, for a text that it does not take.
        sentence: of the error, about its {text!r} or {error}.
    """

    def callback(_ctx: click.Context, _param: click.Parameter, text: str | None) -> _Value | None:
        try:
            return None if text is None else read(text)
        except ValueError as error:
            raise click.BadParameter(sentence.format(text=text, error=error)) from error

    return callback


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


def with_option_name(ctx: click.Context, error: Exception) -> Exception:
    """Return an error with an option of the running command in place of the field that it is about.

    Args:
        ctx: of the command.
        error: of any kind; one about no option stays as it is.
    """
    options = {name for param in ctx.command.params for name in param.opts}
    if isinstance(error, LightingError) and error.field and option_name(error.field) in options:
        return error.renamed(option_name)
    return error


def record_options(name: str, make: Callable[[dict[str, Any]], object], *options: Decorator) -> Decorator:
    """Return a decorator that gives a command options, in the order of its help, and what is made of their values.

    Args:
        name: of the parameter by which the command receives it.
        make: takes all values by name, and removes those that it uses; its ParameterError is wrong usage.
        *options: decorators of click.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def with_record(*args: object, **values: Any) -> None:
            with usage_errors():
                record = make(values)
            command(*args, **{name: record}, **values)

        made: Callable[..., None] = with_record
        for option in reversed(options):
            made = option(made)
        return made

    return decorate


class _Compression(RegistryChoice):
    """How an EXR is packed; the error for another name says more where it once was one."""

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from lighting.files.exr import check_exr_compression

        try:
            check_exr_compression(value)
        except EnvironmentMapError as error:
            self.refuse(str(error), value, param, ctx)
        return value


overwrite_option = click.option("--overwrite", is_flag=True, help="Replace files that are there.")


_MAP_TEXTS, _FILE_TEXTS, _ADJUSTMENT_TEXTS = map(option_texts, (MapOptions, FileOptions, Adjustments))


def _text_option(name: str, text: OptionText, default: object) -> Decorator:
    """The option of a field, by what people read of it everywhere."""
    names = f"--{name}/--no-{name}" if default is True else f"--{name}"
    kind: RegistryChoice | Number | type[int] | None = None
    if text.choices is not None:
        kind = (_Compression if name == "compression" else RegistryChoice)(text.choices)
    elif isinstance(default, bool):
        return click.option(names, is_flag=True, default=default, show_default=default or None, help=_sentence(text))
    elif text.range is not None:
        kind = int if isinstance(default, int) else Number(f"{text.example:g}")
    return click.option(
        names, metavar=text.unit or None, type=kind, default=default, show_default=True, help=_sentence(text)
    )


def _sentence(text: OptionText) -> str:
    phrase = str(text.help)
    return f"{phrase[0].upper()}{phrase[1:]}."


def parse_exposure(text: str) -> float:
    """Return an adjustment of the exposure such as "+0.5" or "-1ev"; ValueError for any other text.

    Args:
        text: a number of EV, with or without the unit.
    """
    return float(text.strip().lower().removesuffix("ev"))


_SUN = click.option(
    "--no-sun",
    "sun",
    flag_value=False,
    default=None,
    help="Leave direct sunlight out.  [default: painted if it likely shines]",
)
_ADJUSTMENTS: dict[str, Decorator] = {  # by the parameters of a command
    "sun_direction": click.option(
        "--sun",
        "sun_direction",
        metavar="AZ,EL",
        callback=read_by(
            parse_sun,
            "it moves the sun, and needs AZIMUTH,ELEVATION in degrees: --sun 40,25. "
            "The sun is painted where it shines; --no-sun leaves it out.",
        ),
        help="Move the sun: degrees from where the camera points, positive right, and above the horizon.",
    ),
    "exposure": click.option(
        "--exposure",
        metavar="EV",
        default="0",
        callback=read_by(parse_exposure, "{text!r} is not a number of EV such as +0.5."),
        help="Brighten by so many EV: +1 is twice as bright.",
    ),
    **{
        name: _text_option(name, _ADJUSTMENT_TEXTS[name], getattr(Adjustments, name))
        for name in ("haze", "overcast", "pick")
    },
}
_SWITCHES: dict[str, Decorator] = {  # that `around` replaces, until 0.4.0
    name: click.option(f"--{name}/--no-{name}", default=None, hidden=True, help="An old form of --around.")
    for name in ("surroundings", "detail")
}
MAP_PARAMETERS = frozenset([*_MAP_TEXTS, *_FILE_TEXTS, *_ADJUSTMENTS, *_SWITCHES])  # that commands have of maps


def map_options(*names: str, without_detail: str = Around.PHOTO.value, max_height: int = MAX_HEIGHT) -> Decorator:
    """Add the options that fill fields of MapOptions; a command receives it as `view`.

    Args:
        names: of the fields; none is all.
        without_detail: as in `around_of_switches`.
        max_height: rows that the command's maps may have.
    """
    names = names or tuple(field.name for field in fields(MapOptions))
    options = [
        *(
            _SUN if name == "sun" else _text_option(name, text, getattr(MapOptions, name))
            for name, text in _MAP_TEXTS.items()
            if name in names
        ),
        *(_ADJUSTMENTS.values() if "adjustments" in names else ()),
        *(_SWITCHES.values() if "around" in names else ()),
    ]

    return record_options("view", partial(_make_view, names, without_detail, max_height), *options)


def _make_view(names: Sequence[str], without_detail: str, max_height: int, values: dict[str, Any]) -> MapOptions:
    """The MapOptions of a command's values, which are removed."""
    fields_of = {name: values.pop(name) for name in names if name != "adjustments"}
    if "around" in names:
        old = around_of_switches(values.pop("surroundings"), values.pop("detail"), without_detail)
        fields_of["around"] = fields_of["around"] or old
    if "adjustments" in names:
        sun, *others = (values.pop(name) for name in _ADJUSTMENTS)
        if fields_of["sun"] is False:
            if sun is not None:
                raise click.UsageError("--sun moves the sun, and --no-sun leaves it out: choose one.")
            if others[-1] is not None:
                raise click.UsageError("--pick chooses a sun, and --no-sun leaves it out: choose one.")
        adjustments = fields_of["adjustments"] = Adjustments(sun, *others)
        if sun is not None and not adjustments.overcast:
            fields_of["sun"] = True
    if "height" in names:
        check_height(fields_of["height"], max_height)
    return MapOptions(**fields_of)


def file_options(*names: str) -> Decorator:
    """Add the options that fill fields of FileOptions; a command receives it as `file`.

    Args:
        names: of the fields.
    """
    options = (_text_option(name, _FILE_TEXTS[name], getattr(FileOptions, name)) for name in names)
    return record_options("file", lambda values: FileOptions(**{name: values.pop(name) for name in names}), *options)


def file_output(kind: OutputKind, *, several: bool = False) -> Decorator:
    """Add -o for a file, and --overwrite.

    Args:
        kind: of file.
        several: whether several sources go to a folder.
    """
    folder = ", or FOLDER/" if several else ""
    what = "EXR on stdout" if kind is MAPS else "stdout"
    return record_output(f'{kind.names}{folder}; "-" is {what}.  [default: {kind.ending} beside the input]')


def folder_output(default: str, text: str = "New or empty unless --overwrite.") -> Decorator:
    """Add -o for a folder, and --overwrite.

    Args:
        default: how the help names the default.
        text: what the help says.
    """
    return _output(f"{text}  [default: {default}]", "FOLDER", check_folder_name)


def record_output(text: str) -> Decorator:
    """Add -o for a file of JSON, and --overwrite.

    Args:
        text: what the help says.
    """
    return _output(text, "FILE", check_file_name)


def _output(text: str, metavar: str, check: Callable[..., str | None]) -> Decorator:
    option = click.option("-o", "--output", metavar=metavar, callback=check, help=text)
    return lambda command: option(overwrite_option(command))


model_option = click.option(
    "--model",
    metavar="FILE.onnx",
    type=FileName(),
    callback=check_file_name,
    help="Use your own network, not the package's.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="JSON on stdout instead of words.")
strict_option = click.option(
    "--strict", is_flag=True, help="Exit with status 3 if a photo is probably not an outdoor daylight photo."
)
require_option = click.option(
    "--require", type=click.Choice(["sure"]), help="Exit with status 4 if an answer is not sure."
)
quiet_option = click.option("-q", "--quiet", is_flag=True, help="No progress and no summary.")
silent_option = click.option("-q", "--quiet", is_flag=True, help="No progress, no summary and no warnings.")
