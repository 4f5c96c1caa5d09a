"""The commands about photos and records: estimate, envmap, render, preview."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from lighting.cli import cli, console
from lighting.cli import options as common
from lighting.errors import ParameterError, PhotoError

if TYPE_CHECKING:
    from lighting.estimator import Estimator
    from lighting.fusion.user_input import UserInput
    from lighting.photo.reader import Photo
    from lighting.photo_estimate import Estimate

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
            photos, lambda name: console.estimate_photo(name, console.read_photo_bytes(name), user_input, model)[1]
        )
    estimator = console.load_estimator(model)
    if together:
        return lambda photos: _estimate_views(estimator, photos, user_input, headings)
    return lambda photos: _estimate_each(photos, lambda name: estimator(console.read_photo_file(name), user_input))


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
            read[i] = name, console.read_photo_file(name, MAX_SIDE if register else None)
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
@common.together_option
@common.headings_option
@common.removed_option("--fit", "--together with time and place says where each camera looks")
@common.user_input_options
@common.model_option
@common.silent_option
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
    common.check_together(len(photos), user_input, **taken_together)
    console.warn_unregistered(quiet, **taken_together)
    failed, answers_of = 0, _answers(model, photos, user_input, **taken_together)
    with console.photo_progress(photos, quiet) as progress:
        for name, answer in answers_of(progress):
            if not isinstance(answer, Exception):
                console.print_estimate(name, answer, as_json, quiet)
                continue
            if ctx.find_root().params["debug"]:
                raise answer
            failed += 1
            console.report_failure(name, answer, as_json, progress)
    if failed and len(photos) > 1:
        click.echo(f"{failed} of {len(photos)} photos failed.", err=True)
    ctx.exit(1 if failed else 0)


@cli.command("envmap")
@click.argument("photo")
@common.map_output
@common.map_options
@common.surroundings_option
@common.detail_option
@click.option(
    "--preview", metavar="FILE.png", callback=common.check_png_file, help="Also draw what `lighting preview` draws."
)
@common.user_input_options
@common.model_option
@common.silent_option
def _envmap(
    photo: str,
    output: str,
    surroundings: bool | None,
    detail: bool,
    preview: str | None,
    user_input: "UserInput",
    model: str | None,
    quiet: bool,
    **view: Any,
) -> None:
    """Estimate the light of PHOTO and render its environment map."""
    console.refuse_collisions(photo, output, preview)
    console.check_compression_option(output, view["compression"])
    with console.prefix_errors(photo):
        data = console.read_photo_bytes(photo)
        picture, estimate = console.estimate_photo(photo, data, user_input, model, console.warm_up)
    context = console.map_context(data, picture, estimate, view["height"], surroundings, detail)
    console.write_output_map(output, estimate.lighting, context=context, **view)
    if preview:
        console.write_preview(preview, data, estimate, surroundings, detail)
    if not quiet and "-" not in (output, preview):
        click.echo(console.format_summary(photo, estimate.lighting))
    console.report_warnings(photo, estimate.warnings, quiet)


@cli.command("render")
@click.argument("record", metavar="LIGHTING.json")
@common.map_output
@common.map_options
def _render(record: str, output: str, **view: Any) -> None:
    """Render a lighting record as an environment map.

    LIGHTING.json holds one record, or one line that "estimate --json" printed.
    """
    console.refuse_collisions(record, output)
    console.check_compression_option(output, view["compression"])
    console.write_output_map(output, console.read_lighting(record), **view)


@cli.command("preview")
@click.argument("photo")
@click.option(
    "-o", "--output", required=True, metavar="FILE.png", callback=common.check_png_file, help='"-" is stdout.'
)
@common.surroundings_option
@common.detail_option
@common.user_input_options
@common.model_option
@common.silent_option
def _preview(
    photo: str,
    output: str,
    surroundings: bool | None,
    detail: bool,
    user_input: "UserInput",
    model: str | None,
    quiet: bool,
) -> None:
    """Draw PHOTO, its light and three spheres lit by it."""
    from lighting.ground import spot_warnings

    console.refuse_collisions(photo, output)
    with console.prefix_errors(photo):
        data = console.read_photo_bytes(photo)
        _, estimate = console.estimate_photo(photo, data, user_input, model)
    console.write_preview(output, data, estimate, surroundings, detail)
    console.report_warnings(photo, (*estimate.warnings, *spot_warnings(estimate.lighting)), quiet)
