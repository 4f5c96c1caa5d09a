"""The command that says what of an installation works."""

import json
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path

import click

from lighting.cli import cli
from lighting.cli import options as common
from lighting.cli.console import escape_control_chars, format_error
from lighting.errors import LightingError, install_command
from lighting.version import __version__

_EXTRAS = (  # what is optional: the module, what it is for, and the extra that installs it
    ("cv2", "OpenCV", "overlapping photos and clips", "all"),
    ("av", "PyAV", "clips", "all"),
    ("rawpy", "rawpy", "RAW photos", "all"),
    ("scipy", "SciPy", "measured skies and photometric stereo", "all"),
    ("pyarrow", "PyArrow", "Parquet", "all"),
    ("ray", "Ray", "batches on several machines", "ray"),
    ("torch", "PyTorch", "training", "train"),
)
_BLENDERS = (  # where Blender lies that is in no search path
    "/Applications/Blender.app/Contents/MacOS/Blender",
    "/snap/bin/blender",
    *(f"C:/Program Files/Blender Foundation/Blender {version}/blender.exe" for version in ("5.1", "5.0", "4.5", "4.2")),
)
_SECONDS = 20.0  # that Blender may take to say its version


@dataclass(frozen=True)
class _Finding:
    """What was found of one thing."""

    name: str
    found: bool
    text: str  # its version, or what to do
    needed: bool = False  # without it hardly anything works


@cli.command(
    "doctor",
    examples=(
        "lighting doctor",
        "lighting doctor --json                              # for a report of a fault",
        "lighting doctor --quiet && echo all that is needed works",
    ),
)
@common.json_option
@click.option("-q", "--quiet", is_flag=True, help="Only what is missing and needed.")
@click.pass_context
def _doctor(ctx: click.Context, /, as_json: bool, quiet: bool) -> None:
    """Say what works here: network, page, extras, Blender.

    The exit status is 1 where something is missing that every photo needs.
    """
    findings = list(_findings())
    if as_json:
        click.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
    for finding in () if as_json else findings:
        if not quiet or (finding.needed and not finding.found):
            mark = "ok" if finding.found else "MISSING" if finding.needed else "-"
            click.echo(f"{mark:7}  {finding.name}: {escape_control_chars(finding.text)}")
    ctx.exit(1 if any(finding.needed and not finding.found for finding in findings) else 0)


def _findings() -> Iterator[_Finding]:
    system = f"{platform.system()} {platform.machine()}, {Path(sys.prefix)}"
    yield _Finding("lighting", True, f"{__version__}, Python {platform.python_version()}, {system}", needed=True)
    yield _check("network", _describe_network)
    yield _check("answer", _estimate_gray)
    yield from _find_pages()
    for module, name, use, extra in _EXTRAS:
        found = find_spec(module) is not None
        yield _Finding(name, found, f"for {use}" if found else f"for {use}: {install_command(extra)}")
    yield _find_blender()


def _check(name: str, describe: Callable[[], str]) -> _Finding:
    """A needed thing, whose description fails where it does not work."""
    try:
        return _Finding(name, True, describe(), needed=True)
    except (LightingError, OSError, ImportError) as error:
        return _Finding(name, False, format_error(error), needed=True)


def _describe_network() -> str:
    from lighting.model import Model

    spec = Model.load().spec
    return f"{spec.name} {spec.version}"


def _estimate_gray() -> str:
    """Whether the whole way works, on a gray picture."""
    from time import monotonic

    import numpy as np

    from lighting.estimator import Estimator
    from lighting.photo.reader import photo_from_array

    began = monotonic()
    Estimator()(photo_from_array(np.full((96, 128, 3), 128, dtype=np.uint8)))
    return f"a gray picture took {monotonic() - began:.1f} s, the network's loading in it"


def _find_pages() -> Iterator[_Finding]:
    """The built page and the book, whose places are known without an import of the service."""
    spec = find_spec("server")
    if spec is None or not spec.submodule_search_locations:
        yield _Finding("page", False, "the service is not installed")
        return
    server = Path(next(iter(spec.submodule_search_locations)))
    is_built = (server / "web" / "dist" / "index.html").is_file()
    missing = "it is not built: run npm ci && npm run build in server/web"
    yield _Finding("page", is_built, "built; `lighting open` shows it" if is_built else missing)
    books = (server.parent / "docs" / "README.md", server / "book_pages" / "README.md")  # of a clone, of a wheel
    is_there = any(book.is_file() for book in books)
    yield _Finding("book", is_there, "at /book/ of `lighting serve`" if is_there else "its pages are missing")


def _find_blender() -> _Finding:
    program = shutil.which("blender") or next((name for name in _BLENDERS if Path(name).is_file()), None)
    if program is None:
        return _Finding("Blender", False, "not found; get it from blender.org to open scenes for it")
    try:
        told = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=_SECONDS, check=False)
    except (OSError, subprocess.SubprocessError) as error:
        return _Finding("Blender", False, f"{program} does not start: {error}")
    version = told.stdout.splitlines()[0] if told.stdout else "of an unknown version"
    return _Finding("Blender", True, f"{version}, {program}")
