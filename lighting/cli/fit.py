"""What `lighting estimate --together --fit` says: place and time from the sun's path over several photos."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import date, timedelta
from typing import TYPE_CHECKING

import click

from lighting.cli.files import naming, open_photo

if TYPE_CHECKING:
    from lighting.evidence import Fit, Given, Range
    from lighting.pipeline import Estimator


def fitted(
    estimator: "Estimator", photos: Sequence[str], kind: str, given: "Given", headings: list[float] | None
) -> "Fit":
    """What is fitted to the photos in files; one that cannot be read ends it."""
    from lighting.turns import MAX_SIDE

    read = []
    for name in photos:
        with naming(name):
            read.append(open_photo(name, None if headings else MAX_SIDE))
    return estimator.follow(read, kind, given, headings)


def print_fit(found: "Fit", as_json: bool, quiet: bool) -> None:
    """A line of JSON, or a line for people with its warnings on stderr."""
    click.echo(json.dumps({"fit": found.to_dict()}) if as_json else fit_in_words(found))
    for warning in () if as_json or quiet else found.warnings:
        click.echo(f"Warning: {warning}", err=True)


def fit_in_words(found: "Fit") -> str:
    """One line for people."""
    parts = [
        f"the first photo looks to {round(found.heading) % 360}° from true north "
        f"(50 % within {found.heading_radius_50:.0f}°, 90 % within {found.heading_radius_90:.0f}°)"
    ]
    degrees, hours = "{:.0f}°".format, "{:+.1f} h".format
    if found.latitude is not None:
        parts.append(f"latitude {degrees(found.latitude.best)} ({_likely(found.latitude, degrees)})")
    if found.day_of_year is not None:
        parts.append(f"date {_day(found.day_of_year.best)} ({_likely(_over_new_year(found.day_of_year), _day)})")
    if found.clock_shift is not None:
        parts.append(f"clock {hours(found.clock_shift.best)} ({_likely(found.clock_shift, hours)})")
    if (offset := found.utc_minus_clock) is not None:
        likely = _likely(offset, hours)
        parts.append(f"UTC is the photos' clock {hours(offset.best)}, zone and error together ({likely})")
    return "; ".join(parts)


def _likely(found: "Range", shown: Callable[[float], str]) -> str:
    """The intervals that hold 50 % and 90 % of the probability, in words."""
    return ", ".join(
        f"{share} % {' or '.join(f'{shown(low)} to {shown(high)}' for low, high in intervals)}"
        for share, intervals in ((50, found.in_50), (90, found.in_90))
    )


def _over_new_year(days: "Range") -> "Range":
    """The days with the intervals that end and begin the year as one, whose end comes before its start."""
    half, most = (
        (*intervals[1:-1], (intervals[-1][0], intervals[0][1]))
        if len(intervals) > 1 and intervals[0][0] == 1.0 and intervals[-1][1] == 365.0
        else intervals
        for intervals in (days.in_50, days.in_90)
    )
    return replace(days, in_50=half, in_90=most)


def _day(number: float) -> str:
    """The day and month of a day of the year, of a year without a leap day."""
    day = date(2025, 1, 1) + timedelta(days=round(number) - 1)
    return f"{day.day} {day:%B}"
