"""The commands `python -m export stereo ...`: what outdoor photometric stereo promises, its network, its errors."""

from pathlib import Path
from typing import Any

import click

from export import FILE, PATH
from lighting.cli import Group


@click.group("stereo", cls=Group)
def stereo_group() -> None:
    """Outdoor photometric stereo: its noise, its normals, its network."""


@stereo_group.command("gain")
def _gain() -> None:
    """Print what the noise gain predicts beside what simulated noise does; a minute or two on two cores."""
    from export.stereo.noise_gain import print_noise_gain

    print_noise_gain(click.echo)


@stereo_group.command("train")
@click.option("--out", type=PATH, default="runs/normals", show_default=True, help="Resumed if it has a checkpoint.")
@click.option("--meshes", type=PATH, default=None, help="Folder of OBJ files to learn from as well. [reliefs alone]")
@click.option("--minutes", type=click.FloatRange(0), default=70.0, show_default=True, help="Of training in all.")
@click.option("--seed", type=int, default=1, show_default=True)
@click.option("--threads", type=click.IntRange(1), default=1, show_default=True)
def _train(out: Path, meshes: Path | None, minutes: float, seed: int, threads: int) -> None:
    """Train the network of normals on simulated days, or go on where a run stopped."""
    from export.stereo.train import Config
    from export.stereo.train import train_normals as run

    checkpoint = run(Config(out=str(out), meshes=str(meshes or ""), minutes=minutes, seed=seed, threads=threads))
    click.echo(f"{checkpoint}")


@stereo_group.command("onnx")
@click.argument("run", type=PATH)
@click.option("--version", default="1.0.0", show_default=True)
@click.option("--out", type=FILE, default=None, help="File to write. [RUN/normals-VERSION.onnx]")
def _onnx(run: Path, version: str, out: Path | None) -> None:
    """Write the averaged network of a run as ONNX; compare it with torch."""
    from export.stereo.train import export_normals

    target = out or run / f"normals-{version}.onnx"
    difference = export_normals(run, target, version)
    click.echo(f"{target}: {target.stat().st_size / 1e6:.1f} MB, largest difference to torch {difference:.1e}")


@stereo_group.command("evaluate")
@click.option("--data", type=PATH, required=True, help="Folder with scanned_objects and meshes.")
@click.option("--network", type=PATH, default=None, help="Network to score. [the one in the package]")
@click.option("--quick", is_flag=True, help="Thin the shapes of the first tables like those of the others.")
@click.option("--table", "tables", multiple=True, metavar="NAME", help="Print only this table, or these. [all]")
def _evaluate(data: Path, network: Path | None, quick: bool, tables: tuple[Any, ...]) -> None:
    """Print how far normals are off on shapes and latitudes that training never saw; a quarter of an hour.

    Tables: seasons, wrong, photos, heading, turbidity, gloss, expected.
    """
    from export.stereo.evaluate import TABLES
    from export.stereo.evaluate import evaluate_normals as run
    from lighting.stereo.solver import Network

    if unknown := set(tables).difference(TABLES):
        raise click.BadParameter(f"{min(unknown)} is no table; give one of {', '.join(TABLES)}.", param_hint="--table")
    run(data, Network.load(network), click.echo, quick=quick, tables=tables or TABLES)


@stereo_group.command("speed")
def _speed() -> None:
    """Print how long the normals of 512 x 512 pixels from eight photos take."""
    from export.stereo.evaluate import print_speed

    print_speed(click.echo)
