"""The options by which the user says what a photo's metadata should say."""

from collections.abc import Callable
from datetime import datetime
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

from lighting.errors import ParameterError

if TYPE_CHECKING:
    from lighting.evidence import Given


def read_moment(_ctx: click.Context, _param: click.Parameter, text: str | None) -> datetime | None:
    from lighting.photo import read_time

    return None if text is None else _parsed(read_time, text)


def read_zone(_ctx: click.Context, _param: click.Parameter, text: str | None) -> float | None:
    from lighting.photo import read_offset

    return None if text is None else _parsed(read_offset, text)


def _headings(_ctx: click.Context, _param: click.Parameter, text: str | None) -> list[float] | None:
    from lighting.evidence import read_headings

    return None if text is None else _parsed(read_headings, text)


def _parsed(read: Callable[[str], Any], text: str) -> Any:
    try:
        return read(text)
    except ParameterError as error:
        raise click.BadParameter(str(error)) from error


Decorator = Callable[[Callable[..., None]], Callable[..., None]]

_OPTIONS: dict[str, Decorator] = {
    "exif": click.option(
        "--no-exif", "exif", flag_value=False, default=True, help="Pixels alone: ignore the metadata."
    ),
    "time": click.option(
        "--time", metavar="TIME", callback=read_moment, help="When: 2024-06-01T14:30, +02:00 behind it if known."
    ),
    "utc_offset": click.option(
        "--utc-offset", metavar="HOURS", callback=read_zone, help="Zone of a local time: +02:00 or 2."
    ),
    "lat": click.option("--lat", type=float, metavar="DEG", help="Where: latitude, positive north."),
    "lon": click.option("--lon", type=float, metavar="DEG", help="Longitude, positive east."),
    "heading": click.option(
        "--heading", type=float, metavar="DEG", help="Where the camera points, clockwise from true north."
    ),
    "fov": click.option("--fov", type=float, metavar="DEG", help="Vertical field of view."),
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
        def with_given(*args: Any, **options: Any) -> None:
            said = {name: options.pop(name) for name in names}
            command(*args, given=_given(**said), **options)

        decorated: Callable[..., None] = with_given
        for name in reversed(names):
            decorated = _OPTIONS[name](decorated)
        return decorated

    return decorate


# What the user knows; a command receives it as `given`. Contradictions are wrong usage.
given_options = _options(*_OPTIONS)
given_of_many_options = _options(*(name for name in _OPTIONS if name not in ("time", "heading")))


def _given(**options: Any) -> "Given":
    from lighting.evidence import SHORT_NAMES, Given

    try:
        return Given(**{SHORT_NAMES.get(name, name): value for name, value in options.items()})
    except ParameterError as error:
        raise click.UsageError(as_typed(str(error), {SHORT_NAMES.get(name, name): name for name in options})) from error


def as_typed(sentence: str, options: dict[str, str]) -> str:
    """The sentence about a field, which begins with its name, about the option that fills it."""
    name, space, rest = sentence.partition(" ")
    return f"--{options[name].replace('_', '-')}{space}{rest}" if name in options else sentence


def check_together(photos: int, given: "Given", together: bool, headings: list[float] | None) -> None:
    """Raise UsageError where what is said of several photos does not fit their number."""
    if together and photos < 2:
        raise click.UsageError("--together needs two photos or more.")
    if headings is not None and not together:
        raise click.UsageError("--headings needs --together.")
    from lighting.evidence import check_heading, check_headings

    try:
        check_headings(photos, headings)
        check_heading(photos, given.heading)
    except ParameterError as error:
        raise click.UsageError(str(error)) from error
