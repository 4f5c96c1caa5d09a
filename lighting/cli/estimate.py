"""The commands about photos and records: estimate, envmap, render, preview."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from lighting.cli import cli
from lighting.cli.console import (
    check_compression_option,
    estimate_photo,
    format_summary,
    load_estimator,
    map_context,
    photo_progress,
    prefix_errors,
    print_estimate,
    read_lighting,
    read_photo_bytes,
    read_photo_file,
    refuse_collisions,
    report_failure,
    report_warnings,
    warm_up,
    warn_unregistered,
    write_output_map,
    write_preview,
)
from lighting.cli.options import (
    check_png_file,
    check_together,
    headings_option,
    map_options,
    map_output,
    model_option,
    removed_option,
    silent_option,
    surroundings_option,
    together_option,
    user_input_options,
)
from lighting.errors import ParameterError, PhotoError

if TYPE_CHECKING:
    from lighting.estimator import Estimator
    from lighting.fusion.user_input import UserInput
    from lighting.photo.reader import Photo
    from lighting.records import Estimate

Answers = Iterator[tuple[str, "Estimate | Exception"]]


def _answers(
    model: str | None,
    names: Sequence[str],
    user_input: "UserInput",
    together: bool = False,
    headings: Sequence[float] | None = None,
) -> Callable[[Iterable[str]], Answers]:
    """A function of the names that gives the estimate of each photo, or the error that it raised, in its place.

    The network is loaded now for several photos, and beside the decoding of one alone. Raises ModelError.
    """
    if len(names) == 1:
        return lambda photos: _estimate_each(
            photos, lambda name: estimate_photo(read_photo_bytes(name), user_input, model)[1]
        )
    estimator = load_estimator(model)
    if together:
        return lambda photos: _estimate_views(estimator, photos, user_input, headings)
    return lambda photos: _estimate_each(photos, lambda name: estimator(read_photo_file(name), user_input))


def _estimate_each(names: Iterable[str], estimate: "Callable[[str], Estimate]") -> Answers:
    for name in names:
        try:
            yield name, estimate(name)
        except (PhotoError, ParameterError, OSError) as error:
            yield name, error


def _estimate_views(
    estimator: "Estimator", names: Iterable[str], user_input: "UserInput", headings: Sequence[float] | None
) -> Iterator[tuple[str, "Estimate | Exception"]]:
    """First the errors, then the estimates of the photos that could be read, taken together.

    Without headings they are registered with each other where OpenCV is installed.
    """
    from lighting.registration.features import MAX_SIDE, has_opencv

    register = headings is None and has_opencv()
    read: dict[int, tuple[str, Photo]] = {}
    for i, name in enumerate(names):
        try:
            read[i] = name, read_photo_file(name, MAX_SIDE if register else None)
        except (PhotoError, OSError) as error:
            yield name, error
    if not read:
        return
    if headings is not None:
        headings = None if len(read) == 1 else [headings[i] for i in read]
    photos = [photo for _, photo in read.values()]
    estimates = estimator.estimate_views(photos, user_input, headings, register=register)
    yield from zip((name for name, _ in read.values()), estimates, strict=True)


@cli.command("estimate")
@click.argument("photos", nargs=-1, required=True, metavar="PHOTO...")
@click.option("--json", "as_json", is_flag=True, help="One JSON object a line instead of words.")
@together_option
@headings_option
@removed_option("--fit", "--together with time and place says where each camera looks")
@user_input_options
@model_option
@silent_option
@click.pass_context
def _estimate(
    ctx: click.Context,
    /,
    photos: Sequence[str],
    as_json: bool,
    user_input: "UserInput",
    model: str | None,
    quiet: bool,
    **taken_together: Any,
) -> None:
    """Print the light of each PHOTO.

    Time, place and lens are taken from the photo's metadata unless stated here. A photo that cannot be read does not
    stop the others; the exit status is 1 then.
    """
    if photos.count("-") > 1:
        raise click.UsageError("Only one of the photos can be stdin.")
    check_together(len(photos), user_input, **taken_together)
    warn_unregistered(quiet, **taken_together)
    failed, answers_of = 0, _answers(model, photos, user_input, **taken_together)
    with photo_progress(photos, quiet) as progress:
        for name, answer in answers_of(progress):
            if not isinstance(answer, Exception):
                print_estimate(name, answer, as_json, quiet)
                continue
            if ctx.find_root().params["debug"]:
                raise answer
            failed += 1
            report_failure(name, answer, as_json, progress)
    if failed and len(photos) > 1:
        click.echo(f"{failed} of {len(photos)} photos failed.", err=True)
    ctx.exit(1 if failed else 0)


@cli.command("envmap")
@click.argument("photo")
@map_output
@map_options
@surroundings_option
@click.option("--preview", metavar="FILE.png", callback=check_png_file, help="Also draw what `lighting preview` draws.")
@user_input_options
@model_option
@silent_option
def _envmap(
    photo: str,
    output: str,
    surroundings: bool | None,
    preview: str | None,
    user_input: "UserInput",
    model: str | None,
    quiet: bool,
    **view: Any,
) -> None:
    """Estimate the light of PHOTO and render its environment map."""
    refuse_collisions(photo, output, preview)
    check_compression_option(output, view["compression"])
    with prefix_errors(photo):
        data = read_photo_bytes(photo)
        picture, estimate = estimate_photo(data, user_input, model, warm_up)
    context = map_context(data, picture, estimate, view["height"], surroundings)
    write_output_map(output, estimate.lighting, context=context, **view)
    if preview:
        write_preview(preview, data, estimate, surroundings)
    if not quiet and "-" not in (output, preview):
        click.echo(format_summary(photo, estimate.lighting))
    report_warnings(photo, estimate.warnings, quiet)


@cli.command("render")
@click.argument("record", metavar="LIGHTING.json")
@map_output
@map_options
def _render(record: str, output: str, **view: Any) -> None:
    """Render a lighting record as an environment map.

    LIGHTING.json holds one record, or one line that "estimate --json" printed.
    """
    refuse_collisions(record, output)
    check_compression_option(output, view["compression"])
    write_output_map(output, read_lighting(record), **view)


@cli.command("preview")
@click.argument("photo")
@click.option("-o", "--output", required=True, metavar="FILE.png", callback=check_png_file, help='"-" is stdout.')
@surroundings_option
@user_input_options
@model_option
@silent_option
def _preview(
    photo: str, output: str, surroundings: bool | None, user_input: "UserInput", model: str | None, quiet: bool
) -> None:
    """Draw PHOTO, its light and three spheres lit by it."""
    refuse_collisions(photo, output)
    with prefix_errors(photo):
        data = read_photo_bytes(photo)
        _, estimate = estimate_photo(data, user_input, model)
    write_preview(output, data, estimate, surroundings)
    report_warnings(photo, estimate.warnings, quiet)
