"""The command that prints the light of photos."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

import click

import lighting.cli.outputs as outputs
import lighting.errors as errors
from lighting.cli import cli, console
from lighting.cli import options as common
from lighting.cli.options import usage_errors
from lighting.cli.photos import (
    exit_status,
    headings_option,
    load_estimator,
    photo_estimator,
    together_option,
    user_input_options,
)
from lighting.errors import ParameterError, PhotoError

if TYPE_CHECKING:
    from lighting.estimator import Estimator
    from lighting.fusion.user_input import UserInput
    from lighting.photo.reader import Photo
    from lighting.photo_estimate import Estimate

Answers = Iterator[tuple[str, "Estimate | Exception"]]


def _estimate_each(estimate: "Callable[[str], Estimate]", names: Iterable[str]) -> Answers:
    """The estimate of each photo, or the error that it raised, in its place."""
    for name in names:
        try:
            yield name, estimate(name)
        except (PhotoError, ParameterError, OSError) as error:
            yield name, error


def _estimate_views(
    estimator: "Estimator", names: Iterable[str], user_input: "UserInput", headings: Sequence[float] | None
) -> Answers:
    """First the errors, then the estimates of the photos that could be read, taken together.

    Without headings they are registered with each other where OpenCV is installed.
    """
    from lighting.registration.features import MATCH_SIDE, has_opencv

    register = headings is None and has_opencv()
    read: dict[int, tuple[str, Photo]] = {}
    for i, name in enumerate(names):
        try:
            read[i] = name, console.read_photo_file(name, MATCH_SIDE if register else None)
        except (PhotoError, OSError) as error:
            yield name, error
    if not read:
        return
    if headings is not None:
        headings = None if len(read) == 1 else [headings[i] for i in read]
    photos = [photo for _, photo in read.values()]
    estimates = estimator.estimate_views(photos, user_input, headings, register=register)
    yield from zip((name for name, _ in read.values()), estimates, strict=True)


def _refuse_fit(_ctx: click.Context, _param: click.Parameter, value: str | None) -> None:
    """End the use of an option that is gone with a sentence about what to use."""
    if value is not None:
        raise click.UsageError("--fit was removed: --together with time and place says where each camera looks.")


@cli.command(
    "estimate",
    epilog="""
    lighting estimate photo.jpg
    lighting estimate *.jpg -o lights.jsonl             # also a record a line
    lighting estimate photo.jpg --time 2024-06-01T18:30+02:00 --lat 48.14 --lon 11.58
    """,
)
@click.argument("photos", nargs=-1, required=True, metavar="PHOTO...", type=common.FileName())
@common.record_output("Also write the record to FILE.json, those of several photos to FILE.jsonl.")
@common.json_option
@common.strict_option
@common.require_option
@together_option
@headings_option
@click.option("--fit", hidden=True, expose_value=False, is_eager=True, callback=_refuse_fit, help="Removed.")
@user_input_options
@common.model_option
@common.silent_option
@click.pass_context
def _estimate(
    ctx: click.Context,
    /,
    photos: Sequence[str],
    output: str | None,
    overwrite: bool,
    as_json: bool,
    user_input: "UserInput",
    model: str | None,
    strict: bool,
    require: str | None,
    quiet: bool,
    together: bool,
    headings: list[float] | None,
) -> None:
    """Print the light of each PHOTO.

    Time, place and lens are taken from the photo's metadata unless stated here. A photo that cannot be read does not
    stop the others; the exit status is 1 then.
    """
    outputs.check_stdin(photos)
    outputs.check_not_written(photos, output, outputs.RECORD_SUFFIXES)
    _check_together(len(photos), user_input, together, headings)
    _warn_unregistered(quiet, together, headings)
    if output == "-":
        output, as_json = None, True
    outputs.check_records(photos, output, overwrite=overwrite)
    failed, lights, lines = 0, list[tuple[float | None, str | None]](), list[str]()
    answers_of: Callable[[Iterable[str]], Answers]
    if together:
        answers_of = partial(_estimate_views, load_estimator(model), user_input=user_input, headings=headings)
    else:
        answers_of = partial(_estimate_each, photo_estimator(photos, user_input, model))
    with console.photo_progress(photos, quiet) as progress:
        for name, answer in answers_of(progress):
            if not isinstance(answer, Exception):
                light, probe = answer.lighting, answer.light_probe() if as_json or output else None
                crop, warnings = answer.photo.crop, answer.warnings
                console.print_estimate(name, light, warnings, probe=probe, crop=crop, as_json=as_json, quiet=quiet)
                lights.append((light.suitable, light.trust))
                lines.append(console.format_record(name, light, probe=probe, crop=crop))
                continue
            if ctx.find_root().params["debug"]:
                raise answer
            failed += 1
            lines.append(console.format_record(name, answer))
            if as_json:
                click.echo(lines[-1])
            console.report_failure(name, answer, progress)
    if failed and len(photos) > 1:
        click.echo(f"{failed} of {len(photos)} photos failed.", err=True)
    if output is not None and lights:
        outputs.write_records(output, lines, quiet=quiet or as_json)
    ctx.exit(1 if failed else exit_status(lights, strict, require))


def _warn_unregistered(quiet: bool, together: bool, headings: Sequence[float] | None) -> None:
    """Say on stderr where photos could have been registered with each other, and what is missing for it.

    Args:
        quiet: say nothing.
        together: whether the photos are of one place and light.
        headings: deg, that the user stated; None without.
    """
    if quiet or not together or headings is not None:
        return
    from lighting.registration.features import has_opencv

    if not has_opencv():
        reason = f"because OpenCV is not installed: {errors.install_command('all')}."
        click.echo(f"Warning: The photos were not matched with each other, {reason}", err=True)


def _check_together(photos: int, user_input: "UserInput", together: bool, headings: list[float] | None) -> None:
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
