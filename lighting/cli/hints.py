"""What was probably meant by a command, an option or a file that is not there, in one sentence."""

import os
import re
import shlex
from collections.abc import Collection, Sequence
from difflib import get_close_matches
from pathlib import Path

import click

from lighting.batch.photo_search import PHOTO_SUFFIXES
from lighting.errors import FOREIGN_NAMES
from lighting.files import CLIP_SUFFIXES, MAP_FILE_SUFFIXES, is_address
from lighting.scene import EXPORTERS

_NEAR = 0.6  # share of the letters that a suggestion has in common with what was typed
_NEAR_FILE = 0.8
_WORDS = {  # that people type in place of a command, and what does it
    **dict.fromkeys(("gui", "ui", "web", "page", "app", "viewer", "view", "show"), "lighting open"),
    **dict.fromkeys(("server", "start", "run", "api", "http"), "lighting serve"),
    **dict.fromkeys(("version", "--v", "ver"), "lighting --version"),
    **dict.fromkeys(("hdri", "hdr", "exr", "map", "sky", "convert", "generate", "process"), "lighting envmap PHOTO"),
    **dict.fromkeys(("sun", "light", "predict", "infer", "detect", "analyze", "analyse"), "lighting estimate PHOTO"),
    **dict.fromkeys(("export", "gltf", "glb"), "lighting scene PHOTO --for gltf"),
    **dict.fromkeys(("clip", "film", "movie"), "lighting video CLIP"),
    **dict.fromkeys(("folder", "dir", "all"), "lighting batch FOLDER"),
    **dict.fromkeys(("check", "test", "status", "diagnose"), "lighting doctor"),
    **dict.fromkeys(("docs", "book", "manual", "man", "usage", "/help", "/?", "lighting"), "lighting --help"),
    **dict.fromkeys(("exif", "metadata", "identify"), "lighting info PHOTO"),
    "train": "python -m export train",
}
_NO_OPTIONS = {  # what an option of other programs is here
    "format": "The ending of -o says the format, such as -o sky.hdr.",
    **dict.fromkeys(
        ("input", "i", "image", "photo", "file", "filename"), "A file needs no option: type its name alone."
    ),
    **dict.fromkeys(("gpu", "cuda", "device", "cpu"), "It runs on the CPU."),
    **dict.fromkeys(
        ("verbose", "v"), "It prints all that it has to say; `lighting --debug` shows where an error arose."
    ),
    "?": "`--help` shows the help.",
    **dict.fromkeys(("V", "version"), "`lighting --version` shows the version."),
    **dict.fromkeys(("recursive", "r"), "`lighting batch FOLDER` reads all photos below a folder."),
}


def describe_unknown_command(name: str, program: str, commands: Sequence[str]) -> str:
    """Return what to type in place of a word that is no command.

    Args:
        name: the word.
        program: whose command it would be.
        commands: of the program.
    """
    if program == "lighting" and (instead := _WORDS.get(name.lower()) or _scene_command(name.lower())):
        return f"There is no command {name!r}. Did you mean `{instead}`?"
    if known := get_close_matches(name.lower(), commands, n=1, cutoff=_NEAR):
        return f"There is no command {name!r}. Did you mean {known[0]}?"
    if program == "lighting" and (line := _command_for_file(name)):
        return line
    return f"There is no command {name!r}. `{program} --help` lists all."


def _scene_command(name: str) -> str | None:
    return f"lighting scene PHOTO --for {name}" if name in EXPORTERS else None


def _command_for_file(name: str) -> str | None:
    """What to do with a file or a folder whose name stands where a command should; None for any other word."""
    path, word = Path(name), shlex.quote(name)
    suffix = path.suffix.lower()
    if is_address(name):
        return f"{name} is an address: download the photo, then type `lighting envmap FILE`."
    if path.is_dir():
        return f"{name} is a folder, not a command: try `lighting batch {word}`."
    if suffix in PHOTO_SUFFIXES:
        return f"{name} is a photo, not a command: try `lighting envmap {word}` or `lighting estimate {word}`."
    if suffix in CLIP_SUFFIXES:
        return f"{name} is a clip, not a command: try `lighting video {word}`."
    if suffix == ".json":
        return f"{name} is a record, not a command: try `lighting render {word}`."
    if suffix in (*MAP_FILE_SUFFIXES, ".onnx") or path.is_file() or os.sep in name:
        return f"{name} is a file, not a command: try `lighting info {word}`."
    return None


def describe_unknown_option(option: str, options: Collection[str]) -> str | None:
    """Return what to type in place of an option that a command does not have; None where nobody can tell.

    Args:
        option: as it was typed, without a value.
        options: that the command has.
    """
    name = option.lstrip("-")
    instead = f"--{FOREIGN_NAMES.get(name.lower().replace('-', '_'), '').replace('_', '-')}"
    if instead in options:
        return f"There is no option {option}. Did you mean {instead}?"
    if f"--{name}" in options and option.startswith("-"):
        return f"There is no option {option}. Did you mean --{name}?"
    if known := _NO_OPTIONS.get(name) or _NO_OPTIONS.get(name.lower()):
        return f"There is no option {option}. {known}"
    if command := _find_command_with(option):
        return f"There is no option {option} here; `lighting {command}` has it."
    near = get_close_matches(option, [other for other in options if other.startswith("--")], n=1, cutoff=_NEAR)
    return f"There is no option {option}. Did you mean {near[0]}?" if near else None


def _find_command_with(option: str) -> str | None:
    """A command about photos that has an option."""
    from lighting.cli import cli  # which imports this module where it is needed

    for name in ("envmap", "scene", "estimate", "batch"):
        command = cli.get_command(click.Context(cli), name)
        if command and any(option in param.opts for param in command.get_params(click.Context(command))):
            return name
    return None


def describe_missing_file(name: str) -> str | None:
    """Return why there is no file of this name, without a full stop; None where nobody can tell.

    Args:
        name: as the user typed it.
    """
    path, missing = Path(name), "No such file or directory"
    if path.is_symlink():
        return f"{missing}: it is a link, and leads nowhere"
    if name.startswith("file://"):
        return "Type its path, without file://"
    if os.name != "nt" and (re.match(r"[A-Za-z]:", name) or "\\" in name):
        return f"{missing}: it is a path of Windows, and here a path is like /home/me/photo.jpg"
    if any(letter in name for letter in "*?["):
        return "No file matches this pattern"
    if name.startswith("~"):
        return f"{missing}: type ~ without quotes, or the whole path"
    if not path.parent.is_dir():
        return f"There is no folder {path.parent}"
    if near := _find_near(path):
        return f"{missing}, but {shlex.quote(str(path.with_name(near)))} is there"
    return None


def _find_near(path: Path) -> str | None:
    """A file in the folder whose name is like a missing one's, or begins with it and a space."""
    try:
        there = {name.lower(): name for name in os.listdir(path.parent)}  # noqa: PTH208 - names alone
    except OSError:
        return None
    typed = path.name.lower()
    begun = [name for name in there if name.startswith(f"{typed} ")]
    near = get_close_matches(typed, begun or there, n=1, cutoff=0.0 if begun else _NEAR_FILE)
    return there[near[0]] if near else None
