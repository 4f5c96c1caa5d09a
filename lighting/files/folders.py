"""Folders that results go to."""

import os
from pathlib import Path

RESULTS = "the results need a folder"


def objection_to(folder: Path, *, overwrite: bool, what: str = "the results", need: str = RESULTS) -> str | None:
    """Why something cannot or must not be written to a folder, in a sentence; None where nothing is in the way.

    `what` is its name in the sentence, `need` says that it takes a folder.
    """
    parent = folder.absolute().parent
    if folder.exists() and not folder.is_dir():
        return f"{folder} is a file; {need}."
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        return f"{folder} is not empty; --overwrite replaces {what} in it."
    if not parent.is_dir():
        return f"There is no folder {parent}."
    closed = (place for place in (parent, folder) if place.exists() and not os.access(place, os.W_OK | os.X_OK))
    return next((f"The folder {place} cannot be written to." for place in closed), None)
