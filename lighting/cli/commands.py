"""The commands about photos and records: estimate, envmap, render, preview."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from lighting.cli.answers import answers
from lighting.cli.files import (
    estimated,
    naming,
    open_lighting,
    photo_bytes,
    place_in,
    refuse_collisions,
    refuse_idle_compression,
    rehearse,
    write_map,
    write_preview,
)
from lighting.cli.given import check_together, given_options, headings_option, together_option
from lighting.cli.group import cli
from lighting.cli.options import (
    map_options,
    map_output,
    model_option,
    preview_file,
    removed_option,
    surroundings_option,
    unwarned_option,
)
from lighting.cli.words import in_words, progress_over, report, report_failure, report_unmatched, report_warnings

if TYPE_CHECKING:
    from lighting.evidence import Given


@cli.command()
@click.argument("photos", nargs=-1, required=True, metavar="PHOTO...")
@click.option("--json", "as_json", is_flag=True, help="One JSON object a line instead of words.")
@together_option
@headings_option
@removed_option("--fit", "--together with time and place says where each camera looks")
@given_options
@model_option
@unwarned_option
@click.pass_context
def estimate(
    ctx: click.Context,
    /,
    photos: Sequence[str],
    as_json: bool,
    given: "Given",
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
    check_together(len(photos), given, **taken_together)
    report_unmatched(quiet, **taken_together)
    failed, answers_of = 0, answers(model, photos, given, **taken_together)
    with progress_over(photos, quiet) as progress:
        for name, answer in answers_of(progress):
            if not isinstance(answer, Exception):
                report(name, answer, as_json, quiet)
                continue
            if ctx.find_root().params["debug"]:
                raise answer
            failed += 1
            report_failure(name, answer, as_json, progress)
    if failed and len(photos) > 1:
        click.echo(f"{failed} of {len(photos)} photos failed.", err=True)
    ctx.exit(1 if failed else 0)


@cli.command()
@click.argument("photo")
@map_output
@map_options
@surroundings_option
@click.option("--preview", metavar="FILE.png", callback=preview_file, help="Also draw what `lighting preview` draws.")
@given_options
@model_option
@unwarned_option
def envmap(
    photo: str,
    output: str,
    surroundings: bool | None,
    preview: str | None,
    given: "Given",
    model: str | None,
    quiet: bool,
    **view: Any,
) -> None:
    """Estimate the light of PHOTO and render its environment map."""
    refuse_collisions(photo, output, preview)
    refuse_idle_compression(output, view["compression"])
    with naming(photo):
        data = photo_bytes(photo)
        picture, estimate = estimated(data, given, model, rehearse)
    place = place_in(data, picture, estimate, view["height"], surroundings)
    write_map(output, estimate.lighting, place=place, **view)
    if preview:
        write_preview(preview, data, estimate, surroundings)
    if not quiet and "-" not in (output, preview):
        click.echo(in_words(photo, estimate.lighting))
    report_warnings(photo, estimate.warnings, quiet)


@cli.command()
@click.argument("record", metavar="LIGHTING.json")
@map_output
@map_options
def render(record: str, output: str, **view: Any) -> None:
    """Render a lighting record as an environment map.

    LIGHTING.json holds one record, or one line that "estimate --json" printed.
    """
    refuse_collisions(record, output)
    refuse_idle_compression(output, view["compression"])
    write_map(output, open_lighting(record), **view)


@cli.command()
@click.argument("photo")
@click.option("-o", "--output", required=True, metavar="FILE.png", callback=preview_file, help='"-" is stdout.')
@surroundings_option
@given_options
@model_option
@unwarned_option
def preview(photo: str, output: str, surroundings: bool | None, given: "Given", model: str | None, quiet: bool) -> None:
    """Draw PHOTO, its light and three spheres lit by it."""
    refuse_collisions(photo, output)
    with naming(photo):
        data = photo_bytes(photo)
        _, estimate = estimated(data, given, model)
    write_preview(output, data, estimate, surroundings)
    report_warnings(photo, estimate.warnings, quiet)
