"""Options of maps, files, outputs and networks that several commands share."""

from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from typing import Any

import click

from lighting.cli.option_types import (
    Decorator,
    FileName,
    Number,
    RegistryChoice,
    add_options,
    check_file_name,
    check_folder_name,
    usage_errors,
)
from lighting.cli.outputs import MAPS, OutputKind
from lighting.errors import EnvironmentMapError, ParameterError
from lighting.files import FileOptions
from lighting.map_options import (
    Adjustments,
    Around,
    MapOptions,
    OptionText,
    around_of_switches,
    check_height,
    option_texts,
    parse_exposure,
    parse_sun,
)


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


_MAP_TEXTS, _FILE_TEXTS = option_texts(MapOptions), option_texts(FileOptions)


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


def _checked_height(_ctx: click.Context, _param: click.Parameter, height: int) -> int:
    with usage_errors():
        check_height(height)
    return height


height_option = click.option(
    "--height",
    default=MapOptions.height,
    show_default=True,
    callback=_checked_height,
    help=_sentence(_MAP_TEXTS["height"]),
)


def _sun(_ctx: click.Context, _param: click.Parameter, text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        return parse_sun(text)
    except ParameterError as error:
        sentence = (
            "it moves the sun, and needs AZIMUTH,ELEVATION in degrees: --sun 40,25. "
            "The sun is painted where it shines; --no-sun leaves it out."
        )
        raise click.BadParameter(sentence) from error


def _exposure(_ctx: click.Context, _param: click.Parameter, text: str) -> float:
    try:
        return parse_exposure(text)
    except ParameterError as error:
        raise click.BadParameter(f"{text!r} is not a number of EV such as +0.5.") from error


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
        callback=_sun,
        help="Move the sun: degrees from where the camera points, positive right, and above the horizon.",
    ),
    "exposure": click.option(
        "--exposure",
        metavar="EV",
        default="0",
        callback=_exposure,
        help="Brighten by so many EV: +1 is twice as bright.",
    ),
    **{
        name: _text_option(name, option_texts(Adjustments)[name], getattr(Adjustments, name))
        for name in ("haze", "overcast", "pick")
    },
}
_SWITCHES: dict[str, Decorator] = {  # that `around` replaces, until 0.4.0
    name: click.option(f"--{name}/--no-{name}", default=None, hidden=True, help="An old form of --around.")
    for name in ("surroundings", "detail")
}
MAP_PARAMETERS = frozenset([*_MAP_TEXTS, *_FILE_TEXTS, *_ADJUSTMENTS, *_SWITCHES])  # that commands have of maps


def map_options(*names: str, without_detail: str = Around.PHOTO.value) -> Decorator:
    """Add the options that fill fields of MapOptions; a command receives it as `view`.

    Args:
        names: of the fields; none is all.
        without_detail: as in `around_of_switches`.
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

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def with_view(*args: object, **values: Any) -> None:
            fields_of = {name: values.pop(name) for name in names if name != "adjustments"}
            if "around" in names:
                old = around_of_switches(values.pop("surroundings"), values.pop("detail"), without_detail)
                fields_of["around"] = fields_of["around"] or old
            if "adjustments" in names:
                sun, *others = (values.pop(name) for name in _ADJUSTMENTS)
                if sun is not None and fields_of["sun"] is False:
                    raise click.UsageError("--sun moves the sun, and --no-sun leaves it out: choose one.")
                if others[-1] is not None and fields_of["sun"] is False:
                    raise click.UsageError("--pick chooses a sun, and --no-sun leaves it out: choose one.")
                fields_of["sun"] = True if sun is not None else fields_of["sun"]
                with usage_errors():
                    fields_of["adjustments"] = Adjustments(sun, *others)
            with usage_errors():
                view = MapOptions(**fields_of)
            command(*args, view=view, **values)

        return add_options(with_view, *options)

    return decorate


def file_options(*names: str) -> Decorator:
    """Add the options that fill fields of FileOptions; a command receives it as `file`.

    Args:
        names: of the fields.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def with_file(*args: object, **values: Any) -> None:
            with usage_errors():
                file = FileOptions(**{name: values.pop(name) for name in names})
            command(*args, file=file, **values)

        return add_options(with_file, *(_text_option(n, _FILE_TEXTS[n], getattr(FileOptions, n)) for n in names))

    return decorate


def file_output(kind: OutputKind, *, several: bool = False) -> Decorator:
    """Add -o for a file, and --overwrite.

    Args:
        kind: of file.
        several: whether several sources go to a folder.
    """
    folder = ", or FOLDER/" if several else ""
    what = "EXR on stdout" if kind is MAPS else "stdout"
    text = f'{kind.names}{folder}; "-" is {what}.  [default: {kind.ending} beside the input]'
    option = click.option("-o", "--output", metavar="FILE", callback=check_file_name, help=text)
    return lambda command: option(overwrite_option(command))


def folder_output(default: str, text: str = "New or empty unless --overwrite.") -> Decorator:
    """Add -o for a folder, and --overwrite.

    Args:
        default: how the help names the default.
        text: what the help says.
    """
    option = click.option(
        "-o", "--output", metavar="FOLDER", callback=check_folder_name, help=f"{text}  [default: {default}]"
    )
    return lambda command: option(overwrite_option(command))


def record_output(text: str) -> Decorator:
    """Add -o for a file of JSON, and --overwrite.

    Args:
        text: what the help says.
    """
    option = click.option("-o", "--output", metavar="FILE", callback=check_file_name, help=text)
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
