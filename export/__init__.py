"""From panoramas to networks: what the commands share. Importing it loads no other module of export."""

from pathlib import Path

import click

PATH = click.Path(path_type=Path)  # a folder, or a file to read
FILE = click.Path(path_type=Path, dir_okay=False)  # to write

PHOTO_SET_PARTS = ("pairs", "sets")  # of `report photo-sets`
# Of `report video`, by what is hard in a clip.
CLIP_KINDS = ("pan", "tilt", "hand", "moving things", "crowd", "motion blur", "exposure", "zoom", "walk")
