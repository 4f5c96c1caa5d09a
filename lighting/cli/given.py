"""The options by which the user says what a photo's metadata should say."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

from lighting.errors import LightingError, ParameterError

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

_OPTIONS: dict[str, Decorator] = {  # by the fields of Given that they fill
    "use_exif": click.option(
        "--no-exif", "use_exif", flag_value=False, default=True, help="Pixels alone: ignore the metadata."
    ),
    "time": click.option(
        "--time", metavar="TIME", callback=read_moment, help="When: 2024-06-01T14:30, +02:00 behind it if known."
    ),
    "utc_offset": click.option(
        "--utc-offset", metavar="HOURS", callback=read_zone, help="Zone of a local time: +02:00 or 2."
    ),
    "latitude": click.option("--lat", "latitude", type=float, metavar="DEG", help="Where: latitude, positive north."),
    "longitude": click.option("--lon", "longitude", type=float, metavar="DEG", help="Longitude, positive east."),
    "heading": click.option(
        "--heading", type=float, metavar="DEG", help="Where the camera points, clockwise from true north."
    ),
    "vertical_fov": click.option("--fov", "vertical_fov", type=float, metavar="DEG", help="Vertical field of view."),
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
    from lighting.evidence import Given

    with wrong_usage():
        return Given(**options)


@contextmanager
def wrong_usage(kind: type[LightingError] = ParameterError) -> Iterator[None]:
    """Turn errors of a kind into wrong usage, with the option in place of the field."""
    try:
        yield
    except kind as error:
        from lighting.ranges import option_name

        raise click.UsageError(str(error.renamed(option_name))) from error


def check_together(photos: int, given: "Given", together: bool, headings: list[float] | None) -> None:
    """Raise UsageError where what is said of several photos does not fit their number."""
    if together and photos < 2:
        raise click.UsageError("--together needs two photos or more.")
    if headings is not None and not together:
        raise click.UsageError("--headings needs --together.")
    from lighting.evidence import check_heading, check_headings

    with wrong_usage():
        check_headings(photos, headings)
        check_heading(photos, given.heading)
