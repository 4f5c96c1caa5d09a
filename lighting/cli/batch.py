"""The command about many photos."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from lighting.cli.given import given_of_many_options
from lighting.cli.group import cli
from lighting.cli.options import map_options, model_option, quiet_option

if TYPE_CHECKING:
    from lighting.batch.job import Job
    from lighting.evidence import Given


@cli.command()
@click.argument("input")
@click.argument("out")
@click.option("--envmap", is_flag=True, help="Also render each photo's environment map, as NAME.exr.")
@map_options
@click.option("--parquet", is_flag=True, help="Also write the results as lighting.parquet.")
@click.option("--workers", type=click.IntRange(1), help="Processes, by default one a CPU.")
@click.option("--overwrite", is_flag=True, help="Start anew instead of going on; maps of before stay.")
@click.option("--engine", type=click.Choice(["pool", "ray"]), default="pool", show_default=True, help="What works.")
@click.option("--address", metavar="ADDRESS", help="Ray's cluster; by default one on this machine.")
@given_of_many_options
@model_option
@quiet_option
@click.pass_context
def batch(
    ctx: click.Context,
    /,
    input: str,
    out: str,
    envmap: bool,
    given: "Given",
    model: str | None,
    engine: str,
    **options: Any,
) -> None:
    """Estimate the light of many photos.

    INPUT is a folder or a quoted glob such as "photos/**/*.jpg". OUT is a folder, which gets lighting.jsonl, the lines
    of "estimate --json"; from Ray it gets lighting.parquet instead. A photo that cannot be read is recorded with the
    reason, and the exit status is 1 at the end. The same command again goes on where a batch was stopped, and tries
    again what failed (from Ray, whose results stay as they are, only with --overwrite). Time, place and lens are taken
    from each photo's metadata.
    """
    from lighting.batch.job import Job, Maps

    maps = Maps(*(options.pop(name) for name in ("height", "sun", "yaw"))) if envmap else None
    _refuse_idle_options(ctx)
    run = _with_ray if engine == "ray" else _with_pool
    failed = run(Job(input, out, model, maps, engine, given.said()), **options)
    if failed:
        click.echo(
            f"Photos that could not be read: {failed}; the reasons are in {click.format_filename(out)}.", err=True
        )
    ctx.exit(1 if failed else 0)


def _refuse_idle_options(ctx: click.Context) -> None:
    """An option that would do nothing is wrong usage."""
    given = {name for name in ctx.params if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE}
    if not ctx.params["envmap"] and given & {"height", "sun", "yaw"}:
        raise click.UsageError("--height, --sun and --yaw need --envmap.")
    if ctx.params["engine"] == "pool" and "address" in given:
        raise click.UsageError("--address needs --engine ray.")
    if ctx.params["engine"] == "ray" and "parquet" in given:
        raise click.UsageError("--engine ray writes Parquet by itself, and nothing else.")


def _with_pool(job: "Job", parquet: bool, workers: int | None, overwrite: bool, quiet: bool, **_: Any) -> int:
    """Returns how many photos failed."""
    from lighting.batch.job import JOURNAL, find_photos, open_batch, run_pool
    from lighting.batch.journal import read_records
    from lighting.batch.table import FILE, schema, write_parquet
    from lighting.model import available_cpus

    if parquet:
        schema()  # says what is missing before any work
    source, names = find_photos(job.source)
    job = replace(job, source=source)
    with open_batch(job, overwrite=overwrite) as journal:
        finished = run_pool(job, names, journal, workers or available_cpus())
        for _name in _progress(finished, len(journal.done.intersection(names)), len(names), quiet):
            pass
        if parquet:
            write_parquet(Path(job.out, FILE), read_records(Path(job.out, JOURNAL)))
    return journal.failed


def _with_ray(job: "Job", address: str | None, workers: int | None, overwrite: bool, quiet: bool, **_: Any) -> int:
    """The same of all results that Ray wrote, of earlier runs too."""
    from lighting.batch.ray import find_photos_at, run_ray

    source, names = find_photos_at(job.source)
    shown = not quiet and sys.stderr.isatty()
    return run_ray(
        replace(job, source=source), names, address=address, workers=workers, overwrite=overwrite, progress=shown
    )


def _progress(finished: Iterator[str], done: int, total: int, quiet: bool) -> Any:
    """The finished photos behind a bar with their rate and the time left, which only a terminal shows."""
    from tqdm import tqdm

    return tqdm(finished, initial=done, total=total, unit="photo", disable=quiet or not sys.stderr.isatty())
