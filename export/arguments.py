"""What the commands of `python -m export` take for paths."""

from pathlib import Path

import click

FOLDER = click.Path(path_type=Path)  # or a file to read
FILE = click.Path(path_type=Path, dir_okay=False)  # to write
