"""The command that processes many photos."""

import json
import shlex
import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

import lighting.cli.outputs as outputs
from lighting.cli import cli
from lighting.cli import options as common
from lighting.cli.console import escape_path
from lighting.cli.photos import DRAWN, exit_status, input_options_but
from lighting.files import FileOptions, escape_undecodable, join_words
from lighting.map_options import MapOptions

if TYPE_CHECKING:
    from lighting.batch.job import BatchJob, Summary
    from lighting.fusion.user_input import UserInput


@cli.command(
    "batch",
    epilog="""
    lighting batch photos results                       # results/lighting.jsonl; run again to go on
    lighting batch "photos/**/*.jpg" results --envmap   # and a map of each photo
    lighting batch photos results --parquet --workers 8
    """,
)
@click.argument("input", type=common.FileName())
@click.argument("out", required=False, type=common.FileName(), callback=common.check_folder_name)
@click.option("-o", "--output", metavar="OUT", callback=common.check_folder_name, help="The same as OUT.")
@click.option("--envmap", is_flag=True, help="Also render each photo's environment map, as PHOTO.jpg.exr.")
@common.map_options()
@common.file_options("format", "compression", "colors")
@click.option("--parquet", is_flag=True, help="Also write the results as lighting.parquet.")
@click.option("--workers", type=click.IntRange(1), help="Number of processes; one per CPU by default.")
@click.option("--overwrite", is_flag=True, help="Discard earlier results instead of resuming; maps stay.")
@click.option(
    "--engine", type=click.Choice(["pool", "ray"]), default="pool", show_default=True, help="What runs the workers."
)
@click.option("--address", metavar="ADDRESS", help="Address of a Ray cluster; a local one is started by default.")
@input_options_but("time", "heading", *DRAWN)
@click.option(
    "--table",
    metavar="FILE.csv",
    callback=common.check_file_name,
    help="What you know of single photos: a row each, with columns file, shadow, pick, time, latitude and so on.",
)
@common.model_option
@common.strict_option
@common.require_option
@common.json_option
@common.quiet_option
@click.pass_context
def _batch(
    ctx: click.Context,
    /,
    input: str,
    out: str | None,
    output: str | None,
    as_json: bool,
    quiet: bool,
    strict: bool,
    require: str | None,
    **options: Any,
) -> None:
    """Estimate the light of many photos.

    INPUT is a folder or a quoted glob such as "photos/**/*.jpg". The folder OUT receives lighting.jsonl, with the lines
    that "estimate --json" prints; --engine ray writes lighting.parquet instead. For a photo that cannot be read the
    results hold the reason, and the exit status is 1. Run the same command again to resume an interrupted batch and to
    retry failed photos (with --engine ray, failed photos are retried only with --overwrite). Time, place and lens are
    taken from each photo's metadata. --sun, --exposure, --haze and --overcast change maps, not the lines.
    """
    from lighting.batch.results import JOURNAL, TABLE, read_answers

    folder = _choose_out(input, out, output)
    _refuse_idle_options(ctx)
    summary = _run(input, folder, progress=not quiet and sys.stderr.isatty(), **options)
    if summary.failed:
        click.echo(f"Photos that failed: {summary.failed}; the reasons are in {escape_path(folder)}.", err=True)
    if as_json:
        click.echo(json.dumps({"output": escape_undecodable(folder), **summary.to_dict()}))
    if not quiet:
        click.echo(str(summary), err=True)
    results = Path(folder, TABLE if options["engine"] == "ray" else JOURNAL)
    outputs.report_written([str(results)], _describe_results, quiet=quiet or as_json, err=True)
    ctx.exit(1 if summary.failed else exit_status(read_answers(results), strict, require))


def _choose_out(source: str, out: str | None, output: str | None) -> str:
    """The folder of the results, by default one beside the photos' folder."""
    if out is not None and output is not None:
        raise click.UsageError("OUT and -o are the same; give one.")
    stated = out if output is None else output
    if stated is None and ("://" in source or not Path(source).is_dir()):
        raise click.UsageError("Say where the results go: lighting batch INPUT OUT.")
    return outputs.choose_folder(str(Path(source)), stated, "-lighting")


def _describe_results(name: str) -> str | None:
    """How to open the results; None where this machine has no program for them."""
    if not name.endswith(".jsonl"):
        return "with any reader of Parquet"
    return f"jq . {shlex.quote(name)}" if shutil.which("jq") else None


def _refuse_idle_options(ctx: click.Context) -> None:
    """Raise UsageError for an option that would do nothing."""
    explicit = {name for name in ctx.params if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE}
    options = {param.name: param.opts[0] for param in ctx.command.params}
    if not ctx.params["envmap"] and (
        idle := [options[name] for name in options if name in explicit & common.MAP_PARAMETERS]
    ):
        raise click.UsageError(f"{join_words(idle, 'and')} {'needs' if len(idle) == 1 else 'need'} --envmap.")
    if ctx.params["engine"] == "pool" and "address" in explicit:
        raise click.UsageError("--address needs --engine ray.")
    if ctx.params["engine"] == "ray" and "parquet" in explicit:
        raise click.UsageError("--engine ray writes Parquet by itself, and nothing else.")


def _run(
    pattern: str,
    folder: str,
    *,
    engine: str,
    envmap: bool,
    view: MapOptions,
    file: FileOptions,
    user_input: "UserInput",
    table: str | None,
    model: str | None,
    parquet: bool,
    address: str | None,
    **running: Any,
) -> "Summary":
    """What became of the photos, in this run and in the earlier ones whose results are kept."""
    from lighting.batch.job import BatchJob, MapOutput
    from lighting.batch.photo_search import check_photo_names, count_skipped, find_photos, read_photo_table
    from lighting.batch.ray import find_photos_at, run_ray
    from lighting.batch.results import TABLE, require_parquet

    began = monotonic()
    parquet = engine == "pool" and (parquet or (Path(folder, TABLE).is_file() and not running["overwrite"]))
    if parquet:
        require_parquet(Path(folder))
    source, names = (find_photos_at if engine == "ray" else find_photos)(pattern)
    known = None if table is None else read_photo_table(table)
    if known is not None:
        check_photo_names(known, names)
    job = BatchJob(source, folder, model, MapOutput(view, file) if envmap else None, engine, user_input, known)
    if engine == "ray":
        summary = run_ray(job, names, address=address, **running)
    else:
        summary = _run_pool(job, names, began, parquet=parquet, **running)
    return replace(summary, skipped=count_skipped(pattern))


def _run_pool(
    job: "BatchJob",
    names: Sequence[str],
    began: float,
    *,
    parquet: bool,
    workers: int | None,
    overwrite: bool,
    progress: bool,
) -> "Summary":
    from tqdm import tqdm

    from lighting.batch.job import Summary
    from lighting.batch.pool import open_batch, run_pool
    from lighting.batch.results import write_parquet
    from lighting.runtime import available_cpus

    with open_batch(job, overwrite=overwrite) as journal:
        earlier, initial = len(journal.names), len(journal.names.intersection(names))
        finished = run_pool(job, names, journal, workers or available_cpus())
        for _name in tqdm(finished, initial=initial, total=len(names), unit="photo", disable=not progress):
            pass
        if parquet:
            write_parquet(Path(job.out))
    return Summary(len(journal.names) - journal.failed, journal.failed, earlier, monotonic() - began)
