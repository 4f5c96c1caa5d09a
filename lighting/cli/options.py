"""Options that several commands share."""

import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from lighting.errors import LightingError, ParameterError
from lighting.files import MAP_FORMATS
from lighting.sky import SKY_MODELS, format_sky_models

if TYPE_CHECKING:
    from lighting.fusion.user_input import UserInput

Command = TypeVar("Command", bound=Callable[..., None])

_EMPTY_NAME = "the name of the file is empty."


def _output_file(*suffixes: str) -> Callable[[click.Context, click.Parameter, str | None], str | None]:
    """A check that refuses an output file before any work if it could not be written later."""

    def check(_ctx: click.Context, _param: click.Parameter, name: str | None) -> str | None:
        if name is not None and (sentence := _output_file_error(name, suffixes)):
            raise click.BadParameter(sentence)
        return name

    return check


def _output_file_error(name: str, suffixes: Sequence[str]) -> str | None:
    if not name:
        return _EMPTY_NAME
    path = Path(name)
    if name == "-":
        if not sys.stdout.writable():
            return "There is no stdout to write to, it is closed."
        return "Binary data needs a file or a pipe, not a terminal." if sys.stdout.isatty() else None
    if path.is_dir():
        return f"{name} is a folder."
    if path.exists() and not path.is_file():
        return f"{name} is a pipe or a device, not a file."
    if path.suffix.lower() not in suffixes:
        return f"{name} must end in {_either(suffixes)}."
    folder = Path(os.path.realpath(name)).parent if path.is_symlink() else path.parent
    if not folder.is_dir():
        return f"There is no folder {folder}."
    return None if os.access(folder, os.W_OK) else f"The folder {folder} cannot be written to."


def check_folder_name(_ctx: click.Context, _param: click.Parameter, name: str) -> str:
    """Refuse what names no folder, as an empty variable of a shell, which would be the current one.

    Args:
        _ctx: of click.
        _param: of click.
        name: of the folder.
    """
    if not name:
        raise click.BadParameter("the name of the folder is empty.")
    if name == "-":
        raise click.BadParameter("the results are a folder, which stdout cannot be.")
    return name


def check_file_name(_ctx: click.Context, _param: click.Parameter, name: str | None) -> str | None:
    """Refuse an empty name, as an empty variable of a shell is.

    Args:
        _ctx: of click.
        _param: of click.
        name: of the file; None where not stated.
    """
    if name == "":
        raise click.BadParameter(_EMPTY_NAME)
    return name


def _either(words: Sequence[str]) -> str:
    return " or ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _map_suffixes() -> list[str]:
    return [f".{name}" for name in MAP_FORMATS]


def _map_file(ctx: click.Context, param: click.Parameter, name: str | None) -> str | None:
    return _output_file(*_map_suffixes())(ctx, param, name)


def _height(_ctx: click.Context, _param: click.Parameter, value: int) -> int:
    from lighting.records import MAX_HEIGHT, MIN_HEIGHT

    if value % 2 or not MIN_HEIGHT <= value <= MAX_HEIGHT:
        raise click.BadParameter(f"{value} is not an even number from {MIN_HEIGHT} to {MAX_HEIGHT}.")
    return value


def _finite(_ctx: click.Context, _param: click.Parameter, value: float) -> float:
    if not math.isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number.")
    return value


class FiniteRange(click.FloatRange):
    """A range that nan is not in, which no comparison keeps out."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{number} is not a finite number.", param, ctx)
        return number


class RegistryChoice(click.Choice):  # type: ignore[type-arg]  # which click before 8.4 knows none of
    """A name in a registry, which is read when it is needed: what was added to it meanwhile counts."""

    def __init__(self, names: Callable[[], Iterable[str]]) -> None:
        self.names, self.case_sensitive = names, True

    @property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(self.names())


def _sky(_ctx: click.Context, _param: click.Parameter, value: str | None) -> str | None:
    if value is not None and value not in SKY_MODELS:
        raise click.BadParameter(f"{value} is not one of {', '.join(SKY_MODELS)}.")
    return value


def _compression(_ctx: click.Context, _param: click.Parameter, name: str | None) -> str | None:
    from lighting.errors import EnvironmentMapError
    from lighting.files.exr import check_exr_compression

    try:
        if name is not None:
            check_exr_compression(name)
    except EnvironmentMapError as error:
        raise click.BadParameter(str(error)) from error
    return name


def removed_option(name: str, instead: str) -> Callable[[Command], Command]:
    """Make an option that is gone and that no help shows: its use ends with a sentence about what to use.

    Args:
        name: such as "--fit".
        instead: the rest of the sentence.
    """

    def refuse(_ctx: click.Context, _param: click.Parameter, value: str | None) -> None:
        if value is not None:
            raise click.UsageError(f"{name} was removed: {instead}.")

    return click.option(name, hidden=True, expose_value=False, is_eager=True, callback=refuse, help="Removed.")


height_option = click.option(
    "--height", default=512, show_default=True, callback=_height, help="Rows of the map; columns are twice that."
)
sun_option = click.option(
    "--sun/--no-sun",
    default=None,
    help="Whether direct sunlight is in it; by default where the light states its power, or where it likely shines.",
)


def map_options(command: Command) -> Command:
    """Add the options that say how a map is rendered; a command receives them together as `view`.

    Args:
        command: that receives them.
    """
    options = [
        height_option,
        sun_option,
        click.option(
            "--sky",
            metavar="MODEL",
            callback=_sky,
            help=f"The sky's shape: {format_sky_models(' or ')}, which are advanced.",
        ),
        click.option(
            "--yaw", default=0.0, metavar="DEG", callback=_finite, help="Turn the map to the right, sun and all."
        ),
        click.option(
            "--compression",
            metavar="NAME",
            callback=_compression,
            help="How an EXR is packed: zip (the default), pxr24 or none.",
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


_required_output = partial(click.option, "-o", "--output", required=True)
results_folder = _required_output(metavar="FOLDER", callback=check_folder_name, help="New or empty unless --overwrite.")
surroundings_option = click.option(
    "--surroundings/--no-surroundings",
    default=None,
    help="Whether the map shows the place, not the sky alone; by default where the network predicts it.",
)
detail_option = click.option(
    "--detail/--no-detail",
    default=True,
    help="Whether a map that shows the place has detail all around the photo; by default it has.",
)
map_output = _required_output(
    metavar="FILE", callback=_map_file, help=f'{_either(_map_suffixes())}; "-" is EXR on stdout.'
)
check_png_file = _output_file(".png")
model_option = click.option(
    "--model", metavar="FILE.onnx", callback=check_file_name, help="Another network than the one in this package."
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
    from lighting.photo.clock import parse_time

    return None if text is None else _parsed(parse_time, text)


def parse_utc_offset_option(_ctx: click.Context, _param: click.Parameter, text: str | None) -> float | None:
    """Read an offset from UTC [hours]; BadParameter for what is none.

    Args:
        _ctx: of click.
        _param: of click.
        text: such as +02:00 or 2; None where not stated.
    """
    from lighting.photo.clock import parse_utc_offset

    return None if text is None else _parsed(parse_utc_offset, text)


def _headings(_ctx: click.Context, _param: click.Parameter, text: str | None) -> list[float] | None:
    from lighting.fusion.user_input import read_headings

    return None if text is None else _parsed(read_headings, text)


def _parsed(read: Callable[[str], Any], text: str) -> Any:
    try:
        return read(text)
    except ParameterError as error:
        raise click.BadParameter(str(error)) from error


Decorator = Callable[[Callable[..., None]], Callable[..., None]]

_OPTIONS: dict[str, Decorator] = {  # by the fields of UserInput that they fill
    "metadata": click.option(
        "--no-exif", "metadata", flag_value=False, default=True, help="Pixels alone: ignore the metadata."
    ),
    "time": click.option(
        "--time", metavar="TIME", callback=parse_time_option, help="When: 2024-06-01T14:30, +02:00 behind it if known."
    ),
    "utc_offset": click.option(
        "--utc-offset", metavar="HOURS", callback=parse_utc_offset_option, help="Zone of a local time: +02:00 or 2."
    ),
    "latitude": click.option("--lat", "latitude", type=float, metavar="DEG", help="Where: latitude, positive north."),
    "longitude": click.option("--lon", "longitude", type=float, metavar="DEG", help="Longitude, positive east."),
    "heading": click.option(
        "--heading", type=float, metavar="DEG", help="Where the camera points, clockwise from true north."
    ),
    "vertical_fov": click.option("--fov", "vertical_fov", type=float, metavar="DEG", help="Vertical field of view."),
    "camera_height": click.option(
        "--camera-height", type=float, metavar="METRES", help="Of the camera above the ground.  [default: 1.6]"
    ),
    "keep_location": click.option("--keep-location", is_flag=True, help="Put latitude and longitude into the output."),
}
together_option = click.option("--together", is_flag=True, help="The photos are of one place and light.")
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
            with usage_errors():
                user_input = UserInput(**values)
            command(*args, user_input=user_input, **options)

        decorated: Callable[..., None] = with_user_input
        for name in reversed(names):
            decorated = _OPTIONS[name](decorated)
        return decorated

    return decorate


# What the user states of a photo; a command receives it as `user_input`. Contradictions are wrong usage.
user_input_options = _options(*_OPTIONS)
batch_input_options = _options(*(name for name in _OPTIONS if name not in ("time", "heading")))


@contextmanager
def usage_errors(kind: type[LightingError] = ParameterError) -> Iterator[None]:
    """Turn errors into wrong usage, with the option in place of the field.

    Args:
        kind: of error.
    """
    try:
        yield
    except kind as error:
        from lighting.validation import option_name

        raise click.UsageError(str(error.renamed(option_name))) from error


def check_together(photos: int, user_input: "UserInput", together: bool, headings: list[float] | None) -> None:
    """Raise UsageError where what is stated of several photos does not fit their number.

    Args:
        photos: their number.
        user_input: of all photos.
        together: whether they are of one place and light.
        headings: deg, one a photo; None where not stated.
    """
    if together and photos < 2:
        raise click.UsageError("--together needs two photos or more.")
    if headings is not None and not together:
        raise click.UsageError("--headings needs --together.")
    from lighting.fusion.user_input import check_headings

    with usage_errors():
        check_headings(photos, headings, user_input.heading)
