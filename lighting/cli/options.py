"""Options that several commands share."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from datetime import datetime
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import click

from lighting.cli.console import MAPS, OutputKind, is_address, print_estimate
from lighting.errors import EnvironmentMapError, LightingError, ParameterError
from lighting.sky import SKY_MODELS, format_sky_models

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from lighting.envmap.relighting import Adjustments
    from lighting.fusion.user_input import UserInput
    from lighting.photo_estimate import Estimate
    from lighting.records import Lighting

Decorator = Callable[[Callable[..., None]], Callable[..., None]]
_Value = TypeVar("_Value")


def _height(_ctx: click.Context, _param: click.Parameter, value: int) -> int:
    from lighting.records import MAX_HEIGHT, MIN_HEIGHT

    if value % 2 or not MIN_HEIGHT <= value <= MAX_HEIGHT:
        raise click.BadParameter(f"{value} is not an even number from {MIN_HEIGHT} to {MAX_HEIGHT}.")
    return value


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
        super().__init__(_compressions)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from lighting.files.exr import check_exr_compression

        try:
            check_exr_compression(value)
        except EnvironmentMapError as error:
            self.refuse(str(error), value, param, ctx)
        return value


def _colour_spaces() -> Iterable[str]:
    from lighting.color import COLOR_SPACES

    return COLOR_SPACES


def _compressions() -> Iterable[str]:
    from lighting.files.exr import COMPRESSIONS

    return COMPRESSIONS


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
height_option = click.option(
    "--height", default=512, show_default=True, callback=_height, help="Rows of the map; columns are twice that."
)
no_sun_option = click.option(
    "--no-sun",
    "sun",
    flag_value=False,
    default=None,
    help="Leave direct sunlight out.  [default: painted if its power is known or it likely shines]",
)


def _add_options(command: Callable[..., None], *options: Decorator) -> Callable[..., None]:
    """The command with options, which its help shows in this order."""
    for option in reversed(options):
        command = option(command)
    return command


_MAP_OPTIONS: tuple[Decorator, ...] = (
    height_option,
    click.option(
        "--sky",
        metavar="MODEL",
        type=RegistryChoice(lambda: SKY_MODELS),
        help=f"The sky's shape: {format_sky_models(' or ')}, which are advanced.",
    ),
    click.option(
        "--yaw",
        default=0.0,
        metavar="DEG",
        type=Number("90"),
        callback=_check_finite,
        help="Turn the map, with its sun, to the right.",
    ),
    click.option(
        "--compression",
        metavar="NAME",
        type=_Compression(),
        help="How an EXR is packed: zip (the default), pxr24 or none.",
    ),
    click.option(
        "--colours",
        metavar="NAME",
        type=RegistryChoice(_colour_spaces),
        help="Primaries of an EXR: rec709 (the default), acescg or linear-p3. A record stays in Rec.709.",
    ),
)


def map_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options that say how a map is rendered; a command receives them together as `view`.

    Args:
        command: that receives them.
    """
    return _add_options(command, *_MAP_OPTIONS)


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


surroundings_option = click.option(
    "--surroundings/--no-surroundings",
    default=None,
    help="Show the surroundings, not only sky and ground.  [default: if the network predicts them]",
)
detail_option = click.option(
    "--detail/--no-detail",
    default=True,
    help="Add fine detail to a map with surroundings, all around the photo.  [default: detail]",
)
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
    from lighting.photo.clock import parse_time

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
    from lighting.photo.clock import parse_utc_offset

    return _parsed(parse_utc_offset, text)


def _headings(_ctx: click.Context, _param: click.Parameter, text: str | None) -> list[float] | None:
    from lighting.fusion.user_input import read_headings

    return None if text is None else _parsed(read_headings, text)


def _parsed(read: Callable[[str], _Value], text: str) -> _Value:
    try:
        return read(text)
    except ParameterError as error:
        raise click.BadParameter(str(error)) from error


def _sun(_ctx: click.Context, _param: click.Parameter, text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    from lighting.envmap.relighting import parse_sun

    try:
        return parse_sun(text)
    except ParameterError as error:
        sentence = (
            "it moves the sun, and needs AZIMUTH,ELEVATION in degrees: --sun 40,25. "
            "The sun is painted where it shines; --no-sun leaves it out."
        )
        raise click.BadParameter(sentence) from error


def _exposure(_ctx: click.Context, _param: click.Parameter, text: str) -> float:
    if text == _NO_EXPOSURE:
        return 0.0
    from lighting.envmap.relighting import parse_exposure

    try:
        return parse_exposure(text)
    except ParameterError as error:
        raise click.BadParameter(f"{text!r} is not a number of EV such as +0.5.") from error


def adjustment_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add what adjusts a light by hand, and --no-sun.

    A command receives `adjustments`, None without any, and `sun`, whether the sun is painted: one that the user moved
    is.

    Args:
        command: that receives them.
    """

    @wraps(command)
    def with_adjustments(*args: Any, **options: Any) -> None:
        names = ("sun_direction", "exposure", "haze", "overcast")
        sun, exposure, haze, overcast = (options.pop(name) for name in names)
        if sun is not None:
            if options["sun"] is False:
                raise click.UsageError("--sun moves the sun, and --no-sun leaves it out: choose one.")
            options["sun"] = True
        if sun is None and not exposure and haze is None and not overcast:
            command(*args, adjustments=None, **options)
            return
        from lighting.envmap.relighting import Adjustments

        with usage_errors():
            adjustments = Adjustments(sun, exposure, haze, overcast)
        command(*args, adjustments=adjustments, **options)

    return _add_options(with_adjustments, *_ADJUSTMENTS)


_NO_EXPOSURE = "0"

_ADJUSTMENTS: tuple[Decorator, ...] = (
    click.option(
        "--sun",
        "sun_direction",
        metavar="AZ,EL",
        callback=_sun,
        help="Move the sun: degrees from where the camera points, positive right, and above the horizon.",
    ),
    click.option(
        "--exposure",
        metavar="EV",
        default=_NO_EXPOSURE,
        callback=_exposure,
        help="Brighten by so many EV: +1 is twice as bright.",
    ),
    click.option("--haze", type=Number("3"), metavar="TURBIDITY", help="How hazy, 1 to 10: 2 is clear, 10 hazy."),
    click.option(
        "--overcast", is_flag=True, help="Cover the sky with clouds: no sun, five sixths of a clear sky's light, gray."
    ),
    no_sun_option,
)

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
            command(*args, user_input=user_input, **options)

        return _add_options(with_user_input, *(_OPTIONS[name] for name in names))

    return decorate


# What the user states of a photo; a command receives it as `user_input`. Contradictions are wrong usage.
user_input_options = _options(*_OPTIONS)
batch_input_options = _options(*(name for name in _OPTIONS if name not in ("time", "heading")))


@dataclass(frozen=True, eq=False, repr=False)
class PhotoOptions:
    """The options of a command that makes something of each photo."""

    photos: Sequence[str]
    """Names of files; "-" is stdin."""
    output: str | None
    """Name of a file or folder. None: beside each photo."""
    overwrite: bool
    """Whether a file may be replaced."""
    surroundings: bool | None
    """Whether maps show the place. None: where the network predicts it."""
    detail: bool
    """Whether they then have detail all around the photo."""
    sun: bool | None
    """Whether it is in maps and scenes. None: where it shines."""
    adjustments: "Adjustments | None"
    """What the user changes of the light. None: nothing."""
    user_input: "UserInput"
    """What the user states of the photos."""
    model: str | None
    """A network's file. None: the one in this package."""
    strict: bool
    """Whether an unsuitable photo gives another exit status."""
    as_json: bool
    """Whether lines are JSON."""
    quiet: bool
    """Whether there are no progress, summaries and warnings."""

    def adjust(self, lighting: "Lighting") -> "Lighting":
        """Return a light as the user adjusts it.

        Args:
            lighting: before.
        """
        if self.adjustments is None:
            return lighting
        from lighting.envmap.relighting import adjust_lighting

        return adjust_lighting(lighting, self.adjustments)

    def print_estimate(
        self, photo: str, answer: "Estimate", lighting: "Lighting", warnings: Sequence[str], files: dict[str, str]
    ) -> None:
        """Print the line of a photo, and its warnings.

        Args:
            photo: name of the file.
            answer: about the photo.
            lighting: as the user adjusted it.
            warnings: of the answer and of what was made of it.
            files: that were written, by what they are.
        """
        probe = None
        if self.as_json:
            probe = answer.replace(lighting=lighting).light_probe(sun=self.sun, surroundings=self.surroundings)
        crop, as_json, quiet = answer.photo.crop, self.as_json, self.quiet
        print_estimate(photo, lighting, warnings, files, probe=probe, crop=crop, as_json=as_json, quiet=quiet)


def photo_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options that PhotoOptions holds, apart from -o; the command receives it as `chosen`.

    Args:
        command: that receives them.
    """

    @wraps(command)
    def with_chosen(*args: Any, **options: Any) -> None:
        chosen = PhotoOptions(**{field.name: options.pop(field.name) for field in fields(PhotoOptions)})
        command(*args, chosen=chosen, **options)

    return _add_options(
        with_chosen,
        click.argument("photos", nargs=-1, required=True, metavar="PHOTO...", type=FileName()),
        adjustment_options,
        surroundings_option,
        detail_option,
        user_input_options,
        model_option,
        strict_option,
        json_option,
        silent_option,
    )


@contextmanager
def usage_errors(kind: type[LightingError] = ParameterError) -> Iterator[None]:
    """Turn errors into wrong usage, with the option in place of the field.

    Args:
        kind: of error.
    """
    try:
        yield
    except kind as error:
        from lighting.fields import option_name

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
