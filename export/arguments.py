"""What the commands of `python -m export` take for paths."""

from pathlib import Path

import click

PATH = click.Path(path_type=Path)  # a folder, or a file to read
FILE = click.Path(path_type=Path, dir_okay=False)  # to write
