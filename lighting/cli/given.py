"""The options by which the user says what a photo's metadata should say."""

from collections.abc import Callable
from datetime import datetime
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

from lighting.clock import read_offset, read_time
from lighting.errors import ParameterError

if TYPE_CHECKING:
    from lighting.metadata import Given


def _time(_ctx: click.Context, _param: click.Parameter, text: str | None) -> datetime | None:
    return None if text is None else _parsed(read_time, text)


def _offset(_ctx: click.Context, _param: click.Parameter, text: str | None) -> float | None:
    return None if text is None else _parsed(read_offset, text)


def _headings(_ctx: click.Context, _param: click.Parameter, text: str | None) -> list[float] | None:
    from lighting.together import read_headings

    return None if text is None else _parsed(read_headings, text)


def _parsed(read: Callable[[str], Any], text: str) -> Any:
    try:
        return read(text)
    except ParameterError as error:
        raise click.BadParameter(str(error)) from error


_OPTIONS = [
    click.option("--no-exif", "use_exif", flag_value=False, default=True, help="Pixels alone: ignore the metadata."),
    click.option("--time", metavar="TIME", callback=_time, help="When: 2024-06-01T14:30, +02:00 behind it if known."),
    click.option("--utc-offset", metavar="HOURS", callback=_offset, help="Zone of a local time: +02:00 or 2."),
    click.option("--lat", "latitude", type=float, metavar="DEG", help="Where: latitude, positive north."),
    click.option("--lon", "longitude", type=float, metavar="DEG", help="Longitude, positive east."),
    click.option("--heading", type=float, metavar="DEG", help="Where the camera points, clockwise from true north."),
    click.option("--fov", "vertical_fov", type=float, metavar="DEG", help="Vertical field of view."),
    click.option("--keep-location", is_flag=True, help="Put latitude and longitude into the output."),
]
together_option = click.option("--together", is_flag=True, help="The photos are of one place and light.")
headings_option = click.option(
    "--headings", metavar="DEG,DEG,...", callback=_headings, help="Where each points, clockwise, from any direction."
)


def given_options(command: Callable[..., None]) -> Callable[..., None]:
    """What the user knows; a command receives it as `given`. Contradictions are wrong usage."""
    names = ["use_exif", "time", "utc_offset", "latitude", "longitude", "heading", "vertical_fov", "keep_location"]

    @wraps(command)
    def with_given(*args: Any, **options: Any) -> None:
        given = {name: options.pop(name) for name in names}
        command(*args, given=_given(**given), **options)

    for option in reversed(_OPTIONS):
        with_given = option(with_given)
    return with_given


def _given(**options: Any) -> "Given":
    from lighting.metadata import Given

    try:
        return Given(**options)
    except ParameterError as error:
        raise click.UsageError(str(error)) from error


def check_together(photos: int, together: bool, headings: list[float] | None, given: "Given") -> None:
    """Raise UsageError where what is said of several photos does not fit their number."""
    if together and photos < 2:
        raise click.UsageError("--together needs two photos or more.")
    if headings is not None and not together:
        raise click.UsageError("--headings needs --together.")
    if headings is not None and len(headings) != photos:
        raise click.UsageError(f"There are {len(headings)} headings for {photos} photos.")
    if given.heading is not None and photos > 1:
        raise click.UsageError("--heading is that of one photo; for several there are --together and --headings.")
