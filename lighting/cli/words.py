"""What commands say: a line for people, a line of JSON, a sentence about an error."""

import errno
import re
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from lighting.errors import install_command, reason
from lighting.words import azimuth_in_words, tilt_in_words

if TYPE_CHECKING:
    from lighting.records import Estimate, Lighting

_CONTROLS = re.compile("[\\x00-\\x1f\\x7f-\\x9f\\u2028-\\u202e\\u2066-\\u2069]")  # and what turns writing round


def progress_over(items: Sequence[str], quiet: bool) -> Any:
    """The items behind a progress bar, which appears only if stderr is a terminal and the results go elsewhere."""
    from tqdm import tqdm

    hidden = quiet or len(items) < 2 or not sys.stderr.isatty() or sys.stdout.isatty()
    return tqdm(items, unit="photo", disable=hidden)


def report(name: str, estimate: "Estimate", as_json: bool, quiet: bool) -> None:
    """Print one photo's estimate: a line of JSON, or a line for people with its warnings on stderr."""
    from lighting.files import json_line

    if as_json:
        click.echo(json_line(name, estimate.lighting))
    else:
        click.echo(in_words(name, estimate.lighting))
        report_warnings(name, estimate.warnings, quiet)


def report_failure(name: str, error: Exception, as_json: bool, progress: Any) -> None:
    from lighting.files import json_line

    if as_json:
        click.echo(json_line(name, reason(error)))
    with progress.external_write_mode(file=sys.stderr):
        click.echo(f"Error: {shown(name)}: {printable(reason(error))}", err=True)


def in_words(name: str, lighting: "Lighting") -> str:
    """One line for people."""
    roll = round(lighting.camera_roll, 1) + 0.0  # without -0.0
    return (
        f"{shown(name)}: sun {azimuth_in_words(lighting.sun_azimuth, 1)}, {lighting.sun_elevation:.1f}° high"
        f"{_spread(lighting)}, direct sunlight {100 * lighting.sun_visibility:.0f} %, "
        f"turbidity {lighting.turbidity:.1f}; "
        f"camera looks {tilt_in_words(lighting.camera_elevation, 1)}, roll {roll:.1f}°, "
        f"vertical field of view {lighting.vertical_fov:.1f}°{_headings(lighting)}{_evidence(lighting)}"
    )


def _spread(lighting: "Lighting") -> str:
    """The radii around the sun; a record that was written by hand may have none."""
    if lighting.radius_90 == 0.0:
        return ""
    return f" (50 % within {lighting.radius_50:.1f}°, 90 % within {lighting.radius_90:.1f}°)"


def _headings(lighting: "Lighting") -> str:
    words = ""
    if lighting.camera_heading is not None:
        words += f", heading {round(lighting.camera_heading) % 360}°"
    if lighting.camera_heading_radius_50 is not None:
        words += f" (50 % within {lighting.camera_heading_radius_50:.0f}°)"
    if lighting.relative_heading is not None:
        words += f", {round(lighting.relative_heading) % 360}° clockwise from the first photo"
    return words


def _evidence(lighting: "Lighting") -> str:
    return f"; from {', '.join(lighting.evidence)}" if len(lighting.evidence) > 1 else ""


def report_warnings(name: str, warnings: Sequence[str], quiet: bool = False) -> None:
    for warning in () if quiet else warnings:
        click.echo(f"Warning: {shown(name)}: {warning}", err=True)


def report_unmatched(quiet: bool, together: bool, headings: Sequence[float] | None) -> None:
    """Say on stderr where photos taken together could have been matched, and what is missing for it."""
    from lighting.turns import has_opencv

    if together and headings is None and not quiet and not has_opencv():
        click.echo(
            "Warning: The photos were not matched with each other, because OpenCV is not installed: "
            f"{install_command('turns')}.",
            err=True,
        )


def shown(name: str) -> str:
    """The name of a file for a terminal, without anything that the terminal would obey."""
    return {"-": "stdin", "": "''"}.get(name) or printable(click.format_filename(name))


def printable(text: str) -> str:
    """The text with control characters as escapes such as \\x1b, so that a terminal obeys none of them."""
    return _CONTROLS.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def sentence(error: Exception) -> str:
    file = getattr(error, "filename", None)
    return printable(f"{click.format_filename(file)}: {reason(error)}" if file else reason(error))


def is_broken_pipe(error: Exception) -> bool:
    return isinstance(error, OSError) and error.errno == errno.EPIPE
