"""Options that several commands share."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from datetime import datetime
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import click

from lighting.cli.console import print_estimate
from lighting.cli.outputs import MAPS, OutputKind
from lighting.errors import EnvironmentMapError, LightingError, ParameterError
from lighting.fields import option_name
from lighting.files import FileOptions, is_address
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

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from lighting.fusion.drawn_camera import KnownCamera
    from lighting.fusion.user_input import UserInput
    from lighting.photo_estimate import Estimate

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

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
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

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a number; BadParameter for what is none, or out of the range.

        Args:
            value: as the user typed it.
            param: of click.
            ctx: of click.
        """
        number = Number(f"{self.min:g}").convert(value, param, ctx)
        _check_finite(ctx, param, number)
        return super().convert(number, param, ctx)


class FileName(click.ParamType):  # type: ignore[type-arg]  # as above
    """The name of a file or folder, or "-", as it was typed; shells complete it."""

    name = "file"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
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

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a name; BadParameter for another one, with a similar one if there is any.

        Args:
            value: as the user typed it.
            param: of click.
            ctx: of click.
        """
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as error:
            self.refuse(error.message, value, param, ctx)

    def refuse(self, sentence: str, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> NoReturn:
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


class _Compression(RegistryChoice):
    """How an EXR is packed; the error for another name says more where it once was one."""

    def __init__(self) -> None:
        super().__init__(_FILE_TEXTS["compression"].choices or tuple)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from lighting.files.exr import check_exr_compression

        try:
            check_exr_compression(value)
        except EnvironmentMapError as error:
            self.refuse(str(error), value, param, ctx)
        return value


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


overwrite_option = click.option("--overwrite", is_flag=True, help="Replace files that are there.")


def _add_options(command: Callable[..., None], *options: Decorator) -> Callable[..., None]:
    """The command with options, which its help shows in this order."""
    for option in reversed(options):
        command = option(command)
    return command


_MAP_TEXTS, _FILE_TEXTS = option_texts(MapOptions), option_texts(FileOptions)


def _text_option(name: str, text: OptionText, default: object) -> Decorator:
    """The option of a field, by what people read of it everywhere."""
    names = f"--{name}/--no-{name}" if default is True else f"--{name}"
    kind: Any = None
    if name == "compression":
        kind = _Compression()
    elif text.choices is not None:
        kind = RegistryChoice(text.choices)
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
_LATER_TEXTS = {name: text for name, text in option_texts(Adjustments).items() if name != "exposure"}
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
        def with_view(*args: Any, **values: Any) -> None:
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

        return _add_options(with_view, *options)

    return decorate


def file_options(*names: str) -> Decorator:
    """Add the options that fill fields of FileOptions; a command receives it as `file`.

    Args:
        names: of the fields.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def with_file(*args: Any, **values: Any) -> None:
            with usage_errors():
                file = FileOptions(**{name: values.pop(name) for name in names})
            command(*args, file=file, **values)

        return _add_options(with_file, *(_text_option(n, _FILE_TEXTS[n], getattr(FileOptions, n)) for n in names))

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


def parse_time_option(_ctx: click.Context, _param: click.Parameter, text: str | None) -> datetime | None:
    """Read a time; BadParameter for what is none.

    Args:
        _ctx: of click.
        _param: of click.
        text: such as 2024-06-01T14:30+02:00; None where not stated.
    """
    if text is None:
        return None
    from lighting.photo.timestamps import parse_time

    return _parsed(parse_time, text)


def parse_utc_offset_option(_ctx: click.Context, _param: click.Parameter, text: str | None) -> float | None:
    """Read an offset from UTC [hours]; BadParameter for what is none.

    Args:
        _ctx: of click.
        _param: of click.
        text: such as +02:00 or 2; None where not stated.
    """
    if text is None:
        return None
    from lighting.photo.timestamps import parse_utc_offset

    return _parsed(parse_utc_offset, text)


def _headings(_ctx: click.Context, _param: click.Parameter, text: str | None) -> list[float] | None:
    from lighting.fusion.user_input import read_headings

    return None if text is None else _parsed(read_headings, text)


def _parsed(read: Callable[[str], _Value], text: str) -> _Value:
    try:
        return read(text)
    except ParameterError as error:
        raise click.BadParameter(str(error)) from error


def _fspy_camera(_ctx: click.Context, _param: click.Parameter, name: str | None) -> "KnownCamera | None":
    if name is None:
        return None
    from lighting.cli.console import read_small_file
    from lighting.fusion.fspy import MAX_FSPY_BYTES, read_fspy

    data = read_small_file(name, MAX_FSPY_BYTES)
    try:
        return read_fspy(data)
    except ParameterError as error:
        raise click.BadParameter(f"{name}: {error}") from error


_OPTIONS: dict[str, Decorator] = {  # by the fields of UserInput that they fill
    "metadata": click.option(
        "--no-metadata",
        "metadata",
        flag_value=False,
        default=True,
        help="Ignore EXIF and the like; use only the pixels.",
    ),
    "time": click.option(
        "--time",
        metavar="TIME",
        callback=parse_time_option,
        help="When: 2024-06-01T14:30, or with its offset, 2024-06-01T14:30+02:00.",
    ),
    "utc_offset": click.option(
        "--utc-offset",
        metavar="HOURS",
        callback=parse_utc_offset_option,
        help="Offset of local time from UTC: +02:00 or 2.",
    ),
    "latitude": click.option("--latitude", "--lat", type=Number("48.14"), metavar="DEG", help="Where: positive north."),
    "longitude": click.option(
        "--longitude", "--lon", type=Number("11.58"), metavar="DEG", help="Where: positive east."
    ),
    "heading": click.option(
        "--heading",
        type=Number("134.2"),
        metavar="DEG",
        help="Where the camera points, clockwise from true north.",
    ),
    "vertical_fov": click.option(
        "--vertical-fov",
        "--fov",
        type=Number("48.7"),
        metavar="DEG",
        help="Vertical field of view of the upright photo.",
    ),
    "camera_height": click.option(
        "--camera-height",
        type=Number("1.6"),
        metavar="METERS",
        help="How high the camera is above the ground.  [default: 1.6]",
    ),
    "shadows": click.option(
        "--shadow",
        "shadows",
        metavar="X,Y,X,Y[,X,Y]",
        multiple=True,
        help="A shadow, in pixels: from the foot of what casts it to its tip, then the thing's top. Repeatable. "
        "Also doubt: before them, own:X,Y, head:X,Y, line:X,Y,X,Y and lit:X,Y,X,Y[,X,Y].",
    ),
    "horizon": click.option(
        "--horizon", metavar="X,Y,X,Y", help="Two points of the horizon, in pixels: the camera's tilt."
    ),
    "verticals": click.option(
        "--vertical",
        "verticals",
        metavar="X,Y,X,Y",
        multiple=True,
        help="A line along an edge that stands upright: tilt and, of two or more, the lens. Repeatable. "
        "Also level:X,Y,X,Y,X,Y,X,Y of level edges that are parallel.",
    ),
    "reference": click.option(
        "--reference",
        metavar="X,Y,X,Y,METERS",
        help="A thing of known size, from its foot to its top: the camera's height. ground:... of one that lies.",
    ),
    "camera": click.option(
        "--camera",
        metavar="FILE",
        type=FileName(),
        callback=_fspy_camera,
        help="The camera by fSpy: its project (.fspy), or its JSON.",
    ),
    "spot": click.option("--spot", metavar="X,Y", help="Where an object stands on the ground, in pixels."),
    "keep_location": click.option("--keep-location", is_flag=True, help="Put latitude and longitude into the output."),
}
together_option = click.option("--together", is_flag=True, help="Combine photos of one place, taken in the same light.")
headings_option = click.option(
    "--headings",
    metavar="DEG,DEG,...",
    callback=_headings,
    help="Where each camera points, clockwise from any common direction.",
)


def _options(*names: str) -> Decorator:
    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def with_user_input(*args: Any, **options: Any) -> None:
            from lighting.fusion.user_input import UserInput

            values = {name: options.pop(name) for name in names}
            check_coordinates(values["latitude"], values["longitude"])
            with usage_errors():
                user_input = UserInput(**values)
            if user_input.drawn_fields and len(options.get("photos", ())) > 1:
                names_of = option_name(user_input.drawn_fields[0])
                raise click.UsageError(f"{names_of} is of one photo; give that photo alone.")
            command(*args, user_input=user_input, **options)

        return _add_options(with_user_input, *(_OPTIONS[name] for name in names))

    return decorate


# What the user states of a photo; a command receives it as `user_input`. Contradictions are wrong usage.
user_input_options = _options(*_OPTIONS)
_DRAWN = ("shadows", "horizon", "verticals", "reference", "camera", "spot")  # in one photo
clip_input_options = _options(*(name for name in _OPTIONS if name not in _DRAWN))
batch_input_options = _options(*(name for name in _OPTIONS if name not in ("time", "heading", *_DRAWN)))


@dataclass(frozen=True, eq=False, repr=False)
class PhotoOptions:
    """The options of a command that makes something of each photo."""

    photos: Sequence[str]
    """Names of files; "-" is stdin."""
    output: str | None
    """Name of a file or folder. None: beside each photo."""
    overwrite: bool
    """Whether a file may be replaced."""
    view: MapOptions
    """Of the map, the preview or the scene."""
    user_input: "UserInput"
    """What the user states of the photos."""
    model: str | None
    """A network's file. None: the one in this package."""
    strict: bool
    """Whether an unsuitable photo gives another exit status."""
    require: str | None
    """The trust that each answer must have, or the exit status is another. None: any."""
    as_json: bool
    """Whether lines are JSON."""
    quiet: bool
    """Whether there are no progress, summaries and warnings."""

    def print_estimate(self, photo: str, answer: "Estimate", warnings: Sequence[str], files: dict[str, str]) -> None:
        """Print the line of a photo, whose light is adjusted first, and its warnings.

        Args:
            photo: name of the file.
            answer: about the photo.
            warnings: of the answer and of what was made of it.
            files: that were written, by what they are.
        """
        from lighting.envmap.relighting import adjust_lighting

        light = adjust_lighting(answer.lighting, self.view.adjustments)
        probe = answer.probe(replace(self.view, yaw=0.0, sky=None)) if self.as_json else None
        crop, as_json, quiet = answer.photo.crop, self.as_json, self.quiet
        print_estimate(photo, light, warnings, files, probe=probe, crop=crop, as_json=as_json, quiet=quiet)


def photo_options(*names: str) -> Decorator:
    """Add the options that PhotoOptions holds, apart from -o; the command receives it as `chosen`.

    Args:
        names: the fields of MapOptions that count; none is all.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def with_chosen(*args: Any, **options: Any) -> None:
            chosen = PhotoOptions(**{field.name: options.pop(field.name) for field in fields(PhotoOptions)})
            command(*args, chosen=chosen, **options)

        return _add_options(
            with_chosen,
            click.argument("photos", nargs=-1, required=True, metavar="PHOTO...", type=FileName()),
            map_options(*names),
            user_input_options,
            model_option,
            strict_option,
            require_option,
            json_option,
            silent_option,
        )

    return decorate


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


def check_coordinates(latitude: float | None, longitude: float | None) -> None:
    """Raise UsageError where one of the two is missing.

    Args:
        latitude: deg; None where not stated.
        longitude: deg; None where not stated.
    """
    if (latitude is None) != (longitude is None):
        stated, missing = ("--lat", "--lon") if longitude is None else ("--lon", "--lat")
        raise click.UsageError(f"{stated} needs {missing} too, such as --lat 48.14 --lon 11.58.")
