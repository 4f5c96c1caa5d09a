"""Options of what a user states of a photo, and those of commands that make something of each photo."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeVar

import click

from lighting.cli.console import print_estimate
from lighting.cli.option_types import Decorator, FileName, Number, add_options, usage_errors
from lighting.cli.options import json_option, map_options, model_option, require_option, silent_option, strict_option
from lighting.errors import ParameterError
from lighting.fields import option_name
from lighting.map_options import MapOptions

if TYPE_CHECKING:
    from lighting.fusion.drawn_camera import KnownCamera
    from lighting.fusion.user_input import UserInput
    from lighting.photo_estimate import Estimate

_Value = TypeVar("_Value")


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
        def with_user_input(*args: object, **options: Any) -> None:
            from lighting.fusion.user_input import UserInput

            values = {name: options.pop(name) for name in names}
            check_coordinates(values["latitude"], values["longitude"])
            with usage_errors():
                user_input = UserInput(**values)
            if user_input.drawn_fields and len(options.get("photos", ())) > 1:
                names_of = option_name(user_input.drawn_fields[0])
                raise click.UsageError(f"{names_of} is of one photo; give that photo alone.")
            command(*args, user_input=user_input, **options)

        return add_options(with_user_input, *(_OPTIONS[name] for name in names))

    return decorate


# What the user states of a photo; a command receives it as `user_input`. Contradictions are wrong usage.
# A command receives these as `user_input`. Contradictions are wrong usage.
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
        def with_chosen(*args: object, **options: Any) -> None:
            chosen = PhotoOptions(**{field.name: options.pop(field.name) for field in fields(PhotoOptions)})
            command(*args, chosen=chosen, **options)

        return add_options(
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


def check_coordinates(latitude: float | None, longitude: float | None) -> None:
    """Raise UsageError where one of the two is missing.

    Args:
        latitude: deg; None where not stated.
        longitude: deg; None where not stated.
    """
    if (latitude is None) != (longitude is None):
        stated, missing = ("--lat", "--lon") if longitude is None else ("--lon", "--lat")
        raise click.UsageError(f"{stated} needs {missing} too, such as --lat 48.14 --lon 11.58.")
