"""What `lighting estimate --together --fit` says: place and time from the sun's path over several photos."""

import json
from collections.abc import Sequence
from datetime import date, timedelta
from typing import TYPE_CHECKING

import click

from lighting.cli.files import naming, open_photo

if TYPE_CHECKING:
    from lighting.evidence import Fit, Given, Range
    from lighting.pipeline import Estimator


def print_fit(
    estimator: "Estimator",
    photos: Sequence[str],
    given: "Given",
    headings: list[float] | None,
    kind: str,
    as_json: bool,
    quiet: bool,
) -> None:
    """Fit and print; a photo that cannot be read ends it."""
    from lighting.turns import MAX_SIDE

    read = []
    for name in photos:
        with naming(name):
            read.append(open_photo(name, None if headings else MAX_SIDE))
    found = estimator.follow(read, kind, given, headings)
    click.echo(json.dumps({"fit": found.to_dict()}) if as_json else fit_in_words(found))
    for warning in () if as_json or quiet else found.warnings:
        click.echo(f"Warning: {warning}", err=True)


def fit_in_words(found: "Fit") -> str:
    """One line for people."""
    parts = [
        f"the first photo looks to {found.heading:.0f}° from true north (50 % within {found.heading_radius_50:.0f}°, "
        f"90 % within {found.heading_radius_90:.0f}°)"
    ]
    if found.latitude is not None:
        parts.append(f"latitude {found.latitude.best:.0f}° ({_likely(found.latitude, '{:.0f}°')})")
    if found.day_of_year is not None:
        parts.append(f"date {_day(found.day_of_year.best)} ({_days(found.day_of_year)})")
    if found.clock_shift is not None:
        parts.append(f"clock {found.clock_shift.best:+.1f} h ({_likely(found.clock_shift, '{:+.1f} h')})")
    if (offset := found.utc_minus_clock) is not None:
        likely = _likely(offset, "{:+.1f} h")
        parts.append(f"UTC is the photos' clock {offset.best:+.1f} h, zone and error together ({likely})")
    return "; ".join(parts)


def _likely(found: "Range", shown: str) -> str:
    return ", ".join(
        f"{share} % {' or '.join(f'{shown.format(low)} to {shown.format(high)}' for low, high in intervals)}"
        for share, intervals in ((50, found.in_50), (90, found.in_90))
    )


def _days(found: "Range") -> str:
    return ", ".join(
        f"{share} % {' or '.join(f'{_day(low)} to {_day(high)}' for low, high in intervals)}"
        for share, intervals in ((50, found.in_50), (90, found.in_90))
    )


def _day(number: float) -> str:
    """The day and month of a day of the year, of a year without a leap day."""
    day = date(2025, 1, 1) + timedelta(days=min(max(round(number), 1), 365) - 1)
    return f"{day.day} {day:%B}"
