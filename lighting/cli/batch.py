"""The command that processes many photos."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from lighting.cli import cli
from lighting.cli.console import escape_path
from lighting.cli.options import (
    batch_input_options,
    check_folder_name,
    map_options,
    model_option,
    quiet_option,
    surroundings_option,
)

if TYPE_CHECKING:
    from lighting.batch.job import BatchJob, Summary
    from lighting.fusion.user_input import UserInput


@dataclass(frozen=True)
class _Options:
    """What the user asked for."""

    input: str
    out: str
    envmap: bool
    height: int
    sun: bool | None
    yaw: float
    sky: str | None
    compression: str | None
    surroundings: bool | None
    parquet: bool
    workers: int | None
    overwrite: bool
    engine: str
    address: str | None
    given: "UserInput"
    model: str | None
    quiet: bool

    @property
    def job(self) -> "BatchJob":
        from lighting.batch.job import BatchJob, MapOptions

        maps = None
        if self.envmap:
            maps = MapOptions(self.height, self.sun, self.yaw, self.sky, self.compression or "zip", self.surroundings)
        return BatchJob(self.input, self.out, self.model, maps, self.engine, self.given.explicit_fields())

    @property
    def progress(self) -> bool:
        return not self.quiet and sys.stderr.isatty()


@cli.command("batch")
@click.argument("input")
@click.argument("out", callback=check_folder_name)
@click.option("--envmap", is_flag=True, help="Also render each photo's environment map, as PHOTO.jpg.exr.")
@map_options
@surroundings_option
@click.option("--parquet", is_flag=True, help="Also write the results as lighting.parquet.")
@click.option("--workers", type=click.IntRange(1), help="Number of processes; one per CPU by default.")
@click.option("--overwrite", is_flag=True, help="Discard earlier results instead of resuming; maps stay.")
@click.option(
    "--engine", type=click.Choice(["pool", "ray"]), default="pool", show_default=True, help="What runs the workers."
)
@click.option("--address", metavar="ADDRESS", help="Address of a Ray cluster; a local one is started by default.")
@batch_input_options
@model_option
@quiet_option
@click.pass_context
def _batch(ctx: click.Context, /, **options: Any) -> None:
    """Estimate the light of many photos.

    INPUT is a folder or a quoted glob such as "photos/**/*.jpg". The folder OUT receives lighting.jsonl, with the lines
    that "estimate --json" prints; --engine ray writes lighting.parquet instead. For a photo that cannot be read the
    results hold the reason, and the exit status is 1. Run the same command again to resume an interrupted batch and to
    retry failed photos (with --engine ray, failed photos are retried only with --overwrite). Time, place and lens are
    taken from each photo's metadata.
    """
    asked = _Options(**options)
    _refuse_idle_options(ctx)
    found = _run_ray(asked) if asked.engine == "ray" else _run_pool(asked)
    if found.failed:
        out = escape_path(asked.out)
        click.echo(f"Photos that failed: {found.failed}; the reasons are in {out}.", err=True)
    if not asked.quiet:
        click.echo(str(found), err=True)
    ctx.exit(1 if found.failed else 0)


def _refuse_idle_options(ctx: click.Context) -> None:
    """Raise UsageError for an option that would do nothing."""
    given = {name for name in ctx.params if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE}
    if not ctx.params["envmap"] and given & {"height", "sun", "yaw", "sky", "compression", "surroundings"}:
        raise click.UsageError("--height, --sun, --yaw, --sky, --compression and --surroundings need --envmap.")
    if ctx.params["engine"] == "pool" and "address" in given:
        raise click.UsageError("--address needs --engine ray.")
    if ctx.params["engine"] == "ray" and "parquet" in given:
        raise click.UsageError("--engine ray writes Parquet by itself, and nothing else.")


def _run_pool(asked: _Options) -> "Summary":
    """What became of the photos."""
    from lighting.batch.job import Summary, count_unread_pictures, find_photos
    from lighting.batch.pool import open_batch, run_pool
    from lighting.batch.results import TABLE, require_parquet, write_parquet
    from lighting.runtime import available_cpus

    began = monotonic()
    parquet = asked.parquet or (Path(asked.out, TABLE).is_file() and not asked.overwrite)
    if parquet:
        require_parquet(Path(asked.out))
    source, names = find_photos(asked.input)
    job = replace(asked.job, source=source)
    with open_batch(job, overwrite=asked.overwrite) as journal:
        earlier, done = len(journal.done), len(journal.done.intersection(names))
        finished = run_pool(job, names, journal, asked.workers or available_cpus())
        for _name in _progress(finished, done, len(names), asked.progress):
            pass
        if parquet:
            write_parquet(Path(job.out))
    done = len(journal.done) - journal.failed
    return Summary(done, journal.failed, earlier, monotonic() - began, count_unread_pictures(asked.input))


def _run_ray(asked: _Options) -> "Summary":
    """What became of the photos, in this run and in the earlier ones whose results are kept."""
    from lighting.batch.job import count_unread_pictures
    from lighting.batch.ray import find_photos_at, run_ray

    source, names = find_photos_at(asked.input)
    found = run_ray(
        replace(asked.job, source=source),
        names,
        address=asked.address,
        workers=asked.workers,
        overwrite=asked.overwrite,
        progress=asked.progress,
    )
    return replace(found, others=count_unread_pictures(asked.input))


def _progress(finished: Iterator[str], done: int, total: int, visible: bool) -> Any:
    """The finished photos behind a progress bar with their rate and the time left."""
    from tqdm import tqdm

    return tqdm(finished, initial=done, total=total, unit="photo", disable=not visible)
